// Kernel of the copies, run by src/stages/motion_blur/gpu.rs: one thread a pixel, one layer a dispatch.

import package::stages::motion_blur::copies::{layer_at, over};

@group(0) @binding(0) var<uniform> params: CopiesParams;
// Linear colour times coverage, and coverage.
@group(0) @binding(1) var<storage, read> layer: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> canvas: array<vec4<f32>>;

@compute @workgroup_size(8, 8)
fn stage_copies(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let here = id.y * params.width + id.x;
    var pixel = canvas[here];
    for (var i = 0u; i < params.count; i++) {
        let offset = params.start + params.step * f32(i);
        let sample = layer_at(f32(id.x) - offset.x, f32(id.y) - offset.y);
        pixel = over(pixel, sample, params.opacity);
    }
    canvas[here] = over(pixel, layer[here], params.centre_opacity);
}
