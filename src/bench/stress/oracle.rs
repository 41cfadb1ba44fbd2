//! What a scene must show, in f64 and by brute force: every triangle asked for every ray, no acceleration structure, no epsilon that grows
//! with the scene, radiance written down in closed form.
//!
//! It knows matt surfaces under one point light, perfect mirrors, clear bodies that only refract, and surfaces that emit their colour; of such
//! scenes the two backends draw nothing at random but the place on pixel and lens, which the oracle takes from the same sampler, so that the
//! two agree sample by sample.

use std::f64::consts::{FRAC_PI_4, PI};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::camera::sampler::{SampleKey, sample_4d};
use crate::scene::{LightKind, SamplerKind, Scene, Side};

/// Where virtual and real geometry coincide, virtual geometry is nearer: within this relative distance (the scene file's meaning).
const COINCIDENCE: f64 = 1e-5;
/// A ray does not meet what it left: nearer than this, relative to the way that led there, nothing counts.
const NEAR: f64 = 1e-9;

enum Look {
    Lambert(DVec3),
    Mirror(DVec3),
    Unlit(DVec3),
    /// Index of refraction.
    Clear(f64),
}

struct Facet {
    corner: DVec3,
    edges: [DVec3; 2],
    /// Unit, by the winding.
    normal: DVec3,
    is_virtual: bool,
    look: usize,
}

/// Which triangles a ray sees.
#[derive(Clone, Copy, PartialEq)]
enum Worlds {
    Mixed,
    Real,
}

/// A scene's triangles in world space.
struct World {
    facets: Vec<Facet>,
    looks: Vec<Look>,
    /// Position and intensity.
    light: Option<(DVec3, DVec3)>,
    max_bounces: u32,
}

/// What every pixel must show.
pub(super) struct Expected {
    pub linear: Vec<DVec3>,
    pub mask: Vec<f64>,
}

/// Renders a scene without a photograph.
pub(super) fn expected(scene: &Scene) -> Expected {
    let world = World::of(scene);
    let pixels = scene.camera.width * scene.camera.height;
    let (linear, mask) = (0..pixels)
        .into_par_iter()
        .map(|pixel| world.pixel(scene, pixel))
        .unzip();
    Expected { linear, mask }
}

impl World {
    fn of(scene: &Scene) -> Self {
        let mut world = Self {
            facets: Vec::new(),
            looks: Vec::new(),
            light: scene.lights.iter().find_map(|light| match light.kind {
                LightKind::Point {
                    position,
                    intensity,
                } => Some((DVec3::from(position), Vec3::from(intensity).as_dvec3())),
                _ => None,
            }),
            max_bounces: scene.settings.max_bounces,
        };
        for object in &scene.objects {
            for instance in &object.instances {
                let m = &instance.material;
                let base = Vec3::from_slice(&m.base_color[..3]).as_dvec3();
                world.looks.push(if m.unlit {
                    Look::Unlit(base)
                } else if m.metallic == 1.0 {
                    Look::Mirror(base)
                } else if m.transmission == 1.0 {
                    Look::Clear(f64::from(m.ior))
                } else {
                    Look::Lambert(base)
                });
                let to_world = object.world_from_object * instance.object_from_local;
                let primitive = &instance.primitive;
                for triangle in &primitive.triangles {
                    let [a, b, c] = triangle.map(|i| {
                        let local = Vec3::from(primitive.positions[i as usize]);
                        to_world.transform_point3(local.as_dvec3())
                    });
                    world.facets.push(Facet {
                        corner: a,
                        edges: [b - a, c - a],
                        normal: (b - a).cross(c - a).normalize_or_zero(),
                        is_virtual: object.side == Side::Virtual,
                        look: world.looks.len() - 1,
                    });
                }
            }
        }
        world
    }

    /// Eq. 4 over a black photograph, and the mask.
    fn pixel(&self, scene: &Scene, pixel: u32) -> (DVec3, f64) {
        let count = scene.settings.rays_per_pixel;
        let (mut mixed, mut real, mut mask) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for index in 0..count {
            let (origin, direction) = camera_ray(scene, pixel, index);
            if let Some((_, facet)) = self.nearest(origin, direction, 0.0, None, Worlds::Mixed)
                && self.facets[facet].is_virtual
            {
                mask += 1.0;
            }
            mixed += self.radiance(origin, direction, 0.0, None, Worlds::Mixed, 1);
            real += self.radiance(origin, direction, 0.0, None, Worlds::Real, 1);
        }
        let count = f64::from(count);
        let (mixed, real, mask) = (mixed / count, real / count, mask / count);
        (mixed * mask + (mixed - real) * (1.0 - mask), mask)
    }

