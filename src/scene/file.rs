//! From the text of a scene file to a [`Scene`].

use std::path::Path;

use toml::de::DeTable;

use super::camera::{read_camera_table, read_lens};
use super::check::read_allowed;
use super::environment::read_environment;
use super::error::{Result, SceneError, Source};
use super::focus_path::read_focus_path;
use super::light::read_lights;
use super::object::ObjectReader;
use super::photo::read_photo;
use super::projection::check_reach;
use super::reader::Table;
use super::sandbox::Sandbox;
use super::settings::read_settings;
use super::shutter::{read_camera_motion, read_shutter};
use super::trajectory::Intrinsics;
use super::{Photo, Scene, Stages};
use crate::decode::{FileKind, MAX_TEXT_BYTES, kind_of, read_file};
use crate::files;

const TABLES: &[&str] = &[
    "photo",
    "camera",
    "lens",
    "environment",
    "light",
    "real",
    "virtual",
    "render",
    "shutter",
    "check",
];

/// What a caller brings in place of the scene file's own.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Replaces `[photo] image`.
    pub photo: Option<Photo>,
    /// Replaces the intrinsics in `[camera]`, which may then be absent.
    pub intrinsics: Option<Intrinsics>,
    /// Refuses files outside the scene's folder, links followed: for scenes of others.
    pub sandbox: bool,
}

/// Reads a scene file (TOML) and everything it names.
///
/// What comes back is finite, in range and refers only to things that exist. Paths in the file are relative to its folder.
///
/// # Errors
///
/// [`SceneError`] names the file, line and column of the first thing that cannot be used, what was expected and how to mend it: bad
/// TOML, unknown keys, wrong types, impossible values, missing or broken files.
pub fn load(path: &Path) -> std::result::Result<Scene, SceneError> {
    load_with(path, Given::default())
}

/// [`load`] with what the caller brings.
///
/// # Errors
/// As [`load`]; or the intrinsics do not fit the photograph, or a file lies outside the sandbox.
pub fn load_with(path: &Path, given: Given) -> std::result::Result<Scene, SceneError> {
    if let Some(kind) = kind_of(path) {
        let named = match kind {
            FileKind::Picture(_) => "`image` in [photo]",
            FileKind::Film(_) => "--frames of `mixray sequence`",
            _ => "`mesh` in [[virtual]] or [[real]]",
        };
        return Err(SceneError::Unreadable {
            path: path.to_path_buf(),
            reason: format!("it is {}, which goes with a scene as {named}", kind.name()),
        });
    }
    let bytes = read_file(path, MAX_TEXT_BYTES).map_err(|reason| SceneError::Unreadable {
        path: path.to_path_buf(),
        reason,
    })?;
    let mut source = Source::new(path, bytes)?;
    source.sandbox = given.sandbox.then(|| Sandbox::around(path));
    read_scene(&source, given)
}

/// [`load`] of a scene file whose text is not that on the disk: what it names is read from its folder.
///
/// # Errors
/// As [`load`].
pub fn load_text(path: &Path, text: &str) -> std::result::Result<Scene, SceneError> {
    load_text_with(path, text, Given::default())
}

/// [`load_text`] with what the caller brings.
///
/// # Errors
/// As [`load_with`].
pub fn load_text_with(
    path: &Path,
    text: &str,
    given: Given,
) -> std::result::Result<Scene, SceneError> {
    let source = Source::new(path, text.as_bytes().to_vec())?;
    read_scene(&source, given)
}

pub(super) fn read_scene(source: &Source, given: Given) -> Result<Scene> {
    let document = DeTable::parse(&source.text).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start);
        let message = match error.message().split_once(", expected ") {
            Some((problem, expected)) => format!("{problem}; expected {expected}"),
            None => format!("{}; expected valid TOML", error.message()),
        };
        source.error(offset, format!("{message}; mend the TOML here"))
    })?;
    let root = Table::root(source, document.get_ref());
    root.refuse_unknown(&[TABLES, Stages::TABLES].concat())?;
    let mut warnings = Vec::new();
    let (photo, mut photo_settings) = read_photo(&root, given.photo, &mut warnings)?;
    let photo_file = photo_settings.file.take();
    let settings = read_settings(&root, photo_settings)?;
    let stages = Stages::read(&root)?;
    let allowed = read_allowed(&root)?;
    let mut camera = read_camera_table(
        &root,
        photo.as_ref(),
        given.intrinsics.as_ref(),
        &mut warnings,
    )?;
    let camera_path = read_camera_motion(&root)?;
    let shutter = read_shutter(&root)?;
    let time_secs = shutter.map_or(0.0, |shutter| shutter.time_secs);
    if let Some(pose) = camera_path.pose(time_secs) {
        camera.world_from_camera = pose;
    }
    let (lens, focal_length_mm) = read_lens(&root)?;
    check_reach(&camera, lens.aperture_radius_m).map_err(|problem| {
        root.error(
            problem,
            "89 degrees off the axis at most with an open aperture",
            "leave out [lens], or crop the photograph",
        )
    })?;
    let focus_path = read_focus_path(&root, &lens)?;
    let environment = read_environment(&root, &mut warnings)?;
    let mut lights = read_lights(&root)?;
    let reader = ObjectReader::new(photo.is_some(), &camera, &mut warnings);
    let (objects, mesh_lights, mesh_files) = reader.read_all(&root)?;
    lights.extend(mesh_lights);
    let mut inputs = source.files.borrow().clone();
    inputs.extend(mesh_files);
    for path in &inputs {
        files::input(path).map_err(|error| SceneError::Unreadable {
            path: path.clone(),
            reason: error.to_string(),
        })?;
    }
    let mut scene = Scene {
        name: scene_name(&source.path),
        path: source.path.clone(),
        photo,
        photo_file,
        camera,
        lens,
        focal_length_mm,
        environment,
        lights,
        objects,
        shutter,
        camera_path,
        focus_path,
        settings,
        inputs,
        stages,
        allowed,
        warnings,
    };
    scene.set_time(time_secs);
    scene.lens = scene.lens_at(time_secs);
    Ok(scene)
}

/// The name of the folder that holds the file, or else of the file.
fn scene_name(path: &Path) -> String {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    absolute
        .parent()
        .and_then(Path::file_name)
        .or(absolute.file_stem())
        .map_or_else(
            || "scene".to_owned(),
            |name| name.to_string_lossy().into_owned(),
        )
}
