// Twin of src/stages/copies.rs: one thread a pixel, one layer a dispatch.

struct CopiesParams {
    width: u32,
    height: u32,
    count: u32,
    opacity: f32,
    start: vec2<f32>,
    step: vec2<f32>,
    centre_opacity: f32,
    pad_0: u32,
    pad_1: u32,
    pad_2: u32,
}

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

fn over(below: vec4<f32>, above: vec4<f32>, opacity: f32) -> vec4<f32> {
    let through = 1.0 - opacity * above.w;
    return vec4<f32>(below.xyz * through + opacity * above.xyz, 1.0 - (1.0 - below.w) * through);
}

fn layer_at(x: f32, y: f32) -> vec4<f32> {
    let left = floor(x);
    let top = floor(y);
    let along = x - left;
    let down = y - top;
    var sum = vec4<f32>(0.0);
    sum += (1.0 - along) * (1.0 - down) * texel(left, top);
    sum += along * (1.0 - down) * texel(left + 1.0, top);
    sum += (1.0 - along) * down * texel(left, top + 1.0);
    sum += along * down * texel(left + 1.0, top + 1.0);
    return sum;
}

fn texel(column: f32, row: f32) -> vec4<f32> {
    if column >= 0.0 && row >= 0.0 && column < f32(params.width) && row < f32(params.height) {
        return layer[u32(row) * params.width + u32(column)];
    }
    return vec4<f32>(0.0);
}
