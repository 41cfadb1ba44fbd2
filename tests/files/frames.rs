//! Which frame is which, and which pose is whose.

use super::support::{FOCAL_PX, ball_with_camera};
use crate::support::Folder;

fn folder(names: &[&str], poses: &str) -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", ball_with_camera());
    folder.grey_frames(names);
    folder.write("t.txt", poses);
    folder
}

/// The ball stands still, so that it is seen on the other side of the camera's step.
fn column(camera_x_m: f64) -> f64 {
    32.0 - FOCAL_PX * camera_x_m / 3.0
}

#[test]
fn frames_stamp() {
    let poses = "0.0000 0 0 -3 0 0 0 1\n0.0333 0.5 0 -3 0 0 0 1\n0.0667 -0.5 0 -3 0 0 0 1\n";
    // Seconds, and whole microseconds and nanoseconds; the middle one of the trajectory is dropped.
    for names in [
        ["0.000000.png", "0.066700.png"],
        ["000000.png", "066700.png"],
        ["0.png", "66700000.png"],
        ["0.png", "0.0667.png"],
    ] {
        let folder = folder(&names, poses);
        folder.sequence_of("frames", "t.txt", "");
        for (name, x) in names.iter().zip([0.0, -0.5]) {
            let seen = folder.ball_at(name)[0];
            assert!((seen - column(x)).abs() < 0.5, "{name}: {seen}");
        }
        assert!((column(0.5) - column(-0.5)).abs() > 5.0, "control");
    }
    let folder = folder(&["f_0000.png", "f_0667.png"], poses);
    folder.refuse_sequence_of(
        "frames",
        "t.txt",
        "frame 1 is missing between f_0000.png and f_0667.png",
    );
}

#[test]
fn stamps_of_an_epoch_pair_by_time() {
    let poses =
        "1403636579.7 0 0 -3 0 0 0 1\n1403636579.8 0.5 0 -3 0 0 0 1\n1403636579.9 0 0 -3 0 0 0 1\n";
    let names = ["1403636579800000000.png", "1403636579850000000.png"];
    let folder = folder(&names, poses);
    folder.sequence_of("frames", "t.txt", "");
    for (name, x) in names.iter().zip([0.5, 0.25]) {
        let seen = folder.ball_at(name)[0];
        assert!((seen - column(x)).abs() < 0.5, "{name}: {seen}");
    }
    folder.write("t.txt", poses.replace("14036365", "15036365"));
    folder.refuse_sequence_of("frames", "t.txt", "no pose for 1403636579800000000.png");
}

/// Frames with time stamps may be missing, and are told.
#[test]
fn gaps_between_time_stamps() {
    let poses = "0.0 0 0 -3 0 0 0 1\n0.1 0 0 -3 0 0 0 1\n0.2 0 0 -3 0 0 0 1\n";
    for (names, gap) in [
        (
            ["0.000.png", "0.033.png", "0.067.png", "0.167.png"],
            "0.1000 s between 0.067.png and 0.167.png",
        ),
        (
            ["0.png", "100000000.png", "133000000.png", "167000000.png"],
            "0.1000 s between 0.png and 100000000.png",
        ),
    ] {
        let folder = folder(&names, poses);
        let said = folder.sequence_of("frames", "t.txt", "");
        assert!(said.contains(gap), "{said}");
        assert_eq!(said.matches(" s between ").count(), 1, "{said}");
        let said = folder.sequence_of("frames", "t.txt", "--allow-gaps");
        assert!(!said.contains("are missing"), "{said}");
    }
    // A film's jitter is no gap.
    let even = ["0.000.png", "0.033.png", "0.080.png", "0.100.png"];
    let said = folder(&even, poses).sequence_of("frames", "t.txt", "");
    assert!(!said.contains("are missing"), "control: {said}");
}

