//! `mixray bench gpu-frame`.

use clap::Args;

use super::on_gpu::{GpuFlags, Report};
use crate::bench::{gpu_frame_markdown, gpu_frame_text, gpu_frames};
use crate::cli::{Failure, Outcome};

/// What a frame of the GPU costs the host: a changed pose, lens and object, by place, and what goes to the device and back
///
/// Counted is the processors' time of the program's own threads, not of a software driver's (Linux; elsewhere 0). Writes gpu-frame.json.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    flags: GpuFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let report = Report {
        name: "gpu-frame",
        list: "frames",
        text: gpu_frame_text,
        markdown: gpu_frame_markdown,
    };
    (arguments.flags).measure(&report, |scene, rays| Ok(gpu_frames(scene, rays)?))
}
