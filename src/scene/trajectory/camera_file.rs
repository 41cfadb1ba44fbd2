//! One camera as calibrations of other programs write it: JSON with `fx`, `fy`, `cx`, `cy` and perhaps a pose, or OpenCV's YAML.

use std::path::Path;

use glam::{DMat4, DVec4};
use serde_json::Value;

use super::json::read_pose;
use super::json_intrinsics::{Style, style_of};
use super::{Intrinsics, read_intrinsics};
use crate::decode::{MAX_TEXT_BYTES, read_text};
use crate::refusal::Refusal;
use crate::scene::reader::Choice;

/// Where a file counts pixels from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelOrigin {
    /// The first pixel's centre is (0.5, 0.5), as everywhere in this program.
    Corner,
    /// The first pixel's centre is (0, 0), as OpenCV has it.
    Centre,
}

impl Choice for PixelOrigin {
    const CHOICES: &'static [(&'static str, Self)] =
        &[("corner", Self::Corner), ("centre", Self::Centre)];
}

/// What a camera file says.
#[derive(Clone, Debug)]
pub struct CameraFile {
    pub intrinsics: Intrinsics,
    pub world_from_camera: Option<DMat4>,
    /// What was assumed.
    pub notes: Vec<String>,
}

/// Poses of a camera that looks along its -Z with +Y up.
const POSE_KEYS: &[&str] = &[
    "world_from_camera",
    "camera_to_world_gltf",
    "transform_matrix",
];
/// The inverse of one that looks along its +Z with +Y down.
const OPENCV_POSE_KEY: &str = "world_to_camera_opencv";

/// Reads a camera; `origin`: where its `cx` and `cy` count from, if the caller knows. Otherwise `fx` beside `cx` is taken as OpenCV's, whose
/// half pixel is added, which a note tells.
///
/// # Errors
/// What cannot be used: "problem; expected ...; how to mend", without the path.
pub fn read_camera(path: &Path, origin: Option<PixelOrigin>) -> Result<CameraFile, Refusal> {
    let text = read_text(path, MAX_TEXT_BYTES)
        .map_err(|problem| format!("{problem}; expected a camera file; correct the path"))?;
    let (mut intrinsics, world_from_camera, own_origin) = match text.trim_start().starts_with('{') {
        true => read_json(&text)?,
        false => {
            let intrinsics = read_intrinsics(path).map_err(|error| error.to_string())?;
            (intrinsics, None, PixelOrigin::Centre)
        }
    };
    let mut notes = Vec::new();
    let shift = match (own_origin, origin) {
        (PixelOrigin::Centre, Some(PixelOrigin::Corner)) => -0.5,
        (PixelOrigin::Corner, Some(PixelOrigin::Centre)) => 0.5,
        _ => 0.0,
    };
    if let Some(centre) = &mut intrinsics.centre {
        *centre = centre.map(|x| x + shift);
        if own_origin == PixelOrigin::Centre && origin.is_none() {
            notes.push(
                "cx and cy are taken to count from the first pixel's centre, as OpenCV has it: half a pixel is added; say pixel_origin = \"centre\", or \"corner\" if they do not"
                    .to_owned(),
            );
        }
    }
    Ok(CameraFile {
        intrinsics,
        world_from_camera,
        notes,
    })
}

