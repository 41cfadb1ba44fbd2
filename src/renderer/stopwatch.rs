//! How long something takes.

use std::time::Instant;

use crate::clock::ProcessorTime;

/// Started when made.
pub(super) struct Stopwatch {
    pub begin: Instant,
    cpu: ProcessorTime,
}

impl Stopwatch {
    pub fn start() -> Self {
        Self {
            begin: Instant::now(),
            cpu: ProcessorTime::now(),
        }
    }

    /// Seconds on the clock.
    pub fn secs(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Seconds of the processors in all of the process's threads.
    pub fn cpu_secs(&self) -> f64 {
        self.cpu.elapsed_secs()
    }
}
