//! What geometry alone tells of how far virtual objects reach, from one ray and no sample.

use glam::Vec3;

use super::beam::Beam;
use crate::accel::Ray;
use crate::light::cones::{cone_solid_angle_fraction, cones_at, direction_meets_spheres};
use crate::light::environment::env_sample;
use crate::math::{hash_combine, hash_u32, luminance, uniform_from_bits};
use crate::packed::{
    Frame, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT,
    LIGHT_TRIANGLE, Light, NONE, PackedScene, SIDE_REAL, SIDE_VIRTUAL,
};

/// Importance per share of the sky (cosine-weighted) covered by virtual geometry.
const REACH_GAIN: f32 = 4.0;
/// Importance of a point whose light from a lamp something virtual may block, and per share of the environment's light that may be blocked.
const LAMP_IMPORTANCE: f32 = 0.5;
const ENVIRONMENT_GAIN: f32 = 2.0;
/// Environment directions tried for blocked light.
const ENVIRONMENT_TRIALS: u32 = 16;
/// Lights examined; scenes with more get certainty instead of an estimate.
pub(crate) const MAX_LIGHTS_EXAMINED: usize = 32;

/// The lights that decide how much of the real world's light something virtual may change.
pub struct PilotLights<'a> {
    /// Real lights, whose shadows may fall far from what casts them.
    examined: Vec<&'a Light>,
    /// Too many to examine, or virtual ones that shine everywhere.
    uncertain: bool,
    /// [`REACH_GAIN`], larger where virtual surfaces emit.
    reach_gain: f32,
    /// Directions drawn from the environment by its brightness.
    directions: Vec<Vec3>,
}

impl<'a> PilotLights<'a> {
    pub fn of(scene: &'a PackedScene) -> Self {
        let is_area = |l: &Light| l.kind == LIGHT_QUAD || l.kind == LIGHT_TRIANGLE;
        let examined: Vec<&Light> = scene
            .lights
            .iter()
            .filter(|l| l.side == SIDE_REAL && l.kind != LIGHT_ENVIRONMENT)
            .collect();
        let emission = scene
            .lights
            .iter()
            .filter(|l| l.side == SIDE_VIRTUAL && is_area(l))
            .map(|l| luminance(Vec3::new(l.radiance[0], l.radiance[1], l.radiance[2])))
            .fold(0.0, f32::max);
        Self {
            uncertain: examined.len() > MAX_LIGHTS_EXAMINED
                || scene
                    .lights
                    .iter()
                    .any(|l| l.side == SIDE_VIRTUAL && !is_area(l)),
            examined,
            reach_gain: REACH_GAIN * (1.0 + emission * scene.frame.exposure_scale),
            directions: environment_directions(scene),
        }
    }
}

/// A fixed handful of directions drawn from the environment by its brightness.
fn environment_directions(scene: &PackedScene) -> Vec<Vec3> {
    if scene.frame.env_light == NONE {
        return Vec::new();
    }
    (0..ENVIRONMENT_TRIALS)
        .map(|i| {
            let u = |d: u32| uniform_from_bits(hash_u32(hash_combine(i, d)));
            env_sample(scene, (i as f32 + u(0)) / ENVIRONMENT_TRIALS as f32, u(1)).direction
        })
        .collect()
}

/// How much of the light at the first real surface that the beam's central ray meets something virtual may change: 0 nothing, 1 (or more) all.
pub fn importance(scene: &PackedScene, beam: &Beam, lights: &PilotLights<'_>) -> f32 {
    let ray = Ray {
        origin: beam.origin,
        direction: beam.direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    };
    let hit = scene.real_bvh.closest(&ray);
    if hit.triangle == NONE {
        return 0.0;
    }
    if lights.uncertain {
        return 1.0;
    }
    let position = beam.origin + beam.direction * hit.t;
    let corners = scene.triangles[hit.triangle as usize].vertices.map(|v| {
        let p = scene.vertices[v as usize].position_u0;
        Vec3::new(p[0], p[1], p[2])
    });
    let normal = (corners[1] - corners[0])
        .cross(corners[2] - corners[0])
        .normalize_or_zero();
    let normal = if normal.dot(beam.direction) > 0.0 {
        -normal
    } else {
        normal
    };
    let mut importance =
        lights.reach_gain * cone_solid_angle_fraction(&cones_at(&scene.frame, position, normal));
    if lights
        .examined
        .iter()
        .any(|l| light_may_be_blocked(&scene.frame, l, position))
    {
        importance = importance.max(LAMP_IMPORTANCE);
    }
    let blocked = lights
        .directions
        .iter()
        .filter(|&&d| d.dot(normal) > 0.0 && direction_meets_spheres(&scene.frame, position, d))
        .count();
    importance + ENVIRONMENT_GAIN * blocked as f32 / ENVIRONMENT_TRIALS as f32
}

/// Whether something virtual may stand between the point and a light other than the environment.
fn light_may_be_blocked(frame: &Frame, light: &Light, position: Vec3) -> bool {
    let v = |a: [f32; 4]| Vec3::new(a[0], a[1], a[2]);
    let (centre, radius) = match light.kind {
        LIGHT_DIRECTIONAL => return direction_meets_spheres(frame, position, -v(light.axis_u)),
        LIGHT_POINT | LIGHT_SPOT => (v(light.position), 0.0),
        _ => (
            v(light.position) + 0.5 * (v(light.axis_u) + v(light.axis_v)),
            0.5 * (v(light.axis_u).length() + v(light.axis_v).length()),
        ),
    };
    let to_light = centre - position;
    let light_distance = to_light.length();
    let light_angle = (radius / light_distance.max(1e-20)).min(1.0).asin();
    frame.spheres[..frame.sphere_count as usize]
        .iter()
        .any(|s| {
            let to_sphere = Vec3::new(s[0], s[1], s[2]) - position;
            let distance = to_sphere.length();
            if distance <= s[3] {
                return true;
            }
            if distance - s[3] > light_distance + radius {
                return false;
            }
            let between = (to_sphere.dot(to_light) / (distance * light_distance.max(1e-20)))
                .clamp(-1.0, 1.0)
                .acos();
            between <= light_angle + (s[3] / distance).asin()
        })
}
