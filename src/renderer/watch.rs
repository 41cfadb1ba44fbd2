//! How long something takes.

use std::time::Instant;

use cpu_time::ProcessTime;

/// Started when made.
pub(super) struct Watch {
    pub begin: Instant,
    cpu: ProcessTime,
}

impl Watch {
    pub fn start() -> Self {
        Self {
            begin: Instant::now(),
            cpu: ProcessTime::now(),
        }
    }

    /// Seconds on the clock.
    pub fn secs(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Seconds of the processors in all of the process's threads.
    pub fn cpu_secs(&self) -> f64 {
        self.cpu.elapsed().as_secs_f64()
    }
}
