//! Whatever is done in the window, nothing panics and the scene stays one.

use glam::DVec3;
use mixray::preview::headless::Window;
use mixray::preview::quantity::Quantity;
use mixray::preview::script::{Held, Step};
use mixray::preview::view::View;
use mixray::scene::{Choice, load_text};

use super::{SCENE, folder, window};
use crate::support::{Folder, Random};

const EVENTS: u32 = 2000;

fn below(random: &mut Random, count: usize) -> usize {
    (random.uniform() * count as f64) as usize
}

fn event(window: &mut Window, folder: &Folder, random: &mut Random) {
    let mut pixel = || [64.0 * random.uniform(), 48.0 * random.uniform()];
    let (from, to) = (pixel(), pixel());
    let notches = (8.0 * random.uniform()) as f32 - 4.0;
    let held = [Held::Nothing, Held::Shift, Held::Control][below(random, 3)];
    let pick = below(random, 100);
    match pick {
        0..25 => window.click(from),
        25..45 => window.drag(from, to),
        45..60 => window.wheel(from, notches, held),
        60..70 => {
            let names = [
                "W",
                "G",
                "P",
                "0",
                "Delete",
                "OpenBracket",
                "CloseBracket",
                "Z",
                "Y",
                "S",
            ];
            window.key(names[below(random, names.len())], held).unwrap();
        }
        70..78 => {
            let session = window.session_mut();
            let there: Vec<Quantity> = (Quantity::CHOICES.iter())
                .map(|(_, quantity)| *quantity)
                .filter(|quantity| {
                    let composition = session.composition();
                    composition.is_some_and(|composition| quantity.of(composition).is_some())
                })
                .collect();
            // None without a scene.
            if !there.is_empty() {
                let quantity = there[below(random, there.len())];
                let value = 0.6 + 3.0 * random.uniform();
                session.edit("set", |composition| quantity.set(composition, value));
            }
        }
        78..84 => window.session_mut().undo(),
        84..88 => window.session_mut().redo(),
        88..89 => window.session_mut().save(),
        89..90 => keyframe(window, random),
        90..93 => {
            let (_, view) = View::CHOICES[below(random, View::CHOICES.len())];
            window.session_mut().set_view(view);
        }
        93..95 => {
            // Down to what a minimised window has.
            let size = [
                80.0 + 900.0 * random.uniform(),
                64.0 + 600.0 * random.uniform(),
            ];
            let size = size.map(|side| side as f32);
            window.step(&Step::Size(size), &mut |_| ()).unwrap();
        }
        95 => window
            .step(&Step::Scale([1.0, 2.0][below(random, 2)]), &mut |_| ())
            .unwrap(),
        // Files go and come underneath.
        96 => {
            let _ = std::fs::remove_file(folder.path("scene.toml"));
        }
        97 => folder.write("scene.toml", SCENE),
        98 => folder.write("scene.toml", "[camera"),
        _ => window.session_mut().reload(),
    }
    window.frame();
}

/// Sets, moves or deletes a key of the first object or of the focus.
fn keyframe(window: &mut Window, random: &mut Random) {
    let session = window.session_mut();
    let name = ["0", "focus"][below(random, 2)];
    let (Some(track), Some(composition)) = (session.track(name), session.composition()) else {
        return;
    };
    let times = composition.key_times_secs(track);
    match (below(random, 4), times.first()) {
        (0, Some(first)) => {
            session.shift_key(track, *first, 2.0 * random.uniform());
        }
        (1, _) => session.delete_key(track),
        (2, _) => session.set_time(2.0 * random.uniform()),
        _ => session.set_key(track),
    }
}

#[test]
fn two_thousand_random_events_leave_a_valid_scene() {
    let folder = folder();
    let mut window = window(&folder);
    let mut random = Random(14);
    let mut edits = 0;
    for n in 0..EVENTS {
        let revision = window.session().revision();
        event(&mut window, &folder, &mut random);
        edits += u32::from(window.session().revision() != revision);
        if n % 100 == 99 {
            let text = window.session().text().unwrap();
            let scene = load_text(&folder.path("scene.toml"), &text);
            let scene = scene.unwrap_or_else(|error| panic!("event {n}: {error}\n{text}"));
            let composition = window.session().composition().unwrap();
            assert_eq!(scene.lens, composition.lens(), "event {n}");
            for object in &composition.objects {
                assert!(object.world_from_object().is_finite());
                assert_ne!(object.scale, DVec3::ZERO);
            }
        }
    }
    assert!(edits > EVENTS / 4, "the walk goes somewhere: {edits}");
    folder.write("scene.toml", SCENE);
    window.session_mut().reload();
    window.wait_for_scene().unwrap();
    window.wait_for_picture(None).unwrap();
}
