//! All parts of a starter scene, put together.

use std::path::{Path, PathBuf};

use super::exif::noted_lens;
use super::light::{Lighting, Surroundings};
use super::mesh::{bounds, read_mesh};
use super::mesh_file::glb;
use super::place::{Placement, RealWorld, place};
use super::real::{PROXY, RealScene};
use super::scan::ScanFrame;
use super::scene_text::{Draft, ThinLens};
use super::{Claim, Request, Scan};
use crate::film::Picture;
use crate::refusal::Refusal;
use crate::scene::{Camera, Photo, Side};

/// The made environment beside the scene file.
const ENVIRONMENT: &str = "environment.exr";

/// A starter scene, to be written into one folder.
pub struct Made {
    pub scene_text: String,
    /// Lat-long, by its name in the scene file.
    pub environment: Option<(&'static str, Picture)>,
    /// Binary glTF, by its name in the scene file.
    pub proxy: Option<(&'static str, Vec<u8>)>,
    /// Of a scan: its trajectory, and the folder of its photographs.
    pub poses: Option<(String, PathBuf)>,
    /// What is said of the camera, a line each.
    pub summary: String,
}

/// Puts a scene together. `name` is how a file is called in the scene file.
///
/// # Errors
/// What was given cannot be read or contradicts itself, in one line.
pub fn compose(request: &Request, name: &dyn Fn(&Path) -> String) -> Result<Made, Refusal> {
    let scan = match Scan::is_one(&request.photo) {
        true => Some(Scan::read(&request.photo)?),
        false => None,
    };
    let frame = match &scan {
        Some(scan) => Some(scan.frame(request.frame.as_deref())?),
        None => None,
    };
    let request = &match frame {
        Some(frame) => with_frame(request, frame),
        None => request.clone(),
    };
    let (photo, _) = Photo::read(&request.photo)
        .map_err(|problem| format!("{}: {problem}", request.photo.display()))?;
    // A scan's cameras are those of the pixels as stored.
    let upright = scan.is_none() && photo.is_turned();
    let photo = if upright { photo.upright() } else { photo };
    let real = match (&scan, frame) {
        (Some(scan), Some(frame)) => RealScene::of_scan(scan, frame, &photo, request, name)?,
        _ => RealScene::of_photograph(&photo, request, name)?,
    };
    let camera = &real.camera.value;
    let lighting = Lighting::of(&photo, camera, request)?;
    let models = put_down(request, &real.world, camera, name)?;
    let (environment, picture) = match lighting.environment.value {
        Surroundings::Made(picture) => (ENVIRONMENT.to_owned(), Some((ENVIRONMENT, picture))),
        Surroundings::Given(path) => (name(&path), None),
    };
    let draft = Draft {
        photo: name(&request.photo),
        upright,
        lens: lens(request, &models, camera),
        camera: real.camera.clone(),
        environment: Claim::new(environment, lighting.environment.basis),
        sun: lighting.sun,
        proxy: real.proxy.clone(),
        models,
    };
    let folder = |frame: &ScanFrame| frame.photo.parent().map(Path::to_owned);
    Ok(Made {
        scene_text: draft.text(),
        environment: picture,
        proxy: real.surface.map(|surface| (PROXY, glb(&surface))),
        poses: (scan.as_ref().zip(frame))
            .and_then(|(scan, frame)| Some((scan.trajectory(), folder(frame)?))),
        summary: real.camera.basis,
    })
}

fn with_frame(request: &Request, frame: &ScanFrame) -> Request {
    Request {
        photo: frame.photo.clone(),
        depth: request.depth.clone().or_else(|| frame.depth.clone()),
        ..request.clone()
    }
}

/// The models, each with its place.
fn put_down(
    request: &Request,
    world: &RealWorld,
    camera: &Camera,
    name: &dyn Fn(&Path) -> String,
) -> Result<Vec<(String, Placement)>, Refusal> {
    let count = request.models.len();
    (request.models.iter().enumerate())
        .map(|(index, path)| {
            let model = read_mesh(path, Side::Virtual)?;
            let bounds = bounds(&model).ok_or_else(|| {
                format!(
                    "{}: it has no triangles; expected a model; name another file",
                    path.display()
                )
            })?;
            let placement = place(world, camera, (index, count), bounds);
            Ok((name(path), placement))
        })
        .collect()
}

/// Focused on the first model.
fn lens(
    request: &Request,
    models: &[(String, Placement)],
    camera: &Camera,
) -> Option<Claim<ThinLens>> {
    let noted = noted_lens(&request.photo)?;
    let (_, first) = models.first()?;
    let seen = (camera.world_from_camera.inverse()).transform_point3(first.translation);
    let lens = ThinLens {
        focus_distance_m: -seen.z,
        ..noted
    };
    (lens.focus_distance_m > 1e-3 * lens.focal_length_mm).then(|| {
        Claim::new(
            lens,
            "Lens: from the camera's tags, exact; its focus is guessed to be on the first model.",
        )
    })
}
