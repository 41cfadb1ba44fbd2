//! What stands in the way when a sequence goes on: damaged frames and notes, other files in their places, full disks.

#[cfg(unix)]
use std::process::Command;

use super::support::{BALL, sequence, y4m};
use crate::support::{Folder, assert_refused, stderr};

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", BALL);
    folder.frames(5, 0.1);
    folder.trajectory(5, 0.1, &[3]);
    folder
}

/// What of the bytes of a file may be left.
fn damages(whole: &[u8]) -> Vec<Vec<u8>> {
    let flipped = |at: usize| {
        let mut bytes = whole.to_vec();
        bytes[at] ^= 4;
        bytes
    };
    vec![
        Vec::new(),
        whole[..8].to_vec(),
        whole[..whole.len() / 2].to_vec(),
        vec![0; whole.len()],
        [whole, b"x"].concat(),
        flipped(0),
        flipped(whole.len() / 2),
        flipped(whole.len() - 1),
    ]
}

#[test]
fn damaged_frames_of_layers_and_of_ranges_are_rendered_again() {
    let folder = folder();
    for (to, frames) in [
        ("out --format exr", ["out/f_0001.exr", "out/f_0003.exr"]),
        (
            "all --format exr --layers composite,real,motion,cryptomatte",
            ["all/f_0001.exr", "all/f_0003.exr"],
        ),
        ("shot/a.##.exr", ["shot/a.02.exr", "shot/a.03.exr"]),
        ("part --range 1..4", ["part/f_0002.png", "part/f_0003.png"]),
    ] {
        let mut words = vec!["--frames", "in", "-o"];
        words.extend(to.split(' '));
        folder.sequence(&words);
        let place = frames[0].split('/').next().expect("a folder");
        let whole = folder.frames_of(place);
        assert!(whole.len() >= 3, "{to}");
        for frame in frames {
            for damaged in damages(&folder.bytes(frame)) {
                folder.write(frame, damaged);
                let said = folder.sequence(&words);
                let kept = format!("{} kept", whole.len() - 1);
                assert!(said.contains(&kept), "{frame}: {said}");
                assert!(folder.frames_of(place) == whole, "{frame}");
            }
        }
        let said = folder.sequence(&words);
        assert!(said.contains("0 rendered"), "control: {said}");
    }
}

/// Frames whose note does not say that they are of this render are left as they are.
#[test]
fn damaged_notes_are_refused() {
    let folder = folder();
    folder.write("in.y4m", y4m(48, 36, 5));
    for (words, note, frame) in [
        (
            ["--frames", "in", "-o", "out"],
            "out/mixray-sequence.json",
            "out/f_0001.png",
        ),
        (
            ["--frames", "in.y4m", "-o", "out.y4m"],
            "out.y4m.mixray-sequence.json",
            "out.y4m",
        ),
    ] {
        folder.sequence(&words);
        let (whole, bytes) = (folder.bytes(note), folder.bytes(frame));
        let earlier = "{\n  \"fingerprint\": \"0123456789abcdef\"\n}\n";
        let mut all = damages(&whole);
        all.push(earlier.into());
        for damaged in all {
            folder.write(note, &damaged);
            folder.refuse_sequence(&words, "; expected a new place");
            assert!(folder.bytes(note) == damaged && folder.bytes(frame) == bytes);
        }
        folder.remove(note);
        folder.refuse_sequence(&words, "another render");
        folder.write(note, &whole);
        let said = folder.sequence(&words);
        assert!(said.contains("0 rendered"), "control: {said}");
    }
}

