//! Virtual objects that were moved: their tree keeps its shape where it can, and what did not move stays as it is.

use super::build::PackError;
use crate::accel::WorldBvh;
use crate::packed::{Moved, PackedScene, Triangle};
use crate::scene::Scene;

impl PackedScene {
    /// [`PackedScene::rebuild_virtual`] where objects were moved: the tree is refitted, which every ray takes as it takes a new one, but more slowly
    /// the farther they have come. Where that is far, it is built anew, but in a draft.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn move_virtual(&mut self, scene: &Scene) -> Result<(), PackError> {
        self.place_virtual(scene)?;
        let first = self.frame.real_triangle_count;
        let corners = self.corners(first as usize);
        let is_draft = self.object_covers.is_some();
        if !self.virtual_bvh.refit(&corners)? || (!is_draft && self.virtual_bvh.is_worn()) {
            self.virtual_bvh = WorldBvh::build(&corners, first)?;
        }
        self.rebuild_moving(scene)
    }

    /// [`PackedScene::move_virtual`] where this object alone was moved, which rests as it did before: the others are not looked at. What it changed is
    /// in [`PackedScene::moved`], unless all of the virtual world is new.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn move_object(&mut self, scene: &Scene, object: usize) -> Result<(), PackError> {
        let Some(moved) = self.place_again(scene, object)? else {
            return self.move_virtual(scene);
        };
        let first = self.frame.real_triangle_count as usize;
        let corners = self.corners_of(moved.triangles.clone());
        self.virtual_bvh
            .refit_part(moved.triangles.start - first, &corners)?;
        let is_draft = self.object_covers.is_some();
        let is_worn = !is_draft && self.virtual_bvh.is_worn();
        if is_worn {
            let resting = self.corners_of(first..self.resting.triangles);
            self.virtual_bvh = WorldBvh::build(&resting, first as u32)?;
        }
        self.cover_resting(scene, first);
        let shining = |packed: &Self| -> Vec<u32> {
            let each = packed.lights.iter().map(|light| light.triangle);
            each.collect()
        };
        let before = shining(self);
        self.rebuild_moving(scene)?;
        // Triangles name their lights.
        self.moved = (!is_worn && before == shining(self)).then_some(moved);
        Ok(())
    }

    /// Packs an object that rests in its old place; `None` where it does not fit there, and all has to be packed.
    fn place_again(&mut self, scene: &Scene, object: usize) -> Result<Option<Moved>, PackError> {
        let known = self
            .resting_objects
            .iter()
            .find(|known| known.object == object);
        let Some(Moved {
            triangles,
            vertices,
            ..
        }) = known.cloned()
        else {
            return Ok(None);
        };
        // Packed after all others first.
        self.triangles.truncate(self.resting.triangles);
        self.vertices.truncate(self.resting.vertices);
        let materials = self.materials.len();
        self.add_object(scene, object, false)?;
        let new_triangles = self.triangles.split_off(self.resting.triangles);
        let new_vertices = self.vertices.split_off(self.resting.vertices);
        let fits = (new_triangles.len(), new_vertices.len()) == (triangles.len(), vertices.len())
            && materials == self.materials.len();
        if !fits {
            return Ok(None);
        }
        let back = (self.resting.vertices - vertices.start) as u32;
        self.vertices[vertices.clone()].copy_from_slice(&new_vertices);
        for (place, new) in self.triangles[triangles.clone()]
            .iter_mut()
            .zip(new_triangles)
        {
            *place = Triangle {
                vertices: new.vertices.map(|v| v - back),
                ..new
            };
        }
        Ok(Some(Moved {
            object,
            triangles,
            vertices,
        }))
    }
}

#[cfg(test)]
mod tests;
