//! Rays against the thin-lens formulas, apertures by chi-squared, the distortion by round trips.

use super::super::chi_squared::{assert_uniform, critical, statistic};
use super::*;
use crate::distortion::{self, Distortion};
use crate::math::{hash_u32, uniform_from_bits};
use crate::pack::camera::frame_camera;
use crate::scene::projection::{LensError, check_distortion, project, undistort};
use crate::scene::{Aperture, Camera, Lens};
use glam::{DMat4, DVec3};

fn camera(distortion: [f64; 5]) -> Camera {
    camera_with(Distortion::opencv(&distortion).expect("five"))
}

fn camera_with(distortion: Distortion) -> Camera {
    let rotation = DMat4::from_rotation_y(0.7) * DMat4::from_rotation_x(-0.3);
    Camera {
        width: 640,
        height: 480,
        fx: 520.9,
        fy: 521.0,
        cx: 325.6,
        cy: 250.2,
        distortion,
        world_from_camera: DMat4::from_translation(DVec3::new(0.4, 1.2, -0.7)) * rotation,
    }
}

fn lens(aperture_radius_m: f64, focus_distance_m: f64, aperture: Aperture) -> Lens {
    Lens {
        aperture_radius_m,
        focus_distance_m,
        aperture,
        blade_rotation_deg: 20.0,
        focal_length_m: 0.0,
    }
}

fn frame(camera: &Camera, lens: &Lens) -> Frame {
    let mut frame: Frame = bytemuck::Zeroable::zeroed();
    frame_camera(camera, lens, DVec3::ZERO, &mut frame);
    frame
}

const NONE: [f64; 5] = [0.0; 5];
/// A mild and a strong barrel, a pincushion, and the calibration of a depth camera's colour sensor.
const DISTORTIONS: [[f64; 5]; 4] = [
    [-0.05, 0.01, 0.0, 0.0, 0.0],
    [-0.28, 0.09, 0.0005, -0.0003, -0.01],
    [0.12, 0.05, -0.001, 0.002, 0.0],
    [0.2312, -0.7849, -0.0033, -0.0001, 0.9172],
];

fn random(i: u32) -> f32 {
    uniform_from_bits(hash_u32(i.wrapping_add(1)))
}

/// The depth along the view axis at which `ray` is, and its position there in camera axes (right, up).
fn at_depth(camera: &Camera, ray: &CameraRay, depth: f64) -> [f64; 2] {
    let view = camera.world_from_camera.inverse();
    let o = view.transform_point3(ray.origin.as_dvec3());
    let d = view.transform_vector3(ray.direction.as_dvec3());
    let t = (-depth - o.z) / d.z;
    [o.x + d.x * t, o.y + d.y * t]
}

#[test]
fn pinhole_ray_goes_through_its_pixel() {
    let camera = camera(NONE);
    let frame = frame(&camera, &lens(0.0, 1.0, Aperture::Disc));
    for (px, py) in [(0.0, 0.0), (325.6, 250.2), (639.5, 10.25), (100.0, 479.0)] {
        let ray = camera_ray(&frame, px, py, 0.3, 0.9);
        let seen = project(
            &camera,
            ray.origin.as_dvec3() + ray.direction.as_dvec3() * 3.0,
        )
        .expect("in front");
        assert!((seen.x - f64::from(px)).abs() < 1e-3 && (seen.y - f64::from(py)).abs() < 1e-3);
        // One pixel further down is another ray.
        assert!((seen.y - f64::from(py + 1.0)).abs() > 0.9);
    }
    // Pixel y runs down, the camera looks along -Z.
    let mut still = camera.clone();
    still.world_from_camera = DMat4::IDENTITY;
    let frame = self::frame(&still, &lens(0.0, 1.0, Aperture::Disc));
    let ray = camera_ray(&frame, 640.0, 480.0, 0.0, 0.0);
    assert!(ray.direction.x > 0.0 && ray.direction.y < 0.0 && ray.direction.z < 0.0);
}

