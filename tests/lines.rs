//! Cameras read from straight lines and squares of real photographs.

use std::path::Path;

use glam::{DMat4, DVec3, Vec3Swizzles};
use mixray::scene::Photo;
use mixray::start::{Basis, Lines, lines_of};
use mixray::video::{FrameSource, Taken};
use serde_json::Value;

use crate::support::shared_data;

/// Every so many frames of a video are looked at.
const EVERY: usize = 6;

/// The focal length of a video, and up in the camera's space for each of its frames that has a pose.
fn truth(folder: &Path) -> (f64, Vec<Option<DVec3>>) {
    let text = std::fs::read_to_string(folder.join("trajectory.json")).unwrap();
    let trajectory: Value = serde_json::from_str(&text).unwrap();
    let up = |frame: &Value| {
        let pose = frame["camera_to_world_gltf"].clone();
        let rows: Option<[[f64; 4]; 4]> = serde_json::from_value(pose).unwrap();
        let camera_from_world = DMat4::from_cols_array_2d(&rows?).transpose().inverse();
        Some(camera_from_world.transform_vector3(DVec3::Y))
    };
    let frames = trajectory["frames"].as_array().unwrap();
    (
        trajectory["fx"].as_f64().unwrap(),
        frames.iter().map(up).collect(),
    )
}

fn is_right(lines: &Lines, focal_px: f64, up: DVec3) -> bool {
    let off_deg = lines.up.dot(up).clamp(-1.0, 1.0).acos().to_degrees();
    (lines.focal_px / focal_px - 1.0).abs() < 0.1 && off_deg < 2.0
}

fn share(of: &[(Lines, DVec3)], what: impl Fn(&Lines, DVec3) -> bool) -> f64 {
    let count = of.iter().filter(|(lines, up)| what(lines, *up)).count();
    count as f64 / of.len() as f64
}

#[test]
fn a_chessboard_tells_focal_length_and_horizon() {
    let Some(folder) = shared_data("webcam_chessboard_video") else {
        return;
    };
    let (focal_px, ups) = truth(&folder);
    let mut video = FrameSource::open(&folder.join("movie.mjpeg")).unwrap();
    let (mut looked_at, mut number) = (0, 0);
    let mut found: Vec<(Lines, DVec3)> = Vec::new();
    while let Some((_, taken)) = video.next(&|_| true).unwrap() {
        if let (0, Some(up), Taken::Whole(frame)) = (number % EVERY, ups[number], taken) {
            looked_at += 1;
            found.extend(lines_of(&frame.photo, None).map(|lines| (lines, up)));
        }
        number += 1;
    }
    assert!(looked_at >= 15 && found.len() * 10 >= looked_at * 7);
    assert!(share(&found, |lines, up| is_right(lines, focal_px, up)) >= 0.9);
    let within = share(&found, |lines, _| {
        (lines.focal_px / focal_px - 1.0).abs() < lines.focal_sigma
    });
    assert!(within >= 0.66, "{within}");
    // Another lens and another direction would not be right.
    assert!(share(&found, |lines, up| is_right(lines, 1.3 * focal_px, up)) < 0.1);
    assert!(share(&found, |lines, up| is_right(lines, focal_px, up.yzx())) < 0.1);
}

#[test]
fn markers_on_curved_paper_tell_them_through_a_lens_that_bends_lines() {
    let Some(folder) = shared_data("webcam_marker_grid_video") else {
        return;
    };
    let (focal_px, ups) = truth(&folder);
    let mut found = Vec::new();
    let mut looked_at = 0;
    for entry in std::fs::read_dir(folder.join("frames")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        let number: usize = name.trim_start_matches("frame_").parse().unwrap();
        if let Some(up) = ups[number] {
            looked_at += 1;
            let photo = Photo::read(&path).unwrap().0;
            found.extend(lines_of(&photo, None).map(|lines| (lines, up)));
        }
    }
    assert!(looked_at >= 3 && found.len() * 10 >= looked_at * 7);
    assert!(
        found
            .iter()
            .all(|(lines, _)| matches!(lines.basis, Basis::Squares { .. }))
    );
    assert!(share(&found, |lines, up| is_right(lines, focal_px, up)) >= 0.8);
    assert!(share(&found, |lines, up| is_right(lines, focal_px, -up)) == 0.0);
}

#[test]
fn circuit_boards_and_blurred_text_tell_nothing() {
    let mut looked_at = 0;
    for name in ["focus_stack_pcb", "real_blur_photos"] {
        let Some(folder) = shared_data(name) else {
            return;
        };
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|ending| ending == "jpg") {
                looked_at += 1;
                let lines = lines_of(&Photo::read(&path).unwrap().0, None);
                assert!(lines.is_none(), "{}: {lines:?}", path.display());
            }
        }
    }
    assert!(looked_at >= 10, "{looked_at}");
}
