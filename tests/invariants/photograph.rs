//! Invariants 1 and 2: what nothing virtual reaches is the photograph, bit for bit.

use std::path::Path;

use mixray::output::{PngBits, Target, write_png};
use mixray::renderer::{RayCounts, Renderer};
use mixray::scene::{BackendChoice, Photo, Scene};

use super::support::*;

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;

/// Every code value in some pixel, in no order.
fn codes(count: u32, levels: u32) -> Vec<u16> {
    (0..count)
        .map(|i| ((i.wrapping_mul(2_654_435_761) >> 8) ^ (i * 40_503)) % levels)
        .map(|code| code as u16)
        .collect()
}

fn write_photo(path: &Path, bits: PngBits) {
    let count = WIDTH * HEIGHT * 3;
    match bits {
        PngBits::Eight => {
            let codes = codes(count, 256).iter().map(|&c| c as u8).collect();
            image::RgbImage::from_raw(WIDTH, HEIGHT, codes)
                .expect("a picture")
                .save(path)
        }
        PngBits::Sixteen => {
            image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(WIDTH, HEIGHT, codes(count, 65_536))
                .expect("a picture")
                .save(path)
        }
    }
    .expect("the photograph is written");
}

/// The picture as written to a file and read back.
fn written(renderer: &Renderer, path: &Path, bits: PngBits) -> image::DynamicImage {
    let target = Target::picture(path).expect("a writable target");
    write_png(
        &target,
        &renderer.picture(),
        renderer.scene().photo.as_ref(),
        bits,
    )
    .expect("the picture is written");
    image::open(path).expect("the picture is read back")
}

fn without_virtual_things_the_photograph_comes_back(backend: BackendChoice) {
    for png_bits in [PngBits::Eight, PngBits::Sixteen] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let photo = folder.path().join("photo.png");
        write_photo(&photo, png_bits);
        let text = format!(
            "[photo]\nimage = {:?}\n{CAMERA}{TABLE}{LAMP}[environment]\nradiance = [1, 2, 3]\n\
             [lens]\naperture_radius_m = 0.1\nfocus_distance_m = 2\n",
            photo.to_str().expect("a Unicode path")
        );
        let original = image::open(&photo).expect("the photograph is read");
        let path = folder.path().join("out.png");

        let untouched = render(&scene(&text), backend);
        assert_eq!(untouched.rays(), RayCounts::default());
        assert!(written(&untouched, &path, png_bits) == original);

        let ball = "[[virtual]]\nshape = \"sphere\"\nsegments = 8\nscale = 0.1\ntranslation = [0, 0.1, 0]\n";
        let touched = render(&scene(&format!("{text}{ball}")), backend);
        assert!(touched.rays().primary > 0, "control");
        assert!(written(&touched, &path, png_bits) != original, "control");
    }
}

/// A proxy that fills only the middle of the picture, a box on it, the sun above.
fn small_stage(max_bounces: u32) -> Scene {
    let mut scene = scene(&format!(
        r#"{CAMERA}
[[real]]
shape = "quad"
corner = [-0.5, 0, 0.5]
edge_u = [1, 0, 0]
edge_v = [0, 0, -1]
material = {{ base_color = [0.6, 0.6, 0.6], specular = 0.0 }}

[[virtual]]
shape = "box"
size = [0.2, 0.2, 0.2]
translation = [0.1, 0.1, 0]

[[light]]
kind = "directional"
direction = [-0.5, -1, 0]
irradiance = [2, 2, 2]

[render]
rays_per_pixel = 16
max_bounces = {max_bounces}
"#
    ));
    let linear = (0..WIDTH * HEIGHT)
        .map(|i| {
            [
                0.2 + (i % 7) as f32 * 0.05,
                0.3,
                0.4 + (i % 5) as f32 * 0.03,
            ]
        })
        .collect();
    scene.photo = Some(photo_of(WIDTH, HEIGHT, linear));
    scene
}

/// Of the ray through photograph position (px, py), in f64.
fn camera_direction(scene: &Scene, px: f64, py: f64) -> glam::DVec3 {
    let camera = &scene.camera;
    camera.world_from_camera.transform_vector3(glam::DVec3::new(
        (px - camera.cx) / camera.fx,
        -(py - camera.cy) / camera.fy,
        -1.0,
    ))
}

