//! How long something takes.

use std::time::Instant;

use cpu_time::ProcessTime;

/// Started when made.
pub(super) struct Stopwatch {
    pub begin: Instant,
    processor_secs: f64,
}

impl Stopwatch {
    pub fn start() -> Self {
        Self {
            begin: Instant::now(),
            processor_secs: processor_secs(),
        }
    }

    /// Seconds on the clock.
    pub fn secs(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Seconds of the processors in all of the process's threads.
    pub fn cpu_secs(&self) -> f64 {
        processor_secs() - self.processor_secs
    }
}

/// Seconds that the processors have spent on the process.
fn processor_secs() -> f64 {
    ProcessTime::now().as_duration().as_secs_f64()
}
