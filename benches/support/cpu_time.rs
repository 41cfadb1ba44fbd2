//! Processor time of the calling thread.

/// Seconds that this thread has run on a processor.
#[cfg(target_os = "linux")]
pub fn thread_cpu_secs() -> f64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: writes to the record that it is given; the clock exists on every Linux.
    let status = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    assert_eq!(status, 0, "no processor clock for threads");
    time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
}

/// Seconds on the clock: other systems have no such time in common.
#[cfg(not(target_os = "linux"))]
pub fn thread_cpu_secs() -> f64 {
    use std::sync::LazyLock;
    use std::time::Instant;
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64()
}