#[test]
fn aperture_zero_ignores_the_lens_bit_for_bit() {
    let bits = |r: CameraRay| [r.origin, r.direction].map(|w| w.to_array().map(f32::to_bits));
    let pinhole = frame(&camera(NONE), &lens(0.0, 1.0, Aperture::Disc));
    for case in 0..256 {
        let random = |i: u32| uniform_from_bits(hash_u32(case * 8 + i));
        let (px, py) = (640.0 * random(0), 480.0 * random(1));
        let (u, v) = (random(2), random(3));
        let focus_m = f64::from(100.0 * random(4)) + 0.01;
        let aperture = match hash_u32(case * 8 + 5) % 9 {
            0 | 2 => Aperture::Disc,
            1 => Aperture::Square,
            blades => Aperture::Blades(blades),
        };
        let expected = bits(camera_ray(&pinhole, px, py, 0.0, 0.0));
        let closed = frame(&camera(NONE), &lens(0.0, focus_m, aperture));
        assert_eq!(
            bits(camera_ray(&closed, px, py, u, v)),
            expected,
            "{case}: {aperture:?}"
        );
        // An open lens differs unless the sample is its centre.
        let open = frame(&camera(NONE), &lens(0.01, focus_m, aperture));
        if (u - 0.5).abs() > 0.1 && (v - 0.5).abs() > 0.1 {
            assert_ne!(
                bits(camera_ray(&open, px, py, u, v)),
                expected,
                "{case}: {aperture:?}"
            );
        }
    }
}

#[test]
fn anchor_is_subtracted_in_f64() {
    let mut far = camera(NONE);
    far.world_from_camera.w_axis += DVec3::new(1e6, -2e6, 3e6).extend(0.0);
    let anchor = DVec3::new(1e6, -2e6, 3e6);
    let mut frame: Frame = bytemuck::Zeroable::zeroed();
    frame_camera(&far, &lens(0.0, 1.0, Aperture::Disc), anchor, &mut frame);
    assert!((frame.camera_position[0] - 0.4).abs() < 1e-7);
    assert!((frame.camera_position[2] + 0.7).abs() < 1e-7);
}

#[test]
fn focus_lies_on_a_plane() {
    for focus in [0.4, 1.2, 30.0] {
        let camera = camera(NONE);
        let frame = frame(&camera, &lens(0.02, focus, Aperture::Disc));
        let pinhole = self::frame(&camera, &lens(0.0, focus, Aperture::Disc));
        for i in 0..200 {
            let (px, py) = (random(i) * 640.0, random(i + 1000) * 480.0);
            let want = at_depth(&camera, &camera_ray(&pinhole, px, py, 0.0, 0.0), focus);
            for k in 0..8 {
                let ray = camera_ray(&frame, px, py, random(i + k), random(i + k + 77));
                let found = at_depth(&camera, &ray, focus);
                let miss = (found[0] - want[0]).hypot(found[1] - want[1]);
                assert!(miss < 2e-6 * (1.0 + focus), "off by {miss} m at {focus} m");
            }
        }
        // On a sphere of that radius the corner would be out of focus: the plane is the only place where rays meet.
        let corner = [0.1, 0.9].map(|u| camera_ray(&frame, 1.0, 1.0, u, u));
        let on_sphere = focus * 0.8;
        let [a, b] = corner.map(|r| at_depth(&camera, &r, on_sphere));
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) > 1e-3);
    }
}

#[test]
fn infinite_focus_gives_parallel_rays() {
    let camera = camera(NONE);
    let frame = frame(&camera, &lens(0.05, f64::INFINITY, Aperture::Blades(6)));
    let pinhole = self::frame(&camera, &lens(0.0, 1.0, Aperture::Disc));
    let want = camera_ray(&pinhole, 17.0, 400.0, 0.0, 0.0);
    for i in 0..50 {
        let ray = camera_ray(&frame, 17.0, 400.0, random(i), random(i + 50));
        assert_eq!(ray.direction, want.direction);
        assert!((ray.origin - want.origin).length() <= 0.05001);
        assert!(ray.direction.is_finite() && ray.origin.is_finite());
    }
}

