//! Real videos.

use crate::support::{Folder, shared_data};

#[test]
fn the_chessboard_video() {
    let Some(video) = shared_data("webcam_chessboard_video/movie.mjpeg") else {
        return;
    };
    let folder = Folder::new();
    folder.write(
        "board.toml",
        "[chessboard]\ncolumns = 6\nrows = 4\nsquare_m = 0.03\n",
    );
    let video = video.display().to_string();
    folder.succeed(&[
        "track",
        &video,
        "--board",
        "board.toml",
        "-o",
        "poses.json",
        "--report",
        "track.json",
    ]);
    let report = folder.json("track.json");
    let posed = report["frames_posed"].as_u64().unwrap();
    let rms = report["rms_px"].as_f64().unwrap();
    assert!(posed >= 120 && rms < 0.10, "{posed} frames, {rms} px");
    // Another size does not fit.
    folder.write(
        "other.toml",
        "[chessboard]\ncolumns = 9\nrows = 6\nsquare_m = 0.03\n",
    );
    folder.refuse(
        &["track", &video, "--board", "other.toml", "-o", "poses.json"],
        "expected",
    );
}

#[test]
fn stills_of_the_marker_video() {
    let Some(frames) = shared_data("webcam_marker_grid_video/frames") else {
        return;
    };
    let folder = Folder::new();
    let frames = frames.display().to_string();
    folder.succeed(&[
        "track",
        &frames,
        "--marker-size",
        "40mm",
        "-o",
        "poses.json",
        "--report",
        "track.json",
    ]);
    let report = folder.json("track.json");
    assert_eq!(report["family"]["name"], "square-binary-3x3");
    assert_eq!(report["family"]["ids"], 12);
    let rms = report["rms_px"].as_f64().unwrap();
    assert!(rms < 0.3, "{rms}");
}
