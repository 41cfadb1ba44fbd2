//! `mixray bench gpu-frame`.

use std::path::PathBuf;

use clap::Args;

use super::command_line;
use super::files::write_json;
use super::flags::{OutputFlags, RaysFlag, finish, load_scenes};
use crate::bench::{Machine, gpu_frame_markdown, gpu_frame_text, gpu_frames};
use crate::cli::scene_flags::SceneFlags;
use crate::cli::{Failure, Outcome, interrupt, print, progress};

/// What a frame of the GPU costs the host: a changed pose, lens and object, by place, and what goes to the device and back
///
/// Counted is the processors' time of the program's own threads, not of a software driver's (Linux; elsewhere 0). Writes gpu-frame.json.
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
    let docs = arguments.output.start("gpu-frame")?;
    let interrupted = interrupt::watch()?;
    let scenes = load_scenes(&arguments.scenes, arguments.scene, arguments.shrink)?;
    let machine = Machine::this(true);
    let folder = arguments.output.make_folder(&["gpu-frame.json"])?;
    let rays_per_pixel = arguments.rays.ascending();
    let steps = progress::Steps::new((scenes.len() * rays_per_pixel.len()) as u64);
    let mut frames = Vec::new();
    'scenes: for scene in &scenes {
        for &rays_per_pixel in &rays_per_pixel {
            steps.say(&format!("{}: {rays_per_pixel} rays per pixel", scene.name));
            frames.extend(gpu_frames(scene, rays_per_pixel)?);
            steps.step();
            if interrupted.is_set() {
                break 'scenes;
            }
        }
    }
    steps.clear();
    write_json(&folder.join("gpu-frame.json"), &machine, "frames", &frames)?;
    print(&gpu_frame_text(&machine, &frames))?;
    let table = gpu_frame_markdown(&command_line(), &machine, &frames);
    finish(docs, &table, interrupted.is_set())
}
