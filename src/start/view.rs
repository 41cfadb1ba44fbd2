//! Focal length, direction and height of the camera of one photograph.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::camera::{camera_over_ground, height_factor, horizon_of_up, up_of_horizon, up_of_pitch};
use super::depth::DepthMap;
use super::exif::noted_focal_length;
use super::plane::{Plane, ground_plane};
use super::{Claim, Request};
use crate::refusal::Refusal;
use crate::scene::{Camera, Photo, projection};

/// Of phones' main cameras, and of most photographs.
const GUESSED_FOV_DEG: f64 = 65.0;
/// Somebody looks at what stands on a table or the floor before them.
const GUESSED_PITCH_DEG: f64 = 20.0;
/// At which a photograph is taken.
const GUESSED_HEIGHT_M: f64 = 1.5;

/// A camera, and what its depth map says.
pub struct View {
    pub camera: Claim<Camera>,
    pub depth: Option<DepthMap>,
}

impl View {
    /// # Errors
    /// What was given contradicts itself or cannot be read.
    pub fn of(photo: &Photo, request: &Request) -> Result<Self, Refusal> {
        let size = (photo.width, photo.height);
        let focal = focal_length(photo, request)?;
        let depth = match &request.depth {
            Some(path) => Some(read_depth(path, request)?),
            None => None,
        };
        let plane = depth.as_ref().and_then(|depth| {
            let level = camera_over_ground(size, focal.value, DVec3::Y, 0.0);
            ground_plane(&depth.surface(&level).positions)
        });
        let up = direction_up(size, focal.value, plane, request)?;
        let relative = depth.as_ref().is_some_and(|depth| depth.unit.is_relative());
        let ground = plane.map(|plane| (-plane.offset_m, relative));
        let (camera, height, factor) = with_height(size, focal.value, up.value, ground, request)?;
        let depth = depth.map(|mut depth| {
            depth.depths_m.iter_mut().for_each(|depth| *depth *= factor);
            depth
        });
        let horizon = match horizon_of_up(size, focal.value, up.value) {
            Some([left, right]) => format!(
                "crosses the left border at {left:.0} and the right one at {right:.0} pixels from the top"
            ),
            None => "is upright".to_owned(),
        };
        let basis = format!(
            "Focal length: {}.\nDirection: {}; the horizon {horizon}.\nHeight over the ground, and with it the scale of the scene: {height}.",
            focal.basis, up.basis
        );
        Ok(Self {
            camera: Claim::new(camera, basis),
            depth,
        })
    }
}

fn read_depth(path: &Path, request: &Request) -> Result<DepthMap, Refusal> {
    DepthMap::read(path, request.depth_unit)
        .map_err(|problem| format!("{}: {problem}", path.display()).into())
}

fn focal_length(photo: &Photo, request: &Request) -> Result<Claim<f64>, Refusal> {
    let (width, height) = (f64::from(photo.width), f64::from(photo.height));
    let of_fov = |fov: f64, side: f64| 0.5 * side / (0.5 * fov.to_radians()).tan();
    if let Some(fov) = request.fov_deg {
        return Ok(Claim::new(
            of_fov(fov, width),
            format!("{fov} degrees across the width, as given"),
        ));
    }
    let noted = noted_focal_length(&request.photo, (photo.width, photo.height))
        .map_err(|problem| format!("{}: {problem}", request.photo.display()))?;
    Ok(noted.unwrap_or_else(|| {
        let basis = format!(
            "guessed, {GUESSED_FOV_DEG} degrees across the longer side, as of phones: may be off by a third; give --fov"
        );
        Claim::new(of_fov(GUESSED_FOV_DEG, width.max(height)), basis)
    }))
}

