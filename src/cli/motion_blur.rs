//! `mixray motion-blur`: copies along a motion for a layer of any program.

use std::path::PathBuf;

use clap::Args;

use super::layers::LayerArguments;
use super::stage_device::StageDevice;
use super::values::{unit, within};
use super::{Failure, Outcome, say, summarize};
use crate::gpu::GpuError;
use crate::output::{Target, write_composite};
use crate::scene::MotionBlurSettings;
use crate::stages::motion_blur::{Copies, draw_copies, draw_see_through, shape};

/// Puts a layer over a photograph, blurred along its motion by copies (Fischer and Bartz 2006, section 5)
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    layers: LayerArguments,
    /// Picture to write, .png or .exr
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Motion since the frame before, pixels to the right and down
    #[arg(long, value_name = "X,Y", allow_hyphen_values = true, value_parser = vector)]
    vector: [f32; 2],
    /// Shorter motion leaves the layer sharp, pixels
    #[arg(long, value_name = "PX", default_value_t = 5.0, value_parser = pixels)]
    min_length: f32,
    /// So does longer motion
    #[arg(long, value_name = "PX", default_value_t = 150.0, value_parser = pixels)]
    max_length: f32,
    /// Between two copies, pixels, from 0.1 on
    #[arg(long, value_name = "PX", default_value_t = 1.0, value_parser = step)]
    step: f32,
    /// Of the copy at the layer's own place
    #[arg(long, value_name = "X", default_value_t = 0.8, value_parser = unit)]
    centre_opacity: f32,
    #[command(flatten)]
    device: StageDevice,
}

fn vector(text: &str) -> Result<[f32; 2], &'static str> {
    let number = |text: &str| text.trim().parse::<f32>().ok().filter(|x| x.is_finite());
    text.split_once(',')
        .and_then(|(x, y)| Some([number(x)?, number(y)?]))
        .ok_or("expected X,Y, two numbers of pixels")
}

fn pixels(text: &str) -> Result<f32, &'static str> {
    within(text, 0.0, Copies::MAX_LENGTH_PX).ok_or("expected pixels from 0 to 4096")
}

fn step(text: &str) -> Result<f32, &'static str> {
    within(text, 0.1, 1000.0).ok_or("expected pixels from 0.1 to 1000")
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let target = Target::picture(&arguments.output)?;
    let mut layers = arguments.layers.read()?;
    let settings = MotionBlurSettings {
        min_length_px: arguments.min_length,
        max_length_px: arguments.max_length,
        step_px: arguments.step,
        centre_opacity: arguments.centre_opacity,
        ..MotionBlurSettings::default()
    };
    match Copies::of(arguments.vector, &settings) {
        Some(copies) => {
            let layer = layers.premultiplied();
            let size = (layers.photo.width, layers.photo.height);
            let gpu = arguments.device.open()?;
            let draw = |canvas: &mut [[f32; 4]], layer: &[[f32; 4]]| -> Result<(), GpuError> {
                match &gpu {
                    Some(gpu) => gpu.draw_copies(canvas, size, &[(layer, copies)]),
                    None => {
                        draw_copies(canvas, size, layer, &copies);
                        Ok(())
                    }
                }
            };
            let shape = shape(&layers.mask, size);
            let photo = &layers.photo.linear;
            layers.picture.linear = match shape == layers.mask {
                true => {
                    let mut canvas: Vec<[f32; 4]> =
                        photo.iter().map(|[r, g, b]| [*r, *g, *b, 0.0]).collect();
                    draw(&mut canvas, &layer)?;
                    canvas.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect()
                }
                false => draw_see_through(photo, &layer, &shape, draw)?,
            };
        }
        None => say(
            "note",
            "the motion is shorter or longer than the limits: the layer stays sharp",
        ),
    }
    write_composite(&target, &layers.picture, &layers.photo, layers.bits())?;
    summarize(&format!("picture {}\n", target.path().display()))?;
    Ok(Outcome::Done)
}
