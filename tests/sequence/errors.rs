//! What is refused, and that what was finished stays.

use std::io::Write;
use std::process::Stdio;

use super::support::{BALL, sequence, y4m};
use crate::support::{Folder, assert_refused};

fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", BALL);
    folder.frames(4, 0.02);
    folder
}

#[test]
fn poses_and_frames_that_do_not_fit_are_refused() {
    let folder = folder();
    let to = ["--frames", "in", "-o", "out"];
    folder.trajectory(3, 0.02, &[]);
    folder.refuse_sequence(&to, "no pose for f_0003.png");
    assert!(
        folder.frames_of("out").is_empty(),
        "before anything is rendered"
    );
    let text = std::fs::read_to_string(folder.path("poses.json")).expect("reads");
    folder.write("poses.json", text.replace("[0,1,0,0]", "[0,1,0,NaN]"));
    folder.refuse_sequence(&to, "NaN");
    folder.write("poses.json", text.replace("[0,1,0,0]", "[0,2,0,0]"));
    folder.refuse_sequence(&to, "not rigid");
    folder.trajectory(4, 0.02, &[]);

    std::fs::remove_file(folder.path("in/f_0002.png")).expect("removes");
    folder.refuse_sequence(&to, "frame 2 is missing");
    folder.refuse_sequence(
        &["--frames", "in", "-o", "out", "--range", "1..3"],
        "frame 2 is missing",
    );
    folder.refuse_sequence(
        &["--frames", "in", "-o", "out", "--range", "9..12"],
        "no frame of the range",
    );
    folder.save_frame("in/f_0002.png", 48, 36, 2);
    folder.refuse_sequence(&["--frames", "in", "-o", "in"], "would be overwritten");
    folder.refuse_sequence(&["--frames", "none", "-o", "out"], "none");
    folder.refuse_sequence(&["-o", "out"], "--frames is absent");
    folder.save_frame("in/g_0002.png", 48, 36, 2);
    folder.refuse_sequence(&to, "have one number");
    std::fs::remove_file(folder.path("in/g_0002.png")).expect("removes");

    folder.write(
        "scene.toml",
        format!("{BALL}[shutter]\nexposure_secs = 0.05\n"),
    );
    folder.trajectory(4, 0.02, &[]);
    let untimed = std::fs::read_to_string(folder.path("poses.json")).expect("reads");
    folder.write(
        "poses.json",
        untimed.replace("\"frames_per_second\": 10, ", ""),
    );
    folder.refuse_sequence(&to, "--fps");
}

#[test]
fn a_frame_of_another_size_ends_the_sequence_and_keeps_what_is_done() {
    let folder = folder();
    folder.save_frame("in/f_0002.png", 40, 36, 2);
    folder.refuse_sequence(
        &["--frames", "in", "-o", "out"],
        "f_0002.png: it has 40 x 36 pixels",
    );
    assert_eq!(folder.frames_of("out").len(), 2);
}

#[test]
fn another_render_in_the_folder_is_not_mixed_up_with_this_one() {
    let folder = folder();
    let to = ["--frames", "in", "-o", "out", "--range", "0..2"];
    folder.sequence(&to);
    let first = folder.frames_of("out");
    folder.write("scene.toml", BALL.replace("0.8, 0.4, 0.2", "0.2, 0.4, 0.8"));
    folder.refuse_sequence(&to, "another render");
    assert_eq!(folder.frames_of("out"), first);
    let mut replace = to.to_vec();
    replace.push("--overwrite");
    folder.sequence(&replace);
    assert_ne!(folder.frames_of("out"), first);
}

#[test]
fn broken_streams_say_where() {
    let folder = folder();
    let stream = y4m(48, 36, 4);
    let run = |bytes: &[u8]| {
        let mut child = folder
            .command(&sequence(&["--frames", "-", "-o", "out", "--overwrite"]))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        // A program that has ended does not read on.
        let _ = child.stdin.take().expect("piped").write_all(bytes);
        child.wait_with_output().expect("ends")
    };
    assert_refused(&run(&stream[..stream.len() - 100]), "truncated: frame 3");
    assert_eq!(
        folder.frames_of("out").len(),
        3,
        "what was whole is rendered"
    );
    assert_refused(&run(b""), "it is empty");
    assert_refused(&run(b"YUV4"), "truncated in the middle of a line");
    assert_refused(&run(b"RIFF\n"), "begin with YUV4MPEG2");
    let two: Vec<u8> = [y4m(48, 36, 1), y4m(40, 36, 1)].concat();
    assert_refused(&run(&two), "another stream begins at frame 1");
    let header = |words: &str| format!("YUV4MPEG2 {words}\n").into_bytes();
    assert_refused(&run(&header("W48 H36 It")), "interlaced");
    assert_refused(&run(&header("W48 H36 C420p10")), "8 bits");
    assert_refused(&run(&header("W48 Hx")), "size");
    assert_refused(&run(&header("W48")), "lacks W or H");
    let mut noise = y4m(48, 36, 1);
    noise.extend(b"NOISE\n");
    assert_refused(&run(&noise), "frame 1 does not begin with FRAME");
}
