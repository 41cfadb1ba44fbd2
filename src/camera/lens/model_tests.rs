//! The rational, thin-prism and fisheye models against OpenCV's own projection, finite differences and round trips.

use bytemuck::Zeroable;
use glam::{DMat4, DVec3};

use super::*;
use crate::camera::splat::lens_connect;
use crate::distortion::{Distortion, distort};
use crate::math::{hash_u32, uniform_from_bits};
use crate::pack::camera::frame_camera;
use crate::packed::NONE;
use crate::scene::projection::{check_distortion, check_reach, project, undistort};
use crate::scene::{Camera, Lens};

const FISHEYE: [f64; 4] = [0.05, -0.02, 0.004, -0.0005];
const RATIONAL: [f64; 12] = [
    0.2, -0.05, 0.001, -0.0015, 0.002, 0.35, 0.02, 0.001, 0.0012, -0.0008, 0.0006, 0.0004,
];

fn camera(distortion: Distortion, focal_px: f64) -> Camera {
    Camera {
        width: 640,
        height: 480,
        fx: focal_px,
        fy: focal_px * 31.0 / 30.0,
        cx: 320.0,
        cy: 240.0,
        distortion,
        world_from_camera: DMat4::from_translation(DVec3::new(0.4, 1.2, -0.7))
            * DMat4::from_rotation_y(0.7),
    }
}

/// A wide fisheye whose corners look 77 degrees off the axis, and a lens of twelve coefficients.
fn cameras() -> [Camera; 3] {
    let rational = Distortion::opencv(&RATIONAL).expect("twelve");
    [
        // Its corners look 122 degrees off the axis.
        camera(Distortion::fisheye([0.0; 4]), 190.0),
        camera(Distortion::fisheye(FISHEYE), 300.0),
        camera(rational, 420.0),
    ]
}

fn frame(camera: &Camera, aperture_radius_m: f64) -> Frame {
    let mut frame = Frame::zeroed();
    let lens = Lens {
        aperture_radius_m,
        focus_distance_m: 2.0,
        ..Lens::PINHOLE
    };
    frame_camera(camera, &lens, DVec3::ZERO, &mut frame);
    frame
}

fn random(i: u32) -> f32 {
    uniform_from_bits(hash_u32(i.wrapping_add(1)))
}

/// Python: `cv2.fisheye.projectPoints` and `cv2.projectPoints` with fx 300, fy 310, cx 319.5, cy 239.5, OpenCV 4.
#[test]
fn models_follow_opencv() {
    let see = |lens: &Distortion, [x, y]: [f64; 2]| {
        let at = distort(lens.model, &lens.coefficients, [x, y]);
        [at[0] * 300.0 + 319.5, at[1] * 310.0 + 239.5]
    };
    let fisheye = Distortion::fisheye(FISHEYE);
    let twelve = Distortion::opencv(&RATIONAL).expect("twelve");
    let eight = Distortion::opencv(&RATIONAL[..8]).expect("eight");
    for (lens, ideal, seen) in [
        (
            &fisheye,
            [0.3, -0.2],
            [406.371_531_696_982_3, 179.655_167_053_189_96],
        ),
        (
            &fisheye,
            [-1.1, 0.7],
            [80.567_222_503_075_58, 396.616_402_171_72],
        ),
        (
            &fisheye,
            [2.5, 1.5],
            [651.777_828_349_786_7, 445.512_253_576_867_7],
        ),
        (
            &fisheye,
            [-6.0, 2.0],
            [-100.632_155_505_261_5, 384.212_186_896_256_75],
        ),
        (
            &twelve,
            [0.3, -0.2],
            [407.587_553_110_953, 178.873_184_879_121_23],
        ),
        (
            &twelve,
            [-1.1, 0.7],
            [77.158_827_137_870_05, 399.502_536_700_249_1],
        ),
        (
            &eight,
            [0.3, -0.2],
            [407.544_809_110_953_05, 178.846_909_279_121_27],
        ),
        (
            &eight,
            [-1.1, 0.7],
            [77.240_427_137_870_03, 398.827_976_700_249_1],
        ),
    ] {
        let found = see(lens, ideal);
        assert!((found[0] - seen[0]).abs() < 1e-9, "{ideal:?}: {found:?}");
        assert!((found[1] - seen[1]).abs() < 1e-9, "{ideal:?}: {found:?}");
    }
    let pinhole = see(&Distortion::NONE, [2.5, 1.5]);
    assert!((pinhole[0] - 651.777_8).abs() > 100.0, "control");
}

#[test]
fn rays_and_projection_are_inverse() {
    for camera in cameras() {
        check_distortion(&camera).expect("reaches every pixel");
        let frame = frame(&camera, 0.0);
        let pinhole = self::frame(
            &Camera {
                distortion: Distortion::NONE,
                ..camera.clone()
            },
            0.0,
        );
        let (mut worst, mut control) = (0.0f64, 0.0f64);
        for i in 0..2000 {
            let (x, y) = (random(i) * 640.0, random(i + 5000) * 480.0);
            let (px, py) = (f64::from(x), f64::from(y));
            let ray = camera_ray(&frame, x, y, 0.0, 0.0);
            let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * 2.5;
            let seen = project(&camera, point).expect("in front");
            worst = worst.max((seen.x - px).abs().max((seen.y - py).abs()));
            let again = camera_project(&frame, point.as_vec3());
            assert!(again.valid || !(0.01..639.9).contains(&x) || !(0.01..479.9).contains(&y));
            assert!((f64::from(again.px) - px).abs() < 3e-3, "{}", again.px);
            let other = camera_ray(&pinhole, x, y, 0.0, 0.0);
            control = control.max(f64::from(other.direction.distance(ray.direction)));
        }
        assert!(worst < 2e-3, "{worst}");
        assert!(control > 0.1, "control: a pinhole looks elsewhere");
    }
}

