//! The spheres about the virtual world: as few as serve all of it, or in a draft those of each object, which go with it where it is moved.

use glam::{DMat3, DMat4, DVec3, Vec3};

use crate::accel::{Cover, Mesh};
use crate::packed::{MAX_PHOTON_SPHERES, MAX_SPHERES, NONE, ObjectCover, PackedScene};
use crate::scene::{Object, Scene, Side};

impl PackedScene {
    /// Covers the virtual triangles that rest, from the global id `first` on.
    pub(super) fn cover_resting(&mut self, scene: &Scene, first: usize) {
        if let Some(mut covers) = self.object_covers.take() {
            let fits = self.cover_objects(scene, first, &mut covers);
            self.object_covers = Some(covers);
            if fits {
                return;
            }
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
        let resting: Vec<(usize, &Object)> = (scene.objects.iter().enumerate())
            .filter(|(_, object)| object.side == Side::Virtual && resting_triangles(object) > 0)
            .collect();
        // Lamps, and what moves, have one more each.
        if resting.len() + 2 > MAX_SPHERES {
            return false;
        }
        let (mut whole, mut smooth) = (Vec::new(), Vec::new());
        for (index, object) in resting {
            let cover = self.cover_of(covers, index, object);
            let world_from_object = object.world_from_object;
            whole.push(self.placed(&cover.whole, world_from_object));
            if !cover.smooth.is_empty() {
                smooth.push(self.placed(&cover.smooth, world_from_object));
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

    fn placed(&self, cover: &Cover, world_from_object: DMat4) -> Cover {
        let linear = DMat3::from_mat4(world_from_object);
        let to =
            |center: DVec3| world_from_object.transform_point3(center) - DVec3::from(self.anchor_m);
        cover.placed(to, largest_stretch(&linear))
    }

    /// In the object's own space; found once.
    fn cover_of<'a>(
        &self,
        covers: &'a mut Vec<ObjectCover>,
        index: usize,
        object: &Object,
    ) -> &'a ObjectCover {
        let triangles = resting_triangles(object);
        let known = (covers.iter()).position(|c| (c.object, c.triangles) == (index, triangles));
        let at = known.unwrap_or_else(|| {
            let mesh = |smooth: bool| {
                let parts = object.instances.iter().filter(|part| {
                    !object.moves(part) && (!smooth || self.is_smooth_part(object, part))
                });
                let mut mesh = Mesh::default();
                for part in parts {
                    let first = mesh.points.len() as u32;
                    mesh.points.extend(part.primitive.positions.iter().map(|p| {
                        let position = Vec3::from(*p).as_dvec3();
                        part.object_from_local.transform_point3(position).as_vec3()
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
            covers.push(ObjectCover {
                object: index,
                triangles,
                whole,
                smooth,
            });
            covers.len() - 1
        });
        &covers[at]
    }
}

fn resting_triangles(object: &Object) -> usize {
    let parts = object.instances.iter().filter(|part| !object.moves(part));
    parts.map(|part| part.primitive.triangles.len()).sum()
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
    }
}
