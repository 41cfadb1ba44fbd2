//! TUM RGB-D trajectories: `timestamp tx ty tz qx qy qz qw` a line, world-from-camera in OpenCV's axes.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::frame_name::unit_of_epoch;
use super::{
    Entry, EntryKey, Result, Trajectory, from_opencv_axes, line_error, numbers, pose_of_quaternion,
};

pub(super) fn read(path: &Path, text: &str) -> Result<Trajectory> {
    let mut entries: Vec<Entry> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let number = index + 1;
        let words: Vec<&str> = line.split_whitespace().collect();
        let entry = read_line(&words, entries.len() as u32, number)
            .map_err(|problem| line_error(path, number, problem))?;
        if entries
            .last()
            .is_some_and(|before| before.time_secs >= entry.time_secs)
        {
            return Err(line_error(
                path,
                number,
                "its time stamp is not after the line before; expected rising time stamps; sort the lines",
            ));
        }
        entries.push(entry);
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

fn read_line(words: &[&str], place: u32, number: usize) -> std::result::Result<Entry, String> {
    let form = "timestamp tx ty tz qx qy qz qw";
    if let Some(other) = other_form(words.len()) {
        return Err(format!(
            "{} numbers, as {other}; expected {form}, or KITTI's twelve; convert the file",
            words.len()
        ));
    }
    let mut words = words.to_vec();
    let secs = words.first().and_then(|stamp| secs_of_epoch(stamp));
    if let (Some(secs), [stamp, ..]) = (&secs, &mut words[..]) {
        *stamp = secs;
    }
    let [time, x, y, z, qx, qy, qz, qw] = numbers::<8>(&words, form)?;
    let quaternion = DQuat::from_xyzw(qx, qy, qz, qw);
    let pose = pose_of_quaternion(quaternion, DVec3::new(x, y, z))?;
    Ok(Entry {
        key: EntryKey::Order(place),
        place: format!("line {number}"),
        time_secs: Some(time),
        world_from_camera: Some(from_opencv_axes(pose)),
        intrinsics: None,
        focus_distance_m: None,
    })
}

/// Seconds, of Unix time in whole milli-, micro- or nanoseconds, as recorders of robots write it.
fn secs_of_epoch(stamp: &str) -> Option<String> {
    let number: u64 = stamp.parse().ok()?;
    Some((number as f64 / unit_of_epoch(number)?).to_string())
}

/// What is written in lines of so many numbers, of which the first eight would pass for a pose.
fn other_form(words: usize) -> Option<&'static str> {
    match words {
        13 => Some("in KITTI-360's poses, a frame's number before three rows"),
        16 => Some("in matrices of four rows"),
        17 => Some("in KITTI-360's poses, a frame's number before four rows"),
        9.. => Some("in no list of poses that is known"),
        _ => None,
    }
}
