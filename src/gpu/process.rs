//! Settings of the whole process: its allocator, signals and threads, and an end without ceremony.

use std::process::Command;

/// Keeps freed memory in the process. llvmpipe allocates megabytes of transformed vertices and binned triangles for
/// every draw; by default the C library returns them to the system after every frame, and the page faults of the next
/// frame take about half of the time before rasterisation. The process keeps its peak amount of memory.
pub(super) fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        /// Bytes, more than a frame frees; the largest value that the library accepts for the second threshold.
        const BYTES: libc::c_int = 1 << 25;
        /// Bytes of the largest piece of which the library makes the heaps of threads. Neither room of that size nor
        /// the pieces are ever given back; a bake in one thread (LP_NUM_THREADS=0) would spend a quarter of its time on
        /// their page faults.
        const PIECE: libc::c_int = 1 << 26;
        // SAFETY: `mallopt` may be called at any time and only changes when memory goes back to the system.
        unsafe {
            libc::mallopt(libc::M_TRIM_THRESHOLD, BYTES);
            libc::mallopt(libc::M_MMAP_THRESHOLD, BYTES);
            libc::mallopt(libc::M_TOP_PAD, PIECE);
        }
    }
}

/// Keeps all threads to one arena of the allocator; to be called before there are any.
///
/// Each thread would have its own, up to eight for every processor, and keep there what it frees (`keep_freed_memory`).
/// A driver's and a bake's threads come and go, and each arena grows to what the largest of them needed: a window in
/// which lights were switched and scenes opened for two minutes held 770 MB, and 320 MB with one arena. Processor time
/// of bakes and frames is the same.
#[cfg(feature = "view")]
pub fn share_arena() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `mallopt` may be called at any time and only changes where later threads find memory.
    unsafe {
        libc::mallopt(libc::M_ARENA_MAX, 1);
    }
}

/// Returns to the system what the process has freed, wherever it lies. Pages that are used again are faulted in once
/// more.
#[cfg(feature = "view")]
pub fn give_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `malloc_trim` takes the allocator's own locks and touches no memory that is in use.
    unsafe {
        libc::malloc_trim(0);
    }
}

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

/// Cores of this machine that the process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, |cores| cores.get())
}

/// Threads of llvmpipe: as many as the environment says, or cores.
pub fn driver_threads() -> usize {
    let given = std::env::var("LP_NUM_THREADS").ok().and_then(|threads| threads.parse().ok());
    given.unwrap_or_else(cores).max(1)
}

/// Gives a new process, one of so many at a time, its share of the cores as threads of llvmpipe besides the one that
/// asks for a drawing, unless the environment says how many. Where every core has a process, none: with a thread
/// besides, two processes on two cores took 11.1 s for what they did in 10.3 s without.
pub fn share_cores(command: &mut Command, processes: usize) {
    if std::env::var_os("LP_NUM_THREADS").is_none() {
        let threads = if processes >= cores() { 0 } else { cores() / processes };
        command.env("LP_NUM_THREADS", threads.to_string());
    }
}
