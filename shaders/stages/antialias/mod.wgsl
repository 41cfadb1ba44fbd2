// Twin of src/stages/antialias/mod.rs.

import package::stages::antialias::gpu::{mask, params, source};

fn source_at(index: u32) -> vec3<f32> {
    return vec3<f32>(source[3u * index], source[3u * index + 1u], source[3u * index + 2u]);
}

fn blended(column: u32, row: u32) -> vec3<f32> {
    let value = source_at(row * params.width + column);
    var sum = vec3<f32>(0.0);
    var count = 1.0;
    for (var y = max(row, 1u) - 1u; y < min(row + 2u, params.height); y++) {
        for (var x = max(column, 1u) - 1u; x < min(column + 2u, params.width); x++) {
            let near = y * params.width + x;
            if mask[near] == 0.0 {
                sum += source_at(near) - value;
                count += 1.0;
            }
        }
    }
    if count > 1.0 {
        return value + params.beta * (sum / count);
    }
    return value;
}
