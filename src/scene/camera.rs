//! `[camera]` and `[lens]`.

use crate::decode::{MAX_PIXELS, MAX_SIDE_PX};
use crate::refusal::Refusal;

use super::error::Result;
use super::pose::read_camera_pose;
use super::projection::check_distortion;
use super::reader::{Node, Table};
use super::trajectory::{Intrinsics, PixelOrigin, half_view, read_camera};
use super::{Aperture, Camera, Distortion, EXPECTED_FOCUS, Lens, Photo};
use crate::distortion::LENS_FISHEYE;

const CAMERA_KEYS: &[&str] = &[
    "width",
    "height",
    "fx",
    "fy",
    "vertical_fov_deg",
    "cx",
    "cy",
    "distortion",
    "lens_model",
    "world_from_camera",
    "position",
    "look_at",
    "up",
    "motion",
    "file",
    "pixel_origin",
];

/// What a `file` says in their place.
const INTRINSICS_KEYS: &[&str] = &[
    "width",
    "height",
    "fx",
    "fy",
    "vertical_fov_deg",
    "cx",
    "cy",
    "distortion",
    "lens_model",
];

const LENS_KEYS: &[&str] = &[
    "aperture_radius_m",
    "f_number",
    "focal_length_mm",
    "focus_distance_m",
    "aperture",
    "blade_rotation_deg",
    "motion",
];

/// `[camera]`, its intrinsics those `given` by the caller, if it brings any; then the table may be absent.
pub(super) fn read_camera_table(
    root: &Table,
    photo: Option<&Photo>,
    given: Option<&Intrinsics>,
    warnings: &mut Vec<String>,
) -> Result<Camera> {
    let table = root.table("camera", "[camera]", CAMERA_KEYS)?;
    if let Some(given) = given {
        let size = photo
            .map(|photo| (photo.width, photo.height))
            .or(given.size);
        let pose = table.as_ref().map(read_camera_pose).transpose()?;
        return size
            .ok_or_else(|| Refusal::from("the intrinsics tell no size"))
            .and_then(|size| given.camera(size, pose.unwrap_or_default()))
            .map_err(|problem| {
                root.error(
                    problem,
                    "intrinsics of the frames' size",
                    "calibrate at that size, or scale the frames",
                )
            });
    }
    let Some(table) = table else {
        return Err(root.error(
            "the scene has no [camera]",
            "a table [camera] with `fx` and `fy` or `vertical_fov_deg`",
            "add it",
        ));
    };
    if table.get("file").is_some() {
        return read_camera_file(&table, photo, warnings);
    }
    if let Some(error) = table.key_error(
        "pixel_origin",
        "`pixel_origin` without `file`; expected it beside a `file`, whose cx and cy it explains; remove it",
    ) {
        return Err(error);
    }
    let width = read_side(&table, "width", photo.map(|photo| photo.width))?;
    let height = read_side(&table, "height", photo.map(|photo| photo.height))?;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(table.error(
            format!("the camera has {width} x {height} pixels"),
            format!("at most {MAX_PIXELS}"),
            "lower `width` or `height`",
        ));
    }
    let distortion = read_distortion(&table)?.unwrap_or(Distortion::NONE);
    let is_fisheye = distortion.model == LENS_FISHEYE;
    let (fx, fy) = read_focal_lengths(&table, f64::from(height), is_fisheye)?;
    let half = |side: u32| f64::from(side) * 0.5;
    let camera = Camera {
        width,
        height,
        fx,
        fy,
        cx: table.optional("cx", Node::finite)?.unwrap_or(half(width)),
        cy: table.optional("cy", Node::finite)?.unwrap_or(half(height)),
        distortion,
        world_from_camera: read_camera_pose(&table)?,
    };
    check_distortion(&camera).map_err(|problem| {
        let at = table.get("distortion").or_else(|| table.get("lens_model"));
        let (expected, mend) = (
            "coefficients that reach every pixel (OpenCV's k1 k2 p1 p2 k3, or k1 k2 k3 k4 of a fisheye)",
            "correct them or `fx` and `fy`",
        );
        match at {
            Some(node) => node.error(problem, expected, mend),
            None => table.error(problem, expected, mend),
        }
    })?;
    Ok(camera)
}

