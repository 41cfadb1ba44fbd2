//! What phone scans bring: photographs with cameras, depth maps and a mesh, in metres.
//!
//! Read are `transforms.json` as nerfstudio's converters write it, and the folder of Polycam's raw export. Both become a world with Y up.

mod polycam;
mod transforms;

use std::path::{Path, PathBuf};

use glam::DMat4;
use serde_json::{Value, json};

use super::camera::coefficients;
use crate::refusal::Refusal;
use crate::scene::trajectory::{Focal, Intrinsics};

/// A scan's frames, and what stands before them.
#[derive(Clone, Debug)]
pub struct Scan {
    pub frames: Vec<ScanFrame>,
    /// A .glb file and world-from-mesh.
    pub mesh: Option<(PathBuf, DMat4)>,
    /// Brings the axes of the files to Y up.
    pub world_from_scan: DMat4,
    /// Where it comes from, and how far it can be trusted.
    pub basis: String,
}

/// One photograph of a scan.
#[derive(Clone, Debug)]
pub struct ScanFrame {
    pub photo: PathBuf,
    pub world_from_camera: DMat4,
    pub intrinsics: Intrinsics,
    /// Millimetres, of any resolution.
    pub depth: Option<PathBuf>,
}

impl Scan {
    /// Whether `path` is a scan, and no photograph.
    pub fn is_one(path: &Path) -> bool {
        path.is_dir()
            || path
                .extension()
                .is_some_and(|e| e.eq_ignore_ascii_case("json"))
    }

    /// Reads a `transforms.json`, its folder, or the folder of a raw export.
    ///
    /// # Errors
    /// It is neither, or something that it names is missing; one line with the path.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        if path.join("keyframes").is_dir() {
            return polycam::read(path);
        }
        let file = match path.is_dir() {
            true => path.join("transforms.json"),
            false => path.to_owned(),
        };
        if !file.is_file() {
            return Err(format!(
                "{}: it is no scan; expected transforms.json, or a folder with transforms.json or keyframes; correct the path",
                path.display()
            )
            .into());
        }
        transforms::read(&file)
    }

    /// A frame: by its photograph's name, with or without the extension, or by its place from 0; without a name the first.
    ///
    /// # Errors
    /// No frame is called so.
    pub fn frame(&self, name: Option<&str>) -> Result<&ScanFrame, Refusal> {
        let name = name.unwrap_or("0");
        let called = |frame: &ScanFrame| {
            let is = |part: Option<&std::ffi::OsStr>| part.is_some_and(|part| part == name);
            is(frame.photo.file_name()) || is(frame.photo.file_stem())
        };
        let by_place = || self.frames.get(name.parse::<usize>().ok()?);
        let by_name = self.frames.iter().find(|frame| called(frame));
        by_name.or_else(by_place).ok_or_else(|| {
            format!(
                "--frame {name}: the scan has {} frames, none of that name; expected a photograph's name, or a number from 0; correct it",
                self.frames.len()
            )
            .into()
        })
    }

    /// Poses for `mixray sequence`.
    pub fn trajectory(&self) -> String {
        let frames: Vec<Value> = (self.frames.iter())
            .map(|frame| {
                let pose = frame.world_from_camera;
                let rows: Vec<[f64; 4]> = (0..4).map(|row| pose.row(row).to_array()).collect();
                json!({
                    "file": frame.photo.file_name().map(|name| name.to_string_lossy()),
                    "world_from_camera": rows,
                    "camera": camera(&frame.intrinsics),
                })
            })
            .collect();
        json!({ "frames": frames }).to_string()
    }
}

fn camera(intrinsics: &Intrinsics) -> Value {
    let mut camera = match intrinsics.focal {
        Focal::Pixels([fx, fy]) => json!({ "fx": fx, "fy": fy }),
        Focal::FieldOfView(angle) => json!({ "camera_angle_x": angle }),
    };
    if let Some([cx, cy]) = intrinsics.centre {
        camera["cx"] = json!(cx);
        camera["cy"] = json!(cy);
    }
    let lens = &intrinsics.distortion;
    camera["distortion"] = json!(coefficients(lens));
    if lens.model == crate::distortion::LENS_FISHEYE {
        camera["lens_model"] = json!("fisheye");
    }
    camera
}

/// The first of these that is a file.
fn existing<const N: usize>(paths: [PathBuf; N]) -> Option<PathBuf> {
    paths.into_iter().find(|path| path.is_file())
}

#[cfg(test)]
mod tests;
