//! Camera poses of a video, from files of several programs.
//!
//! Read by content: a scene-like TOML file or JSON of this program, `transforms.json` of nerfstudio, COLMAP's models, KITTI's poses, TUM trajectories. Poses
//! become world-from-camera in metres, the camera looking along its -Z with +Y up, whatever the file's own axes.

mod camera_file;
mod colmap;
mod colmap_binary;
mod frame_name;
mod intrinsics;
mod json;
mod json_intrinsics;
mod json_values;
mod kalibr;
mod kitti;
mod models;
mod opencv;
mod path;
mod resolve;
#[cfg(test)]
mod tests;
mod toml;
mod tum;

pub use camera_file::{CameraFile, PixelOrigin, read_camera};
pub use frame_name::{FrameName, Naming};
pub(crate) use intrinsics::half_view;
pub use intrinsics::{Focal, Intrinsics};
pub use opencv::read_intrinsics;
pub use path::CameraPath;
pub use resolve::{FrameView, Views};

use std::path::{Path, PathBuf};

use glam::{DMat3, DMat4, DQuat, DVec3};

use super::SceneError;
use super::pose::rigid;
use crate::decode::{MAX_POSES_BYTES, read_file, text_of};

/// Why a trajectory was refused. Displays as one line: "problem; expected ...; how to mend", with the file before it.
#[derive(Debug, thiserror::Error)]
pub enum TrajectoryError {
    /// In TOML: file, line and column.
    #[error(transparent)]
    Toml(#[from] SceneError),
    #[error("{}:{line}: {message}", path.display())]
    Line {
        path: PathBuf,
        /// From 1.
        line: usize,
        message: String,
    },
    #[error("{}: {message}", path.display())]
    File { path: PathBuf, message: String },
}

/// What [`Trajectory::read`] tells apart, as the help of a command says it.
pub const FORMATS: &str = ".toml or .json of this program, transforms.json of nerfstudio, COLMAP's model (folder, or its images file), KITTI's poses, or a TUM trajectory";

pub(super) type Result<T> = std::result::Result<T, TrajectoryError>;

/// How an entry says which picture it belongs to.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum EntryKey {
    /// The number at the end of the picture's name; its place from 0 in a stream.
    Number(u32),
    /// File name, with the folders that the file gives, `/` between them.
    Name(String),
    /// Its place from 0 among the poses; that of the picture too, unless both have time stamps.
    Order(u32),
}

/// One pose of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    pub key: EntryKey,
    /// "line 7" or "frames[3]": for messages.
    pub place: String,
    /// `None`: from the frame number and the frame rate.
    pub time_secs: Option<f64>,
    /// `None`: given as null. The frame passes through unchanged.
    pub world_from_camera: Option<DMat4>,
    pub intrinsics: Option<Intrinsics>,
    /// Along the view axis, if the file pulls the focus.
    pub focus_distance_m: Option<f64>,
}

/// A point of the world and where it was seen, for checking poses.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownPoint {
    pub key: EntryKey,
    /// "line 7": for messages.
    pub place: String,
    pub world: DVec3,
    /// Photograph pixels, corner origin; `None`: only the program's own projection is checked.
    pub seen: Option<[f64; 2]>,
}

/// Poses as a file gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    pub path: PathBuf,
    /// Files that were read.
    pub files: Vec<PathBuf>,
    pub frames_per_second: Option<f64>,
    /// Of all entries that bring none of their own.
    pub intrinsics: Option<Intrinsics>,
    pub entries: Vec<Entry>,
    /// COLMAP's own observations.
    pub known_points: Vec<KnownPoint>,
}

impl Trajectory {
    /// Reads a file, or a COLMAP folder with cameras and images, as text or binary; of a folder of such models the largest.
    ///
    /// # Errors
    /// What cannot be used, in one line: a NaN, a pose that is not rigid, an entry without its pose, two entries for one picture.
    pub fn read(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return models::read(path).and_then(Self::checked);
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        if path.file_name().is_some_and(|name| name == "images.bin") {
            return colmap_binary::read(folder, path).and_then(Self::checked);
        }
        let text = read_text(path)?;
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let name = path.file_name().unwrap_or_default();
        if name == "images.txt" {
            colmap::read(folder, path)
        } else if extension.is_some_and(|e| e == "toml") {
            toml::read(path, text)
        } else if text.trim_start().starts_with('{') {
            json::read(path, &text)
        } else if kitti::is_kitti(&text) {
            kitti::read(path, &text)
        } else if text.contains("p_RS_R_x") {
            Err(file_error(
                path,
                "it is EuRoC's ground truth, which has the poses of the body and not of a camera; expected poses of the camera; put the camera's T_BS after each and save them as a TUM trajectory",
            ))
        } else {
            tum::read(path, &text)
        }
        .and_then(Self::checked)
    }

