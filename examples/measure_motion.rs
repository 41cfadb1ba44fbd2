//! Measures both kinds of motion blur against averages of many sharp frames: `cargo run --release --example measure_motion`.
//!
//! Prints the table of docs/sequence.md.

use std::error::Error;
use std::path::Path;

use glam::{DMat4, DVec3};
use mixray::film::Picture;
use mixray::renderer::{Budget, FrameEdit, NeighbourView, Renderer, RendererOptions, Watcher};
use mixray::scene::trajectory::CameraPath;
use mixray::scene::{MotionBlurMethod, MotionBlurSettings, Scene, Shutter};
use mixray::stages::finish;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Sharp frames in an average.
const FRAMES: u32 = 1000;
const FRAME_RAYS: u32 = 4;
/// Rays per pixel of the shutter and of what is copied.
const RAYS: u32 = 64;
const EXPOSURE_SECS: f64 = 0.04;

const SCENE: &str = "
[camera]
width = 128
height = 96
fx = 120
[environment]
radiance = [0.8, 0.8, 0.8]
[[virtual]]
shape = \"box\"
size = [0.4, 0.3, 0.3]
rotation_deg = [20, 30, 0]
translation = [-0.1, 0, -1.4]
material = { base_color = [0.8, 0.3, 0.1] }
[[virtual]]
shape = \"sphere\"
segments = 48
scale = 0.12
translation = [0.3, 0.1, -1.2]
material = { base_color = [0.2, 0.4, 0.8], metallic = 1.0, roughness = 0.3 }
[render]
max_bounces = 2
backend = \"cpu\"
";

/// World-from-camera at a share of the exposure, -0.5 to 0.5.
type Motion = fn(f64) -> DMat4;

const MOTIONS: &[(&str, Motion, f64)] = &[
    (
        "sideways, 10 px at the box",
        |s| step(DVec3::X * 0.117 * s),
        0.0,
    ),
    (
        "sideways, lens open, focus behind",
        |s| step(DVec3::X * 0.117 * s),
        0.03,
    ),
    (
        "turning about the view, 15 degrees",
        |s| DMat4::from_rotation_z((15.0 * s).to_radians()),
        0.0,
    ),
    (
        "panning, 5 degrees",
        |s| DMat4::from_rotation_y((5.0 * s).to_radians()),
        0.0,
    ),
    ("approach by 0.25 m", |s| step(DVec3::NEG_Z * 0.25 * s), 0.0),
    (
        "approach and pan",
        |s| DMat4::from_rotation_y((5.0 * s).to_radians()) * step(DVec3::NEG_Z * 0.25 * s),
        0.0,
    ),
];

fn step(by: DVec3) -> DMat4 {
    DMat4::from_translation(by)
}

fn main() -> Result<()> {
    println!(
        "RMS error (linear values, over the pixels that the objects touch) against the average of {FRAMES} sharp frames of {FRAME_RAYS} rays per pixel, 128 x 96; shutter and copies at {RAYS} rays per pixel, the paper's settings for the copies; mixray {}.\n",
        env!("CARGO_PKG_VERSION")
    );
    println!("| motion of the camera | no blur | copies | shutter |\n| --- | --- | --- | --- |");
    for (name, motion, aperture_radius_m) in MOTIONS {
        let [sharp, copies, shutter] = errors(*motion, *aperture_radius_m)?;
        println!("| {name} | {sharp:.4} | {copies:.4} | {shutter:.4} |");
    }
    Ok(())
}

