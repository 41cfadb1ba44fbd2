//! `mixray bench gpu-time`.

use clap::Args;

use super::on_gpu::{GpuFlags, Report};
use crate::bench::{gpu_time, gpu_time_markdown, gpu_time_text};
use crate::cli::{Failure, Outcome};

/// Where the time of a GPU render goes, kernel by kernel, at each number of rays per pixel
///
/// Writes gpu-time.json.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    flags: GpuFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let report = Report {
        name: "gpu-time",
        list: "times",
        text: gpu_time_text,
        markdown: gpu_time_markdown,
    };
    arguments.flags.measure(&report, |scene, rays| {
        let Some(time) = gpu_time(scene, rays)? else {
            return Err(Failure(
                "the graphics device takes no timestamps; expected one that does (`mixray info` says)"
                    .to_owned(),
            ));
        };
        Ok(vec![time])
    })
}
