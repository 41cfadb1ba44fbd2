// Where light comes from by way of smooth virtual objects, learnt from photons. Rust twin: src/light/guide.rs.

import package::gpu::buffers::{frame, guide, has_photon_sphere};
import package::math::{INV_PI, dot3, hash_combine, length3, orthonormal_basis, safe_sqrt, sincos_2pi};

fn guide_place(position: vec3<f32>) -> vec4<u32> {
    var nearest = FARTHEST;
    for (var i = 0u; has_photon_sphere(i); i++) {
        let apart = position - frame.photon_spheres[i].xyz;
        nearest = min(nearest, dot3(apart, apart));
    }
    var cells_per_m = frame.guide_cells_per_m;
    var level = 0u;
    while level < GUIDE_LEVELS && nearest * cells_per_m * cells_per_m > GUIDE_CELLS_AWAY {
        cells_per_m *= 0.5;
        level++;
    }
    let place = vec3<i32>(floor(position * cells_per_m));
    return vec4<u32>(level, bitcast<vec3<u32>>(place));
}

fn guide_cell(position: vec3<f32>) -> u32 {
    let place = guide_place(position);
    let hash = hash_combine(hash_combine(hash_combine(place.x, place.y), place.z), place.w);
    return (hash & (frame.guide_cell_count - 1u)) * GUIDE_LOBES;
}

fn guide_count(cell: u32) -> u32 {
    var count = 0u;
    while count < GUIDE_LOBES && guide[cell + count].w > 0.0 { count++; }
    return count;
}

fn lobe_axis(lobe: vec4<f32>, position: vec3<f32>) -> vec3<f32> {
    let to = lobe.xyz - position;
    return to / max(length3(to), LEAST_LENGTH);
}

fn guide_pdf(cell: u32, position: vec3<f32>, direction: vec3<f32>) -> f32 {
    let count = guide_count(cell);
    var sum = 0.0;
    for (var i = 0u; i < count; i++) {
        let lobe = guide[cell + i];
        let apart = direction - lobe_axis(lobe, position);
        if 0.5 * dot3(apart, apart) <= lobe.w { sum += 1.0 / lobe.w; }
    }
    return sum * (0.5 * INV_PI) / f32(max(count, 1u));
}

fn guide_sample(cell: u32, position: vec3<f32>, choice: f32, u: vec2<f32>) -> vec3<f32> {
    let count = guide_count(cell);
    let chosen = min(u32(choice * f32(count)), count - 1u);
    let lobe = guide[cell + chosen];
    let axis = lobe_axis(lobe, position);
    let drop = u.x * lobe.w;
    let sin = safe_sqrt(drop * (2.0 - drop));
    let phi = sincos_2pi(u.y);
    let basis = orthonormal_basis(axis);
    return basis.t * (sin * phi.cos) + basis.b * (sin * phi.sin) + axis * (1.0 - drop);
}
