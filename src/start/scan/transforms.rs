//! `transforms.json` as nerfstudio's converters write it: Z up, a depth map beside each photograph if there is one.

use std::path::{Path, PathBuf};

use glam::DMat4;
use serde_json::Value;

use super::{Scan, ScanFrame, existing};
use crate::decode::{MAX_POSES_BYTES, read_text};
use crate::refusal::Refusal;
use crate::scene::trajectory::Trajectory;

/// Endings of photographs whose names come without one, as instant-ngp's do.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

pub(super) fn read(file: &Path) -> Result<Scan, Refusal> {
    let trajectory = Trajectory::read(file).map_err(|error| error.to_string())?;
    let refuse = |message: String| Refusal::from(format!("{}: {message}", file.display()));
    let text = read_text(file, MAX_POSES_BYTES).map_err(refuse)?;
    let document: Value = serde_json::from_str(&text).map_err(|e| refuse(e.to_string()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let listed = document["frames"].as_array().map_or(&[][..], Vec::as_slice);
    // Of this program's own files, Y is up already.
    let is_own = listed
        .iter()
        .any(|frame| frame.get("world_from_camera").is_some());
    let upright = match is_own {
        true => DMat4::IDENTITY,
        false => DMat4::from_rotation_x(-std::f64::consts::FRAC_PI_2),
    };
    let mut frames = Vec::new();
    for (entry, frame) in trajectory.entries.iter().zip(listed) {
        let Some(pose) = entry.world_from_camera else {
            continue;
        };
        let Some(intrinsics) = entry.intrinsics.or(trajectory.intrinsics) else {
            return Err(refuse(format!(
                "{} has no focal length; expected `fl_x`, or `camera_angle_x`; add it at the top",
                entry.place
            )));
        };
        let name = ["file_path", "file"]
            .iter()
            .find_map(|key| frame[*key].as_str());
        let photo = name.and_then(|name| photo_of(folder, name)).ok_or_else(|| {
            refuse(format!(
                "{}: its photograph {} is not there; expected a file beside transforms.json; correct `file_path`",
                entry.place,
                name.unwrap_or("without a name")
            ))
        })?;
        let depth = frame["depth_file_path"]
            .as_str()
            .map(|name| folder.join(name));
        frames.push(ScanFrame {
            photo,
            world_from_camera: upright * pose,
            intrinsics,
            depth: depth.filter(|path| path.is_file()),
        });
    }
    Ok(Scan {
        frames,
        mesh: None,
        world_from_scan: upright,
        basis: match is_own {
            true => format!("from {}", name_of(file)),
            false => format!(
                "from {}, whose Z is taken for up and whose unit for the metre: true of phones' own tracking, a guess after COLMAP",
                name_of(file)
            ),
        },
    })
}

fn name_of(file: &Path) -> String {
    file.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

fn photo_of(folder: &Path, name: &str) -> Option<PathBuf> {
    let path = folder.join(name);
    let with = |ending: &str| folder.join(format!("{name}.{ending}"));
    existing([path, with(ENDINGS[0]), with(ENDINGS[1]), with(ENDINGS[2])])
}
