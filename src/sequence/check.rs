//! Poses against points that were seen.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use bytemuck::Zeroable;
use glam::DVec3;
use serde::Serialize;

use super::plan::{Files, known_rate, views};
use super::table::{frame_key, read_table};
use super::{Event, SequenceError, SequenceOptions};
use crate::camera::lens::camera_project;
use crate::pack::camera::frame_camera;
use crate::packed::Frame;
use crate::scene::projection::project;
use crate::scene::trajectory::{Focal, FrameName, KnownPoint};
use crate::scene::{Camera, Lens};
use crate::video::FrameSource;

/// Largest number in a table of points, metres or pixels: beyond, nothing can be told from the other side of the picture.
const LARGEST: f64 = 1e12;
/// No lens shows what is seen so far from the picture's corner.
const FARTHEST_PX: f64 = 1e9;
/// Frames with the largest errors that are named.
const NAMED: usize = 5;

/// Of one frame.
#[derive(Default)]
struct Errors {
    /// Pixels, seen against projected.
    seen: Vec<f64>,
    /// Pixels, the renderer's projection against that of the pose in full precision.
    own: f64,
}

/// How far projected points are from where they were seen. Errors in pixels; `None`: no point was seen.
#[derive(Clone, Debug, Serialize)]
pub struct Reprojection {
    pub points: u64,
    /// Points in frames without a pose, and points not in front of the camera.
    pub without_pose: u64,
    pub behind: u64,
    pub rms_px: Option<f64>,
    pub median_px: Option<f64>,
    pub largest_px: Option<f64>,
    /// The renderer's own projection against that of the poses in full precision, at most.
    pub own_px: f64,
    /// The largest errors first.
    pub frames: Vec<FrameReprojection>,
    /// Frames with points, seen or not.
    pub frames_with_points: usize,
}

/// Of the points that were seen in one frame.
#[derive(Clone, Debug, Serialize)]
pub struct FrameReprojection {
    pub frame: String,
    pub points: usize,
    pub rms_px: f64,
}