/// Where the ray through photograph position (px, py) meets the plane y = height.
fn on_plane(scene: &Scene, px: f64, py: f64, height: f64) -> Option<glam::DVec3> {
    let direction = camera_direction(scene, px, py);
    let origin = scene.camera.world_from_camera.w_axis.truncate();
    let t = (height - origin.y) / direction.y;
    (t > 0.0).then(|| origin + direction * t)
}

/// Smallest distance from `to` over the pixel's corners, at a height; infinity above the horizon.
fn distance_on_plane(scene: &Scene, pixel: u32, height: f64, to: glam::DVec3) -> f64 {
    let (x, y) = (f64::from(pixel % WIDTH), f64::from(pixel / WIDTH));
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)]
        .iter()
        .filter_map(|(dx, dy)| on_plane(scene, x + dx, y + dy, height))
        .map(|p| p.distance(to))
        .fold(f64::INFINITY, f64::min)
}

fn changed(renderer: &Renderer) -> Vec<bool> {
    let photo: &Photo = renderer.scene().photo.as_ref().expect("a photograph");
    renderer
        .picture()
        .linear
        .iter()
        .zip(&photo.linear)
        .map(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits))
        .collect()
}

/// Distance of the ray through the pixel's centre from the origin.
fn distance_from_origin(scene: &Scene, pixel: u32) -> f64 {
    let (x, y) = (f64::from(pixel % WIDTH), f64::from(pixel / WIDTH));
    let origin = scene.camera.world_from_camera.w_axis.truncate();
    let direction = camera_direction(scene, x + 0.5, y + 0.5).normalize();
    origin.cross(direction).length()
}

fn pixels_off_the_proxy_are_the_photograph(backend: BackendChoice) {
    let scene = small_stage(4);
    let renderer = render(&scene, backend);
    let changed = changed(&renderer);
    let (mut off, mut untraced) = (0, 0);
    for pixel in 0..WIDTH * HEIGHT {
        let i = pixel as usize;
        // The proxy lies within 0.71 m of the origin, the box within 0.3 m of it and below y = 0.2.
        let far = |height| distance_on_plane(&scene, pixel, height, glam::DVec3::ZERO) > 0.75;
        if far(0.0) && far(0.2) {
            assert!(!changed[i], "pixel {pixel}");
            off += 1;
        }
        if distance_from_origin(&scene, pixel) > 0.8 {
            assert_eq!(renderer.film().pixels[i].n, 0, "pixel {pixel} is traced");
            untraced += 1;
        }
    }
    let touched = changed.iter().filter(|&&c| c).count();
    println!("{off} pixels off the proxy, {untraced} known to be untraced, {touched} changed");
    assert!(
        off > 50 && untraced > 10 && touched > 40,
        "control: there are all"
    );
}

/// At one bounce the sun reaches the proxy everywhere but in the shadow, so the difference elsewhere is exactly 0.
fn lit_pixels_outside_the_shadow_are_the_photograph(backend: BackendChoice) {
    let scene = small_stage(1);
    let renderer = render(&scene, backend);
    let changed = changed(&renderer);
    let box_centre = glam::DVec3::new(0.1, 0.1, 0.0);
    // Along the light from the box's centre to the table.
    let shadow_centre = box_centre + glam::DVec3::new(-0.5, -1.0, 0.0) * 0.1;
    // Half the box's diagonal, drawn out by the slope of the light; half a pixel.
    let reach = 0.1733 * 1.25_f64.sqrt() + 0.02;
    let (mut outside, mut inside) = (0, 0);
    for pixel in 0..WIDTH * HEIGHT {
        let near = |height: f64, centre| distance_on_plane(&scene, pixel, height, centre) < reach;
        let sees_box = [0.0, 0.1, 0.2].iter().any(|&h| near(h, box_centre));
        if sees_box || near(0.0, shadow_centre) {
            inside += usize::from(changed[pixel as usize]);
        } else {
            assert!(!changed[pixel as usize], "pixel {pixel}");
            outside += 1;
        }
    }
    println!("{inside} pixels changed by the box and its shadow, {outside} outside");
    assert!(inside > 15 && outside > 300, "control: there are both");
}

on_the_cpu!(
    without_virtual_things_the_photograph_comes_back,
    pixels_off_the_proxy_are_the_photograph,
    lit_pixels_outside_the_shadow_are_the_photograph,
);
