//! `mixray new`: a starter scene from one photograph, or from a phone's scan.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser};
use glam::DVec2;

use super::terminal::print;
use super::values::length;
use super::{Failure, Outcome, render};
use crate::files;
use crate::light_fit::{FitOptions, edited, fit};
use crate::output::{Format, PngBits, Target, write_bytes, write_image, write_text};
use crate::start::{Ball, DepthUnit, KnownLength, Made, Request, Shadow, compose};
use crate::work::Watcher;

/// Makes a scene from a photograph: camera, ground, light, and models put down in it
///
/// Takes what the photograph's file tells and guesses the rest; the scene file says what was guessed, and how sure it is. Renders a first
/// picture. PHOTO may be a scan instead: nerfstudio's transforms.json, or the folder of Polycam's raw export.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Photograph (PNG, JPEG, EXR, HDR), transforms.json, or a folder that a scan was exported to
    photo: PathBuf,
    /// glTF models (.glb, .gltf) to put into it
    models: Vec<PathBuf>,
    /// Folder to make [default: the photograph's name without its extension]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Replace a scene that is there already
    #[arg(long)]
    overwrite: bool,
    /// Write the scene alone, without a first picture
    #[arg(long)]
    no_render: bool,
    /// Of a scan: the photograph's name, or its place from 0 [default: the first]
    #[arg(long, value_name = "NAME")]
    frame: Option<String>,
    /// Field of view across the width, degrees [default: from the camera's tags]
    #[arg(long, value_name = "DEGREES", value_parser = field_of_view)]
    fov: Option<f64>,
    /// Height of the horizon in the picture, pixels from the top; two where it is not level: at the left and right borders
    #[arg(long, value_name = "Y|LEFT,RIGHT", value_parser = horizon, allow_hyphen_values = true)]
    horizon: Option<Horizon>,
    /// Height of the camera over the ground, such as 1.5m
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with = "length")]
    height: Option<f64>,
    /// Two pixels that show the ground and how far they lie apart there, such as 120,400,310,415,30cm
    #[arg(long, value_name = "X1,Y1,X2,Y2,LENGTH", value_parser = known_length)]
    length: Option<KnownLength>,
    /// Pixels of an object's top and of its shadow's tip; better with the point of the ground below the top
    #[arg(long, value_name = "TOP_X,TOP_Y,TIP_X,TIP_Y[,FOOT_X,FOOT_Y]", value_parser = shadow)]
    sun: Option<Shadow>,
    /// Lat-long environment (EXR, HDR)
    #[arg(long, value_name = "FILE", conflicts_with = "mirror_ball")]
    environment: Option<PathBuf>,
    /// Photograph of a mirror ball, taken from where the photograph was
    #[arg(long, value_name = "FILE")]
    mirror_ball: Option<PathBuf>,
    /// The ball's circle, pixels [default: the largest about the middle of its photograph]
    #[arg(long, value_name = "X,Y,RADIUS", value_parser = ball, requires = "mirror_ball")]
    ball: Option<Ball>,
    /// Depth map of the photograph, of any resolution
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,
    /// What its numbers are [default: millimetres of 16 bits, metres of floats, inverse of 8 bits]
    #[arg(long, value_name = "UNIT", value_parser = depth_unit())]
    depth_unit: Option<DepthUnit>,
    /// Mesh of what the photograph shows (.glb, .gltf), in the axes of the scan, or of a scene of the same photograph
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug)]
struct Horizon([f64; 2]);

/// The names of the files in a scene's folder.
const SCENE: &str = "scene.toml";
const POSES: &str = "poses.json";
const SKETCH: &str = "lines.png";
const PICTURE: &str = "picture.png";

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let folder = arguments.folder()?;
    let scene = folder.join(SCENE);
    if scene.exists() && !arguments.overwrite {
        return Err(Failure(format!(
            "{}: it is there already; expected a new folder; name another with -o, or give --overwrite",
            scene.display()
        )));
    }
    std::fs::create_dir_all(&folder).map_err(|error| {
        Failure(format!(
            "{}: the folder cannot be made ({error}); expected a place to write to; name another with -o",
            folder.display()
        ))
    })?;
    let made = compose(&arguments.request(), &|path| name_from(&folder, path))?;
    write(&made, &folder)?;
    print(&format!("{}\n", made.summary))?;
    super::all_threads()?;
    let has_shape = made.proxy.is_some() || arguments.mesh.is_some();
    if has_shape && arguments.sun.is_none() {
        fit_light(&scene, arguments.environment.is_none())?;
    }
    print(&next_steps(&made, &scene))?;
    if arguments.no_render {
        return Ok(Outcome::Done);
    }
    // As if it had been typed.
    let mut line = vec!["render".into(), scene.into_os_string(), "-o".into()];
    line.push(folder.join(PICTURE).into_os_string());
    render::run(Typed::try_parse_from(line)?.render.check()?)
}

