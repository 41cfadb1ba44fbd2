// Twin of src/stages/noise/missing.rs.

import package::stages::curve::{decode_slope, encode_rgb};
import package::stages::noise::BIN_SHIFT;
import package::stages::noise::gpu::{mask, params, photo, ratio, variance, weights};

fn sigma_of(encoded: vec3<f32>) -> vec3<f32> {
    let bin = bin_of(encoded);
    return vec3<f32>(weights[3u * bin], weights[3u * bin + 1u], weights[3u * bin + 2u]);
}

fn bin_of(encoded: vec3<f32>) -> u32 {
    let sum = encoded.x + encoded.y + encoded.z;
    let intensity = sum * (255.0 / 3.0) + BIN_SHIFT;
    let bin = intensity * (f32(params.bins) * (1.0 / 256.0));
    return min(u32(max(bin, 0.0)), params.bins - 1u);
}

fn missing_sigma(encoded: vec3<f32>, index: u32) -> vec3<f32> {
    let wanted = sigma_of(encoded);
    let encoded_photo = encode_rgb(vec3<f32>(photo[3u * index], photo[3u * index + 1u], photo[3u * index + 2u]));
    let photo_sigma = sigma_of(encoded_photo);
    var share = 0.0;
    if params.has_photo != 0u {
        share = 1.0 - mask[index];
    }
    var sigma: vec3<f32>;
    for (var c = 0u; c < 3u; c++) {
        let here = decode_slope(encoded[c]) * (1.0 / 255.0);
        let there = decode_slope(encoded_photo[c]) * (1.0 / 255.0);
        let carried = share * ratio[3u * index + c] * photo_sigma[c] * there;
        let present = (carried * carried + variance[3u * index + c]) / (here * here);
        sigma[c] = sqrt(max(wanted[c] * wanted[c] - present, 0.0));
    }
    return sigma;
}
