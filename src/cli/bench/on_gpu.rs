//! What measurements of the GPU share: each scene at each number of rays per pixel, and where the figures go.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::command_line;
use super::files::write_json;
use super::flags::{OutputFlags, RaysFlag, finish, load_scenes};
use crate::bench::Machine;
use crate::cli::scene_flags::SceneFlags;
use crate::cli::{Failure, Outcome, interrupt, print, progress};
use crate::scene::Scene;

#[derive(Debug, Args)]
pub(super) struct GpuFlags {
    /// Scene files
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    rays: RaysFlag,
    /// Divide the scenes' width and height
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    shrink: u32,
    #[command(flatten)]
    output: OutputFlags,
}

/// How figures are called, and read.
pub(super) struct Report<T> {
    /// The subcommand, and the file without its ending.
    pub name: &'static str,
    /// Of the list in the file.
    pub list: &'static str,
    pub text: fn(&Machine, &[T]) -> String,
    /// The first is the command line.
    pub markdown: fn(&str, &Machine, &[T]) -> String,
}

impl GpuFlags {
    /// Measures until interrupted; what is measured by then is written.
    pub(super) fn measure<T: Serialize>(
        &self,
        report: &Report<T>,
        measure: impl Fn(&Scene, u32) -> Result<Vec<T>, Failure>,
    ) -> Result<Outcome, Failure> {
        let docs = self.output.start(report.name)?;
        let interrupted = interrupt::watch()?;
        let scenes = load_scenes(&self.scenes, self.scene, self.shrink)?;
        let machine = Machine::this(true);
        let file = format!("{}.json", report.name);
        let folder = self.output.make_folder(&[&file])?;
        let rays_per_pixel = self.rays.ascending();
        let steps = progress::Steps::new((scenes.len() * rays_per_pixel.len()) as u64);
        let mut figures = Vec::new();
        'scenes: for scene in &scenes {
            for &rays_per_pixel in &rays_per_pixel {
                steps.say(&format!("{}: {rays_per_pixel} rays per pixel", scene.name));
                figures.extend(measure(scene, rays_per_pixel)?);
                steps.step();
                if interrupted.is_set() {
                    break 'scenes;
                }
            }
        }
        steps.clear();
        write_json(&folder.join(file), &machine, report.list, &figures)?;
        print(&(report.text)(&machine, &figures))?;
        let table = (report.markdown)(&command_line(), &machine, &figures);
        finish(docs, &table, interrupted.is_set())
    }
}
