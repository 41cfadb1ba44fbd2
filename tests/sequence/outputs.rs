//! Where frames go and in which form: EXR files, PNG files of 16 bits, films that other programs read.

use std::io::Write;
use std::process::{Command, Stdio};

use mixray::film::Picture;
use mixray::output::{ChannelFile, PngBits, Target, write_png};
use mixray::scene::Photo;
use mixray::scene::srgb::encode8;

use super::support::{BALL, sequence, y4m};
use crate::support::{Folder, stderr};

/// Four frames, the third without a pose.
fn folder() -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", BALL);
    folder.frames(4, 0.1);
    folder.trajectory(4, 0.1, &[2]);
    folder
}

/// Codes of R, G and B.
fn codes(folder: &Folder, name: &str) -> Vec<[u8; 3]> {
    let file = ChannelFile::read(&folder.path(name)).expect("reads");
    let rgb = file.rgb(["R", "G", "B"]).expect("R, G and B");
    rgb.iter().map(|pixel| pixel.map(encode8)).collect()
}

#[test]
fn exr_frames_are_the_png_frames_with_layers() {
    let folder = folder();
    folder.sequence(&["--frames", "in", "-o", "png"]);
    folder.sequence(&["--frames", "in", "-o", "shot/out.####.exr"]);
    folder.sequence(&["--frames", "in", "-o", "exr", "--format", "exr"]);
    for number in 0..4 {
        let pattern = format!("shot/out.{number:04}.exr");
        let picture = folder.open(&format!("png/f_{number:04}.png"));
        let expected: Vec<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
        let photo = folder.open(&format!("in/f_{number:04}.png"));
        let own = photo.pixels().map(|pixel| pixel.0).collect();
        let photo = Photo::from_srgb8(photo.width(), photo.height(), own);
        let file = ChannelFile::read(&folder.path(&pattern)).expect("reads");
        let picture = Picture {
            width: photo.width,
            height: photo.height,
            linear: file.rgb(["R", "G", "B"]).expect("R, G and B"),
        };
        let target = Target::picture(&folder.path("of-exr.png")).expect("writable");
        write_png(&target, &picture, Some(&photo), PngBits::Eight).expect("writes");
        // Half floats may fall on the other side of a code's edge.
        let found = folder.open("of-exr.png");
        let found: Vec<[u8; 3]> = found.pixels().map(|pixel| pixel.0).collect();
        let pairs = found.as_flattened().iter().zip(expected.as_flattened());
        let off: Vec<u8> = pairs.map(|(a, b)| a.abs_diff(*b)).collect();
        let equal = off.iter().filter(|d| **d == 0).count();
        assert!(off.iter().all(|d| *d <= 1), "frame {number}");
        assert!(100 * equal >= 99 * off.len(), "frame {number}: {equal}");
        let named = format!("exr/f_{number:04}.exr");
        assert!(folder.bytes(&pattern) == folder.bytes(&named));
        let file = ChannelFile::read(&folder.path(&pattern)).expect("reads");
        let covered: f32 = file.floats["virtual.A"].iter().sum();
        assert_eq!(covered > 10.0, number != 2, "frame {number}: {covered}");
    }
    assert!(
        codes(&folder, "shot/out.0000.exr") != codes(&folder, "shot/out.0001.exr"),
        "control"
    );
    let said = folder.sequence(&["--frames", "in", "-o", "shot/out.####.exr"]);
    assert!(said.contains("4 kept"), "{said}");
    let layers = ["--frames", "in", "-o", "mask.#.exr", "--layers", "mask"];
    folder.sequence(&layers);
    let file = ChannelFile::read(&folder.path("mask.3.exr")).expect("reads");
    assert_eq!(file.floats.keys().collect::<Vec<_>>(), ["mask.Y"]);
}

/// Killed or damaged, EXR and 16-bit frames are rendered again, to the same bytes.
#[test]
fn damaged_frames_of_any_form_are_rendered_again() {
    let folder = folder();
    for (to, frame) in [
        (vec!["-o", "a.####.exr"], "a.0001.exr"),
        (vec!["-o", "b", "--png-bits", "16"], "b/f_0001.png"),
    ] {
        let to = [vec!["--frames", "in"], to].concat();
        folder.sequence(&to);
        let whole = folder.bytes(frame);
        let mut flipped = whole.clone();
        flipped[whole.len() * 2 / 3] ^= 4;
        let cut = whole[..whole.len() - 1].to_vec();
        for damaged in [cut, flipped, vec![0; whole.len()], Vec::new()] {
            folder.write(frame, damaged);
            let said = folder.sequence(&to);
            assert!(
                said.contains("1 rendered") && said.contains("3 kept"),
                "{said}"
            );
            assert!(folder.bytes(frame) == whole);
        }
        let said = folder.sequence(&to);
        assert!(said.contains("4 kept"), "control: {said}");
        folder.refuse_sequence(&[&to[..], &["--seed", "3"]].concat(), "another render");
    }
    let picture = image::open(folder.path("b/f_0001.png")).expect("opens");
    assert_eq!(picture.color(), image::ColorType::Rgb16);
}

