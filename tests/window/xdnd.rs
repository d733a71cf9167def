//! Drags a file onto a window of an X11 display and drops it there, as a file manager does: version 5 of the protocol
//! XDND.

use std::path::Path;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConnectionExt as _, CreateWindowAux, EventMask, PropMode, SELECTION_NOTIFY_EVENT,
    SelectionNotifyEvent, WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;
use x11rb::{COPY_FROM_PARENT, CURRENT_TIME};

const PATIENCE: Duration = Duration::from_secs(20);

/// Drops `file` on `target` at a place of the screen, and waits until the target has read it.
pub fn drop_file(display: &str, target: u32, file: &Path, [x, y]: [u16; 2]) {
    let (connection, screen) = x11rb::connect(Some(display)).unwrap();
    let screen = &connection.setup().roots[screen];
    let atom = |name: &str| connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom;
    let list = atom("text/uri-list");
    let selection = atom("XdndSelection");
    let copy = atom("XdndActionCopy");
    let status = atom("XdndStatus");
    let finished = atom("XdndFinished");
    let source = connection.generate_id().unwrap();
    let look = CreateWindowAux::new();
    let class = WindowClass::INPUT_OUTPUT;
    let depth = COPY_FROM_PARENT as u8;
    connection.create_window(depth, source, screen.root, 0, 0, 1, 1, 0, class, COPY_FROM_PARENT, &look).unwrap();
    connection.set_selection_owner(source, selection, CURRENT_TIME).unwrap();
    let tell = |name: &str, data: [u32; 4]| {
        let [a, b, c, d] = data;
        let message = ClientMessageEvent::new(32, target, atom(name), [source, a, b, c, d]);
        connection.send_event(false, target, EventMask::NO_EVENT, message).unwrap();
        connection.flush().unwrap();
    };
    tell("XdndEnter", [5 << 24, list, 0, 0]);
    tell("XdndPosition", [0, u32::from(x) << 16 | u32::from(y), CURRENT_TIME, copy]);
    let end = Instant::now() + PATIENCE;
    loop {
        assert!(Instant::now() < end, "the window takes no notice of the file");
        match connection.poll_for_event().unwrap() {
            // The window asks for what is dragged.
            Some(Event::SelectionRequest(asked)) => {
                let uri = format!("file://{}\r\n", file.display());
                let mode = PropMode::REPLACE;
                let kind = list;
                connection.change_property8(mode, asked.requestor, asked.property, kind, uri.as_bytes()).unwrap();
                let answer = SelectionNotifyEvent {
                    response_type: SELECTION_NOTIFY_EVENT,
                    sequence: 0,
                    time: asked.time,
                    requestor: asked.requestor,
                    selection: asked.selection,
                    target: asked.target,
                    property: asked.property,
                };
                connection.send_event(false, asked.requestor, EventMask::NO_EVENT, answer).unwrap();
                connection.flush().unwrap();
            }
            Some(Event::ClientMessage(message)) if message.type_ == status => {
                assert_eq!(message.data.as_data32()[1] & 1, 1, "the window refuses the file");
                tell("XdndDrop", [0, CURRENT_TIME, 0, 0]);
            }
            Some(Event::ClientMessage(message)) if message.type_ == finished => return,
            Some(_) => {}
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    }
}
