//! Makes every file under `scenes/` that is not written by hand: photographs, environments, meshes. The same every time.
//!
//! `cargo run --release --example generate_scenes [NAME...]`, names of scenes; all of them without one.
//! `views DIR`, or `target/views`, makes photographs for measurement (`views.rs`).

mod caustics;
mod demo;
mod environment;
mod glb;
mod mesh;
mod photograph;
mod texture;
mod views;

use std::error::Error;
use std::path::{Path, PathBuf};

use photograph::{Sensor, photograph, real_scene};

/// Primary rays for each pixel of the small scenes' photographs.
const TEST_PHOTO_RAYS: u32 = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let names: Vec<String> = std::env::args().skip(1).collect();
    if names.first().is_some_and(|name| name == "views") {
        let target = names.get(1).map_or("target/views", String::as_str);
        return views::generate(Path::new(target));
    }
    let wanted = |name: &str| names.is_empty() || names.iter().any(|n| n == name);
    if wanted("demo") {
        demo::generate(&folder("demo"))?;
    }
    if wanted("room") {
        photograph_proxy(&folder("room"))?;
    }
    if wanted("far") {
        photograph_proxy(&folder("far"))?;
    }
    if wanted("caustics") {
        let folder = folder("caustics");
        caustics::write_ring(&folder)?;
        photograph_proxy(&folder)?;
        photograph_real(&folder.join("sun.toml"), &folder.join("photo_sun.png"))?;
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

/// Takes the photograph of a folder's own proxy: a perfect one.
fn photograph_proxy(folder: &Path) -> Result<(), Box<dyn Error>> {
    photograph_real(&folder.join("scene.toml"), &folder.join("photo.png"))
}

fn photograph_real(scene_file: &Path, photo: &Path) -> Result<(), Box<dyn Error>> {
    let scene = real_scene(scene_file)?;
    photograph(scene, TEST_PHOTO_RAYS, Sensor::NOISELESS, photo)
}
