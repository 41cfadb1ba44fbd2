//! What a caller can say to a running render, and what it hears back.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// How far [`super::Renderer::advance`] goes; it never goes beyond the rays per pixel of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Budget {
    /// Until every pixel has its rays.
    Complete,
    /// About this many primary rays, at least one pass of one ray a pixel.
    Rays(u64),
    /// About this long.
    Time(Duration),
}

/// Where a render stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Rays per pixel that every pixel has taken.
    pub samples: u32,
    pub samples_total: u32,
    pub rays: RayTotals,
    pub elapsed: Duration,
}

/// Rays traced, by the paper's kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayTotals {
    pub primary: u64,
    pub mixed: u64,
    pub real: u64,
    pub mixed_shadow: u64,
    pub real_shadow: u64,
}

impl RayTotals {
    /// All rays but the primary ones, which are among the mixed and real rays already.
    pub fn traced(&self) -> u64 {
        self.mixed + self.real + self.mixed_shadow + self.real_shadow
    }
}

impl std::ops::AddAssign for RayTotals {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.mixed += other.mixed;
        self.real += other.real;
        self.mixed_shadow += other.mixed_shadow;
        self.real_shadow += other.real_shadow;
    }
}

/// One sweep over the film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass<'a> {
    /// Brings every pixel up to this many samples (an absolute sample index, exclusive).
    Main { end: u32 },
    /// The same, a number for each row: what is exposed before an instant.
    MainRows { ends: &'a [u32] },
    /// Replays the real rays that edge pixels need; `everywhere`: of all pixels that are not wholly virtual.
    Real { everywhere: bool },
    /// The same, of the samples before each row's end.
    RealRows { everywhere: bool, ends: &'a [u32] },
}

impl Pass<'_> {
    /// The index, in rays per pixel, before which the samples of a row are taken.
    pub fn end_of_row(&self, row: usize) -> u32 {
        match self {
            Self::Main { end } => *end,
            Self::MainRows { ends } | Self::RealRows { ends, .. } => ends[row],
            Self::Real { .. } => u32::MAX,
        }
    }
}

/// Asked by backends between tiles or batches.
pub struct Cancel<'a> {
    cancelled: &'a (dyn Fn() -> bool + Sync),
    deadline: Option<Instant>,
    pixels_done: AtomicU64,
}

impl<'a> Cancel<'a> {
    pub fn new(cancelled: &'a (dyn Fn() -> bool + Sync), deadline: Option<Instant>) -> Self {
        Self {
            cancelled,
            deadline,
            pixels_done: AtomicU64::new(0),
        }
    }

    /// True once the caller wants the render to end or its time is over.
    pub fn is_cancelled(&self) -> bool {
        (self.cancelled)() || self.deadline.is_some_and(|d| Instant::now() >= d)
    }

    /// Called by a backend after some pixels of the pass are done.
    pub fn progress(&self, pixels: u64) {
        self.pixels_done.fetch_add(pixels, Ordering::Relaxed);
    }

    pub fn pixels_done(&self) -> u64 {
        self.pixels_done.load(Ordering::Relaxed)
    }
}
