//! What several folders of tests need.

mod folder;
mod random;

use std::path::{Path, PathBuf};

use mixray::film::Film;
use mixray::renderer::{Budget, Renderer, Watcher};
use mixray::scene::Scene;

pub use folder::{Folder, assert_refused, interrupt, stderr, stdout};
pub use random::Random;

/// The repository's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A file or folder of the shared data; None, said aloud, where the data is not there.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let path = root().join("../shared/data").join(name);
    let found = path.canonicalize().ok();
    if found.is_none() {
        eprintln!("SKIPPED: {} is not there", path.display());
    }
    found
}

/// Every .gltf and .glb under `folder`, sorted.
pub fn gltf_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path
                .extension()
                .is_some_and(|ending| ending == "gltf" || ending == "glb")
            {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// The scene that a scene file of this text describes.
pub fn scene(text: &str) -> Scene {
    let folder = Folder::new();
    folder.write("scene.toml", text);
    folder.load(text)
}

/// Renders all rays; every sample must be finite.
pub fn complete(renderer: &mut Renderer) {
    renderer
        .advance(Budget::Complete, &Watcher::none())
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(renderer.film().non_finite_samples(), 0);
}

/// Largest magnitude, 0 of none; NaN if any value is.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    let magnitudes = values.into_iter().map(f64::abs);
    magnitudes.max_by(f64::total_cmp).unwrap_or(0.0)
}

/// Fraction of each pixel's rays that met virtual geometry first.
pub fn mask(film: &Film) -> Vec<f64> {
    film.pixels
        .iter()
        .map(|p| f64::from(p.m) / f64::from(p.n.max(1)))
        .collect()
}
