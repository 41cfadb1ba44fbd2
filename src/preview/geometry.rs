//! What stands where: picks under the pointer, and how an object comes to rest on the real surface.

use glam::{DMat4, DVec2, DVec3, Vec3};

use super::composition::{Composition, Placement, rounded_m};
use crate::accel::{AccelError, Ray, WorldBvh};
use crate::scene::{Camera, Instance, Object, Scene, Side, projection};
use crate::shared::NONE;

/// Surfaces steeper than this carry nothing: the cosine of 66 degrees.
const LEAST_UPRIGHT: f64 = 0.4;

/// Trees and vertices of a scene, apart from those that the renderer uses. Real objects stay where the file has them.
pub struct Geometry {
    real: Mesh,
    /// Of each object of the scene, in its own space; real ones are empty here.
    objects: Vec<Mesh>,
    /// Edges of the proxy at which it turns or ends, world space.
    pub proxy_edges: Vec<[DVec3; 2]>,
}

/// Triangles relative to their middle, which keeps f32 exact enough.
struct Mesh {
    middle: DVec3,
    triangles: Vec<[Vec3; 3]>,
    tree: WorldBvh,
}

/// Where a ray of the camera meets something.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// `None`: the real world.
    pub object: Option<usize>,
    /// World space.
    pub point: DVec3,
    /// Unit, towards the camera.
    pub normal: DVec3,
    /// Along the view axis, metres.
    pub depth_m: f64,
}

/// A half-line in world space; the direction has unit length.
#[derive(Clone, Copy, Debug)]
pub struct HalfLine {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl Mesh {
    fn new(triangles: Vec<[DVec3; 3]>) -> Result<Self, AccelError> {
        let corners = || triangles.iter().flatten();
        let lo = corners().fold(DVec3::INFINITY, |a, p| a.min(*p));
        let hi = corners().fold(DVec3::NEG_INFINITY, |a, p| a.max(*p));
        let middle = match triangles.is_empty() {
            true => DVec3::ZERO,
            false => (lo + hi) * 0.5,
        };
        let triangles: Vec<[Vec3; 3]> = (triangles.iter())
            .map(|corners| corners.map(|corner| (corner - middle).as_vec3()))
            .collect();
        Ok(Self {
            middle,
            tree: WorldBvh::build(&triangles, 0)?,
            triangles,
        })
    }

    /// Distance in multiples of the direction, and the triangle's normal.
    fn closest(&self, origin: DVec3, direction: DVec3) -> Option<(f64, DVec3)> {
        let ray = Ray {
            origin: (origin - self.middle).as_vec3(),
            direction: direction.as_vec3(),
            t_min: 0.0,
            t_max: f32::INFINITY,
            skip: NONE,
        };
        let hit = self.tree.closest(&ray);
        let [a, b, c] = self
            .triangles
            .get(hit.triangle as usize)?
            .map(Vec3::as_dvec3);
        let normal = (b - a).cross(c - a).try_normalize()?;
        // In f64: the f32 distance of a far hit is coarser than a millimetre.
        let local = origin - self.middle;
        let along = direction.dot(normal);
        let distance = match along.abs() > 1e-12 {
            true => (a - local).dot(normal) / along,
            false => f64::from(hit.t),
        };
        Some((distance, normal))
    }
}

impl Geometry {
    /// # Errors
    /// More triangles than a tree takes.
    pub fn build(scene: &Scene) -> Result<Self, AccelError> {
        let of_side = |side| {
            scene
                .objects
                .iter()
                .filter(move |object| object.side == side)
        };
        let real = of_side(Side::Real)
            .flat_map(|object| triangles(object, object.world_from_object))
            .collect();
        let objects = scene.objects.iter().map(|object| match object.side {
            Side::Real => Mesh::new(Vec::new()),
            Side::Virtual => Mesh::new(triangles(object, DMat4::IDENTITY).collect()),
        });
        Ok(Self {
            real: Mesh::new(real)?,
            objects: objects.collect::<Result<_, _>>()?,
            proxy_edges: of_side(Side::Real)
                .flat_map(|object| {
                    let parts = object.instances.iter();
                    parts.flat_map(|part| edges(part, object.world_from_object))
                })
                .collect(),
        })
    }

    /// The nearest thing under a position of the photograph, pixels, corner origin.
    pub fn pick(&self, camera: &Camera, composition: &Composition, pixel: DVec2) -> Option<Pick> {
        let ray = camera_ray(camera, composition, pixel)?;
        let real = self.pick_real(camera, composition, pixel);
        let mut nearest = real;
        let world_from_camera = composition.camera.world_from_camera();
        for (index, mesh) in self.objects.iter().enumerate() {
            let world_from_object = composition.world_from_object(index);
            let inverse = world_from_object.inverse();
            let hit = mesh.closest(
                inverse.transform_point3(ray.origin),
                inverse.transform_vector3(ray.direction),
            );
            if let Some((distance, normal)) = hit {
                let normal = inverse.transpose().transform_vector3(normal).normalize();
                let pick = of_hit(&ray, world_from_camera, Some(index), distance, normal);
                if nearest.is_none_or(|nearest| pick.depth_m < nearest.depth_m) {
                    nearest = Some(pick);
                }
            }
        }
        nearest
    }

