//! One look at every pixel before the first sample: which beams can meet virtual geometry, which pixels nothing virtual can reach, and with
//! what share of the samples is worth the evaluation of its difference.
//!
//! The shares steer work, not the result: a sample that is evaluated counts for those that are not. The two flags are proven.

use glam::Vec3;
use rayon::prelude::*;

use crate::accel::Ray;
use crate::camera::lens::camera_ray;
use crate::light::cones::{cone_solid_angle_fraction, direction_meets_spheres};
use crate::light::environment::env_sample;
use crate::math::{hash_combine, hash_u32, luminance, uniform_from_bits};
use crate::packed::{
    Frame, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT,
    LIGHT_TRIANGLE, Light, NONE, PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PackedScene,
    PixelInfo,
};

/// Share of the sky (cosine-weighted) covered by virtual geometry from which on every sample is evaluated.
const REACH_GAIN: f32 = 4.0;
/// Far from everything one sample in this many is evaluated.
const LONGEST_PERIOD: f32 = 16.0;
/// Importance of a point whose light from a lamp something virtual may block, and per share of the environment's light that may be blocked.
const LAMP_IMPORTANCE: f32 = 0.5;
const ENVIRONMENT_GAIN: f32 = 2.0;
/// Environment directions tried per pixel for blocked light.
const ENVIRONMENT_TRIALS: u32 = 16;
/// Lights examined per pixel; scenes with more get certainty instead of an estimate.
const MAX_LIGHTS_EXAMINED: usize = 32;
/// The map of periods is widened by this many pixels, so that a lens beam does not jump off it at an edge.
const DILATION_PX: usize = 2;

/// Fills one [`PixelInfo`] a pixel. Costs one real ray a pixel at most.
pub fn pilot(scene: &PackedScene) -> Vec<PixelInfo> {
    let width = scene.frame.width as usize;
    let height = scene.frame.height as usize;
    let nothing_virtual =
        scene.frame.sphere_count == 0 && !scene.lights.iter().any(|l| l.side == 1);
    if nothing_virtual {
        return vec![
            PixelInfo {
                difference_period: 1,
                flags: PIXEL_OUT_OF_REACH
            };
            width * height
        ];
    }
    let pinhole = Frame {
        aperture_radius: 0.0,
        ..scene.frame
    };
    let lights = PilotLights::of(scene);
    let mut pixels: Vec<PixelInfo> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let beam = Beam::of_pixel(&scene.frame, &pinhole, i as u32);
            let flags = if beam.may_meet_spheres(&scene.frame) {
                PIXEL_BEAM_MAY_MEET_VIRTUAL
            } else {
                0
            };
            let out_of_reach = flags == 0 && !beam.may_meet_real(scene);
            PixelInfo {
                difference_period: difference_period(scene, &beam, &lights),
                flags: flags | if out_of_reach { PIXEL_OUT_OF_REACH } else { 0 },
            }
        })
        .collect();
    dilate(&mut pixels, width, height);
    pixels
}

/// All rays of one pixel: at axis depth z they lie within `radius(z)` of the pinhole ray through the pixel's centre.
struct Beam {
    origin: Vec3,
    /// Unit.
    direction: Vec3,
    /// View axis, unit.
    axis: Vec3,
    /// Pixel footprint at axis depth 1, metres.
    footprint: f32,
    aperture_radius: f32,
    inv_focus_distance: f32,
}

/// Rounding and the curvature of the distortion inside one pixel.
const FOOTPRINT_MARGIN: f32 = 1.1;
/// A square of half-width 1 reaches this far.
const SQUARE_REACH: f32 = std::f32::consts::SQRT_2;

impl Beam {
    fn of_pixel(frame: &Frame, pinhole: &Frame, pixel: u32) -> Self {
        let x = (pixel % frame.width) as f32;
        let y = (pixel / frame.width) as f32;
        let axis = -Vec3::new(
            frame.camera_back[0],
            frame.camera_back[1],
            frame.camera_back[2],
        );
        let centre = camera_ray(pinhole, x + 0.5, y + 0.5, 0.5, 0.5);
        let at_depth_1 = |d: Vec3| d / d.dot(axis).max(1e-6);
        let footprint = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .iter()
            .map(|(dx, dy)| {
                at_depth_1(camera_ray(pinhole, x + dx, y + dy, 0.5, 0.5).direction)
                    .distance(at_depth_1(centre.direction))
            })
            .fold(0.0, f32::max);
        Self {
            origin: centre.origin,
            direction: centre.direction,
            axis,
            footprint: footprint * FOOTPRINT_MARGIN,
            aperture_radius: frame.aperture_radius * SQUARE_REACH,
            inv_focus_distance: frame.inv_focus_distance,
        }
    }

