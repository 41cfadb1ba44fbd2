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

/// What the processors spend on the threads of this program that work for a picture: the one that asks, and the pool's. Those of a graphics
/// driver are not among them.
#[derive(Debug)]
pub(crate) struct HostThreads {
    clocks: Vec<ThreadClock>,
}

impl HostThreads {
    /// The calling thread and the pool's; `None` where the system does not say: all but Linux.
    pub fn here() -> Option<Self> {
        let mut of_all = rayon::broadcast(|_| ThreadClock::of_this_thread());
        of_all.push(ThreadClock::of_this_thread());
        let clocks = of_all.into_iter().collect::<Option<_>>()?;
        Some(Self { clocks })
    }

    /// Seconds so far.
    pub fn secs(&self) -> f64 {
        self.clocks.iter().map(ThreadClock::secs).sum()
    }
}

/// The processor time of one thread, which others may read.
#[derive(Debug)]
#[cfg(target_os = "linux")]
struct ThreadClock(libc::clockid_t);

#[cfg(target_os = "linux")]
impl ThreadClock {
    fn of_this_thread() -> Option<Self> {
        let mut clock = 0;
        // SAFETY: the calling thread exists, and there is room for its clock's number.
        let failed = unsafe { libc::pthread_getcpuclockid(libc::pthread_self(), &raw mut clock) };
        (failed == 0).then_some(Self(clock))
    }

    /// 0 once the thread has ended.
    fn secs(&self) -> f64 {
        let mut time = libc::timespec {
            tv_sec: 0,
            tv_nsec: 0,
        };
        // SAFETY: there is room for the time; the number of a clock that is gone is refused.
        unsafe { libc::clock_gettime(self.0, &raw mut time) };
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    }
}

#[derive(Debug)]
#[cfg(not(target_os = "linux"))]
struct ThreadClock;

#[cfg(not(target_os = "linux"))]
impl ThreadClock {
    fn of_this_thread() -> Option<Self> {
        None
    }

    fn secs(&self) -> f64 {
        0.0
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

    #[test]
    fn a_hosts_threads_count_their_own_work_alone() {
        let Some(threads) = HostThreads::here() else {
            eprintln!("skipped: the system does not say what a thread has spent");
            return;
        };
        let alone = HostThreads {
            clocks: ThreadClock::of_this_thread().into_iter().collect(),
        };
        let work = || (0..20_000_000u64).fold(1, |hash: u64, i| std::hint::black_box(hash ^ i));
        let before = threads.secs();
        std::hint::black_box(work());
        let own = threads.secs() - before;
        let before = alone.secs();
        let of_another = std::thread::spawn(move || std::hint::black_box(work()));
        of_another.join().expect("ends");
        let others = alone.secs() - before;
        assert!(others < 0.5 * own, "{others} of {own}");
    }
}
