//! Acceleration structures: one over the real, one over the virtual triangles.
//!
//! obvhs builds one BVH2 a world (`binary`), and a second over what moves in it (`tree`). From each come an 8-wide tree of f32 boxes for the CPU (`wide`, traversed by `trace`) and a
//! compressed wide tree for the GPU (`compressed`, traversed by `shaders/accel/trace.wgsl`). Both test triangles with the watertight test of
//! Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2013, in the same f32 operations, and decide equal distances by
//! the smaller triangle id, so that they report the same hits.
//!
//! # Why no hit is lost
//!
//! With u = 2^-24 the test computes sheared coordinates whose error is at most 5u times the hit's offset from the origin on that axis plus
//! 10u times the triangle's largest extent, and the distance of a point of the triangle, off by at most 5u times the distance plus 5u times
//! the extent. Each triangle's box is therefore enlarged by at least 16u times its extent (`binary`), and box distances, themselves off by
//! 4u, are compared with a margin of 16u (`trace`). The GPU adds the error of its decompression (`compressed`). Which point of the triangle
//! that is depends on the weights, which are as good as the triangle is wide: for slivers, distances err by u times extent squared over width.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod binary;
mod compressed;
mod kernel;
mod large_pages;
mod spheres;
mod stack;
pub(crate) mod trace;
mod tree;
mod wide;

#[cfg(all(test, feature = "bench"))]
mod tests;

use std::sync::OnceLock;

use glam::Vec3;
use thiserror::Error;

use crate::shared::NONE;
pub use compressed::Refitted;
use compressed::{CompressedBvh, Place};
use kernel::Kernel;
pub use spheres::{Cover, Mesh};
pub use trace::Hit;
use tree::Tree;

/// Largest absolute coordinate, metres, for which no product in the triangle test overflows.
pub const MAX_COORDINATE_M: f32 = 1.0e13;

/// Most triangles in one world: child words keep 28 bits for a block of eight.
pub const MAX_TRIANGLES: usize = 1 << 27;

/// A half-line with the interval in which hits count.
///
/// A hit at distance `t` counts if `t > t_min`, or `t == t_min` and its triangle id is larger than `skip`, and if `t < t_max`. A ray that
/// continues through coincident surfaces therefore starts at the last hit's distance with `skip` set to its id.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Anchor-relative, metres.
    pub origin: Vec3,
    /// Unit length; distances are in multiples of its length.
    pub direction: Vec3,
    /// At least 0.
    pub t_min: f32,
    /// Excluded; may be infinite.
    pub t_max: f32,
    /// [`NONE`] excludes all hits at exactly `t_min`.
    pub skip: u32,
}

impl Hit {
    pub const MISS: Hit = Hit {
        t: f32::INFINITY,
        u: 0.0,
        v: 0.0,
        triangle: NONE,
    };

    /// Whether a triangle was met.
    pub fn is_hit(&self) -> bool {
        self.triangle != NONE
    }
}

/// Why no structure could be built.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AccelError {
    #[error("{count} triangles in one world, at most {MAX_TRIANGLES} are supported")]
    TooManyTriangles { count: usize },
    #[error("triangle {triangle} has a coordinate that is not a number between -1e13 and 1e13 m")]
    Coordinate { triangle: usize },
}

/// The triangles of one world, ready for rays on the CPU and, once a GPU asks, for upload: a tree of what rests, and where anything moves,
/// another of that, which alone is built anew for each instant.
pub struct WorldBvh {
    resting: Tree,
    moving: Option<Tree>,
    /// The GPU's root over both trees, and theirs.
    roots: OnceLock<[compressed::Node; 3]>,
    kernel: Kernel,
}

impl WorldBvh {
    /// Builds the CPU's tree. `triangles` are anchor-relative, in metres; ids are `first_id` plus the index. No triangles is legal: every ray
    /// misses.
    ///
    /// # Errors
    /// More than [`MAX_TRIANGLES`], or a coordinate that is not finite or larger than [`MAX_COORDINATE_M`].
    pub fn build(triangles: &[[Vec3; 3]], first_id: u32) -> Result<WorldBvh, AccelError> {
        Ok(WorldBvh {
            resting: Tree::build(triangles, first_id)?,
            moving: None,
            roots: OnceLock::new(),
            kernel: Kernel::best(),
        })
    }

