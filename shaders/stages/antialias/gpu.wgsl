// Kernel of the antialiasing, run by src/stages/antialias/gpu.rs: one thread a pixel.

import package::stages::antialias::blended;

@group(0) @binding(0) var<uniform> params: AntialiasParams;
// Linear, three words a pixel.
@group(0) @binding(1) var<storage, read> source: array<f32>;
@group(0) @binding(2) var<storage, read> mask: array<f32>;
@group(0) @binding(3) var<storage, read_write> picture: array<f32>;

@compute @workgroup_size(8, 8)
fn stage_antialias(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let here = id.y * params.width + id.x;
    if mask[here] == 0.0 {
        return;
    }
    let value = blended(id.x, id.y);
    picture[3u * here] = value.x;
    picture[3u * here + 1u] = value.y;
    picture[3u * here + 2u] = value.z;
}
