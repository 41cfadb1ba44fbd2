//! `mixray track` on films whose rows were read one after the other, the camera known at every row's own time.

use mixray::tracking::{Family, Follower, Luma, Tone, read_known_board};

use super::commands::{LENS_OF_THE_FILM, off, pose};
use super::film::{Film, View, looking, markers};
use crate::support::{Folder, stderr};

const BOARD: &str =
    "family = \"apriltag-36h11\"\n[grid]\ncolumns = 4\nrows = 3\nside_m = 0.04\ngap_m = 0.02\n";
const TRACK: &str = "track film.y4m --board board.toml --board-flatness rigid --gamma 2.2 --intrinsics lens.yaml --fix-intrinsics -o poses.json --report track.json";
const FRAMES: usize = 16;
/// Of a frame's 40 ms: 20 ms.
const SHARE: f64 = 0.5;

/// A hand that moves the camera to and fro while it goes around the board; the time in frames.
fn at(frames: f64) -> View {
    let secs = frames / 25.0;
    let view = looking(
        0.4 + 0.8 * secs,
        (30.0 + 10.0 * (7.0 * secs).sin()).to_radians(),
        0.5,
        0.1 + 0.3 * (5.0 * secs).sin(),
    );
    let aside = glam::DVec3::new(0.04 * (8.0 * secs).sin(), 0.03 * (9.0 * secs).cos(), 0.0);
    View {
        translation: view.translation + aside,
        ..view
    }
}

/// A film whose camera moves while rows are read, over that share of a frame's time.
fn film(speed: f64, share: f64) -> Folder {
    let folder = Folder::new();
    folder.write("board.toml", BOARD);
    folder.write("lens.yaml", LENS_OF_THE_FILM);
    let tags = Family::named("apriltag-36h11").unwrap();
    let print = markers(tags, 4, 3, 0.04, 0.02);
    let view_of = |frame: usize, row: f64| at(speed * (frame as f64 + share * row));
    Film::around().save_rows(&folder, "film.y4m", &print, FRAMES, &view_of);
    folder
}

/// Millimetres and degrees off, root mean squares over the frames but the first and the last two, whose motion is told by fewer neighbours.
fn errors(folder: &Folder) -> (f64, f64) {
    let poses = folder.json("poses.json");
    let frames = poses["frames"].as_array().unwrap();
    let inner = 2..FRAMES - 2;
    let count = inner.len() as f64;
    let each = inner.map(|index| off(&pose(&frames[index]), &at(index as f64)));
    let (mm, degrees) = each.fold((0.0, 0.0), |(mm, degrees), own| {
        (mm + own.0 * own.0, degrees + own.1 * own.1)
    });
    ((mm / count).sqrt(), (degrees / count).sqrt())
}

/// The way that corners go while rows are read is several pixels. Controls: without a readout time, and with the wrong sign.
#[test]
fn poses_are_those_of_the_middle_row_where_the_readout_time_is_given() {
    let folder = film(1.0, SHARE);
    let run = |flag: &str| {
        folder.succeed(&format!("{TRACK} {flag}"));
        let (mm, degrees) = errors(&folder);
        let rms = folder.json("track.json")["rms_px"].as_f64().unwrap();
        (mm, degrees, rms)
    };
    let (mm, degrees, rms) = run("--readout-time 20ms");
    let without = run("");
    let wrong = run("--readout-time -20ms");
    assert!(
        mm < 0.5 && degrees < 0.06 && rms < 0.12,
        "{mm} {degrees} {rms}"
    );
    assert!(without.0 > 4.0 * mm && without.2 > 4.0 * rms, "{without:?}");
    assert!(
        wrong.0 > 1.5 * without.0 && wrong.2 > 1.5 * without.2,
        "{wrong:?} {without:?}"
    );
}

/// Controls: a film whose rows are of one time, and one on which nothing moves, which tells nothing.
#[test]
fn the_readout_time_is_solved_for_where_motion_shows_it() {
    let solved = |folder: &Folder| {
        let said = folder.succeed(&format!("{TRACK} --readout-time solve"));
        assert!(said.contains("rows:    read in "), "{said}");
        let rows = folder.json("track.json")["rows"].clone();
        let number = |name: &str| 1e3 * rows[name].as_f64().unwrap();
        (number("readout_secs"), number("sigma_secs"))
    };
    let (found, sigma) = solved(&film(1.0, SHARE));
    assert!(
        sigma < 0.5 && (found - 20.0).abs() < 5.0 * sigma.max(0.05),
        "{found} +- {sigma} ms"
    );
    let (found, sigma) = solved(&film(1.0, 0.0));
    assert!(
        found.abs() < 5.0 * sigma.max(0.05),
        "control: {found} +- {sigma} ms"
    );
    let still = film(0.0, SHARE);
    still.refuse(
        &format!("{TRACK} --readout-time solve"),
        "do not determine the readout time",
    );
    still.refuse(
        &format!("{TRACK} --readout-time 50ms"),
        "a frame takes 40.0 ms",
    );
    let output = still.run(&format!("{TRACK} --readout-time 20"));
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("a time with its unit"));
}

/// A stream's poses follow from those before; every frame, and every other one as where frames are dropped. Control: without a readout time.
#[test]
fn a_stream_s_poses_are_those_of_the_middle_row_as_far_as_the_past_tells() {
    let folder = film(1.0, SHARE);
    let known = read_known_board(&folder.path("board.toml")).unwrap();
    let bytes = folder.bytes("film.y4m");
    let (_, frames) = crate::live::parts(&bytes);
    let errors = |readout_secs: Option<f64>, step: usize| {
        let lens = Film::around().lens;
        let follower = Follower::new(known.clone(), None, lens, Some(Tone::Power(2.2)));
        let mut follower = match readout_secs {
            Some(secs) => follower.with_readout(secs, Some(25.0)).unwrap(),
            None => follower,
        };
        let (mut mm, mut degrees, mut count) = (0.0, 0.0, 0.0);
        for (number, frame) in frames.iter().enumerate().step_by(step) {
            let luma = Luma {
                width: 480,
                height: 360,
                codes: frame[b"FRAME\n".len()..][..480 * 360].to_vec(),
            };
            let pose = follower.follow(&luma, number as u32).unwrap();
            // The first ones have no past.
            if number >= 2 * step {
                let own = off(&pose.world_from_camera(), &at(number as f64));
                (mm, degrees, count) = (mm + own.0 * own.0, degrees + own.1 * own.1, count + 1.0);
            }
        }
        ((mm / count).sqrt(), (degrees / count).sqrt())
    };
    for (step, most) in [(1, [1.0, 0.1]), (2, [3.0, 0.3])] {
        let (mm, degrees) = errors(Some(0.02), step);
        let without = errors(None, step);
        assert!(mm < most[0] && degrees < most[1], "{step}: {mm} {degrees}");
        assert!(without.0 > 3.0 * mm, "{step}: {without:?} {mm}");
    }
}

/// What was found goes into the scene to begin with. Control: a run in which all rows are of one time.
#[test]
fn the_readout_time_stands_in_the_scene_to_begin_with() {
    let folder = film(1.0, SHARE);
    let scene = |flag: &str| {
        folder.succeed(&format!("{TRACK} {flag} --scene scene.toml"));
        folder.succeed("info scene.toml");
        folder.read("scene.toml")
    };
    let found = scene("--readout-time 20ms");
    assert!(found.contains("[shutter]") && found.contains("readout_secs = 0.020000"));
    assert!(!scene("").contains("[shutter]"));
    assert!(scene("--readout-time -1ms").contains("from the lowest up"));
}
