//! The spheres about the virtual world: those of each object, which go with it where it is moved; or, where objects are more than spheres, as few as
//! serve all of them.

use glam::{DMat3, DMat4, DVec3, Vec3};

use crate::accel::{Cover, Mesh};
use crate::packed::materials::MaterialKey;
use crate::packed::{
    MATERIAL_PANE, MAX_PHOTON_SPHERES, MAX_SPHERES, Material, NONE, ObjectCover, PackedScene,
};
use crate::scene::{Instance, Object, Scene};

/// Share by which the lengths of vectors may come to differ where an object is moved, turned and scaled as a whole: far above rounding.
const SIMILAR: f64 = 1e-9;

impl PackedScene {
    /// Covers the virtual triangles that rest, from the global id `first` on.
    pub(super) fn cover_resting(&mut self, scene: &Scene, first: usize) {
        let mut covers = std::mem::take(&mut self.object_covers);
        let fits = self.cover_objects(scene, first, &mut covers);
        self.object_covers = covers;
        if fits {
            return;
        }
        let mesh = self.mesh(first..self.triangles.len(), |_| true);
        let (whole, smooth) = rayon::join(
            || Cover::of(&mesh, MAX_SPHERES),
            || self.cover_smooth(first..self.triangles.len()),
        );
        (self.resting_covers, self.resting_smooth_covers) = (vec![whole], vec![smooth]);
    }

    /// False if the objects are more than the spheres.
    fn cover_objects(
        &mut self,
        scene: &Scene,
        first: usize,
        covers: &mut Vec<ObjectCover>,
    ) -> bool {
        // Without those that were scaled to nothing.
        let resting: Vec<usize> = (self.resting_objects.iter())
            .filter(|known| !known.triangles.is_empty())
            .map(|known| known.object)
            .collect();
        // Lamps, and what moves, have one more each.
        if resting.len() + 2 > MAX_SPHERES {
            return false;
        }
        let (mut whole, mut smooth) = (Vec::new(), Vec::new());
        for index in resting {
            let object = &scene.objects[index];
            let [space_from_object, world_from_space] = self.space_of(object);
            let cover = self.cover_of(covers, index, object, space_from_object);
            whole.push(self.placed(&cover.whole, world_from_space));
            if !cover.smooth.is_empty() {
                smooth.push(self.placed(&cover.smooth, world_from_space));
            }
        }
        if smooth.len() + 1 > MAX_PHOTON_SPHERES {
            return false;
        }
        let lamps = self.triangles[first..].partition_point(|t| t.object != NONE);
        let lamps = self.mesh(first + lamps..self.triangles.len(), |_| true);
        whole.push(Cover::of(&lamps, 1));
        (self.resting_covers, self.resting_smooth_covers) = (whole, smooth);
        true
    }

    /// The space in which an object's spheres are found: what leads to it from the object's own, and from it to the world. It is the object's own, and
    /// spheres go with an object that is moved, turned or scaled as a whole. They would be loose where its sides are stretched by different factors: but
    /// for a draft they are then found in the world's directions, and go with an object that is moved alone.
    fn space_of(&self, object: &Object) -> [DMat4; 2] {
        let linear = DMat3::from_mat4(object.world_from_object);
        match self.is_draft || is_similar(&linear) {
            true => [DMat4::IDENTITY, object.world_from_object],
            false => {
                let moved = object.world_from_object.w_axis.truncate();
                [DMat4::from_mat3(linear), DMat4::from_translation(moved)]
            }
        }
    }

    fn placed(&self, cover: &Cover, world_from_space: DMat4) -> Cover {
        let linear = DMat3::from_mat4(world_from_space);
        let to =
            |center: DVec3| world_from_space.transform_point3(center) - DVec3::from(self.anchor_m);
        cover.placed(to, largest_stretch(&linear))
    }

