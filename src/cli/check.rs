//! `mixray check`: what a scene says that can hardly be meant.

use std::path::PathBuf;

use clap::Args;

use super::scene_flags::SceneFlags;
use super::{Failure, Outcome, print, say};
use crate::check::{self, Extent};
use crate::renderer::{Renderer, RendererOptions, Watcher};
use crate::scene::BackendChoice;

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
    let mut scene = arguments.flags.load(&arguments.scene)?;
    for warning in &scene.warnings {
        say("note", warning);
    }
    let mut findings = check::scene(&scene, Extent::Still);
    if scene.photo.is_some() {
        scene.settings.rays_per_pixel = 1;
        scene.settings.backend = BackendChoice::Cpu;
        let options = RendererOptions {
            draft: true,
            ..RendererOptions::default()
        };
        let mut renderer = Renderer::new(scene, options, &Watcher::none())?;
        let fitted_ev = renderer.fitted_exposure_ev();
        findings.extend(check::exposure(renderer.scene(), fitted_ev));
    }
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
