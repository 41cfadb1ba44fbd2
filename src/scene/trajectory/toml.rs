//! This program's own TOML: `[[frame]]` tables, strict as scene files are.

use std::path::Path;

use toml::de::DeTable;

use super::intrinsics::{Fields, LensModel, Names};
use super::{Entry, EntryKey, Intrinsics, Result, Trajectory, name_of};
use crate::distortion::LENS_FISHEYE;
use crate::scene::camera::read_distortion;
use crate::scene::error::{Result as SceneResult, Source};
use crate::scene::pose::read_camera_pose;
use crate::scene::reader::{Node, Table};

const KEYS: &[&str] = &["frames_per_second", "camera", "frame"];
const CAMERA_KEYS: &[&str] = &[
    "width",
    "height",
    "fx",
    "fy",
    "horizontal_fov_deg",
    "cx",
    "cy",
    "distortion",
    "lens_model",
];
const NAMES: Names = Names {
    fx: "fx",
    fov_x: "horizontal_fov_deg",
};
const FRAME_KEYS: &[&str] = &[
    "camera",
    "frame",
    "file",
    "time_secs",
    "pose",
    "world_from_camera",
    "position",
    "look_at",
    "up",
    "focus_distance_m",
];

pub(super) fn read(path: &Path, text: String) -> Result<Trajectory> {
    let source = Source::new(path, text.into_bytes())?;
    Ok(read_source(&source)?)
}

fn read_source(source: &Source) -> SceneResult<Trajectory> {
    let document = DeTable::parse(&source.text).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start);
        let message = format!("{}; expected valid TOML; mend it here", error.message());
        source.error(offset, message)
    })?;
    let root = Table::root(source, document.get_ref());
    root.refuse_unknown(KEYS)?;
    let camera = root.table("camera", "[camera]", CAMERA_KEYS)?;
    let top = camera.as_ref().map(read_fields).transpose()?;
    let entries = root
        .list("frame")?
        .iter()
        .map(|node| read_entry(node, top.unwrap_or_default()))
        .collect::<SceneResult<Vec<_>>>()?;
    // Frames that bring what is missing at the top do without its own.
    let all_own = !entries.is_empty() && entries.iter().all(|entry| entry.intrinsics.is_some());
    let intrinsics = match (&camera, top) {
        (Some(table), Some(fields)) if !all_own => Some(resolve(table, fields)?),
        _ => None,
    };
    Ok(Trajectory {
        path: source.path.clone(),
        files: vec![source.path.clone()],
        frames_per_second: root.optional("frames_per_second", Node::positive)?,
        intrinsics,
        entries,
        known_points: Vec::new(),
    })
}

fn read_fields(table: &Table) -> SceneResult<Fields> {
    let side = |node: &Node| node.integer(1, crate::decode::MAX_SIDE_PX);
    Ok(Fields {
        width: table.optional("width", side)?,
        height: table.optional("height", side)?,
        fx: table.optional("fx", Node::positive)?,
        fy: table.optional("fy", Node::positive)?,
        cx: table.optional("cx", Node::finite)?,
        cy: table.optional("cy", Node::finite)?,
        fov_x: table
            .optional("horizontal_fov_deg", Node::positive)?
            .map(f64::to_radians),
        ..lens_fields(table)?
    })
}

/// The lens as a whole: a frame's own wins over that of all.
fn lens_fields(table: &Table) -> SceneResult<Fields> {
    let Some(lens) = read_distortion(table)? else {
        return Ok(Fields::default());
    };
    let k = lens.coefficients;
    let (model, k) = match lens.model {
        LENS_FISHEYE => {
            let fisheye = [k[0], k[1], 0.0, 0.0, k[2], k[3]];
            let mut all = [0.0; 12];
            all[..6].copy_from_slice(&fisheye);
            (LensModel::Fisheye, all)
        }
        _ => (LensModel::Rational, k),
    };
    Ok(Fields {
        coefficients: k.map(Some),
        model: Some(model),
        ..Fields::default()
    })
}

fn resolve(table: &Table, fields: Fields) -> SceneResult<Intrinsics> {
    fields
        .intrinsics(&NAMES)
        .map_err(|why| table.error(why.problem, why.expected, why.mend))
}

fn read_entry(node: &Node, top: Fields) -> SceneResult<Entry> {
    let table = node.table("[[frame]]", FRAME_KEYS)?;
    table.refuse_both("frame", "file")?;
    let number = table.optional("frame", |node| node.integer(0, u32::MAX))?;
    let file = table.optional("file", |node| Ok(node.string()?.to_owned()))?;
    let key = match (number, file) {
        (Some(number), _) => EntryKey::Number(number),
        (None, Some(file)) => name_of(&file),
        (None, None) => {
            return Err(table.error(
                "the frame says not which it is",
                "`frame = 12` or `file = \"frame_0012.png\"`",
                "add one",
            ));
        }
    };
    for key in ["world_from_camera", "position"] {
        table.refuse_both("pose", key)?;
    }
    let null = table.optional("pose", |node| match node.string()? {
        "null" => Ok(()),
        _ => Err(node.impossible("\"null\": the frame passes through unchanged")),
    })?;
    let given = ["world_from_camera", "position"]
        .iter()
        .any(|key| table.get(key).is_some());
    let world_from_camera = match (null, given) {
        (Some(()), _) => None,
        (None, true) => Some(read_camera_pose(&table)?),
        (None, false) => {
            return Err(table.error(
                "the frame's pose is absent",
                "`world_from_camera`, `position` and `look_at`, or `pose = \"null\"`",
                "add one",
            ));
        }
    };
    Ok(Entry {
        key,
        place: node.label().to_owned(),
        time_secs: table.optional("time_secs", Node::finite)?,
        world_from_camera,
        intrinsics: table
            .table("camera", "[frame.camera]", CAMERA_KEYS)?
            .map(|camera| resolve(&camera, read_fields(&camera)?.or(top)))
            .transpose()?,
        focus_distance_m: table.optional("focus_distance_m", Node::positive_or_infinite)?,
    })
}