#[test]
fn tum_from1() {
    let poses = "# t x y z q\n100.0000 0 0 -3 0 0 0 1\n100.0333 0.5 0 -3 0 0 0 1\n100.0667 -0.5 0 -3 0 0 0 1\n";
    let names = ["f_0001.png", "f_0002.png", "f_0003.png"];
    let folder = folder(&names, poses);
    let said = folder.sequence_of("frames", "t.txt", "");
    assert!(!said.contains("poses for"), "{said}");
    for (name, x) in names.iter().zip([0.0, 0.5, -0.5]) {
        let seen = folder.ball_at(name)[0];
        assert!((seen - column(x)).abs() < 0.5, "{name}: {seen}");
    }
    // A range is of numbers, and takes the same pose.
    let whole = folder.bytes("out/f_0002.png");
    folder.sequence_of("frames", "t.txt", "--range 2..3");
    assert_eq!(folder.bytes("out/f_0002.png"), whole);
    folder.write("t.txt", format!("{poses}100.1 0 0 -3 0 0 0 1\n"));
    let said = folder.sequence_of("frames", "t.txt", "");
    assert!(said.contains("4 poses for 3 frames"), "control: {said}");
}

/// Numbers without leading zeros are in the order of numbers, in a folder and in a trajectory.
#[test]
fn unpadded_numbers_are_in_order() {
    let names = ["f_9.png", "f_10.png", "f_11.png"];
    let poses = "0 0 0 -3 0 0 0 1\n1 0.5 0 -3 0 0 0 1\n2 -0.5 0 -3 0 0 0 1\n";
    let folder = folder(&names, poses);
    folder.sequence_of("frames", "t.txt", "");
    for (name, x) in names.iter().zip([0.0, 0.5, -0.5]) {
        let seen = folder.ball_at(name)[0];
        assert!((seen - column(x)).abs() < 0.5, "{name}: {seen}");
    }
}

/// Numbers before something else that all names have.
#[test]
fn numbers_within_names_are_in_order() {
    let poses = "0 0 0 -3 0 0 0 1\n1 0.5 0 -3 0 0 0 1\n2 -0.5 0 -3 0 0 0 1\n";
    for names in [
        ["9_rgb.png", "10_rgb.png", "11_rgb.png"],
        ["shot_9_64x48.png", "shot_10_64x48.png", "shot_11_64x48.png"],
        [
            "rgb_1403636579.950.png",
            "rgb_1403636579.983.png",
            "rgb_1403636580.017.png",
        ],
    ] {
        let poses = match names[0].starts_with("rgb") {
            true => poses
                .replace("0 0 0 -3", "1403636579.950 0 0 -3")
                .replace("1 0.5", "1403636579.983 0.5")
                .replace("2 -0.5", "1403636580.017 -0.5"),
            false => poses.to_owned(),
        };
        let folder = folder(&names, &poses);
        folder.sequence_of("frames", "t.txt", "");
        for (name, x) in names.iter().zip([0.0, 0.5, -0.5]) {
            let seen = folder.ball_at(name)[0];
            assert!((seen - column(x)).abs() < 0.5, "{name}: {seen}");
        }
    }
    let gap = folder(&["9_rgb.png", "11_rgb.png"], poses);
    gap.refuse_sequence_of("frames", "t.txt", "frame 10 is missing");
}

#[test]
fn files_of_one_output_name_are_refused() {
    let folder = folder(&["a.png", "a.jpg"], "0 0 0 -3 0 0 0 1\n1 0 0 -3 0 0 0 1\n");
    folder.refuse_sequence_of("frames", "t.txt", "a.jpg and a.png");
}