/// Intrinsics with the principal point moved to the corner's origin, pose, and where the file counted from.
fn read_json(text: &str) -> Result<(Intrinsics, Option<DMat4>, PixelOrigin), String> {
    let document: Value = serde_json::from_str(text).map_err(|error| {
        format!("it is no valid JSON ({error}); expected a camera; repair the file")
    })?;
    let Some(root) = document.as_object() else {
        return Err("it is no JSON object; expected a camera; correct it".to_owned());
    };
    let lacks = || {
        "it lacks the intrinsics; expected `fx`, `fy`, `cx` and `cy` in pixels; add them".to_owned()
    };
    let style = style_of(std::iter::once(root))?;
    let intrinsics = style.of_all(root)?.ok_or_else(lacks)?;
    let place = match root.get("camera").and_then(Value::as_object) {
        Some(camera) if style == Style::Own => camera,
        _ => root,
    };
    let mut poses = POSE_KEYS.iter().filter_map(|key| place.get(*key));
    let pose = match (poses.next(), place.get(OPENCV_POSE_KEY)) {
        (Some(pose), _) => read_pose(pose)?,
        (None, Some(pose)) => read_pose(pose)?.map(|camera_from_world| {
            let flip = DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
            camera_from_world.inverse() * flip
        }),
        (None, None) => None,
    };
    let origin = match style {
        Style::Tracked => PixelOrigin::Centre,
        Style::Own | Style::Nerfstudio => PixelOrigin::Corner,
    };
    Ok((intrinsics, pose, origin))
}

#[cfg(test)]
mod tests {
    use super::*;

    const JSON: &str = r#"{"width": 640, "height": 480, "fx": 520.9, "fy": 521.0, "cx": 325.1, "cy": 249.7,
        "distortion": "none (undistorted)", POSE}"#;
    const ROWS: &str = "[[0, 0, 1, 3], [1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 0, 1]]";

    fn read(text: &str, origin: Option<PixelOrigin>) -> Result<CameraFile, Refusal> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.json");
        std::fs::write(&path, text).unwrap();
        read_camera(&path, origin)
    }

    #[test]
    fn half_a_pixel_is_added_where_the_file_counts_from_centres() {
        let text = JSON.replace(", POSE", "");
        let centre = |origin| read(&text, origin).unwrap().intrinsics.centre;
        assert_eq!(centre(None), Some([325.6, 250.2]));
        assert_eq!(centre(Some(PixelOrigin::Centre)), Some([325.6, 250.2]));
        assert_eq!(centre(Some(PixelOrigin::Corner)), Some([325.1, 249.7]));
        assert_eq!(read(&text, None).unwrap().notes.len(), 1, "it is told");
        let said = read(&text, Some(PixelOrigin::Centre)).unwrap();
        assert_eq!(said.notes, [""; 0], "control: it was said");
        let own = text.replacen('{', r#"{"camera": {"#, 1) + "}";
        let own = read(&own, None).unwrap();
        assert_eq!(own.intrinsics.centre, Some([325.1, 249.7]));
        assert_eq!(own.notes, [""; 0]);
    }

    #[test]
    fn poses_of_both_axes_are_one() {
        let of_key = |key: &str, rows: &str| {
            let text = JSON.replace("POSE", &format!("\"{key}\": {rows}"));
            read(&text, None).map(|file| file.world_from_camera.unwrap())
        };
        let gltf = of_key("camera_to_world_gltf", ROWS).unwrap();
        assert_eq!(gltf.w_axis.truncate().to_array(), [3.0, 4.0, 5.0]);
        let flip = DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
        let rows = (gltf * flip).inverse().transpose().to_cols_array_2d();
        let opencv = of_key(OPENCV_POSE_KEY, &format!("{rows:?}")).unwrap();
        assert!(opencv.abs_diff_eq(gltf, 1e-12), "{opencv}");
        let wrong = of_key("camera_to_world_gltf", &format!("{rows:?}")).unwrap();
        assert!(!wrong.abs_diff_eq(gltf, 1e-3), "control");
        let mirrored = ROWS.replace("[1, 0, 0, 4]", "[-1, 0, 0, 4]");
        assert!(of_key("camera_to_world_gltf", &mirrored).is_err());
    }

    #[test]
    fn what_is_no_camera_is_refused() {
        for (text, part) in [
            ("{\"frames\": []}", "lacks the intrinsics"),
            ("{\"fx\": 5", "no valid JSON"),
            (
                "{\"fx\": -5, \"fy\": 5, \"cx\": 1, \"cy\": 1}",
                "not above 0",
            ),
            ("{\"fx\": 5, \"fy\": 5}", "lack `cx`"),
            ("hello", "camera_matrix"),
        ] {
            let error = read(text, None).unwrap_err().to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
