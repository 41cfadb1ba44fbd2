//! Noise from frame to frame, where nothing moves.

use super::support::BALL;
use crate::support::Folder;

const WIDTH: u32 = 48;
const HEIGHT: u32 = 36;
/// Rows that show the floor alone.
const FLOOR: std::ops::Range<u32> = 26..HEIGHT;

/// Six frames of one grey picture, seen from one place, with the shadow of a ball under a small lamp.
fn folder() -> Folder {
    let folder = Folder::new();
    let lamp = "[[light]]\nkind = \"quad\"\ncorner = [0.4, 1, -1.6]\nedge_u = [0.3, 0, 0]\nedge_v = [0, 0, 0.3]\nradiance = [12, 12, 12]\n";
    folder.write("scene.toml", format!("{BALL}{lamp}"));
    folder.create("in");
    for number in 0..6 {
        folder.save(&format!("in/f_{number:04}.png"), WIDTH, HEIGHT, |_, _| {
            [140; 3]
        });
    }
    folder.trajectory(6, 0.0, &[]);
    folder
}

/// Root mean square of the change from frame to frame on the floor, codes.
fn flicker(frames: &[(String, Vec<u8>)]) -> f64 {
    let pictures: Vec<_> = frames
        .iter()
        .map(|(_, bytes)| {
            image::load_from_memory(bytes)
                .expect("decodes")
                .into_rgb16()
        })
        .collect();
    let (mut squares, mut count) = (0.0f64, 0.0f64);
    for pair in pictures.windows(2) {
        for (x, y) in FLOOR.flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
            for (a, b) in pair[0]
                .get_pixel(x, y)
                .0
                .iter()
                .zip(pair[1].get_pixel(x, y).0)
            {
                squares += ((f64::from(*a) - f64::from(b)) / 257.0).powi(2);
                count += 1.0;
            }
        }
    }
    (squares / count).sqrt()
}

#[test]
fn the_final_filter_halves_flicker_and_looks_at_one_frame_alone() {
    let folder = folder();
    let render = |name: &str, flags: &[&str]| {
        folder.sequence(&[&["--frames", "in", "--png-bits", "16", "-o", name], flags].concat());
        folder.frames_of(name)
    };
    let mean = render("mean", &["--combine", "mean"]);
    let filtered = render("final", &["--filter", "final"]);
    let [before, after] = [&mean, &filtered].map(|frames| flicker(frames));
    assert!(before > 0.5, "control: there is noise, {before}");
    assert!(after < 0.5 * before, "{after} {before}");
    // What a frame shows does not depend on those before it: nothing can trail.
    let alone = render("alone", &["--filter", "final", "--range", "3..4"]);
    let same = filtered.iter().filter(|frame| alone.contains(frame));
    assert_eq!(same.count(), 1);
}

#[test]
fn frames_are_rendered_to_an_error() {
    let folder = folder();
    let render = |name: &str, flags: &[&str]| {
        folder.sequence(
            &[
                &[
                    "--frames",
                    "in",
                    "--png-bits",
                    "16",
                    "-o",
                    name,
                    "--range",
                    "0..3",
                ],
                flags,
            ]
            .concat(),
        );
        flicker(&folder.frames_of(name))
    };
    let rough = render("rough", &["--combine", "mean", "--target-error", "0.02"]);
    let fine = render("fine", &["--combine", "mean", "--target-error", "0.002"]);
    let noise = ["--combine", "mean", "--stop-at", "camera-noise"];
    let by_noise = render(
        "noise",
        &[&noise[..], &["--camera-noise", "0,0.01"]].concat(),
    );
    assert!(
        fine < 0.6 * rough && by_noise < rough,
        "{fine} {by_noise} {rough}"
    );
    let stop = ["--frames", "in", "-o", "none", "--stop-at", "camera-noise"];
    folder.refuse_sequence(&stop, "the scene has no [noise]");
}