#[test]
fn frames_in_subfolders() {
    let names = ["cam1/f_0000.png", "cam2/f_0000.png"];
    let folder = folder(&names, "");
    let entry = |file: &str, x: f64| {
        format!(
            r#"{{"file_path": "./images/{file}", "transform_matrix": [[1,0,0,{x}],[0,1,0,0],[0,0,1,3],[0,0,0,1]]}}"#
        )
    };
    let poses = |a: &str, b: &str| {
        folder.write(
            "t.json",
            format!(r#"{{"frames": [{}, {}]}}"#, entry(a, -0.3), entry(b, 0.3)),
        );
    };
    poses(names[0], names[1]);
    for (camera, x) in [("cam1", -0.3), ("cam2", 0.3)] {
        folder.sequence_of(&format!("frames/{camera}"), "t.json", "");
        let seen = folder.ball_at("f_0000.png")[0];
        assert!((seen - column(x)).abs() < 0.5, "{camera}: {seen}");
    }
    folder.refuse_sequence_of("frames", "t.json", "folders cam1, cam2");
    folder.grey_frames(&["f_0000.png"]);
    folder.refuse_sequence_of(
        "frames",
        "t.json",
        "several folders (images/cam1, images/cam2)",
    );
    poses("cam1/f_0000.png", "cam1/f_0000.png");
    folder.refuse_sequence_of("frames", "t.json", "are the same frame");
}

/// A model of two cameras of a rig, in text and in COLMAP's binary form.
fn colmap(folder: &Folder, binary: bool) {
    let images = [("cam1/f_0000.png", -0.3), ("cam2/f_0000.png", 0.3)];
    folder.create("c");
    if !binary {
        folder.write(
            "c/cameras.txt",
            format!("1 PINHOLE 64 48 {FOCAL_PX} {FOCAL_PX} 32 24\n"),
        );
        let lines: Vec<String> = images
            .iter()
            .map(|(name, x)| format!("1 1 0 0 0 {} 0 3 1 {name}\n\n", -x))
            .collect();
        folder.write("c/images.txt", lines.concat());
        return;
    }
    let mut cameras = 1u64.to_le_bytes().to_vec();
    cameras.extend([1u32, 1].map(u32::to_le_bytes).concat());
    cameras.extend([64u64, 48].map(u64::to_le_bytes).concat());
    cameras.extend(
        [FOCAL_PX, FOCAL_PX, 32.0, 24.0]
            .map(f64::to_le_bytes)
            .concat(),
    );
    folder.write("c/cameras.bin", cameras);
    let mut bytes = 2u64.to_le_bytes().to_vec();
    for (number, (name, x)) in (1u32..).zip(images) {
        bytes.extend(number.to_le_bytes());
        bytes.extend(
            [1.0, 0.0, 0.0, 0.0, -x, 0.0, 3.0]
                .map(f64::to_le_bytes)
                .concat(),
        );
        bytes.extend(1u32.to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.push(0);
        // One observation, of no point.
        bytes.extend(1u64.to_le_bytes());
        bytes.extend([3.0, 4.0].map(f64::to_le_bytes).concat());
        bytes.extend((-1i64).to_le_bytes());
    }
    folder.write("c/images.bin", bytes);
}

#[test]
fn colmap_sub() {
    for binary in [false, true] {
        let folder = folder(&["cam1/f_0000.png", "cam2/f_0000.png"], "");
        colmap(&folder, binary);
        for (camera, x) in [("cam1", -0.3), ("cam2", 0.3)] {
            folder.sequence_of(&format!("frames/{camera}"), "c", "");
            let seen = folder.ball_at("f_0000.png")[0];
            assert!(
                (seen - column(x)).abs() < 0.5,
                "{camera}, binary {binary}: {seen}"
            );
        }
        folder.grey_frames(&["f_0000.png"]);
        folder.refuse_sequence_of("frames", "c", "several folders (cam1, cam2)");
        if binary {
            let whole = folder.bytes("c/images.bin");
            folder.write("c/images.bin", &whole[..whole.len() - 9]);
            folder.refuse_sequence_of(
                "frames/cam1",
                "c",
                "images.bin: item 1: the file ends early",
            );
        }
    }
}
