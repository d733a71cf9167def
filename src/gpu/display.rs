//! Events of an X11 display that winit does not report. Over the loss of the display Xlib would end the process, and
//! unsaved edits with it; drops of files that do not exist bring no event at all.

use crate::error::Error;
use raw_window_handle::RawDisplayHandle;
use std::ffi::{CStr, c_char, c_int, c_ulong, c_void};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Whether Xlib has found the connection broken.
static LOST: AtomicBool = AtomicBool::new(false);
static WATCHED: Mutex<Option<Watched>> = Mutex::new(None);

type Handler = unsafe extern "C" fn(*mut c_void) -> c_int;
type ExitHandler = unsafe extern "C" fn(*mut c_void, *mut c_void);
type SetHandler = unsafe extern "C" fn(Option<Handler>) -> Option<Handler>;
type SetExitHandler = unsafe extern "C" fn(*mut c_void, Option<ExitHandler>, *mut c_void);
type ConnectionOf = unsafe extern "C" fn(*mut c_void) -> *mut c_void;
type HasError = unsafe extern "C" fn(*mut c_void) -> c_int;

/// A display that is open.
struct Watched {
    connection: *mut c_void,
    has_error: HasError,
    /// Lets the event loop turn once more.
    wake: Box<dyn Fn() + Send>,
}

// SAFETY: xcb's functions for connections may be called from every thread.
unsafe impl Send for Watched {}

/// Ends the watch when it is dropped, which is before the display is closed.
pub struct Watch(());

impl Drop for Watch {
    fn drop(&mut self) {
        *WATCHED.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Whether the display was lost that a [`Watch`] is held for.
pub fn is_lost() -> bool {
    let watched = WATCHED.lock().unwrap_or_else(PoisonError::into_inner);
    // SAFETY: the connection is open as long as its watch is held.
    let has_error = |watched: &Watched| unsafe { (watched.has_error)(watched.connection) } != 0;
    LOST.load(Ordering::Relaxed) || watched.as_ref().is_some_and(has_error)
}

/// The error of a lost display.
pub fn lost() -> Error {
    Error::Device("the display was lost".into())
}

/// Xlib calls it when a connection breaks, instead of a function that prints a line and ends the process.
unsafe extern "C" fn on_error(_: *mut c_void) -> c_int {
    LOST.store(true, Ordering::Relaxed);
    if let Some(watched) = &*WATCHED.lock().unwrap_or_else(PoisonError::into_inner) {
        (watched.wake)();
    }
    0
}

/// Xlib calls it next, instead of `exit`. All later calls for the display fail.
unsafe extern "C" fn on_exit(_: *mut c_void, _: *mut c_void) {}

/// A function of a library that is loaded.
fn function(library: &CStr, name: &CStr) -> Option<*mut c_void> {
    // SAFETY: the library is one by which the display was opened; it is loaded already and is never unloaded.
    let found = unsafe {
        let library = libc::dlopen(library.as_ptr(), libc::RTLD_LAZY | libc::RTLD_NOLOAD);
        if library.is_null() { null_mut() } else { libc::dlsym(library, name.as_ptr()) }
    };
    (!found.is_null()).then_some(found)
}

/// Number of an event that another client has sent.
const CLIENT_MESSAGE: c_int = 33;
/// Set by every drop of dragged data.
static DROPPED: AtomicBool = AtomicBool::new(false);
/// The message that drops, and Xlib's own function for messages.
static DROP: OnceLock<(c_ulong, WireToEvent)> = OnceLock::new();

type WireToEvent = unsafe extern "C" fn(*mut c_void, *mut ClientMessage, *mut c_void) -> c_int;
type SetWireToEvent = unsafe extern "C" fn(*mut c_void, c_int, Option<WireToEvent>) -> Option<WireToEvent>;
type InternAtom = unsafe extern "C" fn(*mut c_void, *const c_char, c_int) -> c_ulong;

/// The start of Xlib's `XClientMessageEvent`.
#[repr(C)]
struct ClientMessage {
    kind: c_int,
    serial: c_ulong,
    is_sent: c_int,
    display: *mut c_void,
    window: c_ulong,
    message: c_ulong,
}

/// Xlib calls it for every message that it reads.
unsafe extern "C" fn on_message(display: *mut c_void, event: *mut ClientMessage, wire: *mut c_void) -> c_int {
    let Some((drop, own)) = DROP.get() else { return 0 };
    // SAFETY: the arguments are passed on to the function that Xlib would have called, which fills the event.
    unsafe {
        let is_event = own(display, event, wire);
        if (*event).message == *drop {
            DROPPED.store(true, Ordering::Relaxed);
        }
        is_event
    }
}

/// Notes from now on when something is dropped on a window of an X11 display. winit tells of a drop only where every
/// file of it exists.
pub fn notice_drops(display: RawDisplayHandle) {
    let RawDisplayHandle::Xlib(handle) = display else { return };
    let functions = (function(c"libX11.so.6", c"XInternAtom"), function(c"libX11.so.6", c"XESetWireToEvent"));
    let (Some(display), (Some(intern), Some(set))) = (handle.display, functions) else { return };
    // SAFETY: the functions have these types in their headers, and the display is open. No event is read before `DROP`
    // is set, because this is the thread that reads them.
    unsafe {
        let drop = std::mem::transmute::<*mut c_void, InternAtom>(intern)(display.as_ptr(), c"XdndDrop".as_ptr(), 0);
        let set = std::mem::transmute::<*mut c_void, SetWireToEvent>(set);
        if let Some(own) = set(display.as_ptr(), CLIENT_MESSAGE, Some(on_message)) {
            let _ = DROP.set((drop, own));
        }
    }
}

/// Whether something was dropped since the last call.
pub fn take_drop() -> bool {
    DROPPED.swap(false, Ordering::Relaxed)
}

/// Lets the process outlive the loss of an X11 display, of which [`is_lost`] tells and after which `wake` is called.
/// `None` for other displays, and where libX11 is older than 1.7: then the process ends.
pub fn outlive(display: RawDisplayHandle, wake: impl Fn() + Send + 'static) -> Option<Watch> {
    let RawDisplayHandle::Xlib(handle) = display else { return None };
    let display = handle.display?.as_ptr();
    let set = function(c"libX11.so.6", c"XSetIOErrorHandler")?;
    let set_exit = function(c"libX11.so.6", c"XSetIOErrorExitHandler")?;
    let connection_of = function(c"libX11-xcb.so.1", c"XGetXCBConnection")?;
    let has_error = function(c"libxcb.so.1", c"xcb_connection_has_error")?;
    // SAFETY: the functions have these types in their headers, and the display is open. The handlers touch nothing of
    // it.
    unsafe {
        let connection = std::mem::transmute::<*mut c_void, ConnectionOf>(connection_of)(display);
        let has_error = std::mem::transmute::<*mut c_void, HasError>(has_error);
        let watched = Watched { connection, has_error, wake: Box::new(wake) };
        *WATCHED.lock().unwrap_or_else(PoisonError::into_inner) = Some(watched);
        std::mem::transmute::<*mut c_void, SetHandler>(set)(Some(on_error));
        std::mem::transmute::<*mut c_void, SetExitHandler>(set_exit)(display, Some(on_exit), null_mut());
    }
    Some(Watch(()))
}
