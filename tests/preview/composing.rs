//! A shot composed by hand: the file renders what the window showed.

use mixray::preview::composition::{CameraPose, Opening};
use mixray::preview::headless::{self, Window};
use mixray::preview::script::{Held, parse};
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{Lens, load};

use super::{FRAME_TIME, demo, folder, window};

/// Where the ball's middle is seen.
const BALL: [f64; 2] = [32.0, 19.0];

fn f_number(window: &Window) -> f64 {
    match window.session().composition().unwrap().lens.opening {
        Opening::FNumber { f_number, .. } => f_number,
        Opening::RadiusM(_) => panic!("the scene has an f-number"),
    }
}

fn focus_m(window: &Window) -> f64 {
    window
        .session()
        .composition()
        .unwrap()
        .lens
        .focus_distance_m
}

#[test]
fn the_demo_is_composed_saved_and_rendered_alike() {
    let folder = demo();
    let scene = folder.path("scene.toml");
    let (x, y) = (369, 204);
    // The depth of the film at that pixel, through a pinhole.
    let depth = {
        let mut scene = load(&scene).unwrap();
        scene.lens = Lens::PINHOLE;
        let options = RendererOptions {
            guides: true,
            ..RendererOptions::default()
        };
        let mut renderer = Renderer::new(scene, options, &Watcher::none()).unwrap();
        renderer
            .advance(Budget::Complete, &Watcher::none())
            .unwrap();
        let depth = renderer.planes().depth;
        [depth[y * 640 + x], depth[y * 640 + 100]]
    };
    assert!(
        (depth[0] / depth[1] - 1.0).abs() > 0.02,
        "control: {depth:?}"
    );
    let script = format!(
        "\
click {x}.5 {y}.5
expect focus_distance_m {} within 1%
expect unsaved
drag 369 204 to 300 300
expect rests knot within 0.001
set f_number 4
undo
expect f_number 1.8
redo
expect f_number 4
save
expect saved
expect file-equals-window
set seed 7
expect file-differs-from-window
reload
expect focus_distance_m {} within 1%
expect rests knot within 0.001
expect file-equals-window
",
        depth[0], depth[0]
    );
    let steps = parse(&script).unwrap();
    headless::run(&scene, &steps, FRAME_TIME, &mut |_| ()).unwrap();
    let text = folder.read("scene.toml");
    for kept in [
        "# The proxy: what stood before the camera",
        "focal_length_mm = 50\n",
        "rotation_deg = [0, 24, 0]",
        "mesh = \"knot.glb\"                       # brings its own material: gold",
    ] {
        assert!(text.contains(kept), "{kept}:\n{text}");
    }
    let wrong = parse("expect focus_distance_m 9 within 1%").unwrap();
    let failed = headless::run(&scene, &wrong, FRAME_TIME, &mut |_| ()).unwrap_err();
    assert_eq!(failed.line, 1, "control: {failed:?}");
}

#[test]
fn buttons_and_keys_do_what_they_say() {
    let folder = folder();
    let mut window = window(&folder);
    window.key("CloseBracket", Held::Nothing).unwrap();
    assert!(
        (f_number(&window) - 2.02).abs() < 1e-9,
        "{}",
        f_number(&window)
    );
    window.press("Undo").unwrap();
    assert_eq!(f_number(&window), 1.8);
    window.press("Redo").unwrap();
    assert!(f_number(&window) > 2.0);
    window.key("Z", Held::Control).unwrap();
    assert_eq!(f_number(&window), 1.8);
    window.click(BALL);
    let focus = focus_m(&window);
    assert!((2.7..2.9).contains(&focus), "{focus}");
    window.press("Save").unwrap();
    assert!(!window.session().is_dirty());
    assert!(
        folder
            .read("scene.toml")
            .contains(&format!("focus_distance_m = {focus}\n"))
    );
    window.press("Keys").unwrap();
    window.press("Keys").unwrap();
    assert!(window.press("No such button").is_err());
}

#[test]
fn an_object_turns_under_the_wheel_and_scales_on_its_foot() {
    let folder = folder();
    let mut window = window(&folder);
    let ball = window.session().object("ball").unwrap();
    let placement = |window: &Window| window.session().composition().unwrap().objects[ball];
    let before = placement(&window);
    window.wheel(BALL, 2.0, Held::Shift);
    assert_ne!(placement(&window).rotation, before.rotation);
    assert_eq!(placement(&window).scale, before.scale);
    // Plain, it zooms; nothing is edited.
    let turned = placement(&window);
    window.wheel(BALL, 2.0, Held::Nothing);
    assert_eq!(placement(&window), turned);

    window.drag(BALL, [40.0, 30.0]);
    let moved = placement(&window);
    assert!(moved.translation.distance(turned.translation) > 0.1);
    let gap = |window: &Window| {
        let session = window.session();
        let geometry = &session.loaded().unwrap().geometry;
        geometry
            .gap_m(session.composition().unwrap(), ball)
            .unwrap()
    };
    assert!(gap(&window).abs() < 1e-3);
    // A drag is one step back.
    window.session_mut().undo();
    assert_eq!(placement(&window), turned);
}

#[test]
fn the_camera_orbits_and_dollies_and_its_file_shows_the_same() {
    let folder = folder();
    let mut window = window(&folder);
    let position = |window: &Window| match window.session().composition().unwrap().camera {
        CameraPose::LookAt { position, .. } => position,
        CameraPose::Matrix(_) => panic!("the file has a position"),
    };
    let before = position(&window);
    // Without a photograph a drag beside all objects orbits.
    window.drag([4.0, 40.0], [14.0, 42.0]);
    let orbited = position(&window);
    assert!((orbited.length() - before.length()).abs() < 1e-4);
    assert!(orbited.distance(before) > 0.01);
    window.wheel([4.0, 40.0], 3.0, Held::Control);
    assert!(position(&window).length() < 0.8 * before.length());
    window.session_mut().save();
    assert!(window.file_equals_window().unwrap());
}