/// What a command line of `mixray render` says.
#[derive(Parser)]
struct Typed {
    #[command(flatten)]
    render: render::Arguments,
}

impl Arguments {
    fn folder(&self) -> Result<PathBuf, Failure> {
        if let Some(folder) = &self.output {
            return Ok(folder.clone());
        }
        // "." has no name of its own.
        let named = self.photo.canonicalize().unwrap_or(self.photo.clone());
        match named.file_stem() {
            Some(stem) => Ok(PathBuf::from(stem)),
            None => Err(Failure(format!(
                "{}: it has no name for the scene's folder; name one with -o",
                self.photo.display()
            ))),
        }
    }

    fn request(&self) -> Request {
        Request {
            photo: self.photo.clone(),
            models: self.models.clone(),
            frame: self.frame.clone(),
            fov_deg: self.fov,
            horizon: self.horizon.map(|Horizon(ends)| ends),
            height_m: self.height,
            length: self.length,
            shadow: self.sun,
            environment: self.environment.clone(),
            mirror_ball: self.mirror_ball.clone(),
            ball: self.ball,
            depth: self.depth.clone(),
            depth_unit: self.depth_unit,
            mesh: self.mesh.clone(),
        }
    }
}

/// Light as the photograph shows it on a proxy that has a shape. What was taken at the photograph's place stays as it is turned.
fn fit_light(scene: &Path, keep_rotation: bool) -> Result<(), Failure> {
    let options = FitOptions {
        keep_rotation,
        ..FitOptions::default()
    };
    let told = match fit(&crate::scene::load(scene)?, options, &Watcher::none()) {
        Ok(fit) if fit.is_poor() => "it does not explain the photograph's shading".to_owned(),
        Ok(fit) => {
            let text = std::fs::read_to_string(scene)?;
            write_text(scene, &edited(&text, &fit)?)?;
            return print(&format!(
                "Light: fitted to the photograph's shading, of which it explains {:.0}%{}.\n",
                100.0 * fit.gain.share,
                (fit.sun.as_ref())
                    .map_or(String::new(), |sun| format!("; a sun, {}", sun.sureness()))
            ));
        }
        Err(problem) => problem.to_string(),
    };
    print(&format!("Light: as guessed; a fit was tried: {told}.\n"))
}

/// Everything but the scene file first, so that it names nothing that is not there.
fn write(made: &Made, folder: &Path) -> Result<(), Failure> {
    let own = |name: &str| {
        let path = folder.join(name);
        files::own(&path).map(|()| path)
    };
    if let Some((name, picture)) = &made.environment {
        let target = Target::named(&own(name)?, Format::Exr);
        write_image(&target, picture, PngBits::Eight)?;
    }
    if let Some(sketch) = &made.sketch {
        let target = Target::named(&own(SKETCH)?, Format::Png);
        write_image(&target, sketch, PngBits::Eight)?;
    }
    if let Some((name, bytes)) = &made.proxy {
        write_bytes(&own(name)?, bytes)?;
    }
    if let Some((poses, _)) = &made.poses {
        write_text(&own(POSES)?, poses)?;
    }
    write_text(&own(SCENE)?, &made.scene_text)?;
    Ok(())
}

fn next_steps(made: &Made, scene: &Path) -> String {
    let mut text = format!(
        "Scene: {0}; correct it there, and render it with\n  mixray render {0}\n",
        scene.display()
    );
    if let Some((_, frames)) = &made.poses {
        let folder = scene.parent().unwrap_or(Path::new(""));
        text += &format!(
            "and the whole scan with\n  mixray sequence {} --frames {} --trajectory {} -o {}\n",
            scene.display(),
            frames.display(),
            folder.join(POSES).display(),
            folder.join("frames").display()
        );
    }
    text
}

