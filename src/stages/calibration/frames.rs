//! The frames of static scenes: grouped by folder, read one by one.

use std::path::{Path, PathBuf};

use super::CalibrationError;
use crate::scene::trajectory::Naming;
use crate::scene::{EncodedPhoto, read_codes};

/// The frames of one static scene, in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneFrames {
    pub name: String,
    pub folder: PathBuf,
    pub paths: Vec<PathBuf>,
}

impl SceneFrames {
    pub(super) fn check(&self) -> Result<(), CalibrationError> {
        match self.paths.len() {
            0 => Err(CalibrationError::EmptyFolder {
                folder: self.folder.clone(),
            }),
            1 => Err(CalibrationError::OneFrame {
                folder: self.folder.clone(),
            }),
            _ => Ok(()),
        }
    }
}

/// Sorts frames into scenes by the folder they lie in; a folder stands for the pictures in it. In the order of the numbers in
/// their names, or of letters.
///
/// # Errors
/// A folder that cannot be read, or has no pictures.
pub fn group_frames(arguments: &[PathBuf]) -> Result<Vec<SceneFrames>, CalibrationError> {
    let mut scenes: Vec<SceneFrames> = Vec::new();
    for argument in arguments {
        let paths = if argument.is_dir() {
            pictures_in(argument)?
        } else {
            vec![argument.clone()]
        };
        for path in paths {
            // One path a file, however it was named: a frame that counts twice would make the noise seem smaller.
            let path = path
                .canonicalize()
                .map_err(|error| CalibrationError::Frame {
                    path: path.clone(),
                    problem: format!(
                        "it cannot be read ({error}); expected a picture; correct the path"
                    ),
                })?;
            let folder = path.parent().unwrap_or(Path::new(".")).to_path_buf();
            match scenes.iter_mut().find(|scene| scene.folder == folder) {
                Some(scene) if scene.paths.contains(&path) => {
                    return Err(CalibrationError::Frame {
                        path,
                        problem: "it is named twice; expected each frame once; leave one out"
                            .to_owned(),
                    });
                }
                Some(scene) => scene.paths.push(path),
                None => scenes.push(SceneFrames {
                    name: scene_name(&folder),
                    folder,
                    paths: vec![path],
                }),
            }
        }
    }
    for scene in &mut scenes {
        scene.paths = in_order(std::mem::take(&mut scene.paths));
    }
    Ok(scenes)
}

/// `frame10` comes after `frame9`, in whichever order a shell names them.
fn in_order(paths: Vec<PathBuf>) -> Vec<PathBuf> {
    let name = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let mut named: Vec<(String, PathBuf)> = (paths.into_iter())
        .map(|path| (name(&path), path))
        .collect();
    Naming::of(named.iter().map(|(name, _)| name.as_str())).sort(&mut named);
    named.into_iter().map(|(_, path)| path).collect()
}

fn scene_name(folder: &Path) -> String {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
    absolute.file_name().map_or_else(
        || ".".to_owned(),
        |name| name.to_string_lossy().into_owned(),
    )
}

fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, CalibrationError> {
    let unreadable = |error: std::io::Error| CalibrationError::Frame {
        path: folder.to_path_buf(),
        problem: format!("the folder cannot be read ({error})"),
    };
    let mut paths = Vec::new();
    crate::files::input(folder).map_err(unreadable)?;
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let extension = path
            .extension()
            .map(|e| e.to_string_lossy().to_ascii_lowercase());
        if matches!(extension.as_deref(), Some("png" | "jpg" | "jpeg")) {
            paths.push(path);
        }
    }
    if paths.is_empty() {
        return Err(CalibrationError::EmptyFolder {
            folder: folder.to_path_buf(),
        });
    }
    Ok(paths)
}

/// Frames that hold the very pixels of the one before them: what a film of fewer frames was stretched with. Their noise is no noise of
/// their own.
pub(super) fn drop_repeated(
    scene: &SceneFrames,
) -> Result<(SceneFrames, Option<String>), CalibrationError> {
    let mut kept = Vec::new();
    let mut before: Option<Frame> = None;
    for path in &scene.paths {
        let frame = Frame::read(path)?;
        if before
            .as_ref()
            .is_none_or(|before| before.codes != frame.codes)
        {
            kept.push(path.clone());
        }
        before = Some(frame);
    }
    let repeated = scene.paths.len() - kept.len();
    if kept.len() == 1 {
        return Err(CalibrationError::Copies {
            folder: scene.folder.clone(),
            count: scene.paths.len(),
        });
    }
    let note = (repeated > 0).then(|| {
        format!(
            "{}: {repeated} of {} frames repeat the one before and are left out",
            scene.name,
            scene.paths.len()
        )
    });
    let kept = SceneFrames {
        paths: kept,
        ..scene.clone()
    };
    Ok((kept, note))
}

/// One frame's codes. Grey has three equal channels.
pub(super) struct Frame {
    pub width: u32,
    pub height: u32,
    pub codes: Vec<[u16; 3]>,
    /// The largest code.
    pub top: u16,
}

impl Frame {
    pub fn read(path: &Path) -> Result<Self, CalibrationError> {
        let failed = |problem: String| CalibrationError::Frame {
            path: path.to_path_buf(),
            problem,
        };
        let (width, height, codes) = read_codes(path).map_err(|problem| failed(problem.into()))?;
        let (codes, top) = match codes {
            EncodedPhoto::Codes8(codes) => (codes.iter().map(|c| c.map(u16::from)).collect(), 255),
            EncodedPhoto::Codes16(codes) => (codes, u16::MAX),
            EncodedPhoto::Linear => {
                return Err(failed(
                    "it is a linear image; expected the camera's own encoded pictures (PNG or JPEG); convert it".to_owned(),
                ));
            }
        };
        Ok(Self {
            width,
            height,
            codes,
            top,
        })
    }
}
