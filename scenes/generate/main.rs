//! Makes every file under `scenes/` that is not written by hand: photographs, environments, meshes. The same every time.
//!
//! `cargo run --release --example generate_scenes [NAME...]`, names of scenes; all of them without one.

mod environment;
mod photograph;

use std::error::Error;
use std::path::{Path, PathBuf};

use photograph::{Sensor, photograph, real_scene};

/// Primary rays for each pixel of the small scenes' photographs.
const TEST_PHOTO_RAYS: u32 = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    let wanted = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    if wanted("room") {
        photograph_proxy(&folder("room"))?;
    }
    if wanted("far") {
        photograph_proxy(&folder("far"))?;
    }
    if wanted("sunny") {
        let folder = folder("sunny");
        environment::write_exr(&environment::sunny_sky(), &folder.join("sky.exr"))?;
        photograph_proxy(&folder)?;
    }
    Ok(())
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name)
}

/// Takes the photograph of a scene's own proxy: a perfect one.
fn photograph_proxy(folder: &Path) -> Result<(), Box<dyn Error>> {
    let scene = real_scene(folder)?;
    photograph(
        scene,
        TEST_PHOTO_RAYS,
        Sensor::NOISELESS,
        &folder.join("photo.png"),
    )
}
