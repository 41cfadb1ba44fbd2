//! `mixray bench gpu-time`.

use std::path::PathBuf;

use clap::Args;

use super::command_line;
use super::files::write_json;
use super::flags::{OutputFlags, RaysFlag, finish, load_scenes};
use crate::bench::{Machine, gpu_time, gpu_time_markdown, gpu_time_text};
use crate::cli::scene_flags::SceneFlags;
use crate::cli::{Failure, Outcome, interrupt, print, progress};

/// Where the time of a GPU render goes, kernel by kernel, at each number of rays per pixel
///
/// Writes gpu-time.json.
#[derive(Debug, Args)]
pub(super) struct Arguments {
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

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let docs = arguments.output.start("gpu-time")?;
    let interrupted = interrupt::watch()?;
    let scenes = load_scenes(&arguments.scenes, arguments.scene, arguments.shrink)?;
    let machine = Machine::this(true);
    let folder = arguments.output.make_folder(&["gpu-time.json"])?;
    let rays_per_pixel = arguments.rays.ascending();
    let steps = progress::Steps::new((scenes.len() * rays_per_pixel.len()) as u64);
    let mut times = Vec::new();
    'scenes: for scene in &scenes {
        for &rays_per_pixel in &rays_per_pixel {
            steps.say(&format!("{}: {rays_per_pixel} rays per pixel", scene.name));
            let Some(time) = gpu_time(scene, rays_per_pixel)? else {
                return Err(Failure(
                    "the graphics device takes no timestamps; expected one that does (`mixray info` says)"
                        .to_owned(),
                ));
            };
            times.push(time);
            steps.step();
            if interrupted.is_set() {
                break 'scenes;
            }
        }
    }
    steps.clear();
    write_json(&folder.join("gpu-time.json"), &machine, "times", &times)?;
    print(&gpu_time_text(&machine, &times))?;
    let table = gpu_time_markdown(&command_line(), &machine, &times);
    finish(docs, &table, interrupted.is_set())
}
