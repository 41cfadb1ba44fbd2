//! Intrinsics that OpenCV's calibration writes: YAML with `camera_matrix`, `distortion_coefficients`, `image_width` and `image_height`.
//!
//! OpenCV's dialect is no valid YAML (its first line), so the few keys are found by hand.

use std::path::Path;

use super::intrinsics::LensModel;
use super::{Focal, Intrinsics, Result, file_error, line_error, numbers, read_text};

const MATRIX_KEYS: &[&str] = &["camera_matrix", "cameraMatrix", "Camera_Matrix"];
const DISTORTION_KEYS: &[&str] = &[
    "distortion_coefficients",
    "distCoeffs",
    "Distortion_Coefficients",
];

/// Reads an OpenCV calibration. Its principal point counts from the first pixel's centre; half a pixel is added.
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
    let (line, words) = matrix(&text, MATRIX_KEYS).ok_or_else(|| lacks(MATRIX_KEYS[0]))?;
    let at_line = |problem| line_error(path, line, problem);
    let [fx, skew, cx, _, fy, cy, _, _, one] =
        numbers::<9>(&slices(&words), "the camera matrix").map_err(at_line)?;
    if !(fx > 0.0 && fy > 0.0) || skew != 0.0 || one != 1.0 {
        return Err(at_line(
            "the camera matrix is not fx 0 cx, 0 fy cy, 0 0 1; expected focal lengths above 0 and no skew; correct it".to_owned(),
        ));
    }
    let model = model_of(&text).map_err(|problem| file_error(path, problem))?;
    let mut coefficients = [None; 12];
    if let Some((line, words)) = matrix(&text, DISTORTION_KEYS) {
        let words = slices(&words);
        let at_line = |problem| line_error(path, line, problem);
        for (index, word) in words.iter().enumerate() {
            let [k] = numbers::<1>(&[word], "distortion coefficients").map_err(at_line)?;
            // A fisheye's four are k1 to k4.
            let place = match (model, index) {
                (Some(LensModel::Fisheye), 2 | 3) => index + 2,
                _ => index,
            };
            match coefficients.get_mut(place) {
                Some(coefficient) => *coefficient = Some(k),
                None if k == 0.0 => {}
                None => {
                    return Err(at_line(format!(
                        "coefficient {} is {k}; expected OpenCV's twelve up to the thin prism; calibrate without a tilted sensor",
                        index + 1
                    )));
                }
            }
        }
    }
    let model = model.unwrap_or(LensModel::Rational);
    let distortion = model
        .lens(&coefficients)
        .map_err(|why| file_error(path, why.to_string()))?;
    let side = |key: &str| {
        let value = text
            .lines()
            .find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(':'));
        value.and_then(|value| value.trim().parse::<u32>().ok())
    };
    Ok(Intrinsics {
        size: side("image_width").zip(side("image_height")),
        focal: Focal::Pixels([fx, fy]),
        centre: Some([cx + 0.5, cy + 0.5]),
        distortion,
    })
}

/// Where the file says it: by name, or that it is a fisheye.
fn model_of(text: &str) -> std::result::Result<Option<LensModel>, String> {
    let value = |key: &str| {
        let value = text
            .lines()
            .find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(':'))?;
        Some(value.trim().trim_matches(['"', '\'']))
    };
    let is_fisheye = value("fisheye_model").or(value("is_fisheye"));
    if is_fisheye.is_some_and(|yes| ["1", "true"].contains(&yes)) {
        return Ok(Some(LensModel::Fisheye));
    }
    let named = ["distortion_model", "camera_model"]
        .into_iter()
        .find_map(value);
    named.map(LensModel::named).transpose()
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