    /// The real surface there, whatever virtual stands before it.
    pub fn pick_real(
        &self,
        camera: &Camera,
        composition: &Composition,
        pixel: DVec2,
    ) -> Option<Pick> {
        let ray = camera_ray(camera, composition, pixel)?;
        let (distance, normal) = self.real.closest(ray.origin, ray.direction)?;
        let world_from_camera = composition.camera.world_from_camera();
        Some(of_hit(&ray, world_from_camera, None, distance, normal))
    }

    /// The lowest point of an object, world space; `None` if it has no triangles.
    pub fn lowest_point(&self, object: usize, placement: &Placement) -> Option<DVec3> {
        let mesh = &self.objects[object];
        let world_from_object = placement.world_from_object();
        (mesh.triangles.iter().flatten())
            .map(|corner| world_from_object.transform_point3(mesh.middle + corner.as_dvec3()))
            .min_by(|a, b| a.y.total_cmp(&b.y))
    }

    /// The box around an object, in its own space.
    pub fn bounds(&self, object: usize) -> Option<(DVec3, DVec3)> {
        let mesh = &self.objects[object];
        let (lo, hi) = mesh.tree.bounds()?;
        Some((mesh.middle + lo.as_dvec3(), mesh.middle + hi.as_dvec3()))
    }

    /// The height of the real surface under a point that lies above it, or at most `above_m` below.
    pub fn height_under(&self, point: DVec3, above_m: f64) -> Option<f64> {
        let origin = point + DVec3::Y * above_m;
        let (distance, _) = self.real.closest(origin, DVec3::NEG_Y)?;
        Some(origin.y - distance)
    }

    /// An object set down so that its lowest point touches the real surface under `pixel`; `None` if nothing there carries it.
    pub fn rest_at(
        &self,
        camera: &Camera,
        composition: &Composition,
        object: usize,
        pixel: DVec2,
    ) -> Option<Placement> {
        let surface = self.pick_real(camera, composition, pixel)?;
        if surface.normal.y < LEAST_UPRIGHT {
            return None;
        }
        let placement = composition.placement(object);
        let lowest = self.lowest_point(object, &placement)?;
        let moved = placement.translation + (surface.point - lowest);
        Some(Placement {
            translation: rounded_m(moved),
            ..placement
        })
    }

