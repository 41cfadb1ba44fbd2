// The distant environment. Rust twin: src/light/environment.rs, where the map's geometry and sampling are described.

import package::gpu::buffers::frame;
@if(environment_map) import package::gpu::buffers::{env_cdf, env_texels};
import package::math::{PI, atan2_, luminance, safe_sqrt, sincos_2pi};

@if(environment_map)
fn env_coordinates(direction: vec3<f32>) -> vec2<f32> {
    let x = direction.x * frame.env_cos - direction.z * frame.env_sin;
    let z = direction.x * frame.env_sin + direction.z * frame.env_cos;
    let u = 0.5 + atan2_(x, -z) * (0.5 / PI);
    let v = atan2_(safe_sqrt(x * x + z * z), direction.y) * (1.0 / PI);
    return vec2<f32>(u - floor(u), v);
}

@if(environment_map)
fn env_texel(i: u32, j: u32) -> vec3<f32> {
    let at = 3u * (j * frame.env_width + i);
    return vec3<f32>(env_texels[at], env_texels[at + 1u], env_texels[at + 2u]);
}

@if(environment_map)
struct Edges {
    upper: f32,
    lower: f32,
}

@if(environment_map)
fn row_edges(row: f32, height: f32) -> Edges {
    return Edges(max((row - 0.5) / height, 0.0), min((row + 0.5) / height, 1.0));
}

@if(environment_map)
fn env_neighbours(u: f32, v: f32) -> Neighbours {
    let width = frame.env_width;
    let height = frame.env_height;
    let s = u * f32(width) - 0.5;
    let t = v * f32(height) - 0.5;
    let s0 = floor(s);
    let t0 = floor(t);
    let i0 = u32(i32(s0) + i32(width)) % width;
    let i1 = (i0 + 1u) % width;
    let j0 = min(u32(max(t0, 0.0)), height - 1u);
    let j1 = min(u32(max(t0 + 1.0, 0.0)), height - 1u);
    return Neighbours(
        env_texel(i0, j0), env_texel(i1, j0), env_texel(i0, j1), env_texel(i1, j1), s - s0, t - t0,
        t0 + 1.0,
    );
}

@if(environment_map)
fn half_sin(x: f32) -> f32 {
    return sincos_2pi(0.25 * x).sin;
}

@if(environment_map)
fn row_solid_angle_above(row: f32, v: f32) -> f32 {
    let edges = row_edges(row, f32(frame.env_height));
    let above = half_sin(edges.upper + v) * half_sin(v - edges.upper);
    let whole = half_sin(edges.upper + edges.lower) * half_sin(edges.lower - edges.upper);
    return clamp(above / max(whole, 1e-30), 0.0, 1.0);
}

@if(environment_map)
fn env_interpolate(n: Neighbours, fy: f32) -> vec3<f32> {
    let top = n.c00 + (n.c10 - n.c00) * n.fx;
    let bottom = n.c01 + (n.c11 - n.c01) * n.fx;
    return top + (bottom - top) * fy;
}

struct EnvEvaluation {
    pdf: f32,
    radiance: vec3<f32>,
}

fn env_evaluate(direction: vec3<f32>) -> EnvEvaluation {
    @if(environment_map) {
        if frame.env_width != 0u {
            let c = env_coordinates(direction);
            let n = env_neighbours(c.x, c.y);
            let above = row_solid_angle_above(n.row, c.y);
            let interpolated = max(luminance(env_interpolate(n, above)), 0.0);
            return EnvEvaluation(
                interpolated * frame.env_radiance.w,
                env_interpolate(n, n.fy) * env_scale(),
            );
        }
    }
    return EnvEvaluation(0.25 / PI, env_scale());
}

fn env_scale() -> vec3<f32> {
    return frame.env_radiance.xyz;
}

fn env_radiance(direction: vec3<f32>) -> vec3<f32> {
    @if(environment_map) {
        if frame.env_width != 0u {
            let c = env_coordinates(direction);
            let n = env_neighbours(c.x, c.y);
            return env_interpolate(n, n.fy) * env_scale();
        }
    }
    return env_scale();
}

fn share_left_to_eye(direction: vec3<f32>) -> f32 {
    let brightness = luminance(env_radiance(direction));
    return min(frame.env_traced_above / max(brightness, 1e-30), 1.0);
}

@if(environment_map)
fn sample_linear(u: f32, a: f32, b: f32) -> f32 {
    let sum = a + b;
    if sum <= 0.0 { return u; }
    let first = a / sum;
    let last = b / sum;
    let root = safe_sqrt(first * first + u * (last - first));
    return min(u / max(first + root, 1e-20), 1.0);
}

@if(environment_map)
fn env_corner(i: u32, j: u32) -> f32 {
    return luminance(env_texel(i, j));
}

@if(environment_map)
fn find_interval(base: u32, count: u32, u: f32) -> u32 {
    var low = 0u;
    var high = count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if env_cdf[base + middle] <= u { low = middle; } else { high = middle; }
    }
    return low;
}

@if(environment_map)
fn env_within(at: u32, u: f32) -> f32 {
    let low = env_cdf[at];
    let high = env_cdf[at + 1u];
    return clamp((u - low) / max(high - low, 1e-20), 0.0, 1.0);
}

fn env_sample(u0: f32, u1: f32) -> EnvSample {
    @if(environment_map) {
        if frame.env_width != 0u { return env_sample_map(u0, u1); }
    }
    let y = 1.0 - 2.0 * u0;
    let r = safe_sqrt(1.0 - y * y);
    let phi = sincos_2pi(u1);
    return EnvSample(vec3<f32>(r * phi.cos, y, r * phi.sin), env_scale(), 0.25 / PI);
}

@if(environment_map)
fn env_sample_map(u0: f32, u1: f32) -> EnvSample {
    let rows = frame.env_height + 1u;
    let row = find_interval(0u, rows, u0);
    let base = rows + 1u + row * (frame.env_width + 1u);
    let column = find_interval(base, frame.env_width, u1);
    let upper_u = env_within(row, u0);
    let left_u = env_within(base + column, u1);
    let next = (column + 1u) % frame.env_width;
    let top = max(row, 1u) - 1u;
    let bottom = min(row, frame.env_height - 1u);
    let l00 = env_corner(column, top);
    let l10 = env_corner(next, top);
    let l01 = env_corner(column, bottom);
    let l11 = env_corner(next, bottom);
    let fy = sample_linear(upper_u, l00 + l10, l01 + l11);
    let fx = sample_linear(left_u, l00 + (l01 - l00) * fy, l10 + (l11 - l10) * fy);
    let edges = row_edges(f32(row), f32(frame.env_height));
    let at_upper = sincos_2pi(0.25 * edges.upper);
    let at_lower = sincos_2pi(0.25 * edges.lower);
    let sin2 = at_upper.sin * at_upper.sin * (1.0 - fy) + at_lower.sin * at_lower.sin * fy;
    let cos2 = at_upper.cos * at_upper.cos * (1.0 - fy) + at_lower.cos * at_lower.cos * fy;
    let y = cos2 - sin2;
    let r = 2.0 * safe_sqrt(sin2 * cos2);
    let phi = sincos_2pi((f32(column) + 0.5 + fx) / f32(frame.env_width) - 0.5);
    let x = r * phi.sin;
    let z = -r * phi.cos;
    let direction = vec3<f32>(x * frame.env_cos + z * frame.env_sin, y, z * frame.env_cos - x * frame.env_sin);
    let at = env_evaluate(direction);
    return EnvSample(direction, at.radiance, at.pdf);
}
