//! The loss of an X11 display, over which Xlib would end the process, and unsaved edits with it.

use crate::error::Error;
use raw_window_handle::RawDisplayHandle;
use std::ffi::{CStr, c_int, c_void};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Whether Xlib has found the connection broken.
static LOST: AtomicBool = AtomicBool::new(false);
static WATCHED: Mutex<Option<Watched>> = Mutex::new(None);

type Handler = unsafe extern "C" fn(*mut c_void) -> c_int;
type ExitHandler = unsafe extern "C" fn(*mut c_void, *mut c_void);
type SetHandler = unsafe extern "C" fn(Option<Handler>) -> Option<Handler>;
type SetExitHandler = unsafe extern "C" fn(*mut c_void, Option<ExitHandler>, *mut c_void);
type ConnectionOf = unsafe extern "C" fn(*mut c_void) -> *mut c_void;
type HasError = unsafe extern "C" fn(*mut c_void) -> c_int;

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
