//! The film and what is made of it: sums over samples, the composite over the photograph, the output planes.

mod accumulation;
mod combine;
mod compare;
mod composite;
mod enlarge;
mod filter;
mod final_filter;
mod flip;
pub(crate) mod groups;
mod parts;
mod pools;
mod scrambles;
pub(crate) mod splats;
pub(crate) mod sums;
#[cfg(test)]
mod test_support;

pub use accumulation::{Film, MergeError, PixelCounts, PixelKind};
pub use combine::{Combined, combine_robustly, group_counts};
pub use compare::{Comparison, SizeMismatch, compare};
pub(crate) use composite::Means;
pub use composite::{
    Picture, Planes, QUOTIENT_EPSILON, background_pixel, composite, composite_smoothed,
    estimated_error, planes, variance,
};
pub use enlarge::{enlarge, enlarged, nearest};
pub use filter::{RealSurface, filter_difference, smoothed_difference};
pub use final_filter::filter_finally;
pub use flip::{flip, flip_map};
pub use groups::{GROUPS, GroupSums, group_add};
pub use parts::Parts;
pub use pools::pooled;
pub use scrambles::Scrambles;
pub use splats::{Splat, SplatSums};
pub use sums::{
    GuideSums, PixelSums, Sample, Sum3, guide_add, is_unusable, pixel_add, pixel_add_real, sum_add,
    sum3_add, two_sum,
};