/// Nothing but a file makes room for one.
#[cfg(unix)]
#[test]
fn what_is_no_file_stays_in_its_place() {
    let folder = folder();
    folder.write("in.y4m", y4m(48, 36, 5));
    let frames = ["--frames", "in", "-o", "out"];
    let film = ["--frames", "in.y4m", "-o", "out.y4m"];
    folder.sequence(&frames);
    let whole = folder.frames_of("out");
    folder.remove("out/f_0002.png");
    for (words, place) in [
        (&frames, "out/f_0002.png"),
        (&film, "out.y4m.part"),
        (&film, "out.y4m.mixray-sequence.json"),
    ] {
        let path = folder.path(place);
        std::fs::create_dir(&path).expect("makes a folder");
        folder.refuse_sequence(words, "is a folder or another special file");
        std::fs::remove_dir(&path).expect("is there, and empty");
        let made = Command::new("mkfifo").arg(&path).status().expect("mkfifo");
        assert!(made.success());
        folder.refuse_sequence(words, "is a folder or another special file");
        std::fs::remove_file(&path).expect("is there");
        for device in ["/dev/zero", "/dev/full"] {
            std::os::unix::fs::symlink(device, &path).expect("links");
            folder.refuse_sequence(words, "is a folder or another special file");
            std::fs::remove_file(&path).expect("is there");
        }
        let poses = folder.bytes("poses.json");
        std::fs::hard_link(folder.path("poses.json"), &path).expect("links");
        folder.refuse_sequence(words, "is an input of this run");
        assert!(folder.bytes("poses.json") == poses);
        std::fs::remove_file(&path).expect("is there");
    }
    folder.sequence(&frames);
    assert!(folder.frames_of("out") == whole, "control");
    folder.sequence(&film);
}

/// Who may write the folder may replace what is in it; who may not write a film leaves it as it is, under its name.
#[cfg(target_os = "linux")]
#[test]
fn files_without_the_right_to_write() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;

    const NOBODY_ELSE: u32 = 64_988;
    let folder = folder();
    let set = |name: &str, mode: u32| {
        let mode = std::fs::Permissions::from_mode(mode);
        std::fs::set_permissions(folder.path(name), mode).expect("is ours");
    };
    folder.write("in.y4m", y4m(48, 36, 5));
    folder.sequence(&["--frames", "in", "-o", "out"]);
    folder.sequence(&["--frames", "in.y4m", "-o", "out.y4m"]);
    let whole = folder.frames_of("out");
    let film = folder.bytes("out.y4m");
    let program = folder.path("mixray");
    std::fs::copy(env!("CARGO_BIN_EXE_mixray"), &program).expect("copies");
    for writable in ["", "out"] {
        set(writable, 0o777);
    }
    // Root may write all; the user of another number may not.
    let is_root = std::fs::metadata("/proc/self").expect("procfs").uid() == 0;
    let run = |words: &[&str]| {
        let mut command = Command::new(&program);
        command.current_dir(folder.root()).args(sequence(words));
        if is_root {
            command.uid(NOBODY_ELSE);
        }
        command.output().expect("runs")
    };
    folder.write("out/f_0001.png", "half");
    set("out/f_0001.png", 0o444);
    let output = run(&["--frames", "in", "-o", "out"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(folder.frames_of("out") == whole);

    let cut = &film[..film.len() - 100];
    folder.write("out.y4m", cut);
    set("out.y4m", 0o444);
    let words = ["--frames", "in.y4m", "-o", "out.y4m"];
    assert_refused(&run(&words), "out.y4m: it cannot be written");
    assert!(folder.bytes("out.y4m") == cut && !folder.path("out.y4m.part").exists());
    set("out.y4m", 0o666);
    let output = run(&words);
    assert_eq!(
        output.status.code(),
        Some(0),
        "control: {}",
        stderr(&output)
    );
    assert!(folder.bytes("out.y4m") == film);
}

/// A limit on the size of files stands for a disk that is full.
#[cfg(unix)]
#[test]
fn a_film_that_found_no_room_goes_on() {
    let folder = folder();
    folder.write("in.y4m", y4m(48, 36, 5));
    folder.sequence(&["--frames", "in.y4m", "-o", "whole.y4m"]);
    let words = ["--frames", "in.y4m", "-o", "out.y4m"];
    let frame = 6 + 48 * 36 * 3 / 2;
    // Blocks of 1024 bytes: no room for a frame, for two, for three.
    for (blocks, kept) in [(1, 0), (6, 2), (8, 3)] {
        let script = format!("ulimit -f {blocks}; exec \"$MIXRAY\" \"$@\"");
        let output = Command::new("bash")
            .args(["-c", &script, "bash"])
            .args(sequence(&words))
            .current_dir(folder.root())
            .env("MIXRAY", env!("CARGO_BIN_EXE_mixray"))
            .output()
            .expect("bash");
        assert_refused(&output, "out.y4m.part: it cannot be written");
        let part = folder.bytes("out.y4m.part").len();
        assert_eq!(part / frame, kept, "control: {part} bytes");
    }
    let said = folder.sequence(&words);
    assert!(said.contains("3 kept"), "{said}");
    assert!(folder.bytes("out.y4m") == folder.bytes("whole.y4m"));
}
