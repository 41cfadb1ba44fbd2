//! `mixray check`: what a scene says that can hardly be meant.

use std::path::PathBuf;

use clap::Args;

use super::scene_flags::SceneFlags;
use super::{Failure, Outcome, print, say};
use crate::check::{self, Extent};
use crate::renderer::{roughly_fitted_exposure_ev, roughly_limited_albedo};
use crate::scene::Scene;

/// Reads a scene and tells what in it can hardly be meant, a line each, and how to mend it
///
/// `mixray render` says the same before it begins. Exit code 1 if there is anything to tell.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    #[command(flatten)]
    flags: SceneFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let scene = arguments.flags.load(&arguments.scene)?;
    for warning in &scene.warnings {
        say("note", warning);
    }
    let mut findings = check::scene(&scene, Extent::Still);
    findings.extend(check::focal_length(&scene, noted_focal_px(&scene)));
    let exposure = check::exposure(&scene, roughly_fitted_exposure_ev(&scene)?);
    findings.extend(match exposure {
        None => check::limited_albedo(&scene, roughly_limited_albedo(&scene)?),
        told => told,
    });
    let text: String = (findings.iter())
        .map(|finding| format!("{finding}\n"))
        .collect();
    print(&text)?;
    if !findings.is_empty() {
        return Ok(Outcome::CheckFailed);
    }
    print("nothing to tell\n")?;
    Ok(Outcome::Done)
}

/// What the photograph's camera notes of its focal length.
#[cfg(feature = "start")]
pub(super) fn noted_focal_px(scene: &Scene) -> Option<f64> {
    let photo = scene.photo.as_ref()?;
    crate::start::focal_px_of_whole(scene.photo_file.as_ref()?, (photo.width, photo.height))
}

/// Nobody who reads it is built in.
#[cfg(not(feature = "start"))]
pub(super) fn noted_focal_px(_: &Scene) -> Option<f64> {
    None
}
