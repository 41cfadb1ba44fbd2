//! `mixray info FILE`: what a file is and holds, by its content.

mod model;
mod picture;

use std::fmt::Display;
use std::path::Path;

use super::Failure;
use crate::decode::{FileKind, MAX_TEXT_BYTES, kind_of, read_text};
use crate::scene::projection::undistort;
use crate::scene::trajectory::{Trajectory, read_camera};
use crate::scene::{LightKind, NoiseProfile, Scene, Side, load};

/// Lines of "what  value".
#[derive(Default)]
struct Report(String);

impl Report {
    fn line(&mut self, what: &str, value: impl Display) {
        self.0 += &format!("{what:<13} {value}\n");
    }

    fn notes(&mut self, notes: &[String]) {
        for note in notes {
            self.line("note", note);
        }
    }
}

/// What a file holds, a line for each of its properties.
pub(super) fn describe(path: &Path) -> Result<String, Failure> {
    let failure = |problem: String| Failure(format!("{}: {problem}", path.display()));
    let mut report = Report::default();
    match kind_of(path) {
        Some(kind @ (FileKind::Gltf | FileKind::Ply | FileKind::Obj)) => {
            model::describe(path, kind, &mut report)?;
        }
        Some(FileKind::Picture(name)) => picture::describe(path, name, &mut report)?,
        Some(FileKind::Film(name)) => {
            report.line("file", name);
            report.line(
                "use",
                "frames of `mixray sequence`; films other than Y4M and JPEG pictures go through ffmpeg",
            );
        }
        Some(kind @ FileKind::ForeignModel(_)) => {
            return Err(failure(format!(
                "it is {}, which is not read; expected glTF 2.0, PLY or OBJ; import it in Blender and export it as glTF 2.0 (.glb)",
                kind.name()
            )));
        }
        None if path.is_dir() => of_poses(path, &mut report)?,
        None => {
            let text = read_text(path, MAX_TEXT_BYTES).map_err(|problem| {
                failure(format!("{problem}; expected a model, picture, trajectory, camera, noise profile or scene; name another file"))
            })?;
            of_text(path, &text, &mut report)?;
        }
    }
    Ok(report.0)
}

fn of_text(path: &Path, text: &str, report: &mut Report) -> Result<(), Failure> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let says = |key: &str| text.lines().any(|line| line.trim_start().starts_with(key));
    match () {
        () if ending == "toml" && says("[[frame]]") => of_poses(path, report),
        () if ending == "toml" && says("[[bin]]") => of_noise(path, report),
        () if ending == "toml" => of_scene(path, report),
        () if text.trim_start().starts_with('{') && !text.contains("\"frames\"")
            || says("%YAML")
            || says("camera_matrix") =>
        {
            of_camera(path, report)
        }
        () => of_poses(path, report),
    }
}

fn of_scene(path: &Path, report: &mut Report) -> Result<(), Failure> {
    let scene: Scene = load(path)?;
    report.line("file", format!("a scene, `{}`", scene.name));
    let camera = &scene.camera;
    let photo = match &scene.photo {
        Some(_) => "with a photograph",
        None => "without a photograph",
    };
    report.line(
        "picture",
        format!("{} x {} pixels, {photo}", camera.width, camera.height),
    );
    let edges = [0.0, f64::from(camera.width)].map(|x| undistort(camera, x, camera.cy).ok());
    if let [Some(left), Some(right)] = edges {
        let view = (right[0].atan() - left[0].atan()).to_degrees();
        report.line(
            "camera",
            format!(
                "{view:.1} degrees across, at {}",
                place(camera.world_from_camera.w_axis.truncate())
            ),
        );
    }
    if scene.lens.aperture_radius_m > 0.0 {
        let lens = &scene.lens;
        report.line(
            "lens",
            format!(
                "aperture radius {:.2} mm, focus at {} m",
                1e3 * lens.aperture_radius_m,
                lens.focus_distance_m
            ),
        );
    }
    report.line(
        "environment",
        if scene.environment.is_some() {
            "yes"
        } else {
            "none"
        },
    );
    for light in &scene.lights {
        let kind = match light.kind {
            LightKind::Point { .. } => "point",
            LightKind::Spot { .. } => "spot",
            LightKind::Directional { .. } => "directional",
            LightKind::Quad { .. } => "quad",
        };
        report.line("light", kind);
    }
    for object in &scene.objects {
        let side = match object.side {
            Side::Real => "real",
            Side::Virtual => "virtual",
        };
        let extent = model::extent(&object.instances, object.world_from_object);
        report.line(
            side,
            format!(
                "{}: {extent}, at {}",
                object.name,
                place(object.world_from_object.w_axis.truncate())
            ),
        );
    }
    report.notes(&scene.warnings);
    Ok(())
}

