//! Rays, counted by the paper's kinds.

use std::ops::{Add, AddAssign, Sub};

use bytemuck::AnyBitPattern;
use serde::{Deserialize, Serialize};

/// Rays traced, by the paper's kinds. Primary rays are among the mixed and real ones too. `u32` for what one sample or one batch of the GPU
/// counts, `u64` for totals.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, AnyBitPattern)]
pub struct RayCounts<T = u64> {
    pub primary: T,
    pub mixed: T,
    pub real: T,
    pub mixed_shadow: T,
    pub real_shadow: T,
}

impl<T> RayCounts<T> {
    /// Each kind by itself.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> RayCounts<U> {
        RayCounts {
            primary: f(self.primary),
            mixed: f(self.mixed),
            real: f(self.real),
            mixed_shadow: f(self.mixed_shadow),
            real_shadow: f(self.real_shadow),
        }
    }

    fn zip<U, V>(self, other: RayCounts<U>, f: impl Fn(T, U) -> V) -> RayCounts<V> {
        RayCounts {
            primary: f(self.primary, other.primary),
            mixed: f(self.mixed, other.mixed),
            real: f(self.real, other.real),
            mixed_shadow: f(self.mixed_shadow, other.mixed_shadow),
            real_shadow: f(self.real_shadow, other.real_shadow),
        }
    }
}

impl<T: Add<Output = T>> RayCounts<T> {
    /// All rays but the primary ones, which are among the mixed and real rays already.
    pub fn traced(self) -> T {
        self.mixed + self.real + self.mixed_shadow + self.real_shadow
    }
}

/// Counts of one size or a smaller one.
impl<T, U> AddAssign<RayCounts<U>> for RayCounts<T>
where
    T: Copy + Add<Output = T> + From<U>,
{
    fn add_assign(&mut self, more: RayCounts<U>) {
        *self = self.zip(more, |sum, n| sum + T::from(n));
    }
}

impl<T: Sub<Output = T>> Sub for RayCounts<T> {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        self.zip(before, T::sub)
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
        let one = RayCounts {
            primary: 1u32,
            mixed: 2,
            real: 3,
            mixed_shadow: 4,
            real_shadow: 5,
        };
        let mut total = RayCounts::<u64>::default();
        total += one;
        total += one.map(u64::from);
        assert_eq!(total, one.map(|n| 2 * u64::from(n)));
        assert_eq!(total.traced(), 28);
        assert_eq!(total - one.map(u64::from), one.map(u64::from));
        assert_eq!([total, total].into_iter().sum::<RayCounts>().mixed, 8);
        let swapped = RayCounts {
            mixed: one.real,
            real: one.mixed,
            ..one
        };
        assert_ne!(swapped, one, "control");
    }
}