fn direction_up(
    size: (u32, u32),
    focal_px: f64,
    plane: Option<Plane>,
    request: &Request,
) -> Result<Claim<DVec3>, Refusal> {
    if let Some([left, right]) = request.horizon {
        let up = up_of_horizon(size, focal_px, left, right);
        return Ok(Claim::new(up, "from the horizon as given"));
    }
    if let Some(plane) = plane {
        let basis = format!(
            "from the plane in the depth map, taken for level, in which {:.0}% of its points lie within {:.1} mm rms: +- 1 degree if it is",
            100.0 * plane.support,
            1000.0 * plane.rms_m
        );
        return Ok(Claim::new(plane.normal, basis));
    }
    let basis = format!(
        "guessed, {GUESSED_PITCH_DEG} degrees down and not rolled: may be off by 15 degrees; give --horizon"
    );
    Ok(Claim::new(up_of_pitch(GUESSED_PITCH_DEG), basis))
}

/// The camera, what is said of its height, and the factor that a depth map's scale takes. `ground` is how high the camera is over the depth
/// map's plane, metres, and whether that is relative.
fn with_height(
    size: (u32, u32),
    focal_px: f64,
    up: DVec3,
    ground: Option<(f64, bool)>,
    request: &Request,
) -> Result<(Camera, String, f64), Refusal> {
    let first = ground.map_or(GUESSED_HEIGHT_M, |(height_m, _)| height_m);
    let camera = camera_over_ground(size, focal_px, up, first);
    let scaled = |factor: f64| camera_over_ground(size, focal_px, up, first * factor);
    if let Some(known) = request.length {
        let inside = |p: DVec2| {
            let most = DVec2::new(f64::from(size.0), f64::from(size.1));
            p.cmpge(DVec2::ZERO).all() && p.cmple(most).all()
        };
        let factor = height_factor(&camera, known.from, known.to, known.length_m)
            .filter(|_| inside(known.from) && inside(known.to))
            .ok_or("--length: one of the two pixels shows no ground; expected two different points of the ground, below the horizon; correct them, or give --horizon")?;
        let basis = format!(
            "from the length of {} m on the ground, as given",
            known.length_m
        );
        return Ok((scaled(factor), basis, factor));
    }
    if let Some(height) = request.height_m {
        let basis = format!("{height} m, as given");
        return Ok((scaled(height / first), basis, height / first));
    }
    let basis = match ground {
        Some((_, false)) => format!("{first:.3} m, from the depth map"),
        Some((_, true)) => format!(
            "guessed, {first:.3} m, as the depth map has no unit: may be off by a factor of 2; give --length X1,Y1,X2,Y2,LENGTH"
        ),
        None => format!(
            "guessed, {GUESSED_HEIGHT_M} m: may be off by a factor of 2, and all sizes with it; give --length X1,Y1,X2,Y2,LENGTH"
        ),
    };
    Ok((camera, basis, 1.0))
}

/// The middle of the pixels that show the ground: where a photograph without anything else has its ground, mean radiance.
pub fn ground_radiance(photo: &Photo, camera: &Camera) -> [f32; 3] {
    let (width, height) = (photo.width as usize, photo.height as usize);
    let step = (width.max(height) / 200).max(1);
    let shows_ground = |x: usize, y: usize| {
        let ideal = projection::undistort(camera, x as f64 + 0.5, y as f64 + 0.5);
        ideal.is_ok_and(|[right, down]| {
            let direction = DVec3::new(right, -down, -1.0);
            camera.world_from_camera.transform_vector3(direction).y < 0.0
        })
    };
    let pixels = |ground_alone: bool| -> Vec<[f32; 3]> {
        (0..height)
            .step_by(step)
            .flat_map(|y| (0..width).step_by(step).map(move |x| (x, y)))
            .filter(|&(x, y)| !ground_alone || shows_ground(x, y))
            .map(|(x, y)| photo.linear[y * width + x])
            .collect()
    };
    let mut chosen = pixels(true);
    if chosen.is_empty() {
        chosen = pixels(false);
    }
    [0, 1, 2].map(|channel| {
        let mut values: Vec<f32> = chosen.iter().map(|pixel| pixel[channel].max(0.0)).collect();
        values.sort_by(f32::total_cmp);
        values[values.len() / 2]
    })
}
