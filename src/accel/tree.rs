//! One tree over triangles with consecutive ids: the CPU's at once, the GPU's when it is asked for.

use std::sync::{Mutex, OnceLock};

use glam::Vec3;
use obvhs::bvh2::Bvh2;

use super::binary;
use super::compressed::{CompressedBvh, Place, Refitted};
use super::wide::WideBvh;
use super::{AccelError, MAX_COORDINATE_M, MAX_TRIANGLES};
use crate::shared::NONE;

/// Growth of a tree's boxes beside the whole, and so of what a ray costs, up to which moving its triangles is cheaper than building it anew.
const WORN: f32 = 1.2;

pub(super) struct Tree {
    pub(super) wide: WideBvh,
    /// What the GPU's tree is made from, until it is.
    binary: Mutex<Option<Bvh2>>,
    triangles: Vec<[Vec3; 3]>,
    first_id: u32,
    compressed: OnceLock<CompressedBvh>,
    /// [`WideBvh::surface`] as it was built; `None` until triangles are moved.
    built_surface: Option<f32>,
    /// Smallest and largest vertex coordinates; `None` without triangles.
    pub(super) bounds: Option<(Vec3, Vec3)>,
}

impl Tree {
    /// # Errors
    /// As [`super::WorldBvh::build`].
    pub(super) fn build(triangles: &[[Vec3; 3]], first_id: u32) -> Result<Self, AccelError> {
        if triangles.len() > MAX_TRIANGLES || triangles.len() > (NONE - first_id) as usize {
            return Err(AccelError::TooManyTriangles {
                count: triangles.len(),
            });
        }
        let bounds = bounds_of(triangles, 0)?;
        let mut tree = binary::build(triangles);
        let mut wide = WideBvh::empty();
        if let Some(built) = &mut tree {
            wide = collapse(built, triangles, first_id).unwrap_or_else(|| {
                // A tree too deep for the traversal stacks; the balanced one never is.
                *built = binary::build_balanced(triangles);
                collapse(built, triangles, first_id).expect("a balanced tree fits the stacks")
            });
        }
        Ok(Self {
            wide,
            binary: Mutex::new(tree),
            triangles: triangles.to_vec(),
            first_id,
            compressed: OnceLock::new(),
            built_surface: None,
            bounds,
        })
    }

    /// As [`super::WorldBvh::refit_part`].
    ///
    /// # Errors
    /// As [`super::WorldBvh::build`].
    pub(super) fn refit(
        &mut self,
        first: usize,
        triangles: &[[Vec3; 3]],
    ) -> Result<(), AccelError> {
        bounds_of(triangles, first)?;
        self.built_surface.get_or_insert(self.wide.surface());
        let moved = first..first + triangles.len();
        self.triangles[moved.clone()].copy_from_slice(triangles);
        self.bounds = bounds_of(&self.triangles, 0)?;
        self.wide.refit(&self.triangles, self.first_id, &moved);
        // A device that asks for its tree later has it built anew.
        self.binary = Mutex::new(None);
        if let Some(compressed) = self.compressed.get_mut() {
            compressed.refit(&self.triangles, self.first_id, &moved);
        }
        Ok(())
    }

    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// As [`super::WorldBvh::gpu_refitted`].
    pub(super) fn refitted(&self) -> Option<&Refitted> {
        self.compressed.get()?.refitted.as_ref()
    }

    /// As [`super::WorldBvh::is_worn`].
    pub(super) fn is_worn(&self) -> bool {
        (self.built_surface).is_some_and(|built| self.wide.surface() > WORN * built)
    }

    /// The first id after those of this tree.
    pub(super) fn end_id(&self) -> u32 {
        self.first_id + self.triangles.len() as u32
    }

    /// The GPU's tree, made when it is first asked for: a render on the CPU does without. Its place is that of the first call.
    pub(super) fn compressed(&self, place: Place) -> &CompressedBvh {
        self.compressed.get_or_init(|| {
            let convert =
                |tree: &Bvh2| CompressedBvh::convert(tree, &self.triangles, self.first_id, place);
            let built = self.binary.lock().unwrap_or_else(|e| e.into_inner()).take();
            match built.or_else(|| binary::build(&self.triangles)) {
                Some(tree) => convert(&tree).unwrap_or_else(|| {
                    convert(&binary::build_balanced(&self.triangles))
                        .expect("a balanced tree fits the stack")
                }),
                None => CompressedBvh::empty(),
            }
        })
    }
}

/// Smallest and largest vertex coordinates; `None` without triangles. `first`: the number of the first triangle, for messages.
fn bounds_of(triangles: &[[Vec3; 3]], first: usize) -> Result<Option<(Vec3, Vec3)>, AccelError> {
    let mut low = Vec3::splat(f32::INFINITY);
    let mut high = Vec3::splat(f32::NEG_INFINITY);
    for (index, triangle) in triangles.iter().enumerate() {
        for vertex in triangle {
            if !vertex.is_finite() || vertex.abs().max_element() > MAX_COORDINATE_M {
                return Err(AccelError::Coordinate {
                    triangle: first + index,
                });
            }
            low = low.min(*vertex);
            high = high.max(*vertex);
        }
    }
    Ok((!triangles.is_empty()).then_some((low, high)))
}

fn collapse(tree: &Bvh2, triangles: &[[Vec3; 3]], first_id: u32) -> Option<WideBvh> {
    if binary::depth(tree) > binary::MAX_DEPTH {
        return None;
    }
    WideBvh::collapse(tree, triangles, first_id)
}
