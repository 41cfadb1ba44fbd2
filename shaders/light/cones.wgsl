// The cones in which the virtual geometry's bounding spheres are seen from a point. Rust twin: src/light/cones.rs.

import package::gpu::buffers::frame;
import package::math::{PI, cross3, dot3, orthonormal_basis, safe_sqrt, sincos_2pi};

fn cone_of(i: u32, position: vec3<f32>, ns: vec3<f32>) -> Cone {
    let sphere = frame.spheres[i];
    let to_centre = sphere.xyz - position;
    let distance_squared = dot3(to_centre, to_centre);
    let radius_squared = sphere.w * sphere.w;
    if radius_squared >= distance_squared * WIDE_SIN2 {
        return Cone(ns, 1.0, 1.0, true, 1.0);
    }
    let axis = to_centre / safe_sqrt(distance_squared);
    let sin2 = radius_squared / distance_squared;
    let cos = safe_sqrt(1.0 - sin2);
    let one_minus_cos = sin2 / (1.0 + cos);
    let cos_axis = clamp(dot3(axis, ns), -1.0, 1.0);
    var largest = 1.0;
    if cos_axis < cos {
        largest = cos_axis * cos + safe_sqrt(1.0 - cos_axis * cos_axis) * safe_sqrt(sin2);
    }
    return Cone(axis, sin2, one_minus_cos, false, max(2.0 * one_minus_cos * (largest + COSINE_PADDING), 0.0));
}

// All spheres seen from a point; each is seen anew for each question.
struct Cones {
    position: vec3<f32>,
    ns: vec3<f32>,
    total: f32,
}

fn cones_at(position: vec3<f32>, ns: vec3<f32>) -> Cones {
    var seen = Cones(position, ns, 0.0);
    for (var i = 0u; i < frame.sphere_count; i++) {
        seen.total += cone_of(i, position, ns).weight;
    }
    return seen;
}

fn cone_sample(cones: Cones, choice: f32, u: vec2<f32>) -> ConeSample {
    if cones.total <= 0.0 { return ConeSample(cones.ns, 0.0); }
    var left = choice * cones.total;
    var chosen = cone_of(0u, cones.position, cones.ns);
    for (var i = 0u; i < frame.sphere_count; i++) {
        let cone = cone_of(i, cones.position, cones.ns);
        if cone.weight <= 0.0 { continue; }
        left -= cone.weight;
        chosen = cone;
        if left < 0.0 { break; }
    }
    var cos = safe_sqrt(1.0 - u.x);
    var sin = safe_sqrt(u.x);
    if !chosen.wide {
        let drop = u.x * chosen.one_minus_cos;
        cos = 1.0 - drop;
        sin = safe_sqrt(drop * (2.0 - drop));
    }
    let phi = sincos_2pi(u.y);
    let basis = orthonormal_basis(chosen.axis);
    let direction = basis.t * (sin * phi.cos) + basis.b * (sin * phi.sin) + chosen.axis * cos;
    return ConeSample(direction, cone_pdf(cones, direction));
}

fn cone_pdf(cones: Cones, direction: vec3<f32>) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < frame.sphere_count; i++) {
        let cone = cone_of(i, cones.position, cones.ns);
        if cone.wide {
            sum += cone.weight * max(dot3(direction, cones.ns), 0.0) * (1.0 / PI);
        } else if inside(cone, direction) {
            sum += cone.weight / (2.0 * PI * cone.one_minus_cos);
        }
    }
    if cones.total > 0.0 { return sum / cones.total; }
    return 0.0;
}

fn inside(cone: Cone, direction: vec3<f32>) -> bool {
    let across = cross3(direction, cone.axis);
    return dot3(direction, cone.axis) > 0.0 && dot3(across, across) <= cone.sin2 * (1.0 + CONE_PADDING) + CONE_PADDING_SIN2;
}

fn cone_solid_angle_fraction(cones: Cones) -> f32 {
    return min(cones.total, 1.0);
}

fn padded_radius_squared(radius: f32, distance_squared: f32) -> f32 {
    return radius * radius * (1.0 + SPHERE_PADDING) + distance_squared * SPHERE_PADDING_DISTANCE2;
}

fn direction_meets_spheres(position: vec3<f32>, direction: vec3<f32>) -> bool {
    for (var i = 0u; i < frame.sphere_count; i++) {
        let sphere = frame.spheres[i];
        let to_centre = sphere.xyz - position;
        let distance_squared = dot3(to_centre, to_centre);
        let radius_squared = padded_radius_squared(sphere.w, distance_squared);
        if distance_squared <= radius_squared { return true; }
        let across = cross3(direction, to_centre);
        if dot3(direction, to_centre) > 0.0 && dot3(across, across) <= radius_squared { return true; }
    }
    return false;
}
