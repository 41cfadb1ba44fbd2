//! JSON: this program's own (`world_from_camera`), nerfstudio's `transforms.json` (`transform_matrix`), and tracked videos with
//! `camera_to_world_gltf`. All three have a list `frames`, camera-to-world matrices of rows, and a camera that looks along its -Z.

use std::path::Path;

use glam::DMat4;
use serde_json::{Map, Value};

use super::{Entry, EntryKey, Intrinsics, Result, Trajectory, file_error, finite, pose_of_rows};

const POSE_KEYS: &[&str] = &[
    "world_from_camera",
    "transform_matrix",
    "camera_to_world_gltf",
];

type Problem<T> = std::result::Result<T, String>;

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
    let mut entries = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let place = format!("frames[{index}]");
        let entry =
            read_entry(frame, place.clone()).map_err(|problem| format!("{place}: {problem}"))?;
        entries.push(entry);
    }
    Ok(Trajectory {
        path: path.into(),
        files: vec![path.into()],
        frames_per_second: rate,
        intrinsics: read_intrinsics(root)?,
        entries,
        known_points: Vec::new(),
    })
}

fn read_entry(frame: &Value, place: String) -> Problem<Entry> {
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
            let file = Path::new(name).file_name().unwrap_or_default();
            EntryKey::Name(file.to_string_lossy().into_owned())
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
        intrinsics: read_intrinsics(frame)?,
        focus_distance_m: optional("focus_distance_m")?
            .map(|focus| match focus > 0.0 {
                true => Ok(focus),
                false => Err("`focus_distance_m` is not above 0; expected metres; correct it"),
            })
            .transpose()?,
    })
}

fn read_pose(pose: &Value) -> Problem<Option<DMat4>> {
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

fn number(value: &Value, what: &str) -> Problem<f64> {
    match value.as_f64() {
        Some(x) => finite(x, what),
        None => Err(format!(
            "{what} is {value}; expected a finite number; correct it"
        )),
    }
}

fn read_intrinsics(table: &Map<String, Value>) -> Problem<Option<Intrinsics>> {
    if let Some(camera) = table.get("camera").and_then(Value::as_object) {
        return own_intrinsics(camera, 0.0).map(Some);
    }
    if table.contains_key("fl_x") {
        return nerfstudio_intrinsics(table).map(Some);
    }
    if table.contains_key("fx") {
        // Tracked videos count pixel centres from 0, as OpenCV does.
        return own_intrinsics(table, 0.5).map(Some);
    }
    Ok(None)
}

fn required(table: &Map<String, Value>, key: &str) -> Problem<f64> {
    match table.get(key) {
        Some(value) => number(value, key),
        None => Err(format!(
            "the intrinsics lack `{key}`; expected it in pixels; add it"
        )),
    }
}

fn size(table: &Map<String, Value>, keys: [&str; 2]) -> Option<(u32, u32)> {
    let side = |key: &str| u32::try_from(table.get(key)?.as_f64()? as u64).ok();
    Some((side(keys[0])?, side(keys[1])?))
}

fn positive_focal_lengths(intrinsics: Intrinsics) -> Problem<Intrinsics> {
    if intrinsics.fx > 0.0 && intrinsics.fy > 0.0 {
        return Ok(intrinsics);
    }
    Err("a focal length is not above 0; expected pixels; correct the intrinsics".to_owned())
}

fn own_intrinsics(table: &Map<String, Value>, centre_offset: f64) -> Problem<Intrinsics> {
    let distortion = match table.get("distortion") {
        None => [0.0; 5],
        Some(Value::Array(values)) if values.len() == 5 => {
            let mut distortion = [0.0; 5];
            for (k, value) in distortion.iter_mut().zip(values) {
                *k = number(value, "a distortion coefficient")?;
            }
            distortion
        }
        Some(Value::Object(named)) => coefficients(named)?,
        Some(_) => {
            return Err("`distortion` is not understood; expected OpenCV's k1 k2 p1 p2 k3 as a list; correct it".to_owned());
        }
    };
    positive_focal_lengths(Intrinsics {
        size: size(table, ["width", "height"]),
        fx: required(table, "fx")?,
        fy: required(table, "fy")?,
        cx: required(table, "cx")? + centre_offset,
        cy: required(table, "cy")? + centre_offset,
        distortion,
    })
}

fn coefficients(table: &Map<String, Value>) -> Problem<[f64; 5]> {
    let mut distortion = [0.0; 5];
    for (k, key) in distortion.iter_mut().zip(["k1", "k2", "p1", "p2", "k3"]) {
        if let Some(value) = table.get(key) {
            *k = number(value, key)?;
        }
    }
    Ok(distortion)
}

/// nerfstudio takes COLMAP's principal point, whose origin is the corner.
fn nerfstudio_intrinsics(table: &Map<String, Value>) -> Problem<Intrinsics> {
    let model = table
        .get("camera_model")
        .and_then(Value::as_str)
        .unwrap_or("OPENCV");
    let k4 = table.get("k4").and_then(Value::as_f64).unwrap_or(0.0);
    if ![
        "OPENCV",
        "PINHOLE",
        "SIMPLE_PINHOLE",
        "RADIAL",
        "SIMPLE_RADIAL",
    ]
    .contains(&model)
        || k4 != 0.0
    {
        return Err(format!(
            "the camera model {model} with k4 = {k4} is not known; expected OPENCV or PINHOLE without k4; undistort the frames"
        ));
    }
    let fx = required(table, "fl_x")?;
    let fy = match table.get("fl_y") {
        Some(value) => number(value, "fl_y")?,
        None => fx,
    };
    positive_focal_lengths(Intrinsics {
        size: size(table, ["w", "h"]),
        fx,
        fy,
        cx: required(table, "cx")?,
        cy: required(table, "cy")?,
        distortion: coefficients(table)?,
    })
}