    /// Moves the triangles that rest, of which there are as many as before: the tree keeps its shape, and its boxes take their new size. False, and
    /// nothing is done, if there are more or fewer.
    ///
    /// # Errors
    /// As [`WorldBvh::build`].
    pub fn refit(&mut self, triangles: &[[Vec3; 3]]) -> Result<bool, AccelError> {
        let fits = triangles.len() == self.resting.len();
        if fits {
            self.refit_part(0, triangles)?;
        }
        Ok(fits)
    }

    /// [`WorldBvh::refit`] where only `triangles` move, those that rest from number `first` on: nothing else is touched but the boxes around them.
    /// Panics if there are not so many.
    ///
    /// # Errors
    /// As [`WorldBvh::build`].
    pub fn refit_part(&mut self, first: usize, triangles: &[[Vec3; 3]]) -> Result<(), AccelError> {
        self.roots = OnceLock::new();
        self.resting.refit(first, triangles)
    }

    /// Triangles have come so far by [`WorldBvh::refit`] that rays would be faster in a tree built anew.
    pub fn is_worn(&self) -> bool {
        self.resting.is_worn()
    }

    /// Replaces the triangles that move, whose ids follow those that rest; what rests is not touched.
    ///
    /// # Errors
    /// As [`WorldBvh::build`].
    pub fn set_moving(&mut self, triangles: &[[Vec3; 3]]) -> Result<(), AccelError> {
        let build = || Tree::build(triangles, self.resting.end_id());
        self.moving = (!triangles.is_empty()).then(build).transpose()?;
        self.roots = OnceLock::new();
        Ok(())
    }

    /// The nearest hit; of several at the same distance the smallest triangle id. A ray with a coordinate that is not finite misses.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Hit {
        self.closest_by(self.kernel, ray)
    }

    /// Whether anything is hit.
    #[inline]
    pub fn any(&self, ray: &Ray) -> bool {
        self.any_by(self.kernel, ray)
    }

    #[inline]
    fn closest_by(&self, kernel: Kernel, ray: &Ray) -> Hit {
        let hit = kernel::closest(&self.resting.wide, kernel, ray);
        let Some(moving) = &self.moving else {
            return hit;
        };
        // At equal distance the hit stands: what moves has the larger ids.
        let t_max = ray.t_max.min(hit.t);
        let nearer = kernel::closest(&moving.wide, kernel, &Ray { t_max, ..*ray });
        if nearer.is_hit() { nearer } else { hit }
    }

    #[inline]
    fn any_by(&self, kernel: Kernel, ray: &Ray) -> bool {
        kernel::any(&self.resting.wide, kernel, ray)
            || (self.moving.as_ref()).is_some_and(|moving| kernel::any(&moving.wide, kernel, ray))
    }

    /// Smallest and largest vertex coordinates; `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let moving = self.moving.as_ref().and_then(|tree| tree.bounds);
        let all = self.resting.bounds.into_iter().chain(moving);
        all.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Nodes of the GPU's tree, five vec4<u32> each: roots, below what rests, below what moves. Child and triangle indices inside are relative
    /// to this world.
    pub fn gpu_nodes(&self) -> [&[compressed::Node]; 3] {
        let [resting, moving] = self.compressed();
        let roots = self.roots.get_or_init(|| compressed::join(resting, moving));
        [roots, &resting.nodes[1..], &moving.nodes[1..]]
    }

    /// What the last refit changed of the second of [`WorldBvh::gpu_nodes`], and of the first of [`WorldBvh::gpu_leaves`]. `None`: all of them are
    /// new.
    pub fn gpu_refitted(&self) -> Option<&Refitted> {
        self.resting.refitted()
    }

    /// Triangles in the order of the GPU's leaves, what rests and what moves, three vec4<f32> each: the vertices, w of the first holding the
    /// bits of the global id.
    pub fn gpu_leaves(&self) -> [&[[f32; 4]]; 2] {
        self.compressed().map(|tree| &*tree.leaves)
    }

    /// Nodes on the longest path of the GPU's tree.
    pub fn gpu_levels(&self) -> u32 {
        let [resting, moving] = self.compressed();
        // One more joins two trees.
        resting.levels.max(moving.levels) + u32::from(self.moving.is_some())
    }

    fn compressed(&self) -> [&CompressedBvh; 2] {
        let resting = self.resting.compressed(Place::FIRST);
        let moving = match &self.moving {
            Some(moving) => moving.compressed(Place::after(resting)),
            None => CompressedBvh::none(),
        };
        [resting, moving]
    }
}
