//! The same view on fewer pixels.

use crate::scene::{EncodedPhoto, Scene};

/// Divides width and height by `by` (at least 1; what does not divide is cut off right and below); the photograph's pixels are averaged in
/// linear light.
pub fn shrink(mut scene: Scene, by: u32) -> Scene {
    if by <= 1 {
        return scene;
    }
    let camera = &mut scene.camera;
    let stride = camera.width as usize;
    camera.width = (camera.width / by).max(1);
    camera.height = (camera.height / by).max(1);
    for length_px in [
        &mut camera.fx,
        &mut camera.fy,
        &mut camera.cx,
        &mut camera.cy,
    ] {
        *length_px /= f64::from(by);
    }
    let (width, height) = (camera.width as usize, camera.height as usize);
    if let Some(photo) = &mut scene.photo {
        let rows = photo.height as usize;
        let side = by as usize;
        let linear = (0..width * height).map(|pixel| {
            let (x, y) = (pixel % width * side, pixel / width * side);
            let (end_x, end_y) = ((x + side).min(stride), (y + side).min(rows));
            let mut sum = [0.0f64; 3];
            for row in y..end_y {
                for texel in &photo.linear[row * stride + x..row * stride + end_x] {
                    (0..3).for_each(|c| sum[c] += f64::from(texel[c]));
                }
            }
            let count = ((end_x - x) * (end_y - y)) as f64;
            sum.map(|s| (s / count) as f32)
        });
        photo.linear = linear.collect();
        (photo.width, photo.height) = (width as u32, height as u32);
        photo.encoded = EncodedPhoto::Linear;
    }
    scene
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_block_becomes_its_mean() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/far/scene.toml");
        let scene = crate::scene::load(&path).unwrap();
        let small = shrink(scene.clone(), 3);
        let (photo, small_photo) = (scene.photo.unwrap(), small.photo.unwrap());
        assert_eq!((small_photo.width, small_photo.height), (106, 80));
        assert_eq!((small.camera.width, small.camera.height), (106, 80));
        assert!((small.camera.cx * 3.0 - scene.camera.cx).abs() < 1e-9);
        let mean = (0..9)
            .map(|i| photo.linear[(6 + i / 3) * 320 + 9 + i % 3][1])
            .sum::<f32>()
            / 9.0;
        assert!((small_photo.linear[2 * 106 + 3][1] - mean).abs() < 1e-6);
    }
}
