//! Killed in the middle and started again, a sequence ends equal to one never killed.

use std::time::{Duration, Instant};

use super::support::{BALL, sequence, y4m};
use crate::support::Folder;

/// Steps of 0.4 m: the coordinates' origin moves with the camera on the way.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write(
        "scene.toml",
        format!(
            "{}[shutter]\nexposure_secs = 0.05\n",
            BALL.replace("rays_per_pixel = 4", "rays_per_pixel = 64")
        ),
    );
    folder.frames(8, 0.4);
    folder.trajectory(8, 0.4, &[3]);
    folder
}

/// Starts the sequence and kills it once `count` frames are there.
fn kill_after(folder: &Folder, arguments: &[&str], count: usize, done: impl Fn() -> usize) {
    let mut child = folder
        .command(&sequence(arguments))
        .spawn()
        .expect("starts");
    let begin = Instant::now();
    while done() < count && begin.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("is killed");
    child.wait().expect("ends");
}

#[test]
fn frames_of_a_folder() {
    let folder = folder();
    folder.sequence(&["--frames", "in", "-o", "whole"]);
    let whole = folder.frames_of("whole");
    assert_eq!(whole.len(), 8);
    let to = ["--frames", "in", "-o", "killed"];
    kill_after(&folder, &to, 5, || folder.frames_of("killed").len());
    let before = folder.frames_of("killed").len();
    assert!((5..8).contains(&before), "killed in the middle: {before}");
    let said = folder.sequence(&to);
    assert!(said.contains(&format!("{before} kept")), "{said}");
    assert_eq!(folder.frames_of("killed"), whole);
    let said = folder.sequence(&to);
    assert!(said.contains("0 rendered"), "nothing is left to do: {said}");
    folder.sequence(&["--frames", "in", "-o", "other", "--seed", "7"]);
    assert_ne!(folder.frames_of("other"), whole, "control");
}

/// A saving that is left out makes other frames, which are not mixed with those that are there; what changes no bit is no obstacle.
#[test]
fn frames_without_a_saving() {
    let folder = Folder::new();
    folder.write("scene.toml", BALL);
    folder.frames(2, 0.1);
    folder.trajectory(2, 0.1, &[]);
    let to = |out: &str, flags: &[&str]| {
        folder.sequence(&[&["--frames", "in", "-o", out], flags].concat());
        folder.frames_of(out)
    };
    let usual = to("usual", &[]);
    for saving in [
        "virtual-first",
        "edge-real",
        "out-of-reach",
        "specialisation",
        "adaptive",
        "camera-noise",
    ] {
        assert_eq!(to(saving, &["--no-skip", saving]), usual, "{saving}");
        let again = ["--frames", "in", "-o", "usual", "--no-skip", saving];
        let said = folder.sequence(&again);
        assert!(said.contains("2 kept"), "{saving}: {said}");
    }
    for saving in ["cones", "beams"] {
        assert_ne!(to(saving, &["--no-skip", saving]), usual, "{saving}");
        let again = ["--frames", "in", "-o", "usual", "--no-skip", saving];
        folder.refuse_sequence(&again, "--overwrite");
    }
}

#[test]
fn frames_of_a_file() {
    let folder = folder();
    folder.write("in.y4m", y4m(48, 36, 8));
    folder.sequence(&["--frames", "in.y4m", "-o", "whole.y4m"]);
    let whole = std::fs::read(folder.path("whole.y4m")).expect("is there");
    let to = ["--frames", "in.y4m", "-o", "killed.y4m"];
    let part = folder.path("killed.y4m.part");
    let frame = 6 + 48 * 36 * 3 / 2;
    let size = || std::fs::metadata(&part).map_or(0, |m| m.len() as usize);
    kill_after(&folder, &to, 3, || size() / frame);
    assert!(part.exists() && !folder.path("killed.y4m").exists());
    // The last frame may be in the middle of being written.
    let mut torn = std::fs::read(&part).expect("is there");
    torn.truncate(torn.len() - 100);
    std::fs::write(&part, torn).expect("writes");
    let said = folder.sequence(&to);
    assert!(!said.contains(" 0 kept"), "{said}");
    assert_eq!(
        std::fs::read(folder.path("killed.y4m")).expect("is there"),
        whole
    );
    assert!(!part.exists());
}

