//! Several of COLMAP's models in one folder: what it could not join. The largest counts.

use std::path::{Path, PathBuf};

use super::{Result, Trajectory, colmap, colmap_binary, file_error};

/// The model of a folder; of a folder of models, or one that holds them in `sparse`, the one with the most pictures.
pub(super) fn read(folder: &Path) -> Result<Trajectory> {
    let inside = models_in(folder);
    let models = match inside.is_empty() {
        true => models_in(&folder.join("sparse")),
        false => inside,
    };
    if is_model(folder) || models.is_empty() {
        return read_one(folder);
    }
    let mut largest: Option<Trajectory> = None;
    for model in &models {
        let read = read_one(model)?;
        let most = largest.as_ref().map_or(0, |largest| largest.entries.len());
        if read.entries.len() > most {
            largest = Some(read);
        }
    }
    largest.ok_or_else(|| {
        file_error(
            folder,
            "its models hold no picture; expected at least one; reconstruct again from pictures that overlap more",
        )
    })
}

fn read_one(folder: &Path) -> Result<Trajectory> {
    let text = folder.join("images.txt");
    match folder.join("images.bin") {
        binary if binary.is_file() && !text.is_file() => colmap_binary::read(folder, &binary),
        _ => colmap::read(folder, &text),
    }
}

fn is_model(folder: &Path) -> bool {
    ["images.txt", "images.bin"]
        .iter()
        .any(|name| folder.join(name).is_file())
}

/// By their names, so that of two that are equally large the first counts.
fn models_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut models: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.is_dir() && is_model(path))
        .collect();
    models.sort();
    models
}
