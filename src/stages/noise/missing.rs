//! How much noise a pixel lacks. Twin of `shaders/stages/noise/missing.wgsl`.

use super::BIN_SHIFT;
use crate::stages::curve::{decode_slope, encode_rgb};
use crate::stages::settings::NoiseProfile;

/// Sigma by bin and channel, DN.
pub fn sigma_table(profile: &NoiseProfile) -> Vec<[f32; 3]> {
    profile
        .bins
        .iter()
        .map(|bin| bin.sigma.map(|sigma| sigma as f32))
        .collect()
}

/// Sigma of a pixel of these encoded values, DN: that of the bin of its intensity.
pub(super) fn sigma_of(table: &[[f32; 3]], encoded: [f32; 3]) -> [f32; 3] {
    table[bin_of(encoded, table.len())]
}

pub(super) fn bin_of(encoded: [f32; 3], bins: usize) -> usize {
    let sum = encoded[0] + encoded[1] + encoded[2];
    let intensity = sum * (255.0 / 3.0) + BIN_SHIFT;
    let bin = intensity * (bins as f32 * (1.0 / 256.0));
    (bin.max(0.0) as usize).min(bins - 1)
}

/// Standard deviation of the noise to add to the encoded values, DN.
///
/// `photo`: Ic, linear; `share`: 1 - a, the photograph's share of the pixel; `ratio`: r; `variance`: v, linear.
pub fn missing_sigma(
    table: &[[f32; 3]],
    encoded: [f32; 3],
    photo: [f32; 3],
    share: f32,
    ratio: [f32; 3],
    variance: [f32; 3],
) -> [f32; 3] {
    let wanted = sigma_of(table, encoded);
    let encoded_photo = encode_rgb(photo);
    let photo_sigma = sigma_of(table, encoded_photo);
    let mut sigma = [0.0; 3];
    for c in 0..3 {
        // Linear values per DN at the pixel and at the photograph's pixel.
        let here = decode_slope(encoded[c]) * (1.0 / 255.0);
        let there = decode_slope(encoded_photo[c]) * (1.0 / 255.0);
        let carried = share * ratio[c] * photo_sigma[c] * there;
        let present = (carried * carried + variance[c]) / (here * here);
        sigma[c] = (wanted[c] * wanted[c] - present).max(0.0).sqrt();
    }
    sigma
}