/// The photograph position from which the lens point (u, v) sees `point`: the ray's position at the point's depth is affine in the
/// pixel, so two rays an axis give it.
fn image_of(camera: &Camera, frame: &Frame, point: [f64; 3], u: f32, v: f32) -> [f64; 2] {
    let at = |px, py| at_depth(camera, &camera_ray(frame, px, py, u, v), point[2]);
    let (origin, x, y) = (at(0.0, 0.0), at(640.0, 0.0), at(0.0, 480.0));
    [
        640.0 * (point[0] - origin[0]) / (x[0] - origin[0]),
        480.0 * (point[1] - origin[1]) / (y[1] - origin[1]),
    ]
}

#[test]
fn circle_of_confusion_has_the_thin_lens_diameter() {
    let camera = camera(NONE);
    for (radius, focus) in [(0.01, 1.2), (0.004, 0.5), (0.03, 8.0)] {
        let frame = frame(&camera, &lens(radius, focus, Aperture::Disc));
        for d in [0.3, 0.9, 1.1, 3.0, 50.0] {
            let point = [0.11 * d, -0.07 * d, d];
            let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
            let side = 64;
            for i in 0..=side {
                // The rim of the unit square is the rim of the disc.
                let t = (i as f32 / side as f32).min(0.999_999_9);
                for (u, v) in [(t, 0.0), (t, 0.999_999_9), (0.0, t), (0.999_999_9, t)] {
                    let seen = image_of(&camera, &frame, point, u, v);
                    for k in 0..2 {
                        low[k] = low[k].min(seen[k]);
                        high[k] = high[k].max(seen[k]);
                    }
                }
            }
            for (k, focal_px) in [(0, camera.fx), (1, camera.fy)] {
                let want = 2.0 * radius * (d - focus).abs() / d * focal_px / focus;
                let found = high[k] - low[k];
                assert!(
                    (found - want).abs() < 2e-3 * want + 2e-3,
                    "radius {radius}, focus {focus}, distance {d}: {found} px, formula {want} px"
                );
                // The control: the formula without its 1 / d is another number.
                if (d - 1.0).abs() > 0.2 && want > 1.0 {
                    assert!((found - want * d).abs() > 0.02 * want);
                }
            }
        }
    }
}

/// Chi-squared over equal areas: `cell` maps a lens point to its cell or to None outside the shape.
fn aperture_counts(
    frame: &Frame,
    cells: usize,
    cell: impl Fn([f64; 2]) -> Option<usize>,
) -> Vec<u32> {
    let mut counts = vec![0; cells];
    for i in 0..200_000u32 {
        let at = sample_lens(frame, random(2 * i), random(2 * i + 1));
        let inside = cell(at.map(f64::from)).expect("the sample lies in the aperture");
        counts[inside] += 1;
    }
    counts
}

/// Equal-area cells of a disc: rings by r^2, sectors by angle.
fn disc_cell(radius: f64) -> impl Fn([f64; 2]) -> Option<usize> {
    move |[x, y]| {
        let r2 = (x * x + y * y) / (radius * radius);
        let turns = (y.atan2(x) / std::f64::consts::TAU).rem_euclid(1.0);
        (r2 <= 1.0 + 1e-6)
            .then(|| ((r2 * 8.0) as usize).min(7) * 16 + ((turns * 16.0) as usize).min(15))
    }
}

#[test]
fn disc_is_uniform() {
    let frame = frame(&camera(NONE), &lens(0.02, 1.0, Aperture::Disc));
    let counts = aperture_counts(&frame, 128, disc_cell(0.02));
    assert_uniform("disc", &counts);
    assert_eq!(sample_lens(&frame, 0.5, 0.5), [0.0, 0.0]);
}

