//! COLMAP's text model: `cameras.txt`, `images.txt`, and `points3D.txt` where it is there.
//!
//! Images hold camera-from-world in OpenCV's axes; its pixel coordinates have their origin at the corner, as ours do.
//!
//! By hand: lines of words, where an error has to name the line and what was expected on it.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::intrinsics::{COEFFICIENTS, Fields, LensModel, Names};
use super::{
    Entry, EntryKey, Intrinsics, KnownPoint, Result, Trajectory, from_opencv_axes, line_error,
    name_of, numbers, pose_of_quaternion, read_text,
};

pub(super) fn read(folder: &Path, images: &Path) -> Result<Trajectory> {
    let cameras_path = folder.join("cameras.txt");
    let cameras = read_cameras(&cameras_path)?;
    let points_path = folder.join("points3D.txt");
    let points = match points_path.is_file() {
        true => read_points(&points_path)?,
        false => HashMap::new(),
    };
    let text = read_text(images)?;
    let mut entries = Vec::new();
    let mut known_points = Vec::new();
    // Each image has two lines, of which the second, its observations, may be empty.
    let mut lines = (text.lines().enumerate()).filter(|(_, line)| !line.starts_with('#'));
    while let Some((index, line)) = lines.next() {
        if line.trim().is_empty() {
            continue;
        }
        let at_line = |problem| line_error(images, index + 1, problem);
        let entry = read_image(line, index + 1, &cameras).map_err(at_line)?;
        if let Some((index, seen)) = lines.next() {
            let found = read_observations(seen, index + 1, &entry.key, &points)
                .map_err(|problem| line_error(images, index + 1, problem))?;
            known_points.extend(found);
        }
        entries.push(entry);
    }
    let mut files = vec![images.to_owned(), cameras_path];
    files.extend(points_path.is_file().then_some(points_path));
    Ok(whole_model(images, files, &cameras, entries, known_points))
}

/// The trajectory of a model, text or binary.
pub(super) fn whole_model(
    images: &Path,
    files: Vec<PathBuf>,
    cameras: &HashMap<u32, Intrinsics>,
    entries: Vec<Entry>,
    known_points: Vec<KnownPoint>,
) -> Trajectory {
    let one_camera = (cameras.len() == 1).then(|| cameras.values().copied().next());
    Trajectory {
        path: images.into(),
        files,
        frames_per_second: None,
        intrinsics: one_camera.flatten(),
        entries,
        known_points,
    }
}

fn read_cameras(path: &Path) -> Result<HashMap<u32, Intrinsics>> {
    let mut cameras = HashMap::new();
    for (index, line) in read_text(path)?.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let (id, camera) =
            read_camera(&words).map_err(|problem| line_error(path, index + 1, problem))?;
        cameras.insert(id, camera);
    }
    Ok(cameras)
}

fn read_camera(words: &[&str]) -> std::result::Result<(u32, Intrinsics), String> {
    let form = "CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS; correct the line";
    let [id, model, width, height, rest @ ..] = words else {
        return Err(format!("it is too short; expected {form}"));
    };
    let whole = |word: &str| {
        (word.parse::<u32>()).map_err(|_| format!("\"{word}\" is no whole number; expected {form}"))
    };
    let size = (whole(width)?, whole(height)?);
    Ok((whole(id)?, intrinsics_of(model, size, rest)?))
}

