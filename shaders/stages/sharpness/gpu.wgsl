// Kernel of the sharpness, run by src/stages/sharpness/gpu.rs: one thread a pixel.

import package::stages::sharpness::sharpened;

@group(0) @binding(0) var<uniform> params: SharpnessParams;
// Linear, three words a pixel.
@group(0) @binding(1) var<storage, read> photo: array<f32>;
// Gain on the photograph and added light, six words a pixel.
@group(0) @binding(2) var<storage, read> planes: array<f32>;
@group(0) @binding(3) var<storage, read_write> picture: array<f32>;

@compute @workgroup_size(8, 8)
fn stage_sharpness(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let here = 3u * (id.y * params.width + id.x);
    let value = sharpened(id.x, id.y);
    picture[here] = value.x;
    picture[here + 1u] = value.y;
    picture[here + 2u] = value.z;
}