fn errors(motion: Motion, aperture_radius_m: f64) -> Result<[f64; 3]> {
    let mut scene = load()?;
    scene.lens.aperture_radius_m = aperture_radius_m;
    scene.lens.focus_distance_m = 2.5;
    let (truth, touched) = average(&scene, motion)?;
    let keys = (0..=32).map(|i| {
        let share = f64::from(i) / 32.0 - 0.5;
        (EXPOSURE_SECS * share, motion(share))
    });
    let path = CameraPath::new(keys.collect());
    scene.settings.rays_per_pixel = RAYS;

    let sharp = rendered(&scene, &path)?;
    scene.stages.motion_blur = Some(MotionBlurSettings {
        method: MotionBlurMethod::Copies,
        min_length_px: 1.0,
        ..MotionBlurSettings::default()
    });
    // The motion since the frame before is that of the exposure, where the shutter is open for all of the frame's time.
    let renderer = renderer(&scene, &path, 0)?;
    let moved = renderer.picture_motion(&NeighbourView {
        world_from_camera: motion(-1.0),
        time_secs: -EXPOSURE_SECS,
    });
    let film = renderer.film();
    let copied = finish(
        renderer.picture(),
        film,
        renderer.scene(),
        0,
        Some(&moved),
        None,
    )
    .picture;

    scene.stages.motion_blur = None;
    scene.shutter = Some(Shutter {
        exposure_secs: EXPOSURE_SECS,
        readout_secs: 0.0,
        samples: None,
        time_secs: 0.0,
    });
    let traced = rendered(&scene, &path)?;
    Ok([sharp, copied, traced].map(|picture| rms(&picture, &truth, &touched)))
}

fn load() -> Result<Scene> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, SCENE)?;
    Ok(mixray::scene::load(Path::new(&path))?)
}

fn renderer(scene: &Scene, path: &CameraPath, seed: u32) -> Result<Renderer> {
    let mut renderer = Renderer::new(scene.clone(), RendererOptions::default(), &Watcher::none())?;
    let mut camera = scene.camera.clone();
    camera.world_from_camera = path.pose(0.0).unwrap_or_default();
    renderer.set_frame(
        FrameEdit {
            photo: None,
            camera,
            lens: scene.lens,
            camera_path: path.clone(),
            time_secs: 0.0,
            seed,
            anchor: None,
            coarseness: 1,
        },
        &Watcher::none(),
    )?;
    renderer.advance(Budget::Complete, &Watcher::none())?;
    Ok(renderer)
}

fn rendered(scene: &Scene, path: &CameraPath) -> Result<Picture> {
    Ok(renderer(scene, path, 7)?.picture())
}

/// The mean of sharp frames at equal steps, and the pixels in which any of them shows an object.
fn average(scene: &Scene, motion: Motion) -> Result<(Vec<[f64; 3]>, Vec<bool>)> {
    let mut scene = scene.clone();
    scene.settings.rays_per_pixel = FRAME_RAYS;
    let mut renderer = Renderer::new(scene.clone(), RendererOptions::default(), &Watcher::none())?;
    let count = renderer.film().pixels.len();
    let mut sums = vec![[0.0; 3]; count];
    let mut touched = vec![false; count];
    for frame in 0..FRAMES {
        let mut camera = scene.camera.clone();
        camera.world_from_camera = motion((f64::from(frame) + 0.5) / f64::from(FRAMES) - 0.5);
        renderer.set_frame(
            FrameEdit {
                photo: None,
                camera,
                lens: scene.lens,
                camera_path: CameraPath::default(),
                time_secs: 0.0,
                seed: 1000 + frame,
                anchor: None,
                coarseness: 1,
            },
            &Watcher::none(),
        )?;
        renderer.advance(Budget::Complete, &Watcher::none())?;
        for (sum, value) in sums.iter_mut().zip(renderer.picture().linear) {
            for c in 0..3 {
                sum[c] += f64::from(value[c]) / f64::from(FRAMES);
            }
        }
        for (touched, sums) in touched.iter_mut().zip(&renderer.film().pixels) {
            *touched |= sums.m > 0;
        }
    }
    Ok((sums, touched))
}

fn rms(picture: &Picture, truth: &[[f64; 3]], touched: &[bool]) -> f64 {
    let squares = (picture.linear.iter().zip(truth).zip(touched)).filter(|(_, touched)| **touched);
    let (mut sum, mut count) = (0.0, 0.0);
    for ((value, truth), _) in squares {
        for c in 0..3 {
            sum += (f64::from(value[c]) - truth[c]).powi(2);
            count += 1.0;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}
