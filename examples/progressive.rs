//! Drives the progressive renderer: a first look, more rays, then another focus without rebuilding anything.
//!
//! `cargo run --release --example progressive -- scenes/demo/scene.toml`

use std::path::Path;
use std::time::Duration;

use mixray::output::{PngBits, Target, write_png};
use mixray::renderer::{Budget, Renderer, RendererOptions};
use mixray::scene::Lens;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "scenes/demo/scene.toml".to_owned());
    let scene = mixray::scene::load(Path::new(&path))?;
    let mut renderer = Renderer::new(scene, RendererOptions::default())?;

    renderer.advance(Budget::Time(Duration::from_secs(1)), &|| false, &mut |_| ())?;
    println!("after a second: {} rays per pixel", renderer.samples());

    renderer.advance(Budget::Complete, &|| false, &mut |p| {
        eprintln!("{} of {} rays per pixel", p.samples, p.samples_total);
    })?;
    save(&renderer, "focus-1.png")?;

    let lens = renderer.scene().lens;
    renderer.set_lens(Lens {
        focus_distance_m: 1.5 * lens.focus_distance_m,
        ..lens
    })?;
    renderer.advance(Budget::Complete, &|| false, &mut |_| ())?;
    save(&renderer, "focus-2.png")?;
    Ok(())
}

fn save(renderer: &Renderer, name: &str) -> Result<(), Box<dyn std::error::Error>> {
    let target = Target::picture(Path::new(name))?;
    let photo = renderer.scene().photo.as_ref();
    write_png(
        &target,
        &renderer.picture(),
        photo,
        PngBits::for_photo(photo),
    )?;
    println!("picture {name}");
    Ok(())
}