    fn radiance(
        &self,
        origin: DVec3,
        direction: DVec3,
        t_min: f64,
        left: Option<usize>,
        worlds: Worlds,
        depth: u32,
    ) -> DVec3 {
        let Some((t, index)) = self.nearest(origin, direction, t_min, left, worlds) else {
            return DVec3::ZERO;
        };
        let facet = &self.facets[index];
        let look = &self.looks[facet.look];
        if let Look::Unlit(color) = look {
            return *color;
        }
        if depth > self.max_bounces {
            return DVec3::ZERO;
        }
        let position = origin + direction * t;
        let front = facet.normal.dot(direction) < 0.0;
        let normal = if front { facet.normal } else { -facet.normal };
        let cos = -normal.dot(direction);
        let mirrored = direction + normal * (2.0 * cos);
        let onward = |direction: DVec3| {
            self.radiance(
                position,
                direction,
                NEAR * t,
                Some(index),
                worlds,
                depth + 1,
            )
        };
        match look {
            Look::Unlit(color) => *color,
            Look::Lambert(albedo) => {
                *albedo * self.irradiance(position, normal, index, worlds) / PI
            }
            Look::Mirror(f0) => {
                // Schlick, as glTF has it.
                let schlick = *f0 + (DVec3::ONE - *f0) * (1.0 - cos).powi(5);
                schlick * onward(mirrored)
            }
            Look::Clear(index_of_refraction) => {
                let eta = if front {
                    1.0 / index_of_refraction
                } else {
                    *index_of_refraction
                };
                let cos2 = 1.0 - eta * eta * (1.0 - cos * cos);
                onward(if cos2 < 0.0 {
                    mirrored
                } else {
                    direction * eta + normal * (eta * cos - cos2.sqrt())
                })
            }
        }
    }

    /// From the point light.
    fn irradiance(&self, position: DVec3, normal: DVec3, left: usize, worlds: Worlds) -> DVec3 {
        let Some((light, intensity)) = self.light else {
            return DVec3::ZERO;
        };
        let way = light - position;
        let distance = way.length();
        let direction = way / distance;
        let cos = normal.dot(direction);
        if cos <= 0.0 {
            return DVec3::ZERO;
        }
        let blocked = self.facets.iter().enumerate().any(|(i, facet)| {
            i != left
                && (worlds == Worlds::Mixed || !facet.is_virtual)
                && facet
                    .distance(position, direction)
                    .is_some_and(|t| t > NEAR * distance && t < distance * (1.0 - NEAR))
        });
        if blocked {
            DVec3::ZERO
        } else {
            intensity * (cos / (distance * distance))
        }
    }

    fn nearest(
        &self,
        origin: DVec3,
        direction: DVec3,
        t_min: f64,
        left: Option<usize>,
        worlds: Worlds,
    ) -> Option<(f64, usize)> {
        // By world: real, virtual.
        let mut best = [None::<(f64, usize)>; 2];
        for (i, facet) in self.facets.iter().enumerate() {
            if left == Some(i) || (worlds == Worlds::Real && facet.is_virtual) {
                continue;
            }
            let best = &mut best[usize::from(facet.is_virtual)];
            if let Some(t) = facet.distance(origin, direction)
                && t > t_min
                && best.is_none_or(|(nearest, _)| t < nearest)
            {
                *best = Some((t, i));
            }
        }
        match best {
            [Some(real), Some(added)] if added.0 > real.0 * (1.0 + COINCIDENCE) => Some(real),
            [real, added] => added.or(real),
        }
    }
}

impl Facet {
    /// Möller and Trumbore's test.
    fn distance(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let [e1, e2] = self.edges;
        let across = direction.cross(e2);
        let determinant = e1.dot(across);
        if determinant == 0.0 {
            return None;
        }
        let from_corner = origin - self.corner;
        let u = from_corner.dot(across) / determinant;
        let around = from_corner.cross(e1);
        let v = direction.dot(around) / determinant;
        let t = e2.dot(around) / determinant;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
    }
}

/// The thin lens with a disc for aperture, by the same random numbers as the backends.
fn camera_ray(scene: &Scene, pixel: u32, index: u32) -> (DVec3, DVec3) {
    let (camera, lens) = (&scene.camera, &scene.lens);
    let key = SampleKey {
        pixel,
        index,
        total: scene.settings.rays_per_pixel,
        seed: scene.settings.seed,
        sampler: match scene.settings.sampler {
            SamplerKind::Jittered => 0,
            SamplerKind::Cmj => 1,
            SamplerKind::Sobol => 2,
        },
    };
    let u = sample_4d(key, 0).map(f64::from);
    let x = (f64::from(pixel % camera.width) + u[0] - camera.cx) / camera.fx;
    let y = (f64::from(pixel / camera.width) + u[1] - camera.cy) / camera.fy;
    let [right, up, back, position] = [
        camera.world_from_camera.x_axis,
        camera.world_from_camera.y_axis,
        camera.world_from_camera.z_axis,
        camera.world_from_camera.w_axis,
    ]
    .map(|column| column.truncate());
    let at_depth_1 = right * x - up * y - back;
    // Shirley and Chiu's concentric map.
    let (a, b) = (2.0 * u[2] - 1.0, 2.0 * u[3] - 1.0);
    let (radius, angle) = if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else {
        (b, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (a / b))
    };
    let on_lens = (right * angle.cos() + up * angle.sin()) * (radius * lens.aperture_radius_m);
    let direction = at_depth_1 - on_lens / lens.focus_distance_m;
    (position + on_lens, direction.normalize())
}
