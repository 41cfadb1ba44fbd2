//! What cannot be used is called by its name, and nothing else is said.

use super::support::{FOCAL_PX, ball, ball_with_camera};
use crate::support::{Folder, assert_refused, stderr, stdout};

#[test]
fn kitti() {
    let folder = Folder::new();
    folder.write("scene.toml", ball_with_camera());
    let names = ["f_0000.png", "f_0001.png", "f_0002.png"];
    folder.grey_frames(&names);
    let steps = [0.0, 0.1, 0.2];
    let line = |x: f64| format!("1 0 0 {x} 0 1 0 0 0 0 1 -3\n");
    let text = steps.map(line).concat();
    folder.write("t.txt", &text);
    folder.sequence_of("frames", "t.txt", "");
    for (name, x) in names.iter().zip(steps) {
        let seen = folder.ball_at(name)[0];
        assert!(
            (seen - (32.0 - FOCAL_PX * x / 3.0)).abs() < 0.5,
            "{name}: {seen}"
        );
    }
    folder.write("t.txt", text.replacen("1 0 0 0.1", "1 0 0", 1));
    folder.refuse_sequence_of("frames", "t.txt", "t.txt:2: 11 numbers where KITTI's");
    folder.write("t.txt", text.replacen("1 0 0 0.1", "2 0 0 0.1", 1));
    folder.refuse_sequence_of("frames", "t.txt", "not rigid");
    // The first eight of more numbers would pass for a pose.
    for (before, after, part) in [("0 ", "", "KITTI-360"), ("", " 0 0 0 1", "four rows")] {
        let lines = [1, 2, 3].map(|n| format!("{before}{n} 1 0 0 0.1 0 0 0 1 0 0 -3{after}\n"));
        folder.write("t.txt", lines.concat());
        folder.refuse_sequence_of("frames", "t.txt", part);
    }
    folder.write("t.txt", format!("\u{feff}# of an editor\n{text}"));
    folder.sequence_of("frames", "t.txt", "");
    let euroc = "#timestamp, p_RS_R_x [m], p_RS_R_y [m]\n1403636579758555392,4.68,-1.78\n";
    folder.write("t.txt", euroc);
    folder.refuse_sequence_of("frames", "t.txt", "EuRoC");
}

#[test]
fn mp4() {
    let folder = Folder::new();
    folder.write("scene.toml", ball_with_camera());
    folder.write("t.txt", "0 0 0 -3 0 0 0 1\n");
    for (bytes, kind) in [
        (&b"\0\0\0\x20ftypisom\0\0\x02\0isom\n"[..], "MP4"),
        (&b"\x1a\x45\xdf\xa3\x01\0\0\0\0\0\0\x1f"[..], "Matroska"),
        (&b"RIFF\x24\0\0\0AVI LIST"[..], "AVI"),
        (&b"\0\0\0\x08wide\0\0\0\x08mdat"[..], "QuickTime"),
        (
            &b"\x30\x26\xb2\x75\x8e\x66\xcf\x11\xa6\xd9\0\xaa"[..],
            "Windows Media",
        ),
        (
            &b"\x47\x40\x11\x10\0\x42\xf0\x25\0\x01\xc1\0"[..],
            "YUV4MPEG2",
        ),
    ] {
        folder.write("in.mp4", bytes);
        folder.refuse_sequence_of("in.mp4", "t.txt", kind);
        folder.refuse_sequence_of("in.mp4", "t.txt", "ffmpeg");
    }
    folder.write("in.mp4", b"YUV4MPEG2 W4");
    folder.refuse_sequence_of("in.mp4", "t.txt", "truncated");
}

#[test]
fn lens_focus_inside_focal() {
    let folder = Folder::new();
    let scene = |focus: &str| {
        ball(0.2).replace(
            "[camera]\n",
            &format!(
                "[camera]\nwidth = 64\nheight = 48\nfx = 60\nposition = [0, 0, 3]\nlook_at = [0, 0, 0]\n[lens]\nf_number = 2\nfocal_length_mm = 50\nfocus_distance_m = {focus}\n"
            ),
        )
    };
    folder.write("scene.toml", scene("0.04"));
    folder.refuse(
        "render scene.toml -o out.png",
        "nearer than the focal length",
    );
    folder.write("scene.toml", scene("0.06"));
    folder.succeed("render scene.toml -o out.png");
    // Of each frame, and of a pull, before the first is rendered.
    folder.grey_frames(&["f_0.png", "f_1.png"]);
    let poses = |focus: &str| {
        let frame = |number: u32, focus: &str| {
            format!(
                r#"{{"frame": {number}, "focus_distance_m": {focus}, "world_from_camera": [[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}}"#
            )
        };
        let frames = [frame(0, "1"), frame(1, focus)].join(", ");
        folder.write("t.json", format!(r#"{{"frames": [{frames}]}}"#));
    };
    poses("0.04");
    folder.refuse_sequence_of(
        "frames",
        "t.json",
        "t.json: frames[1]: `focus_distance_m` is 0.04",
    );
    assert!(!folder.path("out").exists());
    poses("0.06");
    folder.sequence_of("frames", "t.json", "");
    let pull =
        |from: &str| folder.run_sequence("frames", "t.json", &format!("--focus-pull {from}..2"));
    assert_refused(&pull("0.04"), "--focus-pull");
    assert_eq!(pull("0.06").status.code(), Some(0), "control");
}

#[test]
fn nothing_virtual_is_seen() {
    let folder = Folder::new();
    let scene = |z: f64| {
        ball(0.2).replace(
            "[camera]\n",
            &format!("[camera]\nwidth = 64\nheight = 48\nfx = 60\nposition = [0, 0, {z}]\nlook_at = [0, 0, -9]\n"),
        )
    };
    for (z, is_told) in [(-3.0, true), (3.0, false)] {
        folder.write("scene.toml", scene(z));
        let output = folder.run("render scene.toml -o out.png");
        assert_eq!(output.status.code(), Some(0));
        assert_eq!(stderr(&output).contains("nothing virtual is seen"), is_told);
    }
}

/// The Vulkan loader's layers have nothing to say, with a device or before one is needed.
#[test]
fn no_complaints_of_the_vulkan_loader() {
    let folder = Folder::new();
    for command in ["info", "bench none.toml -o out"] {
        let mut command = folder.command(command);
        let output = command
            .env_remove("XDG_RUNTIME_DIR")
            .output()
            .expect("runs");
        let said = stderr(&output);
        assert!(!said.contains("XDG_RUNTIME_DIR"), "{said}");
        assert!(
            stdout(&output).contains("gpu") || said.contains("none.toml"),
            "{said}"
        );
    }
    folder.refuse(
        "bench none.toml -o out",
        "none.toml: the scene file cannot be read",
    );
}
