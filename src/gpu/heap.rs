//! The host's allocator under a software device.

/// Keeps freed memory in the process. llvmpipe allocates what a draw needs anew each time, megabytes of transformed vertices
/// and binned triangles; the C library gives them back to the system after every frame, and half of the time in front of the
/// rasteriser went into page faults. Memory in use does not grow; what was freed stays at its peak.
pub(super) fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        /// The most that the library takes for the second; more than a frame frees.
        const BYTES: libc::c_int = 1 << 25;
        // SAFETY: `mallopt` may be called at any time and only changes when memory goes back to the system.
        unsafe {
            libc::mallopt(libc::M_TRIM_THRESHOLD, BYTES);
            libc::mallopt(libc::M_MMAP_THRESHOLD, BYTES);
        }
    }
}
