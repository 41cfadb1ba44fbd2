//! Focal length, direction and height of the camera of one photograph.

use std::path::Path;

use glam::{DVec2, DVec3};

use super::camera::{camera_over_ground, height_factor, horizon_of_up, up_of_horizon, up_of_pitch};
use super::depth::DepthMap;
use super::exif::noted_focal_length;
use super::lines::{Basis, Grey, KnownFocal, Lines, read_lines};
use super::plane::{Plane, ground_plane};
use super::{Claim, Request};
use crate::math::luminance;
use crate::refusal::Refusal;
use crate::scene::srgb::encode;
use crate::scene::{Camera, Photo, projection};

/// Of phones' main cameras, and of most photographs.
const GUESSED_FOV_DEG: f64 = 65.0;
/// Somebody looks at what stands on a table or the floor before them.
const GUESSED_PITCH_DEG: f64 = 20.0;
/// At which a photograph is taken.
const GUESSED_HEIGHT_M: f64 = 1.5;

/// Longest side of the picture that lines are looked for in, pixels.
const LINES_SIDE_PX: u32 = 1024;
/// Standard deviations of the logarithm of a focal length that is given, and of one that the camera notes.
const GIVEN_SIGMA: f64 = 0.005;
const NOTED_SIGMA: f64 = 0.03;

/// A camera, and what its depth map and its lines say.
pub struct View {
    pub camera: Claim<Camera>,
    pub depth: Option<DepthMap>,
    /// In pixels of the photograph; `None`: the lines were not needed, or say nothing.
    pub lines: Option<Lines>,
}

impl View {
    /// # Errors
    /// What was given contradicts itself or cannot be read.
    pub fn of(photo: &Photo, request: &Request) -> Result<Self, Refusal> {
        let size = (photo.width, photo.height);
        let known = known_focal_length(photo, request)?;
        let lines = match request.horizon {
            Some(_) if known.is_some() => None,
            _ => lines_of(photo, known.as_ref().map(|(_, known)| *known)),
        };
        let focal = focal_length(photo, known, lines.as_ref());
        let depth = match &request.depth {
            Some(path) => Some(read_depth(path, request)?),
            None => None,
        };
        let plane = depth.as_ref().and_then(|depth| {
            let level = camera_over_ground(size, focal.value, DVec3::Y, 0.0);
            ground_plane(&depth.surface(&level).positions)
        });
        let up = direction_up(size, focal.value, plane, lines.as_ref(), request);
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
            lines,
        })
    }
}

/// What a photograph's straight lines and squares say of its camera, in its pixels; `None`: nothing that is sure. They are looked for in means of blocks of
/// the pixels' codes.
pub fn lines_of(photo: &Photo, known: Option<KnownFocal>) -> Option<Lines> {
    let block = photo.width.max(photo.height).div_ceil(LINES_SIDE_PX) as usize;
    let (width, height) = (photo.width as usize / block, photo.height as usize / block);
    let codes = (0..width * height).map(|i| {
        let (x, y) = (i % width * block, i / width * block);
        let rows = (y..y + block)
            .flat_map(|row| photo.linear[row * photo.width as usize + x..][..block].iter());
        let sum: f32 = rows.map(|pixel| luminance((*pixel).into())).sum();
        255.0 * encode(f64::from(sum) / (block * block) as f64) as f32
    });
    let grey = Grey {
        width,
        height,
        codes: codes.collect(),
    };
    let scale = block as f64;
    let known = known.map(|known| KnownFocal {
        focal_px: known.focal_px / scale,
        ..known
    });
    let mut lines = read_lines(&grey, known)?;
    lines.focal_px *= scale;
    for (segment, _) in &mut lines.segments {
        segment.from *= scale;
        segment.to *= scale;
    }
    if let Basis::Squares { off_px, .. } = &mut lines.basis {
        *off_px *= scale;
    }
    Some(lines)
}

fn read_depth(path: &Path, request: &Request) -> Result<DepthMap, Refusal> {
    DepthMap::read(path, request.depth_unit)
        .map_err(|problem| format!("{}: {problem}", path.display()).into())
}

/// What the user or the camera says.
fn known_focal_length(
    photo: &Photo,
    request: &Request,
) -> Result<Option<(Claim<f64>, KnownFocal)>, Refusal> {
    if let Some(fov) = request.fov_deg {
        let focal_px = of_field_of_view(fov, photo.width);
        let claim = Claim::new(
            focal_px,
            format!("{fov} degrees across the width, as given"),
        );
        let sigma = GIVEN_SIGMA;
        return Ok(Some((claim, KnownFocal { focal_px, sigma })));
    }
    let noted = noted_focal_length(&request.photo, (photo.width, photo.height))
        .map_err(|problem| format!("{}: {problem}", request.photo.display()))?;
    Ok(noted.map(|claim| {
        let known = KnownFocal {
            focal_px: claim.value,
            sigma: NOTED_SIGMA,
        };
        (claim, known)
    }))
}

fn of_field_of_view(degrees: f64, side: u32) -> f64 {
    0.5 * f64::from(side) / (0.5 * degrees.to_radians()).tan()
}

fn focal_length(
    photo: &Photo,
    known: Option<(Claim<f64>, KnownFocal)>,
    lines: Option<&Lines>,
) -> Claim<f64> {
    match (known, lines) {
        (Some((claim, _)), _) => claim,
        (None, Some(lines)) => {
            let seen = match lines.basis {
                Basis::Lines { rms } => format!(
                    "from straight lines at right angles (drawn in lines.png, {rms:.2} standard deviations rms off)"
                ),
                Basis::Squares { corners, off_px } => format!(
                    "from {corners} corners of equal squares in one plane (drawn in lines.png, {off_px:.2} pixels off)"
                ),
            };
            let basis = format!(
                "{seen}: {:.0} pixels +- {:.1}%",
                lines.focal_px,
                100.0 * lines.focal_sigma
            );
            Claim::new(lines.focal_px, basis)
        }
        (None, None) => {
            let basis = format!(
                "guessed, {GUESSED_FOV_DEG} degrees across the longer side, as of phones: may be off by a third; give --fov"
            );
            let side = photo.width.max(photo.height);
            Claim::new(of_field_of_view(GUESSED_FOV_DEG, side), basis)
        }
    }
}

fn direction_up(
    size: (u32, u32),
    focal_px: f64,
    plane: Option<Plane>,
    lines: Option<&Lines>,
    request: &Request,
) -> Claim<DVec3> {
    if let Some([left, right]) = request.horizon {
        let up = up_of_horizon(size, focal_px, left, right);
        return Claim::new(up, "from the horizon as given");
    }
    if let Some(plane) = plane {
        let basis = format!(
            "from the plane in the depth map, taken for level, in which {:.0}% of its points lie within {:.1} mm rms: +- 1 degree if it is",
            100.0 * plane.support,
            1000.0 * plane.rms_m
        );
        return Claim::new(plane.normal, basis);
    }
    if let Some(lines) = lines {
        let seen = match lines.basis {
            Basis::Lines { .. } => "straight lines",
            Basis::Squares { .. } => "squares",
        };
        let basis = format!(
            "from {seen} (drawn in lines.png): +- {:.1} degrees, if what they are taken for is level; else give --horizon",
            lines.up_sigma_deg
        );
        return Claim::new(lines.up, basis);
    }
    let basis = format!(
        "guessed, {GUESSED_PITCH_DEG} degrees down and not rolled: may be off by 15 degrees; give --horizon"
    );
    Claim::new(up_of_pitch(GUESSED_PITCH_DEG), basis)
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
