//! Signals that would end the program without a message, and an end without ceremony.

/// Lets a write beyond the limit on file sizes (`ulimit -f`) fail like one to a full disk, instead of ending the
/// program.
pub fn fail_writes_beyond_limit() {
    // SAFETY: ignoring a signal installs no handler, so no code runs in a signal's context.
    #[cfg(unix)]
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// Ends the process at once, with a code: no destructor and no exit handler runs, and no other thread is waited for.
#[cfg(all(unix, feature = "view"))]
pub fn end_at_once(code: u8) -> ! {
    // SAFETY: it does not return, so nothing is used after it.
    unsafe { libc::_exit(code.into()) }
}