/// `file`: a calibration with or without a pose, of another program.
fn read_camera_file(
    table: &Table,
    photo: Option<&Photo>,
    warnings: &mut Vec<String>,
) -> Result<Camera> {
    for key in INTRINSICS_KEYS {
        table.refuse_both("file", key)?;
    }
    let origin = table.optional("pixel_origin", |node| node.choice::<PixelOrigin>())?;
    let poses = ["world_from_camera", "position", "motion"];
    let has_pose = poses.iter().any(|key| table.get(key).is_some());
    let own_pose = read_camera_pose(table)?;
    table.required("file", "file = \"camera.json\"", |node| {
        let path = node.existing_file()?;
        let file = read_camera(&path, origin).map_err(|problem| node.file_error(&path, problem))?;
        warnings.extend(node.file_warnings(file.notes));
        let size = photo.map(|photo| (photo.width, photo.height));
        let size = size.or(file.intrinsics.size).ok_or_else(|| {
            node.file_error(
                &path,
                "it tells no size; expected `width` and `height`; add them, or a photograph",
            )
        })?;
        let pose = if has_pose {
            own_pose
        } else {
            file.world_from_camera.unwrap_or(own_pose)
        };
        (file.intrinsics.camera(size, pose)).map_err(|problem| {
            let expected = "intrinsics of the photograph's size";
            node.file_error(
                &path,
                format!("{problem}; expected {expected}; scale them, or the photograph"),
            )
        })
    })
}

/// `distortion` and `lens_model`; `None`: neither is there.
pub(super) fn read_distortion(table: &Table) -> Result<Option<Distortion>> {
    let is_fisheye = table.optional("lens_model", |node| match node.string()? {
        "opencv" => Ok(false),
        "fisheye" => Ok(true),
        _ => Err(node.impossible("\"opencv\" or \"fisheye\"")),
    })?;
    if is_fisheye == Some(true) {
        let k = table.optional("distortion", |node| node.vector::<4>())?;
        return Ok(Some(Distortion::fisheye(k.unwrap_or_default())));
    }
    let given = table.optional("distortion", |node| match node.len() {
        Some(4) => Ok(node.vector::<4>()?.to_vec()),
        Some(8) => Ok(node.vector::<8>()?.to_vec()),
        Some(12) => Ok(node.vector::<12>()?.to_vec()),
        _ => Ok(node.vector::<5>()?.to_vec()),
    })?;
    Ok(given.and_then(|k| Distortion::opencv(&k)))
}

fn read_side(table: &Table, key: &str, photo_side: Option<u32>) -> Result<u32> {
    let Some(photo_side) = photo_side else {
        return table.required(key, &format!("{key} = 640"), |node| {
            node.integer(1, MAX_SIDE_PX)
        });
    };
    table
        .optional(key, |node| {
            let side = node.integer(1, MAX_SIDE_PX)?;
            if side == photo_side {
                return Ok(side);
            }
            Err(node.error(
                format!("`{key}` is {side} but the photograph's is {photo_side}"),
                "the photograph's size",
                "remove `width` and `height` and scale the intrinsics",
            ))
        })
        .map(|side| side.unwrap_or(photo_side))
}

