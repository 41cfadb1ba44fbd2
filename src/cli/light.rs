//! `mixray light`: the light of a scene, fitted to its photograph.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde_json::{Value, json};

use super::progress::Bar;
use super::scene_flags::SceneFlags;
use super::{Failure, Outcome, print, say};
use crate::files;
use crate::light_fit::{
    FitOptions, Fitted, Gain, LightFit, ScaleBasis, edited, fit, residual_picture,
};
use crate::output::{Format, PngBits, Target, check_writable_as, write_image, write_text};
use crate::work::{Progress, Watcher};

/// Fits the light of a scene to its photograph
#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Fit(Fit),
}

/// Fits environment and sun to the shading and shadows that the photograph shows on the proxy
///
/// Of the environment its rotation and scale, and a sun if there is one. What the photograph does not tell is kept. Without -o or --write
/// nothing is changed. Exit code 1 if no such light explains the photograph: nothing is written then but the residual and the statistics.
#[derive(Debug, Args)]
struct Fit {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Scene to write, in the same folder, .toml
    #[arg(short, long, value_name = "NEW_SCENE.toml", conflicts_with = "write")]
    output: Option<PathBuf>,
    /// Write the light into the scene file itself; comments and order stay
    #[arg(long)]
    write: bool,
    /// Picture of the photograph, the fitted light, the photograph without it, and what is left
    #[arg(long, value_name = "RESIDUAL.png")]
    residual: Option<PathBuf>,
    /// All figures of the fit
    #[arg(long, value_name = "FIT.json")]
    stats: Option<PathBuf>,
    /// Fit a sky that is white all over in place of the scene's environment
    #[arg(long)]
    white_sky: bool,
    /// Leave the environment as it is turned: where it was taken beside the camera
    #[arg(long)]
    keep_rotation: bool,
    #[command(flatten)]
    flags: SceneFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    match &arguments.command {
        Command::Fit(arguments) => run_fit(arguments),
    }
}

fn run_fit(arguments: &Fit) -> Result<Outcome, Failure> {
    let path = &arguments.scene;
    let written = match &arguments.output {
        Some(output) => {
            check_writable_as(output, "toml")?;
            check_beside(output, path)?;
            Some(output)
        }
        None if arguments.write => {
            files::own(path)?;
            Some(path)
        }
        None => None,
    };
    let residual = match &arguments.residual {
        Some(residual) => {
            check_writable_as(residual, "png")?;
            Some(Target::named(residual, Format::Png))
        }
        None => None,
    };
    if let Some(stats) = &arguments.stats {
        check_writable_as(stats, "json")?;
    }
    let scene = arguments.flags.load(path)?;
    for warning in &scene.warnings {
        say("note", warning);
    }
    let options = FitOptions {
        white_sky: arguments.white_sky,
        keep_rotation: arguments.keep_rotation,
    };
    let named = |problem: &dyn std::fmt::Display| Failure(format!("{}: {problem}", path.display()));
    let bar = Bar::new("building trees", "");
    let hear = |progress: &Progress| bar.hear(progress);
    let fit = fit(&scene, options, &Watcher::none().heard_by(&hear));
    drop(bar);
    let fit = fit.map_err(|problem| named(&problem))?;
    if let Some(target) = &residual {
        write_image(target, &residual_picture(&fit), PngBits::Eight)?;
    }
    if let Some(stats) = &arguments.stats {
        write_text(stats, &format!("{:#}\n", statistics(&fit)))?;
    }
    print(&summary(&fit))?;
    if fit.gain_of_white_sky.is_real() {
        say("warning", &white_sky_told(&fit));
    }
    if fit.is_poor() {
        say("warning", if fit.is_worse() { WORSE } else { POOR });
        return Ok(Outcome::CheckFailed);
    }
    if let Some(output) = written {
        let text = std::fs::read_to_string(path).map_err(|problem| named(&problem))?;
        let text = edited(&text, &fit).map_err(|problem| named(&problem))?;
        write_text(output, &text)?;
        print(&format!("scene     {}\n", output.display()))?;
    }
    Ok(Outcome::Done)
}

const POOR: &str = "the photograph's shading is not that of this proxy under an environment and a sun: everything is kept, and no scene is written; look at --residual: is the proxy aligned, is it complete, do lamps near by light it?";

const WORSE: &str = "the light that the scene has explains more of the photograph than what was found: everything is kept, and no scene is written; look at --residual";

fn white_sky_told(fit: &LightFit) -> String {
    format!(
        "a sky that is white all over explains {:.0}% more than this environment: it is hardly that of the photograph; try --white-sky, or another environment",
        100.0 * fit.gain_of_white_sky.share
    )
}

/// A scene names its files from its own folder.
fn check_beside(output: &Path, scene: &Path) -> Result<(), Failure> {
    let folder = |path: &Path| {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        folder.unwrap_or(Path::new(".")).canonicalize().ok()
    };
    if folder(output) == folder(scene) {
        return Ok(());
    }
    Err(Failure(format!(
        "{}: lies in another folder than the scene, which names its files from its own; expected a name beside {}; name it so",
        output.display(),
        scene.display()
    )))
}

