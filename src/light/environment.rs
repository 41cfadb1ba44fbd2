//! The distant environment: a latitude-longitude map or a constant. WGSL twin: `shaders/light/environment.wgsl`.
//!
//! The map is bilinear between texel centres, wraps in u and is constant beyond the first and last row of centres. It is sampled by cells, the
//! rectangles between neighbouring centres: column i lies between the centres of texels i and i + 1, row j between those of j - 1 and j. A cell
//! is drawn with probability proportional to the mean luminance of its four corners times its solid angle (a row by the marginal, a column by
//! the conditional distribution). Within it the density is bilinear in azimuth and cosine between the corners' luminances, so that the density
//! everywhere is an interpolated luminance times one constant, continuous across cells, and a grey map is drawn almost exactly in proportion.

use glam::Vec3;

use super::environment_table::{interval_of, starts_count};
use crate::math::{PI, atan2_, floor_, luminance, safe_sqrt, sincos_2pi};
use crate::packed::{Frame, PackedScene};
use crate::shared::shared;

shared! {
    /// A direction drawn from the environment.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub value struct EnvSample {
        pub direction: Vec3,
        pub radiance: Vec3,
        /// Per solid angle; 0 if nothing could be drawn.
        pub pdf: f32,
    }

    /// The four texels around a point of the map and where it lies between them.
    value struct Neighbours {
        c00: Vec3,
        c10: Vec3,
        c01: Vec3,
        c11: Vec3,
        fx: f32,
        /// Share of the row's angle above the point.
        fy: f32,
        /// Lower texel's row: the row of cells that the point lies in.
        row: f32,
    }
}

/// World direction to map coordinates in 0..1: u to the right from the left edge, v from the zenith down.
fn env_coordinates(frame: &Frame, direction: Vec3) -> (f32, f32) {
    let x = direction.x * frame.env_cos - direction.z * frame.env_sin;
    let z = direction.x * frame.env_sin + direction.z * frame.env_cos;
    let u = 0.5 + atan2_(x, -z) * (0.5 / PI);
    // Not the arc cosine of y: it loses half the digits near the poles.
    let v = atan2_(safe_sqrt(x * x + z * z), direction.y) * (1.0 / PI);
    (u - floor_(u), v)
}

fn env_texel(scene: &PackedScene, i: u32, j: u32) -> Vec3 {
    let at = 3 * (j * scene.frame.env_width + i) as usize;
    Vec3::new(
        scene.env_texels[at],
        scene.env_texels[at + 1],
        scene.env_texels[at + 2],
    )
}

fn env_neighbours(scene: &PackedScene, u: f32, v: f32) -> Neighbours {
    let width = scene.frame.env_width;
    let height = scene.frame.env_height;
    let s = u * width as f32 - 0.5;
    let t = v * height as f32 - 0.5;
    let (s0, t0) = (floor_(s), floor_(t));
    let i0 = (s0 as i32 + width as i32) as u32 % width;
    let i1 = (i0 + 1) % width;
    let j0 = (t0.max(0.0) as u32).min(height - 1);
    let j1 = ((t0 + 1.0).max(0.0) as u32).min(height - 1);
    Neighbours {
        c00: env_texel(scene, i0, j0),
        c10: env_texel(scene, i1, j0),
        c01: env_texel(scene, i0, j1),
        c11: env_texel(scene, i1, j1),
        fx: s - s0,
        fy: t - t0,
        row: t0 + 1.0,
    }
}

/// Sine of half the angle from the zenith to a row's v.
fn half_sin(v: f32) -> f32 {
    sincos_2pi(0.25 * v).0
}

/// (cos a - cos x) / (cos a - cos b) for the row's edges a and b, as products of sines: differences of cosines cancel near the poles.
fn row_solid_angle_above(scene: &PackedScene, row: f32, v: f32) -> f32 {
    let upper = scene.env_edges[row as usize];
    let above = half_sin(upper.v + v) * half_sin(v - upper.v);
    (above / upper.half_height.max(1e-30)).clamp(0.0, 1.0)
}

fn env_interpolate(n: &Neighbours, fy: f32) -> Vec3 {
    let top = n.c00 + (n.c10 - n.c00) * n.fx;
    let bottom = n.c01 + (n.c11 - n.c01) * n.fx;
    top + (bottom - top) * fy
}

/// Density per solid angle with which [`env_sample`] draws `direction`, and the radiance that arrives from it.
pub fn env_evaluate(scene: &PackedScene, direction: Vec3) -> (f32, Vec3) {
    if scene.frame.env_width == 0 {
        return (0.25 / PI, env_scale(&scene.frame));
    }
    let (u, v) = env_coordinates(&scene.frame, direction);
    let n = env_neighbours(scene, u, v);
    let above = row_solid_angle_above(scene, n.row, v);
    let interpolated = luminance(env_interpolate(&n, above)).max(0.0);
    (
        interpolated * scene.frame.env_radiance[3],
        env_interpolate(&n, n.fy) * env_scale(&scene.frame),
    )
}

fn env_scale(frame: &Frame) -> Vec3 {
    Vec3::new(
        frame.env_radiance[0],
        frame.env_radiance[1],
        frame.env_radiance[2],
    )
}