/// From the scene's folder, so that both can be moved together.
fn name_from(folder: &Path, path: &Path) -> String {
    let relative = || pathdiff::diff_paths(path.canonicalize().ok()?, folder.canonicalize().ok()?);
    relative()
        .unwrap_or(path.to_owned())
        .to_string_lossy()
        .into_owned()
}

/// Finite numbers with commas between.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |part: &str| part.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    text.split(',').map(number).collect()
}

fn field_of_view(text: &str) -> Result<f64, &'static str> {
    let degrees = text.parse().ok().filter(|x| (1.0..=170.0).contains(x));
    degrees.ok_or("expected degrees from 1 to 170")
}

fn horizon(text: &str) -> Result<Horizon, &'static str> {
    match numbers(text).as_deref() {
        Some(&[y]) => Ok(Horizon([y, y])),
        Some(&[left, right]) => Ok(Horizon([left, right])),
        _ => Err("expected pixels from the top, one number or LEFT,RIGHT"),
    }
}

fn known_length(text: &str) -> Result<KnownLength, &'static str> {
    let expected = "expected X1,Y1,X2,Y2,LENGTH, such as 120,400,310,415,30cm";
    let (places, length_m) = text.rsplit_once(',').ok_or(expected)?;
    let length_m = length(length_m.trim()).map_err(|_| expected)?;
    match numbers(places).as_deref() {
        Some(&[x1, y1, x2, y2]) => Ok(KnownLength {
            from: DVec2::new(x1, y1),
            to: DVec2::new(x2, y2),
            length_m,
        }),
        _ => Err(expected),
    }
}

fn shadow(text: &str) -> Result<Shadow, &'static str> {
    let shadow = |x: &[f64], foot| Shadow {
        top: DVec2::new(x[0], x[1]),
        tip: DVec2::new(x[2], x[3]),
        foot,
    };
    match numbers(text).as_deref() {
        Some(x @ &[_, _, _, _]) => Ok(shadow(x, None)),
        Some(x @ &[_, _, _, _, foot_x, foot_y]) => Ok(shadow(x, Some(DVec2::new(foot_x, foot_y)))),
        _ => Err("expected TOP_X,TOP_Y,TIP_X,TIP_Y, or those and FOOT_X,FOOT_Y"),
    }
}

fn ball(text: &str) -> Result<Ball, &'static str> {
    match numbers(text).as_deref() {
        Some(&[x, y, radius_px]) if radius_px >= 2.0 => Ok(Ball {
            centre: DVec2::new(x, y),
            radius_px,
        }),
        _ => Err("expected X,Y,RADIUS in pixels, the radius at least 2"),
    }
}

fn depth_unit() -> impl TypedValueParser<Value = DepthUnit> {
    let names = DepthUnit::NAMES.map(|(name, _)| name);
    PossibleValuesParser::new(names).try_map(|name| {
        let known = DepthUnit::NAMES
            .into_iter()
            .find(|(known, _)| *known == name);
        known.map(|(_, unit)| unit).ok_or("is not a unit")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_lengths_are_read() {
        let known = known_length("120, 400,310,415, 30cm").unwrap();
        assert_eq!(
            (known.from, known.to),
            (DVec2::new(120.0, 400.0), DVec2::new(310.0, 415.0))
        );
        assert!((known.length_m - 0.3).abs() < 1e-12);
        for wrong in ["1,2,3,4", "1,2,3,4,5", "1,2,3,30cm", "a,2,3,4,30cm", "30cm"] {
            assert!(known_length(wrong).is_err(), "{wrong}");
        }
        assert_eq!(shadow("1,2,3,4").unwrap().foot, None);
        assert_eq!(
            shadow("1,2,3,4,5,6").unwrap().foot,
            Some(DVec2::new(5.0, 6.0))
        );
        assert!(shadow("1,2,3").is_err() && shadow("1,2,3,4,nan,6").is_err());
        assert_eq!(horizon("-20").unwrap().0, [-20.0; 2]);
        assert_eq!(horizon("10,30").unwrap().0, [10.0, 30.0]);
        assert!(horizon("10,20,30").is_err() && field_of_view("180").is_err());
        assert!(ball("10,10,0").is_err() && ball("10,10,9").is_ok());
    }
}