#[test]
fn square_is_uniform() {
    let frame = frame(&camera(NONE), &lens(0.02, 1.0, Aperture::Square));
    let (s, c) = 20.0_f64.to_radians().sin_cos();
    let counts = aperture_counts(&frame, 100, |[x, y]| {
        let (a, b) = ((x * c + y * s) / 0.02, (y * c - x * s) / 0.02);
        let index = |t: f64| (((t + 1.0) * 5.0) as usize).min(9);
        (a.abs() <= 1.0 + 1e-5 && b.abs() <= 1.0 + 1e-5).then(|| index(a) * 10 + index(b))
    });
    assert_uniform("square", &counts);
}

#[test]
fn polygon_is_uniform() {
    for blades in [3u32, 5, 6, 9] {
        let frame = frame(&camera(NONE), &lens(0.02, 1.0, Aperture::Blades(blades)));
        let n = f64::from(blades);
        let apothem = 0.02 * (std::f64::consts::PI / n).cos();
        // Cells: blade, then shells of equal area, then halves.
        let counts = aperture_counts(&frame, blades as usize * 16, |[x, y]| {
            let turns = (y.atan2(x) / std::f64::consts::TAU - 20.0 / 360.0).rem_euclid(1.0);
            let blade = ((turns * n) as usize).min(blades as usize - 1);
            let middle = (20.0_f64 / 360.0 + (blade as f64 + 0.5) / n) * std::f64::consts::TAU;
            let along = (x * middle.cos() + y * middle.sin()) / apothem;
            let across = y * middle.cos() - x * middle.sin();
            (along <= 1.0 + 1e-5).then(|| {
                let shell = ((along * along * 8.0) as usize).min(7);
                blade * 16 + shell * 2 + usize::from(across > 0.0)
            })
        });
        assert_uniform(&format!("{blades} blades"), &counts);
        // The corner stands at the rotation angle and at the aperture radius.
        let corner = sample_lens(&frame, 0.999_999_9 / blades as f32, 0.0);
        assert!((corner[0].hypot(corner[1]) - 0.02).abs() < 1e-5);
        let angle = corner[1].atan2(corner[0]).to_degrees();
        assert!((angle - 20.0).abs() < 0.1, "corner at {angle}");
    }
}

#[test]
fn uniformity_test_sees_the_polar_map_without_its_square_root() {
    let mut counts = [0u32; 128];
    let cell = disc_cell(1.0);
    for i in 0..200_000u32 {
        let (r, t) = (f64::from(random(2 * i)), f64::from(random(2 * i + 1)));
        let (s, c) = (t * std::f64::consts::TAU).sin_cos();
        counts[cell([r * c, r * s]).expect("in the disc")] += 1;
    }
    assert!(statistic(&counts) > critical(128));
}

#[test]
fn distortion_round_trips() {
    for k in DISTORTIONS {
        let camera = camera(k);
        check_distortion(&camera).expect("a real lens");
        let frame = frame(&camera, &lens(0.0, 1.0, Aperture::Disc));
        let (mut worst_f64, mut worst_f32) = (0.0_f64, 0.0_f64);
        for i in 0..2000 {
            let (x, y) = (random(i) * 640.0, random(i + 5000) * 480.0);
            let (px, py) = (f64::from(x), f64::from(y));
            let ideal = undistort(&camera, px, py).expect("inside");
            let view = DVec3::new(ideal[0], -ideal[1], -1.0) * 2.5;
            let back = project(&camera, camera.world_from_camera.transform_point3(view))
                .expect("in front");
            worst_f64 = worst_f64.max((back.x - px).abs().max((back.y - py).abs()));
            let ray = camera_ray(&frame, x, y, 0.0, 0.0);
            let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * 2.5;
            let seen = project(&camera, point).expect("in front");
            worst_f32 = worst_f32.max((seen.x - px).abs().max((seen.y - py).abs()));
            let again = camera_project(&frame, point.as_vec3());
            assert!(again.valid || x < 0.01 || y < 0.01 || x > 639.99 || y > 479.99);
            assert!(
                (f64::from(again.px) - px).abs() < 2e-3 && (f64::from(again.py) - py).abs() < 2e-3
            );
            assert!((f64::from(again.depth) - seen.z).abs() < 1e-5);
        }
        eprintln!("{k:?}: round trip {worst_f64:.1e} px in f64, {worst_f32:.1e} px in f32");
        assert!(worst_f64 < 1e-9, "{worst_f64}");
        assert!(worst_f32 < 1e-3, "{worst_f32}");
        // The control: without the distortion the same points are elsewhere.
        let ideal = undistort(&camera, 5.0, 5.0).expect("inside");
        assert!((ideal[0] * camera.fx + camera.cx - 5.0).abs() > 0.1);
    }
}