    /// In the space that `space_from_object` leads to; found once, as long as the object is of the same materials.
    fn cover_of<'a>(
        &self,
        covers: &'a mut Vec<ObjectCover>,
        index: usize,
        object: &Object,
        space_from_object: DMat4,
    ) -> &'a ObjectCover {
        let triangles = resting_triangles(object);
        let materials = self.materials_of(object);
        let known = covers.iter().position(|cover| cover.object == index);
        let fits = |cover: &ObjectCover| {
            cover.triangles == triangles
                && cover.space_from_object == space_from_object
                && cover.materials == materials
        };
        if let Some(at) = known.filter(|&at| fits(&covers[at])) {
            return &covers[at];
        }
        let mesh = |smooth: bool| {
            let parts = object.instances.iter().filter(|part| {
                !object.moves(part) && (!smooth || self.is_smooth_part(object, part))
            });
            let mut mesh = Mesh::default();
            for part in parts {
                let first = mesh.points.len() as u32;
                let space_from_local = space_from_object * part.object_from_local;
                mesh.points.extend(part.primitive.positions.iter().map(|p| {
                    let position = Vec3::from(*p).as_dvec3();
                    space_from_local.transform_point3(position).as_vec3()
                }));
                let triangles = part.primitive.triangles.iter();
                mesh.triangles
                    .extend(triangles.map(|t| t.map(|i| first + i)));
            }
            mesh
        };
        let (whole, smooth) = rayon::join(
            || Cover::of(&mesh(false), MAX_SPHERES),
            || Cover::of(&mesh(true), MAX_PHOTON_SPHERES),
        );
        let found = ObjectCover {
            object: index,
            triangles,
            space_from_object,
            materials,
            whole,
            smooth,
        };
        let at = known.unwrap_or(covers.len());
        match known {
            Some(at) => covers[at] = found,
            None => covers.push(found),
        }
        &covers[at]
    }

    /// Of its parts that rest, without what is known only once all are packed.
    fn materials_of(&self, object: &Object) -> Vec<Material> {
        let parts = object.instances.iter().filter(|part| !object.moves(part));
        let record = |part: &Instance| {
            let key = MaterialKey::new(
                &part.material,
                object.self_shadow_bias_m,
                object.albedo_from_photo,
            );
            let material = self.materials[self.material_table.known(&key)? as usize];
            Some(Material {
                flags: material.flags & !MATERIAL_PANE,
                facet_table: NONE,
                ..material
            })
        };
        parts.filter_map(record).collect()
    }
}

fn resting_triangles(object: &Object) -> usize {
    let parts = object.instances.iter().filter(|part| !object.moves(part));
    parts.map(|part| part.primitive.triangles.len()).sum()
}

/// All vectors become longer by the same factor.
fn is_similar(linear: &DMat3) -> bool {
    let square = linear.transpose() * *linear;
    let mean = (square.x_axis.x + square.y_axis.y + square.z_axis.z) / 3.0;
    square.abs_diff_eq(DMat3::from_diagonal(DVec3::splat(mean)), SIMILAR * mean)
}

/// No vector becomes longer by more than this factor; exact where the axes stay perpendicular.
fn largest_stretch(linear: &DMat3) -> f64 {
    // The largest row sum bounds the largest eigenvalue of the matrix's square.
    let square = linear.transpose() * *linear;
    let rows = [0, 1, 2].map(|row| square.row(row).abs().element_sum());
    rows.into_iter().fold(0.0, f64::max).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_is_exact_for_perpendicular_axes_and_a_bound_for_others() {
        let turned = DMat3::from_rotation_y(0.7) * DMat3::from_diagonal(DVec3::new(0.5, -3.0, 1.0));
        assert!((largest_stretch(&turned) - 3.0).abs() < 1e-12);
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(2.0, 1.0, 0.0), DVec3::Z);
        let exact = 1.0 + 2.0_f64.sqrt();
        assert!(largest_stretch(&sheared) >= exact && largest_stretch(&sheared) < 1.2 * exact);
        assert!(!is_similar(&turned) && !is_similar(&sheared));
        let whole = DMat3::from_rotation_y(0.7) * -0.01;
        assert!(is_similar(&whole) && is_similar(&DMat3::ZERO));
    }
}