fn summary(fit: &LightFit) -> String {
    let percent = |share: f64| format!("{:.0}%", 100.0 * share);
    let mut text = format!(
        "compared  {} points of the proxy; {} left out: clipped, dark, shiny, or at its edges\n",
        fit.points, fit.left_out
    );
    text += &format!(
        "explained {} of the variation between like colours; {} as the scene has it, {} by a white sky\n",
        percent(fit.explained.fitted),
        percent(fit.explained.as_given),
        percent(fit.explained.by_white_sky),
    );
    text += &format!(
        "          {} of parts that it was not fitted to ({:.1} standard errors)\n",
        percent(fit.gain.share),
        fit.gain.significance,
    );
    let shadows = &fit.shadows;
    text += &format!(
        "shadows   {:.2} of what is around them in the photograph; {:.2} by the fit, {:.2} as the scene has it, {:.2} by a white sky\n",
        shadows.in_photograph, shadows.fitted, shadows.as_given, shadows.by_white_sky
    );
    if fit.is_poor() {
        return text;
    }
    text += &match &fit.rotation_deg {
        None => "rotation  kept: the environment is the same from all sides\n".to_owned(),
        Some(rotation) if rotation.is_kept => format!(
            "rotation  kept at {:.1} degrees{}\n",
            rotation.is,
            fit.gain_of_rotation.map_or(String::new(), |gain| {
                format!(": no other explains more{}", gain_told(gain))
            })
        ),
        Some(rotation) => format!(
            "rotation  {:.1} degrees{}, was {:.1}{}\n",
            rotation.is,
            plus_minus(rotation.sigma, 1.0, " degrees"),
            rotation.was,
            fit.gain_of_rotation.map_or(String::new(), gain_told)
        ),
    };
    text += &format!(
        "scale     {}\n",
        scale_told(&fit.scale, fit.scale_basis, fit.mean_albedo)
    );
    text += &match &fit.sun {
        Some(sun) => format!(
            "sun       {:.1} degrees up, azimuth {:.1} (0 is -Z, 90 is +X), irradiance {:.3}; {}{}\n",
            sun.elevation_deg(),
            sun.azimuth_deg(),
            sun.irradiance,
            sun.sureness(),
            gain_told(fit.gain_of_sun)
        ),
        None => format!("sun       none{}\n", gain_told(fit.gain_of_sun)),
    };
    text
}

fn gain_told(gain: Gain) -> String {
    format!(
        " (explains {:.1}% more, {:.1} standard errors)",
        100.0 * gain.share,
        gain.significance
    )
}

fn plus_minus(sigma: Option<f64>, factor: f64, unit: &str) -> String {
    sigma.map_or(String::new(), |sigma| {
        format!(" +- {:.1}{unit}", factor * sigma)
    })
}

fn scale_told(scale: &Fitted, basis: ScaleBasis, mean_albedo: f64) -> String {
    let reflects = 100.0 * mean_albedo;
    match basis {
        ScaleBasis::Albedo => format!(
            "{:.4}{}, was {:.4}: the scene tells what the proxy reflects",
            scale.is,
            plus_minus(scale.sigma.map(|sigma| sigma / scale.is), 100.0, "%"),
            scale.was
        ),
        ScaleBasis::SameReflectance => format!(
            "{:.4}, was {:.4}: the proxy reflects {reflects:.0}% in the mean as before, for its albedo is not known",
            scale.is, scale.was
        ),
        ScaleBasis::GuessedReflectance => format!(
            "{:.4}, was {:.4}: guessed, so that the proxy reflects {reflects:.0}% in the mean; right within a factor of 1.5",
            scale.is, scale.was
        ),
        ScaleBasis::Exposure => format!("kept at {:.4}: exposure_ev is \"auto\"", scale.is),
    }
}

fn statistics(fit: &LightFit) -> Value {
    let fitted = |fitted: &Fitted| json!({ "was": fitted.was, "is": fitted.is, "sigma": fitted.sigma, "kept": fitted.is_kept });
    let gain = |gain: &Gain| json!({ "share": gain.share, "standard_errors": gain.significance });
    let sun = fit.sun.as_ref().map(|sun| {
        json!({
            "direction": sun.direction.to_array(),
            "elevation_deg": sun.elevation_deg(),
            "azimuth_deg": sun.azimuth_deg(),
            "irradiance": sun.irradiance,
            "direction_sigma_deg": sun.direction_sigma_deg,
            "irradiance_relative_sigma": sun.irradiance_sigma,
        })
    });
    json!({
        "points": fit.points,
        "cells_left_out": fit.left_out,
        "explained": {
            "fitted": fit.explained.fitted,
            "as_given": fit.explained.as_given,
            "by_white_sky": fit.explained.by_white_sky,
            "held_out": gain(&fit.gain),
        },
        "poor": fit.is_poor(),
        "gain_of_white_sky": gain(&fit.gain_of_white_sky),
        "is_white_sky": fit.is_white_sky,
        "shadows_over_around": {
            "in_photograph": fit.shadows.in_photograph,
            "fitted": fit.shadows.fitted,
            "as_given": fit.shadows.as_given,
            "by_white_sky": fit.shadows.by_white_sky,
        },
        "texture_ln": fit.texture,
        "mean_albedo": fit.mean_albedo,
        "scale": fitted(&fit.scale),
        "rotation_deg": fit.rotation_deg.as_ref().map(fitted),
        "gain_of_rotation": fit.gain_of_rotation.as_ref().map(gain),
        "sun": sun,
        "gain_of_sun": gain(&fit.gain_of_sun),
    })
}