#[test]
fn distortion_follows_opencv() {
    // cv2.projectPoints by hand: x = 0.3, y = -0.2, r^2 = 0.13.
    let k: [f64; 5] = [-0.1, 0.02, 0.003, -0.004, 0.005];
    let radial = 1.0 - 0.1 * 0.13 + 0.02 * 0.0169 + 0.005 * 0.002_197;
    let want = [
        0.3 * radial + 2.0 * 0.003 * -0.06 - 0.004 * (0.13 + 0.18),
        -0.2 * radial + 0.003 * (0.13 + 0.08) + 2.0 * -0.004 * -0.06,
    ];
    let lens = Distortion::opencv(&k).expect("five");
    let found = distortion::distort(lens.model, &lens.coefficients, [0.3, -0.2]);
    assert!((found[0] - want[0]).abs() < 1e-15 && (found[1] - want[1]).abs() < 1e-15);
}

#[test]
fn folded_distortion_is_refused() {
    // r (1 - 0.9 r^2) turns back at r = 0.61, inside this photograph's corner.
    let folded = camera([-0.9, 0.0, 0.0, 0.0, 0.0]);
    assert!(matches!(
        check_distortion(&folded),
        Err(LensError::NotInvertible { .. })
    ));
    assert!(undistort(&folded, 325.6, 250.2).is_ok());
    assert!(undistort(&folded, 0.0, 0.0).is_err());
    // A later term brings the curve back up: the far sheet has a solution, but not one that a ray can use.
    let returning = camera([-0.9, 0.0, 0.0, 0.0, 0.4]);
    assert!(undistort(&returning, 0.0, 0.0).is_err());
    // Past the fold nothing projects, although the polynomial lands inside the photograph.
    let world = |x: f64| {
        folded
            .world_from_camera
            .transform_point3(DVec3::new(x, 0.0, -1.0))
    };
    assert!(project(&folded, world(0.5)).is_some());
    assert!(project(&folded, world(1.0)).is_none());
    let frame = frame(&folded, &lens(0.0, 1.0, Aperture::Disc));
    assert!(camera_project(&frame, world(0.3).as_vec3()).valid);
    assert!(!camera_project(&frame, world(1.0).as_vec3()).valid);
    assert!(!camera_project(&frame, world(20.0).as_vec3()).valid);
}

#[test]
fn points_behind_the_camera_do_not_project() {
    let camera = camera(NONE);
    let behind = camera.world_from_camera.transform_point3(DVec3::Z);
    assert!(project(&camera, behind).is_none());
    let frame = frame(&camera, &lens(0.0, 1.0, Aperture::Disc));
    assert!(!camera_project(&frame, behind.as_vec3()).valid);
}

#[test]
fn rays_stay_finite_whatever_the_distortion() {
    for i in 0..300 {
        let k = [0, 1, 2, 3, 4].map(|d| f64::from(random(i * 5 + d) - 0.5) * 4.0);
        let frame = frame(&camera(k), &lens(0.01, 1.0, Aperture::Disc));
        for (px, py) in [(0.0, 0.0), (639.0, 3.0), (325.6, 250.2)] {
            let ray = camera_ray(&frame, px, py, 0.2, 0.7);
            assert!(ray.origin.is_finite() && ray.direction.is_finite(), "{k:?}");
        }
    }
}