    /// Multiplies all lengths: poses of pictures alone know no metres.
    pub(crate) fn scale(&mut self, factor: f64) {
        for pose in (self.entries.iter_mut()).filter_map(|entry| entry.world_from_camera.as_mut()) {
            let position = pose.w_axis.truncate() * factor;
            pose.w_axis = position.extend(1.0);
        }
        for point in &mut self.known_points {
            point.world *= factor;
        }
    }

    fn checked(self) -> Result<Self> {
        if self.entries.is_empty() {
            return Err(file_error(
                &self.path,
                "it holds no pose; expected one for each frame; add them",
            ));
        }
        if self
            .entries
            .iter()
            .all(|entry| entry.world_from_camera.is_none())
        {
            return Err(file_error(
                &self.path,
                "every pose is null; expected at least one; track the camera, or copy the frames",
            ));
        }
        Ok(self)
    }
}

/// A file's name in a trajectory: its folders as far as they are told, without `.`.
fn name_of(path: &str) -> EntryKey {
    let path = path.replace('\\', "/");
    let parts = path
        .split('/')
        .filter(|part| !part.is_empty() && *part != ".");
    EntryKey::Name(parts.collect::<Vec<_>>().join("/"))
}

fn read_text(path: &Path) -> Result<String> {
    let bytes = read_file(path, MAX_POSES_BYTES).map_err(|reason| {
        file_error(
            path,
            format!("it cannot be read ({reason}); expected a file of poses; correct the path"),
        )
    })?;
    text_of(bytes).ok_or_else(|| {
        file_error(
            path,
            "it is no UTF-8 text; expected TOML, JSON, COLMAP or TUM text; export it as text",
        )
    })
}

fn file_error(path: &Path, message: impl Into<String>) -> TrajectoryError {
    TrajectoryError::File {
        path: path.into(),
        message: message.into(),
    }
}

fn line_error(path: &Path, line: usize, message: impl Into<String>) -> TrajectoryError {
    TrajectoryError::Line {
        path: path.into(),
        line,
        message: message.into(),
    }
}

/// A finite number of at most 1e15, or why not.
fn finite(x: f64, what: &str) -> std::result::Result<f64, String> {
    if x.abs() <= super::reader::MAX_MAGNITUDE {
        return Ok(x);
    }
    let expected = match x.is_finite() {
        true => format!("a number of at most {:e}", super::reader::MAX_MAGNITUDE),
        false => "a finite number".to_owned(),
    };
    Err(format!(
        "{what} is {x}; expected {expected}; correct it, or give the pose as null so that its frame passes through"
    ))
}

/// The numbers of a line of text, NaN and the like refused.
fn numbers<const N: usize>(words: &[&str], what: &str) -> std::result::Result<[f64; N], String> {
    let mut values = [0.0; N];
    if words.len() < N {
        return Err(format!(
            "{} numbers where {what} need {N}; expected {N}; complete the line",
            words.len()
        ));
    }
    for (value, word) in values.iter_mut().zip(words) {
        let parsed = word
            .parse::<f64>()
            .map_err(|_| format!("\"{word}\" is no number; expected {what}; correct the line"))?;
        *value = finite(parsed, what)?;
    }
    Ok(values)
}

/// World-from-camera of rows, made exactly rigid.
///
/// # Errors
/// Why they are no rotation and translation.
pub(crate) fn pose_of_rows(rows: [[f64; 4]; 4]) -> std::result::Result<DMat4, String> {
    for x in rows.as_flattened() {
        finite(*x, "an element of the pose")?;
    }
    rigid(&rows).map_err(|problem| {
        format!(
            "the pose is not rigid: {problem}; expected a rotation and a translation, as 4 rows, the camera looking along its -Z; correct the matrix"
        )
    })
}

/// World-from-camera of OpenCV axes (y down, looking along +Z) turned to ours.
fn from_opencv_axes(world_from_camera: DMat4) -> DMat4 {
    world_from_camera * DMat4::from_scale(DVec3::new(1.0, -1.0, -1.0))
}

/// A unit quaternion x, y, z, w of nearly unit length, and a position.
fn pose_of_quaternion(quaternion: DQuat, position: DVec3) -> std::result::Result<DMat4, String> {
    let length = quaternion.length();
    if (length - 1.0).abs() > 1e-2 {
        return Err(format!(
            "the quaternion has length {length:.6}; expected a unit quaternion; divide it by its length"
        ));
    }
    Ok(DMat4::from_mat3_translation(
        DMat3::from_quat(quaternion.normalize()),
        position,
    ))
}
