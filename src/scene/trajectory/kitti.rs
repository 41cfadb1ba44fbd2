//! KITTI odometry: the twelve numbers of three rows a line, world-from-camera in OpenCV's axes, a line for each frame in order.

use std::path::Path;

use super::{
    Entry, EntryKey, Result, Trajectory, from_opencv_axes, line_error, numbers, pose_of_rows,
};

/// Of a pose.
const NUMBERS: usize = 12;

/// The first line that is no remark has as many numbers.
pub(super) fn is_kitti(text: &str) -> bool {
    let line = text.lines().map(str::trim).find(|line| !is_remark(line));
    line.is_some_and(|line| line.split_whitespace().count() == NUMBERS)
}

fn is_remark(line: &str) -> bool {
    line.is_empty() || line.starts_with('#')
}

pub(super) fn read(path: &Path, text: &str) -> Result<Trajectory> {
    let mut entries = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if is_remark(line.trim()) {
            continue;
        }
        let number = index + 1;
        let entry = read_line(line, entries.len() as u32, number);
        entries.push(entry.map_err(|problem| line_error(path, number, problem))?);
    }
    Ok(Trajectory {
        path: path.into(),
        files: vec![path.into()],
        frames_per_second: None,
        intrinsics: None,
        entries,
        known_points: Vec::new(),
    })
}

fn read_line(line: &str, place: u32, number: usize) -> std::result::Result<Entry, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let form = "KITTI's three rows of four";
    if words.len() > NUMBERS {
        return Err(format!(
            "it has {} words; expected {form}; correct the line",
            words.len()
        ));
    }
    let [a, b, c]: [[f64; 4]; 3] = bytemuck::cast(numbers::<NUMBERS>(&words, form)?);
    let pose = pose_of_rows([a, b, c, [0.0, 0.0, 0.0, 1.0]])?;
    Ok(Entry {
        key: EntryKey::Order(place),
        place: format!("line {number}"),
        time_secs: None,
        world_from_camera: Some(from_opencv_axes(pose)),
        intrinsics: None,
        focus_distance_m: None,
    })
}