/// A frame that a power cut or a bad disk has damaged is no finished frame.
#[test]
fn damaged_frames_are_rendered_again() {
    let folder = folder();
    let to = ["--frames", "in", "-o", "out"];
    folder.sequence(&to);
    let whole = folder.frames_of("out");
    let path = folder.path("out/f_0001.png");
    let bytes = std::fs::read(&path).expect("is there");
    let flipped = |at: usize| {
        let mut bytes = bytes.clone();
        bytes[at] ^= 4;
        bytes
    };
    let other_size = folder.path("in/small.png");
    image::RgbImage::new(8, 8).save(&other_size).expect("saves");
    let small = std::fs::read(&other_size).expect("is there");
    std::fs::remove_file(&other_size).expect("removes");
    for damaged in [
        Vec::new(),
        bytes[..bytes.len() / 2].to_vec(),
        bytes[..bytes.len() - 1].to_vec(),
        flipped(bytes.len() / 2),
        flipped(20),
        vec![0; bytes.len()],
        small,
    ] {
        std::fs::write(&path, damaged).expect("writes");
        let said = folder.sequence(&to);
        assert!(
            said.contains("1 rendered") && said.contains("7 kept"),
            "{said}"
        );
        assert_eq!(folder.frames_of("out"), whole);
    }
    // The fourth frame has no pose: it is a copy of what came in.
    std::fs::write(folder.path("out/f_0003.png"), "").expect("writes");
    let said = folder.sequence(&to);
    assert!(said.contains("1 passed through, 7 kept"), "{said}");
    assert_eq!(folder.frames_of("out"), whole);
    let said = folder.sequence(&to);
    assert!(
        said.contains("0 rendered") && said.contains("8 kept"),
        "control: {said}"
    );
}

/// So is a film that was cut, before or after it had its name.
#[test]
fn damaged_films_are_gone_on_with() {
    let folder = folder();
    folder.write("in.y4m", y4m(48, 36, 8));
    let to = ["--frames", "in.y4m", "-o", "out.y4m"];
    folder.sequence(&to);
    let path = folder.path("out.y4m");
    let part = folder.path("out.y4m.part");
    let whole = std::fs::read(&path).expect("is there");
    let frame = 6 + 48 * 36 * 3 / 2;
    let begin = whole.len() - 8 * frame;
    let mut unmarked = whole.clone();
    unmarked[begin + 2 * frame..][..6].fill(0);
    for (damaged, kept) in [
        (Vec::new(), 0),
        (whole[..begin / 2].to_vec(), 0),
        (whole[..begin + 3 * frame + 5].to_vec(), 3),
        // Nothing tells but the frames that come in.
        (whole[..begin + 5 * frame].to_vec(), 5),
        (unmarked, 2),
        (vec![0; whole.len()], 0),
    ] {
        for place in [&path, &part] {
            let _ = std::fs::remove_file(&path);
            std::fs::write(place, &damaged).expect("writes");
            let said = folder.sequence(&to);
            assert!(
                said.contains(&format!("{kept} kept")),
                "{}: {said}",
                damaged.len()
            );
            assert!(std::fs::read(&path).expect("is there") == whole && !part.exists());
        }
    }
    let said = folder.sequence(&to);
    assert!(said.contains("0 rendered"), "control: {said}");
    // A file of nobody's is left alone.
    folder.write("out.y4m", "YUV4MPEG2 W8 H8\n");
    folder.refuse_sequence(&to, "another render");
    assert_eq!(folder.read("out.y4m"), "YUV4MPEG2 W8 H8\n");
}

/// The frames of a range are not those of another one that a file holds.
#[test]
fn a_file_of_another_range_is_another_render() {
    let folder = folder();
    let to = |range| ["--frames", "in", "-o", "out.y4m", "--range", range];
    folder.sequence(&to("0..2"));
    folder.refuse_sequence(&to("2..4"), "another render");
    let said = folder.sequence(&to("0..2"));
    assert!(said.contains("2 kept"), "control: {said}");
}

/// What ended runs have left beside the frames goes, but nothing that is written or is not this command's.
#[test]
fn what_ended_runs_have_left_goes() {
    let folder = folder();
    folder.create("out");
    let left = |name: &str| folder.path(&format!("out/.mixray-{name}-abc123.tmp"));
    for name in [
        "f_0001.png",
        "f_0002.png",
        "other.png",
        "mixray-sequence.json",
    ] {
        std::fs::write(left(name), "half").expect("writes");
    }
    let written = std::fs::File::create(left("f_0002.png")).expect("opens");
    written.lock().expect("locks");
    folder.sequence(&["--frames", "in", "-o", "out"]);
    let there = [
        "f_0001.png",
        "f_0002.png",
        "other.png",
        "mixray-sequence.json",
    ]
    .map(|name| left(name).exists());
    assert_eq!(there, [false, true, true, false]);
    drop(written);
    folder.sequence(&["--frames", "in", "-o", "out"]);
    assert!(!left("f_0002.png").exists() && left("other.png").exists());
    // Two runs do not write one film.
    let part = std::fs::File::create(folder.path("out.y4m.part")).expect("opens");
    part.lock().expect("locks");
    folder.refuse_sequence(
        &["--frames", "in", "-o", "out.y4m"],
        "another run writes it",
    );
    drop(part);
    folder.sequence(&["--frames", "in", "-o", "out.y4m"]);
}
