//! Scene files as a whole: what is accepted and what it becomes, what is refused and where.

mod accepted;
mod images;
mod objects;
mod refused;

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::{Scene, SceneError, load};

/// The shortest [camera] without a photograph.
const CAMERA: &str = "[camera]\nwidth = 64\nheight = 48\nvertical_fov_deg = 45\n";

/// A folder with a scene file in it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load(&self, text: &str) -> Result<Scene, SceneError> {
        let path = self.path("scene.toml");
        std::fs::write(&path, text).expect("a writable folder");
        load(&path)
    }
}

fn near(a: DVec3, b: [f64; 3]) -> bool {
    (a - DVec3::from(b)).length() < 1e-12
}

/// Loads a scene of this text alone.
fn load_text(text: &str) -> Result<Scene, SceneError> {
    Folder::new().load(text)
}

/// Loads a scene of [`CAMERA`] and this text.
fn load_with_camera(text: &str) -> Scene {
    load_text(&format!("{CAMERA}{text}")).expect("a valid scene")
}

/// The data folder beside the checkout, or None, said aloud.
fn shared_data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/data")
        .join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: {} is absent", path.display());
    None
}
