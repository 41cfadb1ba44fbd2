//! Keys set, moved and deleted in the window, for objects and for the focus.

use eframe::egui::{Event, Modifiers, PointerButton};
use egui_kittest::kittest::Queryable;
use mixray::preview::headless::{self, Failed, Window};
use mixray::preview::script::{Held, Step, parse};

use super::{FRAME_TIME, SCENE, folder, window};
use crate::support::Folder;

fn run(folder: &Folder, script: &str) -> Result<(), Failed> {
    let steps = parse(script).unwrap();
    headless::run(&folder.path("scene.toml"), &steps, FRAME_TIME, &mut |_| ())
}

fn times(window: &Window) -> Vec<f64> {
    let composition = window.session().composition().unwrap();
    let track = window.session().track("ball").unwrap();
    composition.key_times_secs(track)
}

/// From one time of the timeline to another.
fn drag_time(window: &mut Window, from_secs: f64, to_secs: f64) {
    let [from, to] = [from_secs, to_secs].map(|secs| window.app().time_on_screen(secs).unwrap());
    let press = |window: &mut Window, at, pressed| {
        window.harness().hover_at(at);
        window.frame();
        window.harness().event(Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        window.frame();
    };
    press(window, from, true);
    for n in 1..=4 {
        let at = from + (to - from) * (n as f32 / 4.0);
        window.harness().hover_at(at);
        window.frame();
    }
    press(window, to, false);
}

#[test]
fn an_object_and_the_focus_move_by_keys_set_in_the_window() {
    let folder = folder();
    run(
        &folder,
        "\
expect keyframes ball
keyframe set ball
keyframe set focus
set time_secs 1
expect position ball 0 0.3 0 within 0.000001
drag 32 22 to 40 26
set focus_distance_m 2
expect keyframes ball 0 1
expect keyframes focus 0 1
save
expect file-equals-window
set time_secs 0
expect position ball 0 0.3 0 within 0.000001
expect focus_distance_m 3
set time_secs 0.5
expect focus_distance_m 2.4 within 0.01%
keyframe move 1 2 ball
undo
expect keyframes ball 0 1
redo
expect keyframes ball 0 2
save
reload
expect keyframes ball 0 2
set time_secs 2
keyframe delete ball
expect position ball 0 0.3 0 within 0.000001
set time_secs 0
keyframe delete ball
expect keyframes ball
expect position ball 0 0.3 0 within 0.000001
save
expect file-equals-window
",
    )
    .unwrap();
    let text = folder.read("scene.toml");
    for kept in [
        "# wide open",
        "# the ball",
        "[[lens.motion]]\ntime_secs = 1.0\nfocus_distance_m = 2.0\n",
    ] {
        assert!(text.contains(kept), "{kept}:\n{text}");
    }
    assert!(!text.contains("[[virtual.motion]]"), "{text}");
    let failed = run(&folder, "keyframe delete ball").unwrap_err();
    assert!(failed.problem.contains("no key"), "control: {failed:?}");
    let failed = run(&folder, "expect keyframes focus 0").unwrap_err();
    assert!(failed.problem.contains("[0.0, 1.0]"), "control: {failed:?}");
}

#[test]
fn keys_are_shown_and_dragged_on_the_timeline() {
    let folder = folder();
    let mut window = window(&folder);
    assert_eq!(window.app().time_on_screen(0.0), None, "nothing moves");
    // All of the panel is seen.
    (window.step(&Step::Size([1240.0, 1400.0]), &mut |_| ())).unwrap();
    window.frame();
    window.click([32.0, 22.0]);
    window.key("K", Held::Nothing).unwrap();
    assert_eq!(times(&window), [0.0]);
    window.frame();
    let has_lane = |window: &mut Window| {
        let harness = window.harness();
        harness.query_by_label("time and keys").is_some()
    };
    assert!(has_lane(&mut window));
    // Where no key is, the time is taken along.
    drag_time(&mut window, 0.5, 0.75);
    let composition = window.session().composition().unwrap();
    assert!(
        (composition.time_secs() - 0.75).abs() < 0.01,
        "{}",
        composition.time_secs()
    );
    assert_eq!(times(&window), [0.0]);
    window.press("Set key").unwrap();
    let second = times(&window)[1];
    drag_time(&mut window, second, 0.25);
    let moved = times(&window);
    assert!((moved[1] - 0.25).abs() < 0.01, "{moved:?}");
    // One gesture, one step back.
    window.session_mut().undo();
    assert_eq!(times(&window), [0.0, second]);
    window.press("Delete key").unwrap();
    window.session_mut().undo();
    window.session_mut().undo();
    assert_eq!(times(&window), [0.0], "before the second was set");
}

#[test]
fn a_sequence_follows_the_keys_of_the_lens() {
    let folder = folder();
    let keys = "
[[lens.motion]]
time_secs = 0.0
focus_distance_m = 3.0

[[lens.motion]]
time_secs = 1.0
focus_distance_m = 1.0

[environment]";
    let still = SCENE.replace("focus_distance_m = 3.0", "focus_distance_m = 1.0");
    folder.write("scene.toml", SCENE.replace("\n[environment]", keys));
    folder.write("near.toml", still);
    folder.write(
        "poses.toml",
        "\
frames_per_second = 1.0

[[frame]]
frame = 0
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.0, 0.0]

[[frame]]
frame = 1
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.0, 0.0]
",
    );
    folder.create("frames");
    for n in 0..2 {
        folder.save(&format!("frames/frame_{n:04}.png"), 64, 48, |x, y| {
            [x as u8 * 3, y as u8 * 4, 60]
        });
    }
    for (scene, out) in [("scene.toml", "keyed"), ("near.toml", "near")] {
        folder.succeed(&format!(
            "sequence {scene} --frames frames --trajectory poses.toml -o {out}"
        ));
    }
    let frame = |out: &str, n: u32| folder.open(&format!("{out}/frame_{n:04}.png"));
    assert_eq!(frame("keyed", 1), frame("near", 1));
    assert_ne!(
        frame("keyed", 0),
        frame("near", 0),
        "control: another focus"
    );
}

#[test]
fn a_mark_that_is_clicked_leads_to_its_time() {
    let folder = folder();
    let mut window = window(&folder);
    let step = |window: &mut Window, step: Step| window.step(&step, &mut |_| ()).unwrap();
    step(&mut window, Step::SetKey("ball".to_owned()));
    step(
        &mut window,
        parse("set time_secs 0.6").unwrap().remove(0).step,
    );
    step(&mut window, Step::SetKey("focus".to_owned()));
    window.frame();
    let first = window.app().time_on_screen(0.0).unwrap();
    window
        .harness()
        .hover_at(first + eframe::egui::vec2(2.0, 0.0));
    window.frame();
    for pressed in [true, false] {
        let pos = first + eframe::egui::vec2(2.0, 0.0);
        window.harness().event(Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        window.frame();
    }
    window.frame();
    assert_eq!(window.session().composition().unwrap().time_secs(), 0.0);
}
