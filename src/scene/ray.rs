//! Single rays against the triangles of objects, in f64: for placing, picking and checking, which ask for a few. Rendering has `accel`.

use glam::{DVec2, DVec3};

use super::projection::undistort;
use super::{Camera, Instance, Object};

/// A half-line in world space; the direction has unit length.
#[derive(Clone, Copy, Debug)]
pub struct HalfLine {
    pub origin: DVec3,
    pub direction: DVec3,
}

/// Where a half-line first meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    pub distance_m: f64,
    /// World space.
    pub point: DVec3,
    /// Of the triangle, unit, to the side that the ray comes from.
    pub normal: DVec3,
    /// The triangle shows its back.
    pub is_back: bool,
    /// Places in the list of objects and in its object's list of instances.
    pub object: usize,
    pub instance: usize,
}

/// The ray through the middle of the lens; `pixel` has its origin in the photograph's upper left corner. `None` where the distortion has no ray.
pub fn pixel_ray(camera: &Camera, pixel: DVec2) -> Option<HalfLine> {
    let [x, y] = undistort(camera, pixel.x, pixel.y).ok()?;
    let direction = (camera.world_from_camera).transform_vector3(DVec3::new(x, -y, -1.0));
    Some(HalfLine {
        origin: camera.world_from_camera.w_axis.truncate(),
        direction: direction.normalize(),
    })
}

/// The nearest of the objects that `wanted` takes.
pub fn nearest(
    objects: &[Object],
    ray: &HalfLine,
    wanted: impl Fn(&Object) -> bool,
) -> Option<RayHit> {
    let objects = objects.iter().enumerate();
    let wanted = objects.filter(|(_, object)| wanted(object));
    let hits = wanted.flat_map(|(index, object)| {
        let instances = object.instances.iter().enumerate();
        instances.filter_map(move |(part, instance)| {
            let (distance_m, normal) = nearest_of(object, instance, ray)?;
            let is_back = normal.dot(ray.direction) > 0.0;
            Some(RayHit {
                distance_m,
                point: ray.origin + ray.direction * distance_m,
                normal: if is_back { -normal } else { normal },
                is_back,
                object: index,
                instance: part,
            })
        })
    });
    hits.min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
}

/// Distance and normal of the nearest triangle of an instance.
fn nearest_of(object: &Object, instance: &Instance, ray: &HalfLine) -> Option<(f64, DVec3)> {
    let world_from_local = object.world_from_object * instance.object_from_local;
    let local_from_world = world_from_local.inverse();
    let origin = local_from_world.transform_point3(ray.origin);
    // Not normalised: distances stay those of world space.
    let direction = local_from_world.transform_vector3(ray.direction);
    let positions = &instance.primitive.positions;
    let mut nearest: Option<(f64, DVec3)> = None;
    for triangle in &instance.primitive.triangles {
        let [a, b, c] = triangle.map(|v| DVec3::from(positions[v as usize].map(f64::from)));
        if let Some(distance) = meet(origin, direction, [a, b, c])
            && nearest.is_none_or(|(least, _)| distance < least)
        {
            nearest = Some((distance, (b - a).cross(c - a)));
        }
    }
    let (distance, normal) = nearest?;
    let normal = local_from_world.transpose().transform_vector3(normal);
    Some((distance, normal.try_normalize()?))
}

/// Moeller and Trumbore 1997, both sides, rims included.
fn meet(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (edge_u, edge_v) = (b - a, c - a);
    let across = direction.cross(edge_v);
    let determinant = edge_u.dot(across);
    let from_a = origin - a;
    let u = from_a.dot(across) / determinant;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let along = from_a.cross(edge_u);
    let v = direction.dot(along) / determinant;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let distance = edge_v.dot(along) / determinant;
    (distance > 0.0 && distance.is_finite()).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [DVec3; 3] = [
        DVec3::ZERO,
        DVec3::new(2.0, 0.0, 0.0),
        DVec3::new(0.0, 2.0, 0.0),
    ];

    #[test]
    fn a_ray_meets_what_lies_before_it_alone() {
        let at = |x, y| meet(DVec3::new(x, y, 3.0), DVec3::NEG_Z, TRIANGLE);
        assert_eq!(at(0.5, 0.5), Some(3.0));
        assert_eq!(at(0.0, 0.0), Some(3.0), "a corner");
        for (x, y) in [(1.5, 1.5), (-0.1, 0.5), (0.5, -0.1)] {
            assert_eq!(at(x, y), None, "{x} {y}");
        }
        assert_eq!(meet(DVec3::new(0.5, 0.5, 3.0), DVec3::Z, TRIANGLE), None);
        assert_eq!(
            meet(DVec3::new(0.5, 0.5, 3.0), DVec3::X, TRIANGLE),
            None,
            "along"
        );
        let twice = meet(DVec3::new(0.5, 0.5, 3.0), DVec3::NEG_Z * 2.0, TRIANGLE);
        assert_eq!(twice, Some(1.5), "in lengths of the direction");
    }
}
