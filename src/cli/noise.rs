//! `mixray noise`: a camera's noise, measured and given to what no camera took.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};

use super::layers::LayerArguments;
use super::stage_device::StageDevice;
use super::values::within;
use super::{Failure, Outcome, print, progress, read_photo, say, summarize};
use crate::output::{Target, check_writable_as, write_composite, write_text};
use crate::scene::{Choice, NoiseFit, NoiseMethod, NoiseProfile, NoiseSettings};
use crate::stages::calibration::{calibrate, estimate_from_one, group_frames, report_html};
use crate::stages::noise::{NoiseInput, NoiseStage};

/// Measures a camera's noise, or gives it to a layer of another program
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Calibrate(Calibrate),
    Estimate(Estimate),
    Apply(Apply),
}

/// Measures a camera's noise from several frames of static scenes
///
/// Frames of one folder are one scene; a folder stands for the pictures in it. Nothing may move; light that drifts or flickers is
/// removed.
#[derive(Debug, Args)]
struct Calibrate {
    /// Frames (PNG or JPEG as the camera stored them), or folders of them
    #[arg(required_unless_present = "from")]
    frames: Vec<PathBuf>,
    /// Profile to write
    #[arg(short, long, value_name = "NOISE.toml")]
    output: PathBuf,
    /// Intensity bins, a power of two
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = bins)]
    bins: usize,
    /// Write a page with histograms and plots
    #[arg(long, value_name = "PAGE.html")]
    report: Option<PathBuf>,
    /// No frames: white noise of sigma^2 = A y + B, y and sigma in 8-bit codes
    #[arg(long, value_name = "A,B", value_parser = fit, conflicts_with_all = ["frames", "report"], allow_hyphen_values = true)]
    from: Option<NoiseFit>,
}

/// Measures a camera's noise from the flat parts of one photograph
///
/// For photographs whose camera is not at hand. Texture without end (grass, gravel) passes for noise; several frames of one scene, with `calibrate`, tell them apart.
#[derive(Debug, Args)]
struct Estimate {
    /// The photograph (PNG or JPEG as the camera stored it)
    photo: PathBuf,
    /// Profile to write
    #[arg(short, long, value_name = "NOISE.toml")]
    output: PathBuf,
    /// Intensity bins, a power of two
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = bins)]
    bins: usize,
}

fn bins(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(n) if n.is_power_of_two() && n <= crate::scene::MAX_BINS => Ok(n),
        _ => Err(format!(
            "expected a power of two, at most {}",
            crate::scene::MAX_BINS
        )),
    }
}

fn fit(text: &str) -> Result<NoiseFit, &'static str> {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.abs() <= 1e4);
    text.split_once(',')
        .and_then(|(a, b)| {
            Some(NoiseFit {
                a: number(a)?,
                b: number(b)?,
            })
        })
        .ok_or("expected two numbers like 0.02,0.5")
}

/// Puts a layer over a photograph and adds the noise that it lacks
#[derive(Debug, Args)]
struct Apply {
    #[command(flatten)]
    layers: LayerArguments,
    /// The camera's noise, from `mixray noise calibrate` or `estimate`
    #[arg(long, value_name = "NOISE.toml")]
    profile: PathBuf,
    /// Picture to write, .png or .exr
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// missing: what the photograph does not bring itself, with the measured correlation; textures: as Fischer and Bartz 2006
    #[arg(long, value_parser = PossibleValuesParser::new(["missing", "textures"]))]
    method: Option<String>,
    /// Factor on the noise
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = factor)]
    scale: f32,
    /// Side of the textures, a power of two
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = texture_size)]
    texture_size: u32,
    /// Pixels that one texel covers along each axis
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = magnification)]
    magnification: f32,
    /// Frames that keep the same noise
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    update_delay: u32,
    /// Textures of 8 bits, all as in the paper: implies --method textures
    #[arg(long, conflicts_with = "method")]
    paper: bool,
    /// The same seed gives the same noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Frame number of a video: every frame has its own noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u32,
    #[command(flatten)]
    device: StageDevice,
}

fn factor(text: &str) -> Result<f32, &'static str> {
    within(text, 0.0, 1000.0).ok_or("expected a number from 0 to 1000")
}

fn magnification(text: &str) -> Result<f32, &'static str> {
    within(text, 0.01, 1000.0).ok_or("expected a number from 0.01 to 1000")
}

fn texture_size(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(n) if n.is_power_of_two() && n <= NoiseSettings::MAX_TEXTURE_SIZE => Ok(n),
        _ => Err(format!(
            "expected a power of two, at most {}",
            NoiseSettings::MAX_TEXTURE_SIZE
        )),
    }
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.command {
        Command::Calibrate(arguments) => run_calibrate(arguments),
        Command::Estimate(arguments) => run_estimate(arguments),
        Command::Apply(arguments) => run_apply(arguments),
    }
}