/// How many parameters each model has, and what stands where: f, fx and fy, cx, cy, and the coefficients by name.
const MODELS: [(&str, &[&str]); 9] = [
    ("SIMPLE_PINHOLE", &["f", "cx", "cy"]),
    ("PINHOLE", &["fx", "fy", "cx", "cy"]),
    ("SIMPLE_RADIAL", &["f", "cx", "cy", "k1"]),
    ("RADIAL", &["f", "cx", "cy", "k1", "k2"]),
    ("OPENCV", &["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]),
    (
        "OPENCV_FISHEYE",
        &["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"],
    ),
    (
        "FULL_OPENCV",
        &[
            "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
        ],
    ),
    ("SIMPLE_RADIAL_FISHEYE", &["f", "cx", "cy", "k1"]),
    ("RADIAL_FISHEYE", &["f", "cx", "cy", "k1", "k2"]),
];

/// The names of a model's parameters in order.
pub(super) fn parameters_of(model: &str) -> std::result::Result<&'static [&'static str], String> {
    let found = MODELS.iter().find(|(name, _)| *name == model);
    found.map(|(_, names)| *names).ok_or_else(|| {
        format!(
            "the camera model {model} is not known; expected {}; undistort the images with COLMAP's image_undistorter",
            MODELS.map(|(name, _)| name).join(", ")
        )
    })
}

fn intrinsics_of(
    model: &str,
    size: (u32, u32),
    words: &[&str],
) -> std::result::Result<Intrinsics, String> {
    let names = parameters_of(model)?;
    let values = words.iter().map(|word| {
        let [value] = numbers::<1>(&[word], "the camera's parameters")?;
        Ok(value)
    });
    let values = values.collect::<std::result::Result<Vec<f64>, String>>()?;
    if values.len() < names.len() {
        return Err(format!(
            "{} parameters where {model} has {}; expected {}; complete the line",
            values.len(),
            names.len(),
            names.join(" ")
        ));
    }
    intrinsics(model, size, names, &values)
}

/// Of parameters by their names.
pub(super) fn intrinsics(
    model: &str,
    (width, height): (u32, u32),
    names: &[&str],
    values: &[f64],
) -> std::result::Result<Intrinsics, String> {
    let value = |name: &str| {
        let at = names.iter().position(|own| *own == name)?;
        values.get(at).copied()
    };
    let fields = Fields {
        width: Some(width),
        height: Some(height),
        fx: value("fx").or(value("f")),
        fy: value("fy"),
        cx: value("cx"),
        cy: value("cy"),
        coefficients: COEFFICIENTS.map(value),
        model: Some(LensModel::named(model)?),
        ..Fields::default()
    };
    let names = Names {
        fx: "fx",
        fov_x: "fx",
    };
    fields.intrinsics(&names).map_err(|why| why.to_string())
}

fn read_image(
    line: &str,
    number: usize,
    cameras: &HashMap<u32, Intrinsics>,
) -> std::result::Result<Entry, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let form = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
    if words.len() < 10 {
        return Err(format!(
            "it has {} words; expected {form}; complete the line",
            words.len()
        ));
    }
    let [qw, qx, qy, qz, x, y, z] = numbers::<7>(&words[1..8], form)?;
    let camera_from_world =
        pose_of_quaternion(DQuat::from_xyzw(qx, qy, qz, qw), DVec3::new(x, y, z))?;
    let intrinsics = words[8]
        .parse::<u32>()
        .ok()
        .and_then(|camera| cameras.get(&camera))
        .ok_or_else(|| {
            format!(
                "camera {} is not in cameras.txt; expected one of its cameras; export both again",
                words[8]
            )
        })?;
    Ok(Entry {
        key: name_of(&words[9..].join(" ")),
        place: format!("line {number}"),
        time_secs: None,
        world_from_camera: Some(from_opencv_axes(camera_from_world.inverse())),
        intrinsics: Some(*intrinsics),
        focus_distance_m: None,
    })
}

/// Triples X Y POINT3D_ID; -1 is a feature without a point.
fn read_observations(
    line: &str,
    number: usize,
    key: &EntryKey,
    points: &HashMap<i64, DVec3>,
) -> std::result::Result<Vec<KnownPoint>, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let mut known = Vec::new();
    for triple in words.chunks(3) {
        let [x, y, id] = triple else {
            return Err(
                "its observations are no triples; expected X Y POINT3D_ID; export the model again"
                    .to_owned(),
            );
        };
        let pixel = numbers::<2>(&[x, y], "X Y POINT3D_ID")?;
        if let Some(world) = id.parse::<i64>().ok().and_then(|id| points.get(&id)) {
            known.push(KnownPoint {
                key: key.clone(),
                place: format!("line {number}"),
                world: *world,
                seen: Some(pixel),
            });
        }
    }
    Ok(known)
}

fn read_points(path: &Path) -> Result<HashMap<i64, DVec3>> {
    let mut points = HashMap::new();
    for (index, line) in read_text(path)?.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let form = "POINT3D_ID X Y Z";
        let at_line = |problem| line_error(path, index + 1, problem);
        let [id, x, y, z] = numbers::<4>(&words, form).map_err(at_line)?;
        points.insert(id as i64, DVec3::new(x, y, z));
    }
    Ok(points)
}
