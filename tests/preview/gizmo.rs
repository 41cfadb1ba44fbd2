//! Arrows and rings: each moves or turns along its own axis, by what the camera's projection says.

use glam::DVec3;
use mixray::preview::composition::{Placement, Rotation};
use mixray::preview::gizmo::Handle;
use mixray::preview::headless::{self, Window};
use mixray::preview::script::{Step, parse};

use super::{FRAME_TIME, folder, window};

/// The scene's camera, written down once more: 64 x 48 pixels, 40 degrees high, from (0, 1, 3) to the origin.
fn ray(pixel: [f64; 2]) -> (DVec3, DVec3) {
    let focal_px = 24.0 / 20.0_f64.to_radians().tan();
    let origin = DVec3::new(0.0, 1.0, 3.0);
    let forward = -origin.normalize();
    let right = DVec3::X;
    let up = right.cross(forward);
    let [x, y] = [pixel[0] - 32.0, 24.0 - pixel[1]];
    (
        origin,
        (forward * focal_px + right * x + up * y).normalize(),
    )
}

/// Where the axis comes nearest to the ray, by bisection of its three thirds.
fn nearest_m(axis: DVec3, centre: DVec3, pixel: [f64; 2]) -> f64 {
    let (origin, direction) = ray(pixel);
    let apart = |metres: f64| {
        let from = centre + axis * metres - origin;
        from.cross(direction).length()
    };
    let (mut low, mut high) = (-10.0, 10.0);
    for _ in 0..200 {
        let third = (high - low) / 3.0;
        match apart(low + third) < apart(high - third) {
            true => high -= third,
            false => low += third,
        }
    }
    0.5 * (low + high)
}

fn ball(window: &Window) -> Placement {
    let object = window.session().object("ball").unwrap();
    window.session().composition().unwrap().objects[object]
}

/// Where the handle is caught and where it is left, pixels.
fn pull(window: &mut Window, handle: Handle, by: [f64; 2]) -> [[f64; 2]; 2] {
    let step = Step::Select("ball".to_owned());
    window.step(&step, &mut |_| ()).unwrap();
    let from = window.app().grip(handle).unwrap().to_array();
    window.step(&Step::Pull(handle, by), &mut |_| ()).unwrap();
    [from, [from[0] + by[0], from[1] + by[1]]]
}

#[test]
fn an_arrow_moves_one_coordinate_by_what_the_projection_says() {
    for scale in [1.0, 2.0] {
        let folder = folder();
        let mut window = window(&folder);
        window.step(&Step::Scale(scale), &mut |_| ()).unwrap();
        for (handle, axis, by) in [
            (Handle::MoveX, DVec3::X, [5.0, 1.0]),
            (Handle::MoveY, DVec3::Y, [-1.0, -4.0]),
            (Handle::MoveZ, DVec3::Z, [0.5, 3.0]),
        ] {
            let before = ball(&window);
            let [from, to] = pull(&mut window, handle, by);
            let after = ball(&window);
            let moved = after.translation - before.translation;
            let [start, end] = [from, to].map(|pixel| nearest_m(axis, before.translation, pixel));
            assert!(
                (moved.dot(axis) - (end - start)).abs() < 1e-4,
                "{handle:?} at {scale}: {moved}, expected {}",
                end - start
            );
            assert!((end - start).abs() > 0.05, "control: it is dragged");
            let aside = moved - axis * moved.dot(axis);
            assert_eq!(aside, DVec3::ZERO, "{handle:?}: no other coordinate");
            assert_eq!(
                (after.rotation, after.scale),
                (before.rotation, before.scale)
            );
            window.session_mut().undo();
            assert_eq!(ball(&window), before, "one step back");
        }
    }
}

#[test]
fn a_ring_turns_about_its_axis_by_the_angle_of_the_pointer() {
    let folder = folder();
    let mut window = window(&folder);
    let before = ball(&window);
    let [from, to] = pull(&mut window, Handle::TurnY, [-7.0, 1.0]);
    let after = ball(&window);
    // On the plane of the ring, about +Y from +Z to +X.
    let angle_deg = |pixel: [f64; 2]| {
        let (origin, direction) = ray(pixel);
        let at = origin + direction * ((before.translation.y - origin.y) / direction.y);
        let from_centre = at - before.translation;
        from_centre.x.atan2(from_centre.z).to_degrees()
    };
    let turned = (angle_deg(to) - angle_deg(from) + 540.0).rem_euclid(360.0) - 180.0;
    let Rotation::EulerDeg(deg) = after.rotation else {
        panic!("degrees: {after:?}")
    };
    assert!(turned.abs() > 5.0, "control: {turned}");
    assert!(
        (deg - DVec3::new(0.0, turned, 0.0)).length() < 0.01,
        "{deg}, expected {turned}"
    );
    assert_eq!(
        (after.translation, after.scale),
        (before.translation, before.scale)
    );
}

#[test]
fn without_the_gizmo_nothing_of_the_kind_happens() {
    let folder = folder();
    let mut window = window(&folder);
    let before = ball(&window);
    let [from, to] = pull(&mut window, Handle::MoveY, [0.0, -4.0]);
    let moved = ball(&window);
    assert!(moved.translation.y > before.translation.y, "it is lifted");
    window.session_mut().undo();
    window.press("Gizmo").unwrap();
    assert_eq!(window.app().grip(Handle::MoveY), None);
    let step = Step::Pull(Handle::MoveY, [0.0, -4.0]);
    assert!(window.step(&step, &mut |_| ()).is_err());
    window.drag(from, to);
    assert!(
        (ball(&window).translation.y - 0.3).abs() < 1e-3,
        "it stays on the table"
    );
}

#[test]
fn a_script_pulls_and_looks() {
    let folder = folder();
    let script = "\
select ball
pull move-y 0 -6
expect unsaved
undo
expect position ball 0 0.3 0 within 0.000001
expect saved
redo
save
expect file-equals-window
";
    let steps = parse(script).unwrap();
    let scene = folder.path("scene.toml");
    headless::run(&scene, &steps, FRAME_TIME, &mut |_| ()).unwrap();
    let wrong = parse("expect position ball 0 0.3 0 within 0.000001").unwrap();
    let failed = headless::run(&scene, &wrong, FRAME_TIME, &mut |_| ()).unwrap_err();
    assert_eq!(failed.line, 1, "control: {failed:?}");
}
