//! Choosing a light and a point on it. WGSL twin: `shaders/light/lights.wgsl`.

use glam::Vec3;

use super::environment::{env_evaluate, env_radiance, env_sample};
use super::rectangle::{rectangle_from, sample_rectangle};
use crate::material::triangle_emission;
use crate::math::{dot3, length3, safe_sqrt};
use crate::packed::{
    LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_QUAD, LIGHT_SPOT, Light, NONE,
    PackedScene, SIDE_REAL, xyz,
};
use crate::shared::shared;

shared! {
    /// Light from one direction.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct LightSample {
        /// Unit, from the shaded point to the light.
        pub direction: Vec3,
        /// Metres; infinity for the environment and directional lights.
        pub distance: f32,
        /// Radiance, or for delta lights what multiplies f cos: intensity over distance squared, or irradiance.
        pub radiance: Vec3,
        /// Per solid angle, the probability of the light's choice included; for delta lights that probability alone. 0: nothing drawn.
        pub pdf: f32,
        pub delta: bool,
        /// `SIDE_REAL` or `SIDE_VIRTUAL`.
        pub side: u32,
    }
}

fn no_light() -> LightSample {
    LightSample {
        direction: Vec3::Z,
        distance: 0.0,
        radiance: Vec3::ZERO,
        pdf: 0.0,
        delta: false,
        side: SIDE_REAL,
    }
}

/// Alias method over all lights; the coin has a number of its own because `u` has too few bits left once a light of many is chosen.
pub fn light_select(scene: &PackedScene, u: f32, coin: f32) -> u32 {
    let scaled = u * scene.frame.light_count as f32;
    let index = (scaled as u32).min(scene.frame.light_count - 1);
    let light = &scene.lights[index as usize];
    if coin < light.alias_threshold {
        index
    } else {
        light.alias_light
    }
}

/// Draws a point on a light that [`light_select`] chose.
pub fn light_sample(scene: &PackedScene, index: u32, position: Vec3, u: [f32; 2]) -> LightSample {
    let light = &scene.lights[index as usize];
    match light.kind {
        LIGHT_ENVIRONMENT => {
            let s = env_sample(scene, u[0], u[1]);
            LightSample {
                direction: s.direction,
                distance: f32::INFINITY,
                radiance: s.radiance,
                pdf: s.pdf * light.select_pdf,
                delta: false,
                side: light.side,
            }
        }
        LIGHT_DIRECTIONAL => LightSample {
            direction: -xyz(light.axis_u),
            distance: f32::INFINITY,
            radiance: xyz(light.radiance),
            pdf: light.select_pdf,
            delta: true,
            side: light.side,
        },
        LIGHT_POINT | LIGHT_SPOT => sample_point_light(light, position),
        _ => sample_area_light(scene, light, position, u[0], u[1]),
    }
}

fn sample_point_light(light: &Light, position: Vec3) -> LightSample {
    let to_light = xyz(light.position) - position;
    let distance_squared = dot3(to_light, to_light);
    if distance_squared <= 0.0 {
        return no_light();
    }
    let distance = safe_sqrt(distance_squared);
    let direction = to_light / distance;
    let mut radiance = xyz(light.radiance) / distance_squared;
    if light.kind == LIGHT_SPOT {
        radiance *= spot_falloff(light, -dot3(direction, xyz(light.axis_u)));
    }
    LightSample {
        direction,
        distance,
        radiance,
        pdf: light.select_pdf,
        delta: true,
        side: light.side,
    }
}

/// The fall-off that KHR_lights_punctual recommends: the square of a linear ramp between the cosines.
pub fn spot_falloff(light: &Light, cos: f32) -> f32 {
    let (inner, outer) = (light.axis_u[3], light.axis_v[3]);
    let ramp = ((cos - outer) / (inner - outer).max(1e-4)).clamp(0.0, 1.0);
    ramp * ramp
}

/// A rectangle uniformly by solid angle unless it is small, other quads and triangles uniformly by area. A quad emits to the side of
/// axis_u x axis_v only, a triangle to both.
fn sample_area_light(
    scene: &PackedScene,
    light: &Light,
    position: Vec3,
    u0: f32,
    u1: f32,
) -> LightSample {
    let rectangle = rectangle_from(light, position);
    let (mut a, mut b) = (u0, u1);
    if light.kind != LIGHT_QUAD {
        let root = safe_sqrt(u0);
        a = root * (1.0 - u1);
        b = root * u1;
    }
    let by_solid_angle = rectangle.solid_angle > 0.0;
    let to_light = if by_solid_angle {
        sample_rectangle(&rectangle, u0, u1)
    } else {
        (xyz(light.position) - position) + (xyz(light.axis_u) * a + xyz(light.axis_v) * b)
    };
    let distance = length3(to_light);
    if distance <= 0.0 {
        return no_light();
    }
    let direction = to_light / distance;
    let pdf = if by_solid_angle {
        light.select_pdf / rectangle.solid_angle
    } else {
        area_pdf(light, direction, distance)
    };
    if pdf <= 0.0 {
        return no_light();
    }
    let mut radiance = xyz(light.radiance);
    if light.triangle != NONE {
        radiance = triangle_emission(scene, light.triangle, a, b);
    }
    LightSample {
        direction,
        distance,
        radiance,
        pdf,
        delta: false,
        side: light.side,
    }
}

/// Density per solid angle, choice included, of drawing uniformly by area what lies on an area light along `direction` at `distance`; 0 from a quad's dark side.
fn area_pdf(light: &Light, direction: Vec3, distance: f32) -> f32 {
    let area = light.radiance[3];
    let mut cos = -dot3(direction, xyz(light.normal)) / light.normal[3];
    if light.kind != LIGHT_QUAD {
        cos = cos.abs();
    }
    if cos <= 0.0 {
        return 0.0;
    }
    light.select_pdf * distance * distance / (area * cos)
}

/// Density with which [`light_sample`] at `from_position` would have drawn the point that a ray along `direction` met at `distance` on `light`.
pub fn light_pdf_hit(
    scene: &PackedScene,
    light: u32,
    from_position: Vec3,
    direction: Vec3,
    distance: f32,
) -> f32 {
    if light == NONE {
        return 0.0;
    }
    let record = &scene.lights[light as usize];
    let rectangle = rectangle_from(record, from_position);
    if rectangle.solid_angle > 0.0 {
        return record.select_pdf / rectangle.solid_angle;
    }
    area_pdf(record, direction, distance)
}

/// Radiance that arrives from the environment along `direction`, and the density with which [`light_sample`] draws it.
pub fn env_arriving(scene: &PackedScene, direction: Vec3) -> (Vec3, f32) {
    if scene.frame.env_light == NONE {
        return (env_radiance(scene, direction), 0.0);
    }
    let (pdf, radiance) = env_evaluate(scene, direction);
    let select_pdf = scene.lights[scene.frame.env_light as usize].select_pdf;
    (radiance, pdf * select_pdf)
}
