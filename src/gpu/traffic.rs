//! What goes to a device and back.

use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;

/// Since the device was opened, or between two such counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Traffic {
    pub bytes_up: u64,
    pub bytes_down: u64,
    pub submissions: u64,
    /// Runs of commands that end with sums on their way home: as many submissions as there would be if none were cut by time.
    pub recordings: u64,
    /// Of the estimator's kernels.
    pub dispatches: u64,
    /// Of batches of samples, as recorded.
    pub steps: u64,
    /// Steps in which no sample was alive any more.
    pub idle_steps: u64,
    /// How often the host waited for the device.
    pub waits: u64,
}

impl std::ops::Sub for Traffic {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        Self {
            bytes_up: self.bytes_up - before.bytes_up,
            bytes_down: self.bytes_down - before.bytes_down,
            submissions: self.submissions - before.submissions,
            recordings: self.recordings - before.recordings,
            dispatches: self.dispatches - before.dispatches,
            steps: self.steps - before.steps,
            idle_steps: self.idle_steps - before.idle_steps,
            waits: self.waits - before.waits,
        }
    }
}

/// Counts from any thread.
#[derive(Debug, Default)]
pub(super) struct TrafficCounter {
    pub bytes_up: AtomicU64,
    pub bytes_down: AtomicU64,
    pub submissions: AtomicU64,
    pub recordings: AtomicU64,
    pub dispatches: AtomicU64,
    pub steps: AtomicU64,
    pub idle_steps: AtomicU64,
    pub waits: AtomicU64,
}

impl TrafficCounter {
    pub fn counts(&self) -> Traffic {
        let of = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            bytes_up: of(&self.bytes_up),
            bytes_down: of(&self.bytes_down),
            submissions: of(&self.submissions),
            recordings: of(&self.recordings),
            dispatches: of(&self.dispatches),
            steps: of(&self.steps),
            idle_steps: of(&self.idle_steps),
            waits: of(&self.waits),
        }
    }
}

/// One more count.
pub(super) fn count(counter: &AtomicU64, more: u64) {
    counter.fetch_add(more, Ordering::Relaxed);
}