#[test]
fn names_that_promise_what_cannot_be_written_are_refused() {
    let folder = folder();
    for (to, part) in [
        ("-o out.exr", "a pattern like out.####.exr"),
        ("-o out.mp4", "a file that ends in .y4m"),
        ("-o out.####.jpg", "a pattern like"),
        ("-o out.y4m --format exr", "a folder or a pattern"),
        ("-o out --layers mask", "EXR frames for --layers"),
        ("-o out --stats out.toml", "expected .json"),
    ] {
        let to: Vec<&str> = to.split(' ').collect();
        folder.refuse_sequence(&[&["--frames", "in"], &to[..]].concat(), part);
        assert!(!folder.path(to[1]).exists());
    }
    for (line, part) in [
        ("render scene.toml -o a.jpg", "expected .png or .exr"),
        ("render scene.toml -o a.png --stats s.csv", "expected .json"),
        (
            "noise calibrate --from 0.03,0.5 -o noise.json",
            "expected .toml",
        ),
        ("cartoon in/f_0000.png out.tif", "expected .png or .exr"),
        ("bench scene.toml -o out.html", "expected a folder"),
    ] {
        folder.refuse(line, part);
    }
}

/// Whether ffmpeg is there.
fn has_ffmpeg() -> bool {
    let has = (Command::new("ffmpeg").arg("-version").output()).is_ok_and(|o| o.status.success());
    if !has {
        eprintln!("SKIPPED: ffmpeg is not installed");
    }
    has
}

#[test]
fn ffmpeg_reads_our_films_and_writes_ours() {
    if !has_ffmpeg() {
        return;
    }
    let folder = folder();
    let ffmpeg = |line: &str| {
        let output = Command::new("ffmpeg")
            .args(["-v", "error", "-y"])
            .args(line.split(' '))
            .current_dir(folder.root())
            .output()
            .expect("starts");
        assert!(output.status.success(), "{line}: {}", stderr(&output));
        assert_eq!(stderr(&output), "", "{line}");
        output.stdout
    };
    // A size that makes the header long.
    folder.create("wide");
    for number in 0..4 {
        folder.save_frame(&format!("wide/f_{number}.png"), 1048, 36, number);
    }
    folder.sequence(&["--frames", "wide", "-o", "film.y4m", "--fps", "29.97"]);
    let film = folder.bytes("film.y4m");
    let header = film.iter().position(|byte| *byte == b'\n').expect("a line") + 1;
    let planes = ffmpeg("-i film.y4m -f rawvideo -");
    let frame = 3 * 1048 * 36;
    assert_eq!(planes.len(), 4 * frame);
    for number in 0..4 {
        let ours = &film[header + number * (6 + frame) + 6..][..frame];
        assert!(planes[number * frame..][..frame] == *ours, "frame {number}");
    }
    ffmpeg("-f lavfi -i testsrc=s=48x36:r=10:d=0.4 -pix_fmt yuv420p theirs.y4m");
    folder.sequence(&["--frames", "theirs.y4m", "-o", "again.y4m"]);
    ffmpeg("-i again.y4m -f null -");
    let said = folder.sequence(&["--frames", "theirs.y4m", "-o", "again.y4m"]);
    assert!(said.contains("4 kept"), "{said}");
}

/// Whoever writes the stream writes it to its end.
#[test]
fn a_range_of_a_stream_cuts_nobody_off() {
    let folder = folder();
    let frames = 400;
    folder.trajectory(frames, 0.001, &[]);
    let mut child = folder
        .command(&sequence(&[
            "--frames", "-", "--range", "1..3", "-o", "out.y4m",
        ]))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("starts");
    let stream = y4m(48, 36, frames);
    let mut input = child.stdin.take().expect("piped");
    // Far more than a pipe holds.
    input.write_all(&stream).expect("no broken pipe");
    drop(input);
    let output = child.wait_with_output().expect("ends");
    assert!(output.status.success(), "{}", stderr(&output));
    let header = 41;
    assert!(folder.bytes("out.y4m").len() > header + 2 * 2592);
    assert!(folder.bytes("out.y4m").len() < header + 3 * 2592);
}
