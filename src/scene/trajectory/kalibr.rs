//! One camera of a Kalibr camera chain, or a `sensor.yaml` of EuRoC: YAML with `intrinsics`, `distortion_coeffs` and `resolution`.
//!
//! By hand, as [`super::opencv`]: the few keys are flat lists of numbers.

use std::path::Path;

use super::intrinsics::{LensModel, intrinsics_of_pixel_centres};
use super::{Intrinsics, Result, file_error, line_error, numbers};

/// The text is such a file's: OpenCV has a matrix instead.
pub(super) fn is_kalibr(text: &str) -> bool {
    list(text, "intrinsics").is_some()
}

/// `model`: what the file says of the lens.
pub(super) fn read(path: &Path, text: &str, model: Option<LensModel>) -> Result<Intrinsics> {
    let cameras: Vec<&str> = (text.lines())
        .filter_map(|line| line.strip_suffix(':'))
        .filter(|key| key.starts_with("cam") && key[3..].bytes().all(|b| b.is_ascii_digit()))
        .collect();
    if cameras.len() > 1 {
        return Err(file_error(
            path,
            format!(
                "it holds the cameras {}; expected one; keep the frames' own in a file",
                cameras.join(", ")
            ),
        ));
    }
    let lacks = |key: &str| {
        file_error(
            path,
            format!("it lacks `{key}`; expected a camera as Kalibr writes it; export it again"),
        )
    };
    let (line, words) = list(text, "intrinsics").ok_or_else(|| lacks("intrinsics"))?;
    if words.len() != 4 {
        return Err(line_error(
            path,
            line,
            format!(
                "{} intrinsics; expected fu, fv, cu, cv of a pinhole; calibrate with the model pinhole",
                words.len()
            ),
        ));
    }
    let at_line = |problem| line_error(path, line, problem);
    let [fx, fy, cx, cy] = numbers::<4>(&words, "fu, fv, cu, cv").map_err(at_line)?;
    let found = ["distortion_coeffs", "distortion_coefficients"]
        .iter()
        .find_map(|key| list(text, key));
    let (line, coefficients) = found.unwrap_or_default();
    let at_line = |problem| line_error(path, line, problem);
    let size = match list(text, "resolution") {
        Some((line, words)) => {
            let at_line = |problem| line_error(path, line, problem);
            let [width, height] = numbers::<2>(&words, "width and height").map_err(at_line)?;
            Some((width as u32, height as u32))
        }
        None => None,
    };
    intrinsics_of_pixel_centres([fx, fy, cx, cy], size, model, &coefficients).map_err(at_line)
}

/// Line of a key, and the words of the list behind it: `[a, b]`, or a line `- a` for each.
fn list<'a>(text: &'a str, key: &str) -> Option<(usize, Vec<&'a str>)> {
    let without_note = |line: &'a str| line.split('#').next().unwrap_or("").trim();
    let mut lines = (1..).zip(text.lines().map(without_note));
    let (number, first) = lines.find_map(|(number, line)| {
        let rest = line.strip_prefix(key)?.strip_prefix(':')?;
        Some((number, rest.trim()))
    })?;
    let rest = lines.map(|(_, line)| line);
    let parts: Vec<&str> = match first.strip_prefix('[') {
        Some(begin) => {
            let is_open = |part: &&str| !part.contains(']');
            let own = std::iter::once(begin);
            let mut whole: Vec<&str> = Vec::new();
            for part in own.chain(rest) {
                whole.push(part.trim_end_matches(']'));
                if !is_open(&part) {
                    break;
                }
            }
            whole
        }
        None => rest.map_while(|line| line.strip_prefix("- ")).collect(),
    };
    let words = parts.into_iter().flat_map(|part| part.split([',', ' ']));
    Some((number, words.filter(|word| !word.is_empty()).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_in_brackets_or_line_by_line() {
        let lists = "a:\n  k: [1, 2,\n    3] # of three\n  l:\n  - 4\n  - 5\n  m: 6\n";
        assert_eq!(list(lists, "k"), Some((2, vec!["1", "2", "3"])));
        assert_eq!(list(lists, "l"), Some((4, vec!["4", "5"])));
        assert_eq!(list(lists, "n"), None, "control");
    }
}
