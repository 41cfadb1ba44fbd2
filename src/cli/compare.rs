//! `mixray compare`: how far two images are apart.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Failure, Outcome, print, read_photo, say};
use crate::film::{Picture, compare};

/// Prints the differences of two images as JSON
///
/// rmse, rel_mse (squared difference over squared reference + 0.01), psnr (null for equal images) on linear values; flip (LDR-FLIP)
/// as seen on a display.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Image to judge: PNG or JPEG (decoded from sRGB), EXR or HDR (linear)
    image: PathBuf,
    /// Reference of the same size
    reference: PathBuf,
    /// Exit with 1 if the RMSE is larger
    #[arg(long, value_name = "X", value_parser = limit)]
    max_rmse: Option<f64>,
}

fn limit(text: &str) -> Result<f64, &'static str> {
    match text.parse::<f64>() {
        Ok(x) if x >= 0.0 => Ok(x),
        _ => Err("expected a number, 0 or larger"),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let (image, reference) = (read(&arguments.image)?, read(&arguments.reference)?);
    let comparison = compare(&image, &reference).map_err(|problem| {
        let (a, b) = (arguments.image.display(), arguments.reference.display());
        Failure(format!("{a}, {b}: {problem}"))
    })?;
    let mut json = serde_json::to_string_pretty(&comparison)?;
    json.push('\n');
    print(&json)?;
    match arguments.max_rmse {
        Some(limit) if comparison.rmse > limit => {
            say(
                "check failed",
                &format!("RMSE {} is above {limit}", comparison.rmse),
            );
            Ok(Outcome::CheckFailed)
        }
        _ => Ok(Outcome::Done),
    }
}

fn read(path: &Path) -> Result<Picture, Failure> {
    let photo = read_photo(path)?;
    Ok(Picture {
        width: photo.width,
        height: photo.height,
        linear: photo.linear,
    })
}
