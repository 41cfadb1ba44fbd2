//! Acceleration structures: one over the real, one over the virtual triangles.
//!
//! obvhs builds one BVH2 a world (`binary`). From it come an 8-wide tree of f32 boxes for the CPU (`wide`, traversed by `trace`) and a
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
mod wide;

#[cfg(all(test, feature = "bench"))]
mod gpu_tests;
#[cfg(all(test, feature = "bench"))]
mod tests;

use std::sync::{Mutex, OnceLock};

use glam::Vec3;
use obvhs::bvh2::Bvh2;
use thiserror::Error;

use crate::shared::NONE;
use compressed::CompressedBvh;
use kernel::Kernel;
pub use trace::Hit;
use wide::WideBvh;

/// Largest absolute coordinate, metres, for which no product in the triangle test overflows.
pub const MAX_COORDINATE_M: f32 = 1.0e13;

/// Most triangles in one world: child words keep 28 bits for a block of eight.
pub const MAX_TRIANGLES: usize = 1 << 27;

/// At most `max` spheres (centre, radius) over triangles, as [`WorldBvh::bounding_spheres`].
pub fn covering_spheres(triangles: &[[Vec3; 3]], max: usize) -> Vec<[f32; 4]> {
    spheres::cover(triangles, max)
}

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

/// The triangles of one world, ready for rays on the CPU and, once a GPU asks, for upload.
pub struct WorldBvh {
    wide: WideBvh,
    /// What the GPU's tree is made from, until it is.
    tree: Mutex<Option<Bvh2>>,
    triangles: Vec<[Vec3; 3]>,
    first_id: u32,
    compressed: OnceLock<CompressedBvh>,
    kernel: Kernel,
    bounds: Option<(Vec3, Vec3)>,
}

impl WorldBvh {
    /// Builds the CPU's tree. `triangles` are anchor-relative, in metres; ids are `first_id` plus the index. No triangles is legal: every ray
    /// misses.
    ///
    /// # Errors
    /// More than [`MAX_TRIANGLES`], or a coordinate that is not finite or larger than [`MAX_COORDINATE_M`].
    pub fn build(triangles: &[[Vec3; 3]], first_id: u32) -> Result<WorldBvh, AccelError> {
        if triangles.len() > MAX_TRIANGLES || triangles.len() > (NONE - first_id) as usize {
            return Err(AccelError::TooManyTriangles {
                count: triangles.len(),
            });
        }
        let mut low = Vec3::splat(f32::INFINITY);
        let mut high = Vec3::splat(f32::NEG_INFINITY);
        for (index, triangle) in triangles.iter().enumerate() {
            for vertex in triangle {
                if !vertex.is_finite() || vertex.abs().max_element() > MAX_COORDINATE_M {
                    return Err(AccelError::Coordinate { triangle: index });
                }
                low = low.min(*vertex);
                high = high.max(*vertex);
            }
        }
        let mut tree = binary::build(triangles);
        let mut wide = WideBvh::empty();
        if let Some(built) = &mut tree {
            wide = Self::collapse(built, triangles, first_id).unwrap_or_else(|| {
                // A tree too deep for the traversal stacks; the balanced one never is.
                *built = binary::build_balanced(triangles);
                Self::collapse(built, triangles, first_id).expect("a balanced tree fits the stacks")
            });
        }
        Ok(WorldBvh {
            wide,
            tree: Mutex::new(tree),
            triangles: triangles.to_vec(),
            first_id,
            compressed: OnceLock::new(),
            kernel: Kernel::best(),
            bounds: (!triangles.is_empty()).then_some((low, high)),
        })
    }

    fn collapse(tree: &Bvh2, triangles: &[[Vec3; 3]], first_id: u32) -> Option<WideBvh> {
        if binary::depth(tree) > binary::MAX_DEPTH {
            return None;
        }
        WideBvh::collapse(tree, triangles, first_id)
    }

    /// The GPU's tree, made when it is first asked for: a render on the CPU does without.
    fn compressed(&self) -> &CompressedBvh {
        self.compressed.get_or_init(|| {
            let convert =
                |tree: &Bvh2| CompressedBvh::convert(tree, &self.triangles, self.first_id);
            match self.tree.lock().unwrap_or_else(|e| e.into_inner()).take() {
                Some(tree) => convert(&tree).unwrap_or_else(|| {
                    convert(&binary::build_balanced(&self.triangles))
                        .expect("a balanced tree fits the stack")
                }),
                None => CompressedBvh::empty(),
            }
        })
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
        kernel::closest(&self.wide, kernel, ray)
    }

    #[inline]
    fn any_by(&self, kernel: Kernel, ray: &Ray) -> bool {
        kernel::any(&self.wide, kernel, ray)
    }

    /// Smallest and largest vertex coordinates; `None` without triangles.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.bounds
    }

    /// Nodes of the GPU's tree, five vec4<u32> each, at least one. Child and triangle indices inside are relative to this world.
    pub fn gpu_nodes(&self) -> &[[[u32; 4]; 5]] {
        self.compressed().nodes()
    }

    /// Triangles in the order of the GPU's leaves, three vec4<f32> each: the vertices, w of the first holding the bits of the global id.
    pub fn gpu_leaves(&self) -> &[[f32; 4]] {
        self.compressed().leaves()
    }

    /// At most `max` spheres (centre, radius) that together contain every triangle; fewer where more would hardly be smaller in total
    /// cross-section. Empty without triangles or with `max == 0`.
    pub fn bounding_spheres(&self, max: usize) -> Vec<[f32; 4]> {
        spheres::cover(&self.triangles, max)
    }
}
