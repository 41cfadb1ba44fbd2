//! `mixray sharpness`: the sharpness of a photograph's camera, measured at the photograph's own edges.

use std::path::PathBuf;

use clap::Args;

use super::{Failure, Outcome, print, read_photo};
use crate::stages::sharpness::{Measured, measure};

/// Measures how soft and how sharpened a photograph's edges are
///
/// The slanted-edge method of ISO 12233, at the photograph's own straight edges in focus. Prints a [sharpness] table for a scene file, which takes
/// `from = "photo"` as well.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The photograph
    photo: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let photo = read_photo(&arguments.photo)?;
    let measured = measure(&photo.linear, (photo.width, photo.height))
        .map_err(|problem| Failure(format!("{}: {problem}", arguments.photo.display())))?;
    print(&table(&measured))?;
    Ok(Outcome::Done)
}

/// As a scene file takes it.
fn table(measured: &Measured) -> String {
    let spread = &measured.spread;
    let list = |values: &[f32]| {
        let values: Vec<String> = values.iter().map(|value| format!("{value:.3}")).collect();
        values.join(", ")
    };
    format!(
        "# {} edges, {} of them in focus: 10 to 90% within {:.2} pixels, {:.1}% overshoot.\n\
         # An edge of this table: {:.2} pixels, {:.1}%.\n\
         [sharpness]\nsigma_px = [{}]\ncorner_sigma_px = [{}]\nsharpening = {:.3}\nsharpening_radius_px = {:.3}\nlateral_px = [{}]\n",
        measured.edges,
        measured.in_focus,
        measured.edge_spread_px,
        100.0 * measured.overshoot,
        measured.fitted_spread_px,
        100.0 * measured.fitted_overshoot,
        list(&spread.sigma_px),
        list(&spread.corner_sigma_px),
        spread.sharpening,
        spread.sharpening_radius_px,
        list(&spread.lateral_px),
    )
}