fn of_noise(path: &Path, report: &mut Report) -> Result<(), Failure> {
    let profile = NoiseProfile::read(path)
        .map_err(|problem| Failure(format!("{}: {problem}", path.display())))?;
    report.line(
        "file",
        format!("a noise profile of {} bins", profile.bins.len()),
    );
    for (channel, name) in ["red", "green", "blue"].into_iter().enumerate() {
        let sigmas = profile.bins.iter().map(|bin| bin.sigma[channel]);
        let least = sigmas.clone().fold(f64::INFINITY, f64::min);
        let most = sigmas.fold(0.0, f64::max);
        let fit = profile.fit[channel];
        report.line(
            name,
            format!(
                "sigma {least:.2} to {most:.2} DN; sigma^2 = {:.4} y + {:.3}",
                fit.a, fit.b
            ),
        );
    }
    for source in &profile.sources {
        report.line("source", source);
    }
    Ok(())
}

fn of_poses(path: &Path, report: &mut Report) -> Result<(), Failure> {
    let trajectory = Trajectory::read(path)?;
    let poses: Vec<_> = (trajectory.entries.iter())
        .filter_map(|entry| entry.world_from_camera)
        .collect();
    let missing = trajectory.entries.len() - poses.len();
    report.line("file", "a trajectory");
    report.line(
        "poses",
        format!("{}, and {missing} frames without one", poses.len()),
    );
    if let Some(rate) = trajectory.frames_per_second {
        report.line("rate", format!("{rate} frames a second"));
    }
    let own = trajectory
        .entries
        .iter()
        .filter(|entry| entry.intrinsics.is_some())
        .count();
    report.line(
        "intrinsics",
        match (trajectory.intrinsics, own) {
            (Some(_), 0) => "one for all frames".to_owned(),
            (None, 0) => "none: the scene's".to_owned(),
            (_, own) => format!("of their own in {own} frames"),
        },
    );
    let places = poses.iter().map(|pose| pose.w_axis.truncate());
    if let Some((low, high)) = crate::scene::placing::bounds(places) {
        report.line("reach", format!("{} to {} m", place(low), place(high)));
    }
    Ok(())
}

fn of_camera(path: &Path, report: &mut Report) -> Result<(), Failure> {
    let file = read_camera(path, None)
        .map_err(|problem| Failure(format!("{}: {problem}", path.display())))?;
    report.line("file", "a camera");
    let size = file.intrinsics.size;
    report.line(
        "size",
        size.map_or("not told".to_owned(), |(w, h)| format!("{w} x {h} pixels")),
    );
    let camera = file.intrinsics.camera_of_any_size(
        size.unwrap_or((0, 0)),
        file.world_from_camera.unwrap_or_default(),
    );
    report.line(
        "focal length",
        format!("{:.2} x {:.2} pixels", camera.fx, camera.fy),
    );
    report.line(
        "centre",
        format!("{:.2}, {:.2} from the corner", camera.cx, camera.cy),
    );
    report.line(
        "distortion",
        if camera.distortion.is_none() {
            "none"
        } else {
            "yes"
        },
    );
    match file.world_from_camera {
        Some(pose) => report.line("pose", format!("at {}", place(pose.w_axis.truncate()))),
        None => report.line("pose", "none"),
    }
    report.notes(&file.notes);
    Ok(())
}

fn place(point: glam::DVec3) -> String {
    format!("[{:.3}, {:.3}, {:.3}]", point.x, point.y, point.z)
}
