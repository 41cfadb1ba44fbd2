//! Intrinsics that OpenCV's and ROS's calibrations write: YAML with `camera_matrix`, `distortion_coefficients`, `image_width` and `image_height`.
//!
//! OpenCV's dialect is no valid YAML (its first line), so the few keys are found by hand.

use std::borrow::Cow;
use std::path::Path;

use super::intrinsics::{LensModel, intrinsics_of_pixel_centres};
use super::{Intrinsics, Result, file_error, kalibr, line_error, numbers, read_text};

const MATRIX_KEYS: &[&str] = &["camera_matrix", "cameraMatrix", "Camera_Matrix"];
const DISTORTION_KEYS: &[&str] = &[
    "distortion_coefficients",
    "distCoeffs",
    "Distortion_Coefficients",
];

/// Reads a calibration of OpenCV, ROS or Kalibr. Its principal point counts from the first pixel's centre; half a pixel is added.
///
/// # Errors
/// A matrix that is missing, short, NaN, or of another camera model.
pub fn read_intrinsics(path: &Path) -> Result<Intrinsics> {
    let text = read_text(path)?;
    let lacks = |what: &str| {
        file_error(
            path,
            format!(
                "it lacks `{what}`; expected a calibration as OpenCV writes it; export it again"
            ),
        )
    };
    let model = model_of(&text).map_err(|problem| file_error(path, problem))?;
    let Some((line, words)) = matrix(&text, MATRIX_KEYS) else {
        return match kalibr::is_kalibr(&text) {
            true => kalibr::read(path, &text, model),
            false => Err(lacks(MATRIX_KEYS[0])),
        };
    };
    let at_line = |problem| line_error(path, line, problem);
    let [fx, skew, cx, _, fy, cy, _, _, one] =
        numbers::<9>(&slices(&words), "the camera matrix").map_err(at_line)?;
    if !(fx > 0.0 && fy > 0.0) || skew != 0.0 || one != 1.0 {
        return Err(at_line(
            "the camera matrix is not fx 0 cx, 0 fy cy, 0 0 1; expected focal lengths above 0 and no skew; correct it".to_owned(),
        ));
    }
    let (line, words) = matrix(&text, DISTORTION_KEYS).unwrap_or((line, Vec::new()));
    let side = |key: &str| {
        let value = text
            .lines()
            .find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(':'));
        value.and_then(|value| value.trim().parse::<u32>().ok())
    };
    let size = side("image_width").zip(side("image_height"));
    intrinsics_of_pixel_centres([fx, fy, cx, cy], size, model, &slices(&words))
        .map_err(|problem| line_error(path, line, problem))
}

/// Where the file says it: by name, or that it is a fisheye.
fn model_of(text: &str) -> std::result::Result<Option<LensModel>, String> {
    LensModel::of(text.lines().filter_map(|line| {
        let (key, value) = line.split('#').next()?.trim().split_once(':')?;
        Some((key, Cow::from(value.trim().trim_matches(['"', '\'']))))
    }))
}

fn slices(words: &[String]) -> Vec<&str> {
    words.iter().map(String::as_str).collect()
}

/// Line of the key, and the numbers of the `data: [ ... ]` that follows it.
fn matrix(text: &str, keys: &[&str]) -> Option<(usize, Vec<String>)> {
    let mut offset = 0;
    for (index, line) in text.split_inclusive('\n').enumerate() {
        let key = line.trim_start().split(':').next().unwrap_or("");
        if keys.contains(&key) {
            let rest = &text[offset..];
            let data = &rest[rest.find("data:")?..];
            let list = data.split_once('[')?.1.split_once(']')?.0;
            let words = list
                .split([',', ' ', '\n', '\r', '\t'])
                .filter(|word| !word.is_empty());
            return Some((index + 1, words.map(str::to_owned).collect()));
        }
        offset += line.len();
    }
    None
}
