//! The processors' clock. Like [`std::time::Instant`] it may step back, which counts as no time.

use std::time::Duration;

/// What the processors have spent on this process so far, in all of its threads; nothing where the system does not say, and in a library
/// without the feature `cli`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProcessorTime(Duration);

impl ProcessorTime {
    #[cfg(feature = "cli")]
    pub fn now() -> Self {
        let now = cpu_time::ProcessTime::try_now();
        Self(now.map_or(Duration::ZERO, |time| time.as_duration()))
    }

    #[cfg(not(feature = "cli"))]
    pub fn now() -> Self {
        Self(Duration::ZERO)
    }

    /// Seconds since then.
    pub fn elapsed_secs(self) -> f64 {
        Self::now().since(self).as_secs_f64()
    }

    fn since(self, before: Self) -> Duration {
        self.0.saturating_sub(before.0)
    }
}

/// What the processors have spent on the calling thread so far; nothing where the system does not say.
#[cfg(feature = "preview")]
pub(crate) fn thread_time() -> Duration {
    cpu_time::ThreadTime::try_now().map_or(Duration::ZERO, |time| time.as_duration())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_steps_back_counts_nothing() {
        let at = |secs| ProcessorTime(Duration::from_secs(secs));
        assert_eq!(at(3).since(at(5)), Duration::ZERO);
        assert_eq!(at(5).since(at(3)), Duration::from_secs(2), "control");
        assert!(ProcessorTime::now().elapsed_secs() >= 0.0);
    }
}