fn run_calibrate(arguments: &Calibrate) -> Result<Outcome, Failure> {
    check_writable_as(&arguments.output, "toml")?;
    if let Some(report) = &arguments.report {
        check_writable_as(report, "html")?;
    }
    if let Some(fit) = arguments.from {
        if fit.variance(0.0).max(fit.variance(255.0)) <= 0.0 {
            return Err(Failure(
                "--from: the variance is 0 or less at every level; expected A y + B above 0; give larger numbers"
                    .to_owned(),
            ));
        }
        let profile = NoiseProfile::from_fit(fit, arguments.bins);
        profile
            .check()
            .map_err(|problem| Failure(format!("--from: {problem}")))?;
        write_text(&arguments.output, &profile.to_toml())?;
        summarize(&summary(&profile, &arguments.output))?;
        return Ok(Outcome::Done);
    }
    let scenes = group_frames(&arguments.frames)?;
    let bar = progress::Count::new("frames read");
    let result = calibrate(&scenes, arguments.bins, &mut |done, total| {
        bar.show(done, total);
    });
    bar.clear();
    let calibration = result?;
    for note in &calibration.notes {
        say("note", note);
    }
    write_text(&arguments.output, &calibration.profile.to_toml())?;
    if let Some(report) = &arguments.report {
        write_text(report, &report_html(&calibration))?;
    }
    summarize(&summary(&calibration.profile, &arguments.output))?;
    if let Some(report) = &arguments.report {
        summarize(&format!("report  {}\n", report.display()))?;
    }
    Ok(Outcome::Done)
}

fn run_estimate(arguments: &Estimate) -> Result<Outcome, Failure> {
    check_writable_as(&arguments.output, "toml")?;
    let photo = read_photo(&arguments.photo)?;
    let name = arguments.photo.display().to_string();
    let size = (photo.width, photo.height);
    let estimate = estimate_from_one(&photo.encoded, size, arguments.bins, &name)
        .map_err(|problem| Failure(format!("{name}: {problem}")))?;
    for note in &estimate.notes {
        say("note", note);
    }
    write_text(&arguments.output, &estimate.profile.to_toml())?;
    print(&summary(&estimate.profile, &arguments.output))?;
    Ok(Outcome::Done)
}

fn summary(profile: &NoiseProfile, output: &Path) -> String {
    let mut out = format!("profile {}\n", output.display());
    for (index, bin) in profile.bins.iter().enumerate() {
        let count = profile.bins.len();
        out += &format!(
            "bin     intensity {:>3} to {:>3}: sigma",
            index * 256 / count,
            (index + 1) * 256 / count
        );
        for c in 0..3 {
            out += &format!(" {:.3}", bin.sigma[c]);
            if bin.filled[c] {
                out += " (filled)";
            } else if bin.samples[c] > 0 {
                out += &format!(" ({:.3} to {:.3})", bin.low[c], bin.high[c]);
            }
        }
        out += " DN\n";
    }
    let [red, green, blue] = profile.autocorrelation;
    out + &format!(
        "beside  correlation along x {:.3} {:.3} {:.3}, along y {:.3} {:.3} {:.3}; of channels {:.3} {:.3} {:.3}\n",
        red[0][4],
        green[0][4],
        blue[0][4],
        red[1][3],
        green[1][3],
        blue[1][3],
        profile.channel_correlation[0],
        profile.channel_correlation[1],
        profile.channel_correlation[2]
    )
}

fn run_apply(arguments: &Apply) -> Result<Outcome, Failure> {
    let target = Target::picture(&arguments.output)?;
    let profile = NoiseProfile::read(&arguments.profile)
        .map_err(|problem| Failure(format!("{}: {problem}", arguments.profile.display())))?;
    let method = match arguments.method.as_deref().and_then(NoiseMethod::from_name) {
        Some(method) => method,
        None if arguments.paper => NoiseMethod::Textures,
        None => NoiseMethod::Missing,
    };
    let settings = NoiseSettings {
        method,
        scale: arguments.scale,
        texture_size: arguments.texture_size,
        magnification: arguments.magnification,
        update_delay_frames: arguments.update_delay,
        eight_bit: arguments.paper,
        ..NoiseSettings::new(profile)
    };
    settings.check_textures()?;
    let mut layers = arguments.layers.read()?;
    let gpu = arguments.device.open()?;
    let start = Instant::now();
    let input = NoiseInput {
        photo: Some(&layers.photo.linear),
        mask: Some(&layers.mask),
        ..NoiseInput::default()
    };
    let stage = NoiseStage::new(&settings, arguments.seed);
    match gpu {
        Some(gpu) => gpu.noise(&stage, &mut layers.picture, &input, arguments.frame)?,
        None => stage.apply(&mut layers.picture, &input, arguments.frame),
    }
    let seconds = start.elapsed().as_secs_f64();
    write_composite(&target, &layers.picture, &layers.photo, layers.bits())?;
    summarize(&format!(
        "picture {}\ntime    {:.1} ms for the noise\n",
        target.path().display(),
        1000.0 * seconds
    ))?;
    Ok(Outcome::Done)
}