    /// How far an object's lowest point is above the real surface under it, metres; negative: below.
    pub fn gap_m(&self, composition: &Composition, object: usize) -> Option<f64> {
        let placement = composition.placement(object);
        let lowest = self.lowest_point(object, &placement)?;
        let (lo, hi) = self.bounds(object)?;
        let size = placement.scale.abs().max_element() * (hi - lo).length();
        Some(lowest.y - self.height_under(lowest, 0.5 * size)?)
    }
}

fn of_hit(
    ray: &HalfLine,
    world_from_camera: DMat4,
    object: Option<usize>,
    distance: f64,
    normal: DVec3,
) -> Pick {
    let point = ray.origin + ray.direction * distance;
    let towards = match normal.dot(ray.direction) > 0.0 {
        true => -normal,
        false => normal,
    };
    Pick {
        object,
        point,
        normal: towards,
        depth_m: -world_from_camera.inverse().transform_point3(point).z,
    }
}

/// The ray through the middle of the lens; `None` where the distortion has none.
pub fn camera_ray(camera: &Camera, composition: &Composition, pixel: DVec2) -> Option<HalfLine> {
    let [x, y] = projection::undistort(camera, pixel.x, pixel.y).ok()?;
    let world_from_camera = composition.camera.world_from_camera();
    let direction = world_from_camera.transform_vector3(DVec3::new(x, -y, -1.0));
    Some(HalfLine {
        origin: world_from_camera.w_axis.truncate(),
        direction: direction.normalize(),
    })
}

/// Where the camera shows a point, pixels.
pub fn seen_at(camera: &Camera, composition: &Composition, point: DVec3) -> Option<DVec2> {
    let posed = Camera {
        world_from_camera: composition.camera.world_from_camera(),
        ..camera.clone()
    };
    projection::project(&posed, point).map(DVec3::truncate)
}

fn triangles(object: &Object, world_from_object: DMat4) -> impl Iterator<Item = [DVec3; 3]> {
    object.instances.iter().flat_map(move |part| {
        let transform = world_from_object * part.object_from_local;
        part.primitive.triangles.iter().map(move |corners| {
            corners.map(|corner| {
                let position = part.primitive.positions[corner as usize];
                transform.transform_point3(DVec3::from(position.map(f64::from)))
            })
        })
    })
}

/// Edges of one triangle alone, or between two that meet at more than 20 degrees.
fn edges(part: &Instance, world_from_object: DMat4) -> Vec<[DVec3; 2]> {
    let transform = world_from_object * part.object_from_local;
    let positions = &part.primitive.positions;
    let mut sides = std::collections::BTreeMap::<[[u32; 3]; 2], Vec<DVec3>>::new();
    for corners in &part.primitive.triangles {
        let points = corners.map(|corner| positions[corner as usize]);
        let [a, b, c] = points.map(|p| DVec3::from(p.map(f64::from)));
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for side in 0..3 {
            // Vertices that differ in their normals alone are one.
            let mut ends = [points[side], points[(side + 1) % 3]].map(|p| p.map(f32::to_bits));
            ends.sort_unstable();
            sides.entry(ends).or_default().push(normal);
        }
    }
    let turns = |normals: &[DVec3]| match normals {
        [a, b] => a.dot(*b) < 0.94,
        _ => true,
    };
    (sides.iter().filter(|(_, normals)| turns(normals)))
        .map(|(ends, _)| {
            ends.map(|end| {
                let position = end.map(|bits| f64::from(f32::from_bits(bits)));
                transform.transform_point3(DVec3::from(position))
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::preview::document::Document;
    use crate::scene::load_text;

    const TEXT: &str = "\
[camera]
width = 64
height = 48
vertical_fov_deg = 40
position = [0, 1, 3]
look_at = [0, 0, 0]

[[real]]
shape = \"quad\"
corner = [-1, 0, 1]
edge_u = [2, 0, 0]
edge_v = [0, 0, -2]

[[virtual]]
shape = \"sphere\"
scale = 0.1
translation = [0.3, 0.25, 0]
";

    #[test]
    fn an_object_comes_to_rest_by_its_lowest_point() {
        let scene = load_text(Path::new("scene.toml"), TEXT).unwrap();
        let mut composition = Document::parse(TEXT).unwrap().composition(&scene);
        let geometry = Geometry::build(&scene).unwrap();
        let gap = geometry.gap_m(&composition, 1).unwrap();
        assert!((gap - 0.15).abs() < 1e-4, "control: it floats by {gap}");

        let pixel = DVec2::new(40.0, 30.0);
        let rested = geometry
            .rest_at(&scene.camera, &composition, 1, pixel)
            .unwrap();
        composition.objects[1] = rested;
        let gap = geometry.gap_m(&composition, 1).unwrap();
        assert!(gap.abs() < 1e-4, "{gap}");
        let lowest = geometry.lowest_point(1, &rested).unwrap();
        let seen = seen_at(&scene.camera, &composition, lowest).unwrap();
        assert!((seen - pixel).length() < 0.05, "{seen}");
        let sky = DVec2::new(32.0, 0.5);
        assert_eq!(geometry.rest_at(&scene.camera, &composition, 1, sky), None);
    }

    #[test]
    fn the_nearest_thing_is_picked_at_its_depth() {
        let scene = load_text(Path::new("scene.toml"), TEXT).unwrap();
        let composition = Document::parse(TEXT).unwrap().composition(&scene);
        let geometry = Geometry::build(&scene).unwrap();
        let pick = |x: f64, y: f64| geometry.pick(&scene.camera, &composition, DVec2::new(x, y));
        let ground = pick(32.0, 24.0).unwrap();
        assert_eq!(ground.object, None);
        assert!((ground.depth_m - 10_f64.sqrt()).abs() < 1e-4, "{ground:?}");
        assert!(ground.normal.y > 0.999);
        let at = seen_at(&scene.camera, &composition, DVec3::new(0.3, 0.25, 0.0)).unwrap();
        let ball = pick(at.x, at.y).unwrap();
        assert_eq!(ball.object, Some(1));
        // Nearer than its centre by its radius, but for the angle at which it is seen.
        let surface_m = 9.75 / 10_f64.sqrt() - 0.1;
        assert!((ball.depth_m - surface_m).abs() < 5e-3, "{ball:?}");
        assert_eq!(pick(32.0, 0.5), None, "the sky");
    }

    #[test]
    fn the_proxy_has_edges_where_it_turns() {
        let scene = load_text(Path::new("scene.toml"), TEXT).unwrap();
        let geometry = Geometry::build(&scene).unwrap();
        assert_eq!(geometry.proxy_edges.len(), 4, "a quad without its diagonal");
    }
}
