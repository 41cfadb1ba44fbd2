// Twin of src/stages/antialias.rs: one thread a pixel.

struct AntialiasParams {
    width: u32,
    height: u32,
    beta: f32,
    pad: u32,
}

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
    let value = vec3<f32>(source[3u * here], source[3u * here + 1u], source[3u * here + 2u]);
    var sum = vec3<f32>(0.0);
    var count = 1.0;
    for (var y = max(id.y, 1u) - 1u; y < min(id.y + 2u, params.height); y++) {
        for (var x = max(id.x, 1u) - 1u; x < min(id.x + 2u, params.width); x++) {
            let near = y * params.width + x;
            if mask[near] == 0.0 {
                sum += vec3<f32>(source[3u * near], source[3u * near + 1u], source[3u * near + 2u]) - value;
                count += 1.0;
            }
        }
    }
    if count > 1.0 {
        let blended = value + params.beta * (sum / count);
        picture[3u * here] = blended.x;
        picture[3u * here + 1u] = blended.y;
        picture[3u * here + 2u] = blended.z;
    }
}