    /// Largest distance from the centre ray over the axis depths z0..z1; convex in z, so the ends decide.
    fn radius(&self, z0: f32, z1: f32) -> f32 {
        let blur = |z: f32| {
            self.aperture_radius * (1.0 - z * self.inv_focus_distance).abs()
                + self.footprint * z.max(0.0)
        };
        blur(z0.max(0.0)).max(blur(z1.max(0.0)))
    }

    fn may_meet_sphere(&self, centre: Vec3, radius: f32) -> bool {
        let to = centre - self.origin;
        let z = to.dot(self.axis);
        if z + radius < 0.0 {
            return false;
        }
        let off_ray = (to - self.direction * to.dot(self.direction)).length();
        off_ray <= (radius + self.radius(z - radius, z + radius)) * 1.001
    }

    fn may_meet_spheres(&self, frame: &Frame) -> bool {
        frame.spheres[..frame.sphere_count as usize]
            .iter()
            .any(|s| self.may_meet_sphere(Vec3::new(s[0], s[1], s[2]), s[3]))
    }

    fn may_meet_real(&self, scene: &PackedScene) -> bool {
        match scene.real_bvh.bounds() {
            None => false,
            Some((lo, hi)) => self.may_meet_sphere((lo + hi) * 0.5, (hi - lo).length() * 0.5),
        }
    }
}

/// The lights that matter to the pilot.
struct PilotLights<'a> {
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
    fn of(scene: &'a PackedScene) -> Self {
        let is_area = |l: &Light| l.kind == LIGHT_QUAD || l.kind == LIGHT_TRIANGLE;
        let examined: Vec<&Light> = scene
            .lights
            .iter()
            .filter(|l| l.side == 0 && l.kind != LIGHT_ENVIRONMENT)
            .collect();
        let emission = scene
            .lights
            .iter()
            .filter(|l| l.side == 1 && is_area(l))
            .map(|l| luminance(Vec3::new(l.radiance[0], l.radiance[1], l.radiance[2])))
            .fold(0.0, f32::max);
        Self {
            uncertain: examined.len() > MAX_LIGHTS_EXAMINED
                || scene.lights.iter().any(|l| l.side == 1 && !is_area(l)),
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

fn difference_period(scene: &PackedScene, beam: &Beam, lights: &PilotLights<'_>) -> u32 {
    let ray = Ray {
        origin: beam.origin,
        direction: beam.direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
        skip: NONE,
    };
    let hit = scene.real_bvh.closest(&ray);
    if hit.triangle == NONE {
        return LONGEST_PERIOD as u32;
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
        lights.reach_gain * cone_solid_angle_fraction(&scene.frame, position, normal);
    if lights.uncertain {
        importance = 1.0;
    } else if lights
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
    importance += ENVIRONMENT_GAIN * blocked as f32 / ENVIRONMENT_TRIALS as f32;
    (1.0 / importance).clamp(1.0, LONGEST_PERIOD).round() as u32
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

/// Shortest period of the neighbourhood, separably.
fn dilate(pixels: &mut [PixelInfo], width: usize, height: usize) {
    let pass = |pixels: &mut [PixelInfo],
                count: usize,
                stride: usize,
                lines: usize,
                line_stride: usize| {
        for line in 0..lines {
            let at = |i: usize| line * line_stride + i * stride;
            let values: Vec<u32> = (0..count)
                .map(|i| pixels[at(i)].difference_period)
                .collect();
            for i in 0..count {
                let window =
                    &values[i.saturating_sub(DILATION_PX)..(i + DILATION_PX + 1).min(count)];
                pixels[at(i)].difference_period = window.iter().fold(u32::MAX, |a, &b| a.min(b));
            }
        }
    };
    pass(pixels, width, 1, height, width);
    pass(pixels, height, width, width, 1);
}
