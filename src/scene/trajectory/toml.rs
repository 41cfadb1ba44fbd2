//! This program's own TOML: `[[frame]]` tables, strict as scene files are.

use std::path::Path;

use toml::de::DeTable;

use super::{Entry, EntryKey, Intrinsics, Result, Trajectory};
use crate::scene::error::{Result as SceneResult, Source};
use crate::scene::pose::read_camera_pose;
use crate::scene::reader::{Node, Table};

const KEYS: &[&str] = &["frames_per_second", "camera", "frame"];
const CAMERA_KEYS: &[&str] = &["width", "height", "fx", "fy", "cx", "cy", "distortion"];
const FRAME_KEYS: &[&str] = &[
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
    let intrinsics = root
        .table("camera", "[camera]", CAMERA_KEYS)?
        .map(|table| read_intrinsics(&table))
        .transpose()?;
    let entries = root
        .list("frame")?
        .iter()
        .map(|node| read_entry(node))
        .collect::<SceneResult<Vec<_>>>()?;
    Ok(Trajectory {
        path: source.path.clone(),
        files: vec![source.path.clone()],
        frames_per_second: root.optional("frames_per_second", Node::positive)?,
        intrinsics,
        entries,
        known_points: Vec::new(),
    })
}

fn read_intrinsics(table: &Table) -> SceneResult<Intrinsics> {
    let side = |node: &Node| node.integer(1, crate::decode::MAX_SIDE_PX);
    let width = table.optional("width", side)?;
    let height = table.optional("height", side)?;
    let fx = table.required("fx", "fx = 520.0", Node::positive)?;
    Ok(Intrinsics {
        size: width.zip(height),
        fx,
        fy: table.optional("fy", Node::positive)?.unwrap_or(fx),
        cx: table.required("cx", "cx = 320.0", Node::finite)?,
        cy: table.required("cy", "cy = 240.0", Node::finite)?,
        distortion: table
            .optional("distortion", |node| node.vector::<5>())?
            .unwrap_or_default(),
    })
}

fn read_entry(node: &Node) -> SceneResult<Entry> {
    let table = node.table("[[frame]]", FRAME_KEYS)?;
    table.refuse_both("frame", "file")?;
    let number = table.optional("frame", |node| node.integer(0, u32::MAX))?;
    let file = table.optional("file", |node| Ok(node.string()?.to_owned()))?;
    let key = match (number, file) {
        (Some(number), _) => EntryKey::Number(number),
        (None, Some(file)) => EntryKey::Name(file),
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
        intrinsics: None,
        focus_distance_m: table.optional("focus_distance_m", Node::positive_or_infinite)?,
    })
}
