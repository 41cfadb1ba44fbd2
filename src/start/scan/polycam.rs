//! The folder of Polycam's raw export, by its documented layout: ARKit's cameras with Y up, depth in millimetres, and a mesh.

use std::path::{Path, PathBuf};

use glam::DMat4;
use serde_json::Value;

use super::{Scan, ScanFrame, existing};
use crate::decode::{MAX_TEXT_BYTES, read_text};
use crate::distortion::Distortion;
use crate::refusal::Refusal;
use crate::scene::trajectory::{Focal, Intrinsics, pose_of_rows};

pub(super) fn read(folder: &Path) -> Result<Scan, Refusal> {
    let keyframes = folder.join("keyframes");
    // Those that were undistorted and optimised are better, where there are any.
    let is_corrected =
        keyframes.join("corrected_cameras").is_dir() && keyframes.join("corrected_images").is_dir();
    let (cameras, images) = match is_corrected {
        true => ("corrected_cameras", "corrected_images"),
        false => ("cameras", "images"),
    };
    let mut files = camera_files(&keyframes.join(cameras))?;
    files.sort();
    let mut frames = Vec::with_capacity(files.len());
    for file in &files {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let image = |ending: &str| keyframes.join(images).join(format!("{stem}.{ending}"));
        let photo = existing([image("jpg"), image("png")]).ok_or_else(|| {
            Refusal::from(format!(
                "{}: its photograph is not in {images}; expected {stem}.jpg; export the scan again",
                file.display()
            ))
        })?;
        let (world_from_camera, intrinsics) = camera(file)?;
        let depth = keyframes.join("depth").join(format!("{stem}.png"));
        frames.push(ScanFrame {
            photo,
            world_from_camera,
            intrinsics,
            depth: depth.is_file().then_some(depth),
        });
    }
    if frames.is_empty() {
        return Err(format!(
            "{}: it holds no camera; expected one .json for each photograph; export the scan's raw data again",
            keyframes.join(cameras).display()
        )
        .into());
    }
    Ok(Scan {
        frames,
        mesh: mesh(folder)?,
        world_from_scan: DMat4::IDENTITY,
        basis: match is_corrected {
            true => "from the scan: its cameras after optimisation, in metres".to_owned(),
            false => "from the scan: the phone's own tracking, in metres, lens distortion left in"
                .to_owned(),
        },
    })
}

fn camera_files(folder: &Path) -> Result<Vec<PathBuf>, Refusal> {
    let unreadable = |error: std::io::Error| {
        Refusal::from(format!(
            "{}: it cannot be read ({error}); expected a camera for each photograph; export the scan's raw data again",
            folder.display()
        ))
    };
    let mut files = Vec::new();
    for entry in folder.read_dir().map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if path.extension().is_some_and(|ending| ending == "json") {
            files.push(path);
        }
    }
    Ok(files)
}

fn document(file: &Path) -> Result<Value, Refusal> {
    let text = read_text(file, MAX_TEXT_BYTES).and_then(|text| {
        serde_json::from_str(&text).map_err(|error| format!("it is no valid JSON ({error})"))
    });
    text.map_err(|problem| {
        format!(
            "{}: {problem}; expected a file of the scan's raw data; export it again",
            file.display()
        )
        .into()
    })
}

fn camera(file: &Path) -> Result<(DMat4, Intrinsics), Refusal> {
    let document = document(file)?;
    let refuse = |problem: &str, expected: &str| {
        Refusal::from(format!(
            "{}: {problem}; expected {expected}; export the scan again",
            file.display()
        ))
    };
    let number = |key: &str| {
        let value = document[key].as_f64().filter(|x| x.is_finite());
        value.ok_or_else(|| refuse(&format!("`{key}` is missing"), "a number"))
    };
    let mut rows = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (i, row) in rows.iter_mut().take(3).enumerate() {
        for (j, element) in row.iter_mut().enumerate() {
            *element = number(&format!("t_{i}{j}"))?;
        }
    }
    let pose = pose_of_rows(rows).map_err(|problem| format!("{}: {problem}", file.display()))?;
    let side = |key: &str| number(key).map(|side| side as u32);
    let intrinsics = Intrinsics {
        size: Some((side("width")?, side("height")?)),
        focal: Focal::Pixels([number("fx")?, number("fy")?]),
        centre: Some([number("cx")?, number("cy")?]),
        distortion: Distortion::NONE,
    };
    Ok((pose, intrinsics))
}

/// The mesh lies in axes of its own; the inverse of `alignmentTransform` brings it back to the cameras.
fn mesh(folder: &Path) -> Result<Option<(PathBuf, DMat4)>, Refusal> {
    let (file, info) = (folder.join("raw.glb"), folder.join("mesh_info.json"));
    if !file.is_file() {
        return Ok(None);
    }
    let aligned = match info.is_file() {
        true => document(&info)?["alignmentTransform"].clone(),
        false => Value::Null,
    };
    if aligned.is_null() {
        return Ok(Some((file, DMat4::IDENTITY)));
    }
    let columns: Vec<f64> = (aligned.as_array().into_iter().flatten())
        .flat_map(|value| match value.as_array() {
            Some(column) => column.clone(),
            None => vec![value.clone()],
        })
        .filter_map(|value| value.as_f64())
        .collect();
    let matrix = <[f64; 16]>::try_from(columns).ok();
    let inverse = matrix
        .map(|columns| DMat4::from_cols_array(&columns).inverse())
        .filter(|inverse| inverse.is_finite());
    match inverse {
        Some(world_from_mesh) => Ok(Some((file, world_from_mesh))),
        None => Err(format!(
            "{}: `alignmentTransform` is no matrix that can be inverted; expected 16 numbers, column after column; export the scan again",
            info.display()
        )
        .into()),
    }
}
