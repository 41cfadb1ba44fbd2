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
