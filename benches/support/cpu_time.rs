//! Processor time of the calling thread.

use std::sync::LazyLock;
use std::time::Instant;

/// Seconds that this thread has run on a processor (Linux); elsewhere seconds on the clock.
pub fn thread_cpu_secs() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let nanoseconds = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|s| s.split_whitespace().next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}
