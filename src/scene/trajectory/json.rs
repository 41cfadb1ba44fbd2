//! JSON: this program's own (`world_from_camera`), nerfstudio's `transforms.json` (`transform_matrix`), and tracked videos with
//! `camera_to_world_gltf`. All three have a list `frames`, camera-to-world matrices of rows, and a camera that looks along its -Z.

use std::path::Path;

use glam::DMat4;
use serde_json::{Map, Value};

use super::json_intrinsics::{Style, style_of};
use super::json_values::{Problem, number};
use super::{Entry, EntryKey, Result, Trajectory, file_error, name_of, pose_of_rows};

const POSE_KEYS: &[&str] = &[
    "world_from_camera",
    "transform_matrix",
    "camera_to_world_gltf",
];

pub(super) fn read(path: &Path, text: &str) -> Result<Trajectory> {
    let document: Value =
        serde_json::from_str(text).map_err(|error| super::TrajectoryError::Line {
            path: path.into(),
            line: error.line(),
            message: syntax_problem(text, &error),
        })?;
    read_document(path, &document).map_err(|message| file_error(path, message))
}

/// Python writes NaN and Infinity, which JSON does not have.
fn syntax_problem(text: &str, error: &serde_json::Error) -> String {
    let line = text
        .lines()
        .nth(error.line().saturating_sub(1))
        .unwrap_or("");
    for word in ["NaN", "Infinity"] {
        if line.contains(word) {
            return format!(
                "a number is {word}; expected finite numbers; correct it, or give the pose as null so that its frame passes through"
            );
        }
    }
    format!("it is no valid JSON ({error}); expected a list `frames` of poses; repair the file")
}

fn read_document(path: &Path, document: &Value) -> Problem<Trajectory> {
    let Some(root) = document.as_object() else {
        return Err(
            "it is no JSON object; expected a list `frames` in one; correct the file".to_owned(),
        );
    };
    let Some(frames) = root.get("frames").and_then(Value::as_array) else {
        return Err(
            "it lacks the list `frames`; expected one entry for each frame; add it".to_owned(),
        );
    };
    let rate = ["frames_per_second", "nominal_fps"]
        .iter()
        .find_map(|key| root.get(*key).map(|value| number(value, key)))
        .transpose()?;
    if rate.is_some_and(|rate| rate <= 0.0) {
        return Err(
            "the frame rate is not above 0; expected frames per second; correct it".to_owned(),
        );
    }
    let tables = std::iter::once(root).chain(frames.iter().filter_map(Value::as_object));
    let style = style_of(tables)?;
    let mut entries = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let place = format!("frames[{index}]");
        let entry = read_entry(frame, root, style, place.clone())
            .map_err(|problem| format!("{place}: {problem}"))?;
        entries.push(entry);
    }
    // Frames that bring what is missing at the top do without its own.
    let all_own = !entries.is_empty() && entries.iter().all(|entry| entry.intrinsics.is_some());
    Ok(Trajectory {
        path: path.into(),
        files: vec![path.into()],
        frames_per_second: rate,
        intrinsics: match all_own {
            true => None,
            false => style.of_all(root)?,
        },
        entries,
        known_points: Vec::new(),
    })
}

fn read_entry(
    frame: &Value,
    root: &Map<String, Value>,
    style: Style,
    place: String,
) -> Problem<Entry> {
    let Some(frame) = frame.as_object() else {
        return Err("it is no object; expected a frame with its pose; correct it".to_owned());
    };
    let Some(pose) = POSE_KEYS.iter().find_map(|key| frame.get(*key)) else {
        return Err(format!(
            "its pose is absent; expected `{}`; add the pose, or null so that its frame passes through",
            POSE_KEYS.join("`, `")
        ));
    };
    let name = ["file_path", "file"].iter().find_map(|key| frame.get(*key));
    let key = match (frame.get("frame"), name) {
        (Some(number), _) => number
            .as_u64()
            .and_then(|number| u32::try_from(number).ok())
            .map(EntryKey::Number)
            .ok_or("`frame` is no frame number; expected a whole number from 0; correct it")?,
        (None, Some(name)) => {
            let name = name
                .as_str()
                .ok_or("its file name is no string; expected one; correct it")?;
            name_of(name)
        }
        (None, None) => {
            return Err(
                "it says not which frame it is; expected `frame` or `file_path`; add one"
                    .to_owned(),
            );
        }
    };
    let optional = |key: &str| frame.get(key).map(|value| number(value, key)).transpose();
    Ok(Entry {
        key,
        place,
        time_secs: optional("time_secs")?,
        world_from_camera: read_pose(pose)?,
        intrinsics: style.of_frame(frame, root)?,
        focus_distance_m: optional("focus_distance_m")?
            .map(|focus| match focus > 0.0 {
                true => Ok(focus),
                false => Err("`focus_distance_m` is not above 0; expected metres; correct it"),
            })
            .transpose()?,
    })
}

/// A matrix of rows; `None`: null.
pub(super) fn read_pose(pose: &Value) -> Problem<Option<DMat4>> {
    if pose.is_null() {
        return Ok(None);
    }
    let shape = "the pose is no matrix; expected 4 rows of 4 numbers, or null; correct it";
    let rows = pose
        .as_array()
        .filter(|rows| rows.len() == 4)
        .ok_or(shape)?;
    let mut matrix = [[0.0; 4]; 4];
    for (numbers, row) in matrix.iter_mut().zip(rows) {
        let row = row.as_array().filter(|row| row.len() == 4).ok_or(shape)?;
        for (value, element) in numbers.iter_mut().zip(row) {
            *value = number(element, "an element of the pose")?;
        }
    }
    pose_of_rows(matrix).map(Some)
}
