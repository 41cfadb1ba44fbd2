//! A scene at half its width and height, so that a benchmark ends soon.

use mixray::scene::{BackendChoice, Scene};

/// The same view on a quarter of the pixels, rendered by the CPU; the photograph's pixels are averaged in fours.
pub fn of(mut scene: Scene) -> Scene {
    scene.settings.backend = BackendChoice::Cpu;
    let camera = &mut scene.camera;
    let (width, height) = (camera.width as usize / 2, camera.height as usize / 2);
    let stride = camera.width as usize;
    (camera.width, camera.height) = (width as u32, height as u32);
    for length in [
        &mut camera.fx,
        &mut camera.fy,
        &mut camera.cx,
        &mut camera.cy,
    ] {
        *length *= 0.5;
    }
    if let Some(photo) = &mut scene.photo {
        (photo.width, photo.height) = (width as u32, height as u32);
        photo.linear = (0..width * height)
            .map(|i| {
                let at = 2 * (i / width) * stride + 2 * (i % width);
                [0, 1, 2].map(|c| {
                    [at, at + 1, at + stride, at + stride + 1]
                        .iter()
                        .map(|&p| 0.25 * photo.linear[p][c])
                        .sum()
                })
            })
            .collect();
    }
    scene
}
