//! Rays, counted by the paper's kinds.

use std::ops::{AddAssign, Div, Sub};

use bytemuck::AnyBitPattern;
use serde::{Deserialize, Serialize};

use crate::shared::shared;

shared! {
    /// Rays that one sample, or one batch of the GPU, has traced, as [`RayCounts`].
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, AnyBitPattern)]
    pub struct SampleRays {
        pub primary: u32,
        pub mixed: u32,
        pub real: u32,
        pub mixed_shadow: u32,
        pub real_shadow: u32,
    }
}

/// Rays traced, by the paper's kinds. Primary rays are among the mixed and real ones too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RayCounts {
    pub primary: u64,
    pub mixed: u64,
    pub real: u64,
    pub mixed_shadow: u64,
    pub real_shadow: u64,
}

impl RayCounts {
    /// All rays but the primary ones, which are among the mixed and real rays already.
    pub fn traced(self) -> u64 {
        self.mixed + self.real + self.mixed_shadow + self.real_shadow
    }

    fn zip(self, other: Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            primary: f(self.primary, other.primary),
            mixed: f(self.mixed, other.mixed),
            real: f(self.real, other.real),
            mixed_shadow: f(self.mixed_shadow, other.mixed_shadow),
            real_shadow: f(self.real_shadow, other.real_shadow),
        }
    }
}

impl From<SampleRays> for RayCounts {
    fn from(rays: SampleRays) -> Self {
        Self {
            primary: rays.primary.into(),
            mixed: rays.mixed.into(),
            real: rays.real.into(),
            mixed_shadow: rays.mixed_shadow.into(),
            real_shadow: rays.real_shadow.into(),
        }
    }
}

/// Of counts of either kind.
impl<T: Into<Self>> AddAssign<T> for RayCounts {
    fn add_assign(&mut self, more: T) {
        *self = self.zip(more.into(), |sum, n| sum + n);
    }
}

impl Sub for RayCounts {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        self.zip(before, |now, before| now - before)
    }
}

/// The mean of several, rounded down.
impl Div<u64> for RayCounts {
    type Output = Self;

    fn div(self, count: u64) -> Self {
        self.zip(self, |sum, _| sum / count)
    }
}

impl std::iter::Sum for RayCounts {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |mut sum, counts| {
            sum += counts;
            sum
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_summed_apart_and_primary_rays_are_not_traced_twice() {
        let sample = SampleRays {
            primary: 1,
            mixed: 2,
            real: 3,
            mixed_shadow: 4,
            real_shadow: 5,
        };
        let one = RayCounts::from(sample);
        let mut total = RayCounts::default();
        total += one;
        total += sample;
        assert_eq!(total.traced(), 28);
        assert_eq!(total - one, one);
        assert_eq!(total / 2, one);
        assert_eq!([total, total].into_iter().sum::<RayCounts>().mixed, 8);
        let swapped = RayCounts {
            mixed: one.real,
            real: one.mixed,
            ..one
        };
        assert_ne!(swapped, one, "control");
    }
}