/// Pixels. One of `fx` and `fy` alone means square pixels.
fn read_focal_lengths(table: &Table, height: f64, is_fisheye: bool) -> Result<(f64, f64)> {
    table.refuse_both("fx", "vertical_fov_deg")?;
    table.refuse_both("fy", "vertical_fov_deg")?;
    let fx = table.optional("fx", Node::positive)?;
    let fy = table.optional("fy", Node::positive)?;
    let from_fov = table.optional("vertical_fov_deg", |node| {
        let expected = "degrees above 0 and below 180";
        // Beyond these the focal length leaves the range in which f32 can divide by it.
        let fov = node.number(expected, |fov| (1e-4..=179.9999).contains(&fov))?;
        Ok(height * 0.5 / half_view(fov.to_radians() * 0.5, is_fisheye))
    })?;
    match (fx.or(fy).or(from_fov), fy.or(fx).or(from_fov)) {
        (Some(fx), Some(fy)) => Ok((fx, fy)),
        _ => Err(table.error(
            "[camera] lacks a focal length",
            "`fx` and `fy` in pixels, or `vertical_fov_deg`",
            "add it",
        )),
    }
}

/// The lens, and its focal length in millimetres where the file says it.
pub(super) fn read_lens(root: &Table) -> Result<(Lens, Option<f64>)> {
    let pinhole = Lens::PINHOLE;
    let Some(table) = root.table("lens", "[lens]", LENS_KEYS)? else {
        return Ok((pinhole, None));
    };
    let aperture_radius_m = read_aperture_radius(&table)?;
    let focus = table.optional("focus_distance_m", Node::positive_or_infinite)?;
    if focus.is_none() && aperture_radius_m > 0.0 {
        return Err(table.error(
            "[lens] lacks `focus_distance_m`",
            "`focus_distance_m = 1.2` in metres, or inf",
            "add it",
        ));
    }
    let focal_length_mm = table.optional("focal_length_mm", Node::positive)?;
    let focal_length_m = focal_length_mm.map_or(0.0, |mm| mm / 1000.0);
    let lens = Lens {
        aperture_radius_m,
        focus_distance_m: focus.unwrap_or(pinhole.focus_distance_m),
        aperture: table
            .optional("aperture", read_aperture)?
            .unwrap_or(pinhole.aperture),
        blade_rotation_deg: table
            .optional("blade_rotation_deg", Node::finite)?
            .unwrap_or(0.0),
        focal_length_m,
    };
    table.optional("focus_distance_m", |node| {
        match lens.focus_problem(lens.focus_distance_m) {
            Some(problem) => Err(node.error(problem, EXPECTED_FOCUS, "correct one of them")),
            None => Ok(()),
        }
    })?;
    Ok((lens, focal_length_mm))
}

fn read_aperture_radius(table: &Table) -> Result<f64> {
    table.refuse_both("aperture_radius_m", "f_number")?;
    table.refuse_both("aperture_radius_m", "focal_length_mm")?;
    let radius = table.optional("aperture_radius_m", Node::not_negative)?;
    let f_number = table.optional("f_number", Node::positive)?;
    let focal_length_mm = table.optional("focal_length_mm", Node::positive)?;
    match (radius, f_number, focal_length_mm) {
        (Some(radius), ..) => Ok(radius),
        (None, None, None) => Ok(0.0),
        (None, Some(f_number), Some(focal_length_mm)) => Ok(focal_length_mm / (2000.0 * f_number)),
        (None, f_number, _) => {
            let (given, missing) = match f_number {
                Some(_) => ("f_number", "focal_length_mm"),
                None => ("focal_length_mm", "f_number"),
            };
            Err(table.error(
                format!("[lens] has `{given}` without `{missing}`"),
                "both, or `aperture_radius_m`",
                format!("add `{missing}`"),
            ))
        }
    }
}

fn read_aperture(node: &Node) -> Result<Aperture> {
    let expected = "\"disc\", \"square\", or a number of blades from 3 to 64";
    if !node.is_string() {
        return Ok(Aperture::Blades(node.integer_described(3, 64, expected)?));
    }
    match node.string()? {
        "disc" => Ok(Aperture::Disc),
        "square" => Ok(Aperture::Square),
        _ => Err(node.impossible(expected)),
    }
}