/// Projects points through the poses and renders nothing; `points` are those of a table
/// (`frame,x_px,y_px,x_m,y_m,z_m`), or else the trajectory's own.
///
/// # Errors
/// Something cannot be read, or no points are there.
pub fn check_poses(
    options: &SequenceOptions,
    points: Option<&Path>,
    hear: &dyn Fn(&Event<'_>),
) -> Result<Reprojection, SequenceError> {
    let files = Files::read(options, hear)?;
    let points = match points {
        Some(path) => read_points(path)?,
        None => files.trajectory.known_points.clone(),
    };
    if points.is_empty() {
        return Err(SequenceError::Unfit(format!(
            "{}: it holds no points that were seen; expected COLMAP's points3D.txt beside images.txt, or a table of points; give --check POINTS.csv",
            files.trajectory.path.display()
        )));
    }
    let source = options
        .frames
        .as_deref()
        .map(FrameSource::open)
        .transpose()?;
    let is_stream = source.as_ref().is_some_and(FrameSource::is_stream);
    let rate = known_rate(options, &files.trajectory, source.as_ref());
    let views = views(options, &files.trajectory, rate, is_stream)?;
    let mut errors: BTreeMap<String, Errors> = BTreeMap::new();
    let (mut used, mut without_pose, mut behind) = (0u64, 0u64, 0u64);
    let mut own_camera: Option<(Camera, Lens)> = None;
    for point in &points {
        let name = FrameName::of_key(&point.key);
        let view = views.of(&name)?;
        let Some(pose) = view.world_from_camera else {
            without_pose += 1;
            continue;
        };
        let (camera, lens) = match (files.intrinsics_of(&view), &own_camera) {
            (Some(intrinsics), _) => {
                let size = intrinsics
                    .size
                    .or_else(|| source.as_ref()?.header().map(|h| (h.width, h.height)));
                if size.is_none() && matches!(intrinsics.focal, Focal::FieldOfView(_)) {
                    return Err(SequenceError::Unfit(format!(
                        "{}: its field of view is of pictures whose size is not told; expected a width and a height beside it; add them",
                        files.trajectory.path.display()
                    )));
                }
                let size = size.unwrap_or((32768, 32768));
                (intrinsics.camera_of_any_size(size, pose), None)
            }
            (None, Some((camera, lens))) => (camera.clone(), Some(*lens)),
            (None, None) => {
                let scene = files.scene(options, &view, None, hear)?;
                own_camera = Some((scene.camera.clone(), scene.lens));
                (scene.camera, Some(scene.lens))
            }
        };
        let camera = Camera {
            world_from_camera: pose,
            ..camera
        };
        let in_reach = |seen: &DVec3| seen.truncate().abs().max_element() <= FARTHEST_PX;
        let Some(projected) = project(&camera, point.world).filter(in_reach) else {
            behind += 1;
            continue;
        };
        used += 1;
        let entry = errors.entry(name.label.clone()).or_default();
        let pixel = projected.truncate();
        if let Some([x, y]) = point.seen {
            entry.seen.push(pixel.distance(glam::DVec2::new(x, y)));
        }
        entry.own = entry.own.max(own_error(&camera, lens, point.world, pixel));
    }
    Ok(Reprojection::of(&errors, used, without_pose, behind))
}

/// Distance between where the renderer's own arithmetic sees a point and where the pose puts it, pixels.
fn own_error(camera: &Camera, lens: Option<Lens>, world: DVec3, pixel: glam::DVec2) -> f64 {
    let anchor = camera.world_from_camera.w_axis.truncate();
    let lens = lens.unwrap_or(Lens::PINHOLE);
    let mut frame = Frame::zeroed();
    frame_camera(camera, &lens, anchor, &mut frame);
    let seen = camera_project(&frame, (world - anchor).as_vec3());
    pixel.distance(glam::DVec2::new(seen.px.into(), seen.py.into()))
}

impl Reprojection {
    fn of(errors: &BTreeMap<String, Errors>, points: u64, without_pose: u64, behind: u64) -> Self {
        let mut all: Vec<f64> = (errors.values())
            .flat_map(|e| e.seen.iter().copied())
            .collect();
        all.sort_by(f64::total_cmp);
        let mut frames: Vec<FrameReprojection> = (errors.iter())
            .filter_map(|(name, e)| {
                Some(FrameReprojection {
                    frame: name.clone(),
                    points: e.seen.len(),
                    rms_px: root_mean_square(&e.seen)?,
                })
            })
            .collect();
        frames.sort_by(|a, b| b.rms_px.total_cmp(&a.rms_px));
        Self {
            points,
            without_pose,
            behind,
            rms_px: root_mean_square(&all),
            median_px: all.get(all.len() / 2).copied(),
            largest_px: all.last().copied(),
            own_px: errors.values().map(|e| e.own).fold(0.0, f64::max),
            frames,
            frames_with_points: errors.len(),
        }
    }

    /// A few lines for the user.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{} points in {} frames; {} in frames without a pose, {} not in front of the camera\n",
            self.points, self.frames_with_points, self.without_pose, self.behind
        );
        let told = (self.rms_px.zip(self.median_px)).zip(self.largest_px);
        if let Some(((rms, median), largest)) = told {
            let _ = writeln!(
                text,
                "reprojection error in pixels: rms {rms:.3}, median {median:.3}, largest {largest:.3}"
            );
        }
        let _ = writeln!(
            text,
            "the renderer's own projection is off by at most {:.5} px",
            self.own_px
        );
        for frame in self.frames.iter().take(NAMED) {
            let _ = writeln!(text, "{}: rms {:.3} px", frame.frame, frame.rms_px);
        }
        text
    }
}

fn root_mean_square(values: &[f64]) -> Option<f64> {
    let sum: f64 = values.iter().map(|x| x * x).sum();
    (!values.is_empty()).then(|| (sum / values.len() as f64).sqrt())
}

/// `frame,x_px,y_px,x_m,y_m,z_m` a line; `frame` is a number or a file name, the pixel may be empty.
fn read_points(path: &Path) -> Result<Vec<KnownPoint>, SequenceError> {
    let failure = |line: u64, problem: String| {
        SequenceError::Unfit(format!("{}:{line}: {problem}", path.display()))
    };
    let mut points = Vec::new();
    for (line, words) in read_table(path, "points", "frame", &failure)? {
        let [frame, x_px, y_px, x, y, z] = words.as_slice() else {
            return Err(failure(
                line,
                format!(
                    "it has {} columns; expected frame,x_px,y_px,x_m,y_m,z_m; complete the line",
                    words.len()
                ),
            ));
        };
        let number = |word: &str| match word.parse::<f64>() {
            Ok(x) if x.abs() <= LARGEST => Ok(x),
            _ => Err(failure(
                line,
                format!(
                    "{word:?} is no number from -1e12 to 1e12; expected frame,x_px,y_px,x_m,y_m,z_m; correct the line"
                ),
            )),
        };
        if frame.contains(char::is_control) {
            return Err(failure(
                line,
                format!(
                    "{frame:?} names no frame; expected its number or the name of its file; correct the line"
                ),
            ));
        }
        let seen = match (x_px.is_empty(), y_px.is_empty()) {
            (true, true) => None,
            _ => Some([number(x_px)?, number(y_px)?]),
        };
        points.push(KnownPoint {
            key: frame_key(frame),
            place: format!("line {line}"),
            world: DVec3::new(number(x)?, number(y)?, number(z)?),
            seen,
        });
    }
    Ok(points)
}
