//! Files beside the window: changed, broken, deleted, dropped, left by a crash.

use std::time::{Duration, Instant};

use mixray::preview::headless::{self, Window};
use mixray::preview::script::parse;
use mixray::preview::session::Session;
use mixray::preview::window::App;

use super::{FRAME_TIME, SCENE, folder, window};
use crate::support::Folder;

/// Frames until it holds; false after a while.
fn soon(window: &mut Window, holds: impl Fn(&Session) -> bool) -> bool {
    let end = Instant::now() + Duration::from_secs(20);
    while Instant::now() < end {
        window.frame();
        if holds(window.session()) {
            return true;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    false
}

fn rays(session: &Session) -> u32 {
    session.composition().unwrap().rays_per_pixel
}

#[test]
fn a_broken_scene_is_told_with_its_place_and_the_picture_stays() {
    let folder = folder();
    let mut window = window(&folder);
    window.wait_for_picture(None).unwrap();
    let picture = window.session().shown().unwrap();
    folder.write(
        "scene.toml",
        SCENE.replace("f_number = 1.8", "f_number = \"wide\""),
    );
    assert!(soon(&mut window, |session| session.problem().is_some()));
    let problem = window.session().problem().unwrap();
    assert!(problem.contains("scene.toml:9:12:"), "{problem}");
    let shown = window.session().shown().unwrap();
    assert_eq!(shown.codes, picture.codes, "the last good picture");
    assert_eq!(rays(window.session()), 4);
    folder.write(
        "scene.toml",
        SCENE.replace("rays_per_pixel = 4", "rays_per_pixel = 3"),
    );
    assert!(soon(&mut window, |session| rays(session) == 3));
    assert_eq!(window.session().problem(), None);
    window.session_mut().undo();
    assert!(
        soon(&mut window, |session| rays(session) == 4),
        "undo brings the text before"
    );
}

#[test]
fn own_saves_are_no_news_and_others_ask_before_edits_go() {
    let folder = folder();
    let mut window = window(&folder);
    window
        .session_mut()
        .edit("rays", |composition| composition.rays_per_pixel = 5);
    window.session_mut().save();
    let revision = window.session().revision();
    assert!(!soon_briefly(&mut window, |session| session.is_reading()));
    assert_eq!(window.session().revision(), revision);

    window
        .session_mut()
        .edit("rays", |composition| composition.rays_per_pixel = 6);
    folder.write("scene.toml", SCENE);
    assert!(soon(&mut window, Session::has_conflict));
    assert_eq!(rays(window.session()), 6, "edits are kept");
    window.press("Reload").unwrap();
    assert!(soon(&mut window, |session| rays(session) == 4
        && !session.has_conflict()));
}

fn soon_briefly(window: &mut Window, holds: impl Fn(&Session) -> bool) -> bool {
    (0..80).any(|_| {
        window.frame();
        std::thread::sleep(Duration::from_millis(10));
        holds(window.session())
    })
}

#[test]
fn unsaved_work_survives_a_crash() {
    let folder = folder();
    let mut window = window(&folder);
    window
        .session_mut()
        .edit("rays", |composition| composition.rays_per_pixel = 11);
    let written = || folder.path("scene.toml.unsaved").exists();
    assert!(soon(&mut window, |_| written()));
    // Nobody says goodbye.
    drop(window);
    assert_eq!(folder.read("scene.toml"), SCENE);
    let mut next = self::window(&folder);
    assert!(next.session().recovered());
    assert_eq!(rays(next.session()), 4, "it is asked first");
    next.press("Restore").unwrap();
    assert!(soon(&mut next, |session| rays(session) == 11
        && session.is_dirty()));
    next.session_mut().save();
    assert!(folder.read("scene.toml").contains("rays_per_pixel = 11"));
    assert!(!written(), "it is saved");
}

#[test]
fn a_script_leaves_no_unsaved_work_behind() {
    let folder = folder();
    let steps = parse("set rays_per_pixel 2\nmeasure 1\nexpect unsaved\n").unwrap();
    let scene = folder.path("scene.toml");
    headless::run(&scene, &steps, FRAME_TIME, &mut |_| ()).unwrap();
    assert!(!folder.path("scene.toml.unsaved").exists());
    assert_eq!(folder.read("scene.toml"), SCENE);
}

#[test]
fn meshes_and_images_are_dropped_into_the_scene() {
    let folder = folder();
    folder.save("photo.png", 64, 48, |x, y| [x as u8, y as u8, 90]);
    let knot = crate::support::root().join("scenes/demo/knot.glb");
    folder.write("knot.glb", std::fs::read(knot).unwrap());
    let mut window = window(&folder);
    window
        .session_mut()
        .take_file(&folder.path("knot.glb"), None);
    window.wait_for_scene().unwrap();
    assert!(window.session().object("knot").is_some());
    window
        .session_mut()
        .take_file(&folder.path("photo.png"), None);
    window.wait_for_scene().unwrap();
    window.wait_for_picture(Some(1)).unwrap();
    window.session_mut().save();
    let text = folder.read("scene.toml");
    assert!(
        text.contains("mesh = \"knot.glb\"") && text.contains("image = \"photo.png\""),
        "{text}"
    );
    window.session_mut().undo();
    window.session_mut().undo();
    assert!(soon(&mut window, |session| session
        .object("knot")
        .is_none()));
    window
        .session_mut()
        .take_file(&folder.path("notes.txt"), None);
    assert!(window.session().problem().unwrap().contains("expected"));
}

#[test]
fn a_file_is_chosen_from_the_list() {
    let folder = folder();
    folder.create("models");
    let knot = crate::support::root().join("scenes/demo/knot.glb");
    folder.write("models/knot.glb", std::fs::read(knot).unwrap());
    folder.write("models/notes.txt", "not for the window");
    let mut window = window(&folder);
    // The list measures itself in its first frames.
    let open = |window: &mut Window| {
        window.press("Open").unwrap();
        window.frame();
        window.frame();
    };
    open(&mut window);
    window.press("models/").unwrap();
    assert!(window.press("notes.txt").is_err());
    window.press("knot.glb").unwrap();
    window.wait_for_scene().unwrap();
    assert!(window.session().object("knot").is_some());
    window.session_mut().save();
    assert!(
        folder
            .read("scene.toml")
            .contains("mesh = \"models/knot.glb\"")
    );
    open(&mut window);
    window.press("Up").unwrap();
    window.press("scene.toml").unwrap();
    window.wait_for_scene().unwrap();
    assert!(window.session().object("knot").is_some(), "as it was saved");
}

#[test]
fn a_scene_that_is_broken_from_the_start_is_told() {
    let folder = Folder::new();
    folder.write("scene.toml", "[camera\n");
    let session = Session::open(&folder.path("scene.toml"), FRAME_TIME, || ()).unwrap();
    let mut window = Window::new(App::new(session));
    let problem = window.wait_for_scene().unwrap_err();
    assert!(problem.contains("scene.toml:1:"), "{problem}");
    folder.write("scene.toml", SCENE);
    assert!(
        soon(&mut window, |session| session.loaded().is_some()),
        "it is mended"
    );
}

#[test]
fn a_still_is_rendered_beside_and_never_over_an_input() {
    use mixray::preview::still::StillState;
    let folder = folder();
    let mut window = window(&folder);
    window.session_mut().render_still(folder.path("still.png"));
    let done = |session: &Session| {
        session
            .still()
            .is_some_and(|still| still.state() == StillState::Done)
    };
    assert!(soon(&mut window, done));
    assert!(folder.path("still.png").exists());
    window.session_mut().render_still(folder.path("scene.toml"));
    assert!(window.session().problem().is_some());
    assert_eq!(folder.read("scene.toml"), SCENE);
}

#[test]
fn a_scene_that_cannot_be_read_does_not_take_the_place_of_a_good_one() {
    let folder = folder();
    let mut window = window(&folder);
    window
        .step(
            &parse("set f_number 4").unwrap().remove(0).step,
            &mut |_| (),
        )
        .unwrap();
    folder.write("broken.toml", "[camera");
    folder.write(
        "other.toml",
        SCENE.replace("rays_per_pixel = 4", "rays_per_pixel = 3"),
    );
    for file in ["broken.toml", "nowhere.toml"] {
        window.session_mut().take_file(&folder.path(file), None);
        assert!(soon(&mut window, |session| session.problem().is_some()));
        let session = window.session();
        assert!(session.problem().unwrap().contains(file));
        assert_eq!(session.path(), folder.path("scene.toml"));
        assert_eq!(rays(session), 4);
        assert!(session.is_dirty() && session.can_undo(), "the edit stays");
    }
    window
        .session_mut()
        .take_file(&folder.path("other.toml"), None);
    assert!(soon(&mut window, |session| rays(session) == 3), "control");
    let session = window.session();
    assert_eq!(session.path(), folder.path("other.toml"));
    assert!(!session.is_dirty() && !session.can_undo());
    assert_eq!(session.problem(), None);
}
