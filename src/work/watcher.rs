//! Who watches a render: it may end it, and hears where it stands.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use super::RayCounts;

/// What goes on, in this order. A renderer leaves out what a scene does not need, and begins again after an edit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The scene is packed, and its acceleration structures are built.
    Trees,
    /// The exposure is fitted to the photograph.
    Exposure,
    /// The albedo of real surfaces is estimated from the photograph.
    Albedo,
    /// The pilot plans the samples.
    LookingAhead,
    /// The graphics device is opened and its kernels are compiled.
    Kernels,
    /// Samples are taken.
    Rendering,
    /// Light is fitted to the photograph's shading.
    FittingLight,
}

impl Phase {
    /// As the user reads it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Trees => "building trees",
            Self::Exposure => "fitting the exposure",
            Self::Albedo => "estimating albedo",
            Self::LookingAhead => "looking ahead",
            Self::Kernels => "compiling kernels",
            Self::Rendering => "rendering",
            Self::FittingLight => "fitting the light",
        }
    }
}

/// Where a render stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    pub phase: Phase,
    /// Of this phase, from 0 to 1.
    pub share_done: f64,
    /// Since this phase began.
    pub elapsed: Duration,
    /// Rays per pixel that every pixel has taken, or scrambles that are complete; 0 before rendering.
    pub samples: u32,
    pub samples_total: u32,
    /// Rays traced for the film since the renderer was made.
    pub rays: RayCounts,
}

impl Progress {
    /// The beginning of a phase that takes no samples.
    pub fn begin(phase: Phase) -> Self {
        Self {
            phase,
            share_done: 0.0,
            elapsed: Duration::ZERO,
            samples: 0,
            samples_total: 0,
            rays: RayCounts::default(),
        }
    }
}

/// Asked by what runs for long whether to go on, and told where it stands: from any thread.
#[derive(Clone, Copy)]
pub struct Watcher<'a> {
    cancelled: Option<&'a (dyn Fn() -> bool + Sync)>,
    deadline: Option<Instant>,
    heard: Option<&'a (dyn Fn(&Progress) + Sync)>,
    /// Counts the samples that a backend has taken.
    meter: Option<&'a Meter<'a>>,
}

impl<'a> Watcher<'a> {
    /// Nobody: what runs goes on to its end, and says nothing.
    pub const fn none() -> Self {
        Self {
            cancelled: None,
            deadline: None,
            heard: None,
            meter: None,
        }
    }

    /// It also ends what runs once `cancelled` says so.
    #[must_use]
    pub const fn cancelled_by(self, cancelled: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self {
            cancelled: Some(cancelled),
            ..self
        }
    }

    /// It also hears where a render stands: at the beginning and the end of every phase, and now and then within it.
    #[must_use]
    pub const fn heard_by(self, heard: &'a (dyn Fn(&Progress) + Sync)) -> Self {
        Self {
            heard: Some(heard),
            ..self
        }
    }

    /// It also ends what runs at this time, in place of another that it had; `None` changes nothing.
    #[must_use]
    pub fn until(self, deadline: Option<Instant>) -> Self {
        Self {
            deadline: deadline.or(self.deadline),
            ..self
        }
    }

    /// It lets all run to its end.
    #[must_use]
    pub const fn to_the_end(self) -> Self {
        Self {
            cancelled: None,
            deadline: None,
            ..self
        }
    }

    /// Nobody hears, and nobody ends what runs.
    pub fn is_nobody(&self) -> bool {
        self.cancelled.is_none() && self.deadline.is_none() && self.heard.is_none()
    }

    /// The caller wants the end, or the time is over. What runs then stops soon, and leaves whole pixels.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.is_some_and(|cancelled| cancelled())
            || self.deadline.is_some_and(|at| Instant::now() >= at)
    }

    /// Until the deadline; without one without end.
    pub fn secs_left(&self) -> f64 {
        self.deadline.map_or(f64::INFINITY, |at| {
            at.saturating_duration_since(Instant::now()).as_secs_f64()
        })
    }

    pub fn hear(&self, progress: &Progress) {
        if let Some(heard) = self.heard {
            heard(progress);
        }
    }

    /// A backend has taken so many samples.
    pub fn taken(&self, samples: u64) {
        if let Some(meter) = self.meter {
            meter.add(samples);
        }
    }

    /// The watcher that a backend gets: what it takes is counted by `meter`.
    #[must_use]
    pub const fn metered(self, meter: &'a Meter<'a>) -> Self {
        Self {
            meter: Some(meter),
            ..self
        }
    }
}

/// Tells a watcher what share of a phase is done, as it is counted: from any thread, and not too often.
pub struct Meter<'a> {
    watcher: Watcher<'a>,
    from: Progress,
    /// The share that is done once everything is counted.
    share_at_end: f64,
    total: u64,
    begin: Instant,
    done: AtomicU64,
    /// When the watcher was told the last time, in milliseconds since the beginning.
    told_ms: AtomicU64,
}

impl<'a> Meter<'a> {
    const EVERY_MS: u64 = 100;

    /// A phase of so many things to do begins; the watcher hears of it at once.
    pub fn begin(watcher: &Watcher<'a>, phase: Phase, total: u64) -> Self {
        Self::part(watcher, Progress::begin(phase), 1.0, total)
    }

    /// The part of a phase that goes on from where it stands, to `share_at_end` of it.
    pub fn part(watcher: &Watcher<'a>, from: Progress, share_at_end: f64, total: u64) -> Self {
        watcher.hear(&from);
        Self {
            watcher: *watcher,
            from,
            share_at_end,
            total,
            begin: Instant::now(),
            done: AtomicU64::new(0),
            told_ms: AtomicU64::new(0),
        }
    }

    /// What is being done is not waited for any more.
    pub fn is_cancelled(&self) -> bool {
        self.watcher.is_cancelled()
    }

    /// So many more are done.
    pub fn add(&self, count: u64) {
        let done = count + self.done.fetch_add(count, Ordering::Relaxed);
        let ms = self.begin.elapsed().as_millis() as u64;
        let told_ms = self.told_ms.load(Ordering::Relaxed);
        let is_due = ms >= told_ms + Self::EVERY_MS
            && (self.told_ms)
                .compare_exchange(told_ms, ms, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok();
        if is_due {
            self.tell(done);
        }
    }

    /// All is done, or what is left is not needed.
    pub fn end(self) {
        self.tell(self.total);
    }

    fn tell(&self, done: u64) {
        let share = done as f64 / self.total.max(1) as f64;
        let from = self.from.share_done;
        self.watcher.hear(&Progress {
            share_done: from + (self.share_at_end - from) * share.min(1.0),
            elapsed: self.from.elapsed + self.begin.elapsed(),
            ..self.from
        });
    }
}
