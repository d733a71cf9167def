//! What a window shows on an X11 display: surface, swapchain and presentation with all else of a window.

use super::window::{SIZE, device_options, show, viewer};
use raw_window_handle::{
    DisplayHandle, HandleError, HasDisplayHandle, HasWindowHandle, RawDisplayHandle, RawWindowHandle, WindowHandle,
    XcbDisplayHandle, XcbWindowHandle,
};
use shadow_fields::gpu::{Device, PresentMode, Window};
use shadow_fields::view::FrameTarget;
use shadow_fields::{Error, Result};
use std::ffi::CString;
use std::num::NonZeroU32;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::Arc;
use x11rb::connection::Connection as _;
use x11rb::protocol::xproto::{ConnectionExt as _, CreateWindowAux, ImageFormat, WindowClass};
use x11rb::xcb_ffi::XCBConnection;

/// File in the folder that names the display.
pub const NAME: &str = "display";

/// A window of its own connection to the display.
struct Own {
    connection: XCBConnection,
    screen: i32,
    window: NonZeroU32,
}

impl Own {
    fn open(display: &str) -> Self {
        let name = CString::new(display).unwrap();
        let (connection, screen) = XCBConnection::connect(Some(&name)).unwrap();
        let root = &connection.setup().roots[screen];
        let window = connection.generate_id().unwrap();
        let look = CreateWindowAux::new().background_pixel(root.black_pixel);
        let [width, height] = SIZE.map(|side| side as u16);
        let class = WindowClass::INPUT_OUTPUT;
        let depth = root.root_depth;
        let visual = root.root_visual;
        connection.create_window(depth, window, root.root, 0, 0, width, height, 0, class, visual, &look).unwrap();
        connection.map_window(window).unwrap();
        connection.flush().unwrap();
        Own { screen: screen as i32, window: window.try_into().unwrap(), connection }
    }

    /// The window's pixels. The server has executed what was sent before.
    fn look(&self) -> Vec<u8> {
        let [width, height] = SIZE.map(|side| side as u16);
        let asked = self.connection.get_image(ImageFormat::Z_PIXMAP, self.window.get(), 0, 0, width, height, !0);
        asked.unwrap().reply().unwrap().data
    }
}

impl HasDisplayHandle for Own {
    #[allow(unsafe_code)]
    fn display_handle(&self) -> std::result::Result<DisplayHandle<'_>, HandleError> {
        let handle = XcbDisplayHandle::new(NonNull::new(self.connection.get_raw_xcb_connection()), self.screen);
        // SAFETY: the connection is open as long as this value lives.
        Ok(unsafe { DisplayHandle::borrow_raw(RawDisplayHandle::Xcb(handle)) })
    }
}

impl HasWindowHandle for Own {
    #[allow(unsafe_code)]
    fn window_handle(&self) -> std::result::Result<WindowHandle<'_>, HandleError> {
        // SAFETY: the window exists as long as its connection.
        Ok(unsafe { WindowHandle::borrow_raw(RawWindowHandle::Xcb(XcbWindowHandle::new(self.window))) })
    }
}

/// Shows the frames of [`show`] on the display, and writes what is seen of the last as `d.raw`.
pub fn run(folder: &Path) -> Result<()> {
    let own = Arc::new(Own::open(&std::fs::read_to_string(folder.join(NAME)).unwrap()));
    let options = device_options(folder);
    let device = Device::for_display(&options, own.display_handle().unwrap().as_raw())?;
    // What is presented is seen at once, and not when the display is next refreshed.
    let mut target = Window::new(&device, &own, SIZE, PresentMode::Immediate)?;
    let mut viewer = viewer(folder, device.clone(), options, target.format())?;
    // As the window does: again where nothing was drawn, or something new would be seen.
    show(&mut viewer, &mut |viewer| Ok(viewer.draw(FrameTarget::Window(&mut target))? && !viewer.wants_frame()))?;
    std::fs::write(folder.join("d.raw"), own.look()).map_err(|error| Error::Failed(error.to_string()))
}