/// Radiance that arrives from `direction` (unit, pointing away from the scene point).
pub fn env_radiance(scene: &PackedScene, direction: Vec3) -> Vec3 {
    if scene.frame.env_width == 0 {
        return env_scale(&scene.frame);
    }
    let (u, v) = env_coordinates(&scene.frame, direction);
    let n = env_neighbours(scene, u, v);
    env_interpolate(&n, n.fy) * env_scale(&scene.frame)
}

/// Share of the light from `direction` that the eye's paths bring through smooth virtual objects; photons bring the rest.
pub fn share_left_to_eye(scene: &PackedScene, direction: Vec3) -> f32 {
    let brightness = luminance(env_radiance(scene, direction));
    (scene.frame.env_traced_above / brightness.max(1e-30)).min(1.0)
}

/// Inverts the distribution whose density runs linearly from `a` to `b` over 0..1; uniform where both are 0.
fn sample_linear(u: f32, a: f32, b: f32) -> f32 {
    let sum = a + b;
    if sum <= 0.0 {
        return u;
    }
    let (first, last) = (a / sum, b / sum);
    let root = safe_sqrt(first * first + u * (last - first));
    (u / (first + root).max(1e-20)).min(1.0)
}

/// Luminance of a texel.
fn env_corner(scene: &PackedScene, i: u32, j: u32) -> f32 {
    luminance(env_texel(scene, i, j))
}

/// Last index i with cdf[base + i] <= u among `count` intervals of the environment's. (The shader halves: it has arithmetic to spare, but no memory.)
fn find_interval(scene: &PackedScene, base: u32, count: u32, u: f32) -> u32 {
    let (width, rows) = (scene.frame.env_width, scene.frame.env_height + 1);
    let starts_of_one = starts_count(count as usize);
    let mut first = 0;
    if base > 0 {
        let row = (base - (rows + 1)) / (width + 1);
        first = starts_count(rows as usize) + row as usize * starts_of_one;
    }
    let cdf = &scene.env_cdf[base as usize..=(base + count) as usize];
    interval_of(cdf, &scene.env_starts[first..][..starts_of_one], u)
}

/// Where u lies in the interval from entry `at` of the distributions to the next.
fn env_within(scene: &PackedScene, at: u32, u: f32) -> f32 {
    let (low, high) = (scene.env_cdf[at as usize], scene.env_cdf[at as usize + 1]);
    ((u - low) / (high - low).max(1e-20)).clamp(0.0, 1.0)
}

/// Draws a direction by brightness; uniformly over the sphere if the environment is constant.
pub fn env_sample(scene: &PackedScene, u0: f32, u1: f32) -> EnvSample {
    if scene.frame.env_width != 0 {
        return env_sample_map(scene, u0, u1);
    }
    let y = 1.0 - 2.0 * u0;
    let r = safe_sqrt(1.0 - y * y);
    let (sin, cos) = sincos_2pi(u1);
    EnvSample {
        direction: Vec3::new(r * cos, y, r * sin),
        radiance: env_scale(&scene.frame),
        pdf: 0.25 / PI,
    }
}

fn env_sample_map(scene: &PackedScene, u0: f32, u1: f32) -> EnvSample {
    let frame = &scene.frame;
    let rows = frame.env_height + 1;
    let row = find_interval(scene, 0, rows, u0);
    let base = rows + 1 + row * (frame.env_width + 1);
    let column = find_interval(scene, base, frame.env_width, u1);
    let (upper_u, left_u) = (
        env_within(scene, row, u0),
        env_within(scene, base + column, u1),
    );
    let next = (column + 1) % frame.env_width;
    let (top, bottom) = (row.max(1) - 1, row.min(frame.env_height - 1));
    let (l00, l10) = (env_corner(scene, column, top), env_corner(scene, next, top));
    let (l01, l11) = (
        env_corner(scene, column, bottom),
        env_corner(scene, next, bottom),
    );
    let fy = sample_linear(upper_u, l00 + l10, l01 + l11);
    let fx = sample_linear(left_u, l00 + (l01 - l00) * fy, l10 + (l11 - l10) * fy);
    let (upper, lower) = (
        scene.env_edges[row as usize],
        scene.env_edges[row as usize + 1],
    );
    let sin2 = upper.sin2 * (1.0 - fy) + lower.sin2 * fy;
    let cos2 = upper.cos2 * (1.0 - fy) + lower.cos2 * fy;
    let y = cos2 - sin2;
    let r = 2.0 * safe_sqrt(sin2 * cos2);
    let (sin, cos) = sincos_2pi((column as f32 + 0.5 + fx) / frame.env_width as f32 - 0.5);
    // Azimuth 0 is the map's centre column: -Z, with +X to its right.
    let (x, z) = (r * sin, -r * cos);
    let direction = Vec3::new(
        x * frame.env_cos + z * frame.env_sin,
        y,
        z * frame.env_cos - x * frame.env_sin,
    );
    // Looked up from the direction, so that this density and env_evaluate's are the same number.
    let (pdf, radiance) = env_evaluate(scene, direction);
    EnvSample {
        direction,
        radiance,
        pdf,
    }
}