/// Area per ideal area against the f64 model's finite differences, out to the corners.
#[test]
fn a_pixels_area_is_that_of_finite_differences() {
    const STEP: f64 = 1e-5;
    for camera in cameras().into_iter().skip(1) {
        let (frame, lens) = (frame(&camera, 0.0), camera.distortion);
        for i in 0..500 {
            let (px, py) = (random(i) * 640.0, random(i + 999) * 480.0);
            let at = undistort(&camera, px.into(), py.into()).expect("inside");
            let see = |dx: f64, dy: f64| {
                distort(lens.model, &lens.coefficients, [at[0] + dx, at[1] + dy])
            };
            let [right, left] = [see(STEP, 0.0), see(-STEP, 0.0)];
            let [down, up] = [see(0.0, STEP), see(0.0, -STEP)];
            let along = |a: [f64; 2], b: [f64; 2]| {
                [(a[0] - b[0]) / (2.0 * STEP), (a[1] - b[1]) / (2.0 * STEP)]
            };
            let (x, y) = (along(right, left), along(down, up));
            let wanted = (x[0] * y[1] - x[1] * y[0]).abs();
            let found = f64::from(lens_area(&frame, at[0] as f32, at[1] as f32));
            assert!(
                (found / wanted - 1.0).abs() < 1e-3,
                "{px} {py}: {found} {wanted}"
            );
            assert!((found * 1.01 / wanted - 1.0).abs() > 1e-3, "control");
        }
    }
}

/// Light that goes back along a camera ray, pinhole or not, lands in the pixel that the ray came from.
#[test]
fn light_lands_where_rays_come_from() {
    for camera in cameras() {
        for aperture_radius_m in [0.0, 0.01] {
            if check_reach(&camera, aperture_radius_m).is_err() {
                continue;
            }
            let frame = frame(&camera, aperture_radius_m);
            let pose = camera_pose(&frame);
            let mut lost = 0;
            for i in 0..1000 {
                let (x, y) = (random(i) * 638.0 + 1.0, random(i + 777) * 478.0 + 1.0);
                let (u, v) = (random(i + 1234), random(i + 4321));
                let ray = camera_ray(&frame, x, y, u, v);
                let connection =
                    lens_connect(&frame, &pose, ray.origin + ray.direction * 3.0, u, v);
                let pixel = y as u32 * 640 + x as u32;
                let is_near_border =
                    x.fract() < 0.02 || x.fract() > 0.98 || y.fract() < 0.02 || y.fract() > 0.98;
                lost += u32::from(connection.pixel == NONE);
                assert!(is_near_border || connection.pixel == pixel, "{x} {y}");
                assert!(connection.direction.distance(-ray.direction) < 1e-4);
            }
            assert_eq!(lost, 0);
        }
    }
}

/// The integral of the importance over a pixel's solid angle is 1, whatever the lens.
#[test]
fn a_pixel_collects_one_pixels_light() {
    for camera in cameras() {
        let frame = frame(&camera, 0.0);
        let pose = camera_pose(&frame);
        for (column, row) in [(320u32, 240u32), (20, 30), (630, 470), (600, 100)] {
            const CELLS: u32 = 24;
            let direction =
                |x: f32, y: f32| camera_ray(&frame, x, y, 0.0, 0.0).direction.as_dvec3();
            let mut sum = 0.0;
            for i in 0..CELLS * CELLS {
                let cell = 1.0 / CELLS as f32;
                let (x, y) = (
                    column as f32 + (i % CELLS) as f32 * cell,
                    row as f32 + (i / CELLS) as f32 * cell,
                );
                let [a, b, c] = [
                    direction(x, y),
                    direction(x + cell, y),
                    direction(x, y + cell),
                ];
                let solid_angle = (b - a).cross(c - a).length();
                let middle = direction(x + 0.5 * cell, y + 0.5 * cell).as_vec3();
                let seen = lens_connect(&frame, &pose, pose.position + middle * 2.0, 0.0, 0.0);
                assert_eq!(seen.pixel, row * 640 + column);
                sum += solid_angle * f64::from(seen.importance);
            }
            assert!((sum - 1.0).abs() < 0.02, "{column} {row}: {sum}");
        }
    }
}

#[test]
fn an_open_lens_that_looks_too_far_aside_is_refused() {
    let wide = camera(Distortion::fisheye([0.0; 4]), 240.0);
    check_distortion(&wide).expect("95 degrees, as a pinhole");
    check_reach(&wide, 0.0).expect("a pinhole");
    let refused = check_reach(&wide, 0.01).expect_err("the corner is at 95 degrees");
    assert!(refused.to_string().contains("89 degrees"), "{refused}");
    let narrow = camera(Distortion::fisheye([0.0; 4]), 270.0);
    check_reach(&narrow, 0.01).expect("control: 85 degrees");
    let back = camera(Distortion::fisheye([0.0; 4]), 120.0);
    assert!(check_distortion(&back).is_err(), "beyond straight back");
}
