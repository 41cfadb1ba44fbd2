//! `mixray antialias`: smooth borders for a layer with a hard mask.

use std::path::PathBuf;

use clap::Args;

use super::layers::LayerArguments;
use super::stage_device::StageDevice;
use super::values::unit;
use super::{Failure, Outcome, say, summarize};
use crate::output::{Target, write_composite};
use crate::scene::AntialiasSettings;
use crate::stages::antialias::antialias;

/// Puts a layer over a photograph and blends its hard border (Fischer and Bartz 2006, section 4)
///
/// A mask that is soft already is only composited.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    layers: LayerArguments,
    /// Picture to write, .png or .exr
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Share of the blended colour in a border pixel
    #[arg(long, value_name = "X", default_value_t = 0.8, value_parser = unit)]
    beta: f32,
    #[command(flatten)]
    device: StageDevice,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let target = Target::picture(&arguments.output)?;
    let mut layers = arguments.layers.read()?;
    let settings = AntialiasSettings {
        beta: arguments.beta,
    };
    let done = match arguments.device.open()? {
        Some(gpu) => gpu.antialias(&mut layers.picture, &layers.mask, &settings)?,
        None => antialias(&mut layers.picture, &layers.mask, &settings),
    };
    if !done {
        say("note", "the mask is soft already: nothing is blended");
    }
    write_composite(&target, &layers.picture, &layers.photo, layers.bits())?;
    summarize(&format!("picture {}\n", target.path().display()))?;
    Ok(Outcome::Done)
}
