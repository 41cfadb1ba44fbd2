//! The difference's samples in groups, for the robust combination of the delivered picture. Twin of `shaders/film/groups.wgsl`.
//!
//! A group is every fifth of a pixel's evaluations of the difference: an odd number, as every second or fourth point of a Sobol sequence lies in one
//! half or quarter of its first dimension, and each group must see all lights.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::sums::{Sum3, is_unusable, sum3_add};
use crate::shared::{Array, shared};

shared! {
    /// Of the evaluations of a pixel.
    pub const GROUPS: u32 = 5;

    /// Sums of the difference over the samples of all groups but the last, which has what is left of the pixel's sum.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct GroupSums {
        pub diff: [Sum3; 4] as Array<Sum3, 4>,
    }
}

/// Adds the difference of the evaluation with this number, which met nothing virtual.
pub fn group_add(sums: &mut GroupSums, evaluation: u32, difference: Vec3) {
    let group = evaluation % GROUPS;
    if group < GROUPS - 1 && !is_unusable(difference) {
        sum3_add(&mut sums.diff[group as usize], difference);
    }
}

impl GroupSums {
    /// Of each group; `all`: of all samples.
    pub fn values(&self, all: DVec3) -> [DVec3; GROUPS as usize] {
        let mut values = [all; GROUPS as usize];
        for (group, sum) in self.diff.iter().enumerate() {
            values[group] = sum.value();
            values[GROUPS as usize - 1] -= values[group];
        }
        values
    }

    /// Adds the sums of other samples of the same pixel.
    pub(super) fn merge(&mut self, other: &Self) {
        for (a, b) in self.diff.iter_mut().zip(&other.diff) {
            a.merge(b);
        }
    }
}
