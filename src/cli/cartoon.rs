//! `mixray cartoon`: any picture as a cartoon.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use clap::builder::PossibleValuesParser;

use super::stage_device::StageDevice;
use super::values::{unit, within};
use super::{Failure, Outcome, read_photo, summarize};
use crate::output::{PngBits, Target, write_image};
use crate::scene::{CartoonSettings, CartoonStyle, Choice};
use crate::stages::EncodedImage;
use crate::stages::cartoon::{EdgeResponses, cartoon};

/// How much brighter than the responses the edge picture is, so that the thresholds of 0.05 can be seen.
const EDGE_GAIN: f32 = 4.0;

/// Turns a picture into a cartoon: flat colours with dark silhouettes
///
/// Fischer and Bartz 2005; defaults are the paper's. The flow style's own keys are set in a scene file's [cartoon] alone.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Picture: PNG, JPEG, EXR or HDR
    image: PathBuf,
    /// Cartoon to write, .png or .exr
    output: PathBuf,
    /// Write the edge responses side by side: simplified picture, original picture (both 4 times brighter), silhouettes
    #[arg(long, value_name = "FILE")]
    edges: Option<PathBuf>,
    #[command(flatten)]
    keys: Keys,
    #[command(flatten)]
    device: StageDevice,
}

#[derive(Debug, Args)]
struct Keys {
    #[arg(long, value_parser = PossibleValuesParser::new(["photometric", "flow"]))]
    style: Option<String>,
    /// Size of the simplified picture, pixels [default: 240x180]
    #[arg(long, value_name = "WxH", value_parser = size)]
    shrunk: Option<(u32, u32)>,
    /// Passes of the photometric filter [default: 7]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=i64::from(CartoonSettings::MAX_ITERATIONS)))]
    iterations: Option<u32>,
    /// Spread of colours that are mixed [default: 0.025]
    #[arg(long, value_name = "X", value_parser = sigma)]
    sigma_p: Option<f32>,
    /// Weight of colour against brightness in an edge [default: 0.3]
    #[arg(long, value_name = "X", value_parser = unit)]
    alpha: Option<f32>,
    /// Weight of the original picture's edges against the simplified one's [default: 0.3]
    #[arg(long, value_name = "X", value_parser = unit)]
    beta: Option<f32>,
    /// Thresholds of the simplified picture's edges [default: 0.054,0.064]
    #[arg(long, value_name = "S0,S1", value_parser = step)]
    s: Option<(f32, f32)>,
    /// Thresholds of the original picture's edges [default: 0.3,0.7]
    #[arg(long, value_name = "A0,A1", value_parser = step)]
    a: Option<(f32, f32)>,
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let most = CartoonSettings::MAX_SHRUNK_PX;
    let side = |side: &str| side.parse().ok().filter(|side| (1..=most).contains(side));
    text.split_once('x')
        .and_then(|(width, height)| Some((side(width)?, side(height)?)))
        .ok_or(format!("expected a size like 240x180, 1 to {most} a side"))
}

fn sigma(text: &str) -> Result<f32, &'static str> {
    within(text, 1e-4, 1e3).ok_or("expected a number from 0.0001 to 1000")
}

fn step(text: &str) -> Result<(f32, f32), &'static str> {
    let threshold = |text| within(text, 0.0, 100.0);
    text.split_once(',')
        .and_then(|(low, high)| Some((threshold(low)?, threshold(high)?)))
        .filter(|(low, high)| low < high)
        .ok_or("expected two numbers from 0 to 100, the second the larger, like 0.3,0.7")
}

impl Keys {
    fn settings(&self) -> CartoonSettings {
        let default = CartoonSettings::default();
        let (shrunk_width, shrunk_height) = self
            .shrunk
            .unwrap_or((default.shrunk_width, default.shrunk_height));
        let (s0, s1) = self.s.unwrap_or((default.s0, default.s1));
        let (a0, a1) = self.a.unwrap_or((default.a0, default.a1));
        CartoonSettings {
            style: self
                .style
                .as_deref()
                .and_then(CartoonStyle::from_name)
                .unwrap_or(default.style),
            shrunk_width,
            shrunk_height,
            iterations: self.iterations.unwrap_or(default.iterations),
            sigma_p: self.sigma_p.unwrap_or(default.sigma_p),
            alpha: self.alpha.unwrap_or(default.alpha),
            beta: self.beta.unwrap_or(default.beta),
            s0,
            s1,
            a0,
            a1,
            flow: default.flow,
        }
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let target = Target::picture(&arguments.output)?;
    let edges_target = arguments
        .edges
        .as_deref()
        .map(Target::picture)
        .transpose()?;
    let photo = read_photo(&arguments.image)?;
    let bits = PngBits::for_photo(Some(&photo));
    let image = EncodedImage::from_photo(&photo);
    let settings = arguments.keys.settings();
    let with_edges = edges_target.is_some();
    let gpu = arguments.device.open()?;
    let compute = || match &gpu {
        Some(gpu) => gpu.cartoon(&image, &settings, with_edges),
        None => Ok(cartoon(&image, &settings, with_edges)),
    };
    if gpu.is_some() {
        // Kernels are compiled at their first use: that is no time of the cartoon.
        compute()?;
    }
    let start = Instant::now();
    let result = compute()?;
    let seconds = start.elapsed().as_secs_f64();
    write_image(&target, &result.image.to_picture(), bits)?;
    if let (Some(target), Some(edges)) = (&edges_target, &result.edges) {
        write_image(target, &side_by_side(edges).to_picture(), PngBits::Eight)?;
    }
    summarize(&format!(
        "picture {} ({} x {}, {} style)\ntime    {:.1} ms for the cartoon\n",
        target.path().display(),
        image.width,
        image.height,
        settings.style.name(),
        1000.0 * seconds
    ))?;
    Ok(Outcome::Done)
}

fn side_by_side(edges: &EdgeResponses) -> EncodedImage {
    let width = edges.width as usize;
    let panels = [
        (&edges.simplified, EDGE_GAIN),
        (&edges.original, EDGE_GAIN),
        (&edges.silhouette, 1.0),
    ];
    let rgb = (0..edges.height as usize)
        .flat_map(|row| {
            panels.iter().flat_map(move |(values, gain)| {
                values[row * width..][..width]
                    .iter()
                    .map(move |value| [(value * gain).min(1.0); 3])
            })
        })
        .collect();
    EncodedImage {
        width: 3 * edges.width,
        height: edges.height,
        rgb,
    }
}
