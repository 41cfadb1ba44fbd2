//! Drives the progressive renderer: a first look, more rays, then another focus without rebuilding anything.
//!
//! `cargo run --release --example progressive -- scenes/demo/scene.toml`

use std::path::Path;
use std::time::Duration;

use mixray::output::{PngBits, Target, write_png};
use mixray::renderer::{Budget, Progress, Renderer, RendererOptions, Watcher};
use mixray::scene::Lens;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "scenes/demo/scene.toml".to_owned());
    let scene = mixray::scene::load(Path::new(&path))?;
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())?;

    renderer.advance(Budget::Time(Duration::from_secs(1)), &Watcher::none())?;
    println!("after a second: {} rays per pixel", renderer.samples());

    let say = |p: &Progress| {
        let percent = 100.0 * p.share_done;
        eprintln!(
            "{}: {percent:.0}%, {} of {} rays per pixel",
            p.phase.name(),
            p.samples,
            p.samples_total
        );
    };
    renderer.advance(Budget::Complete, &Watcher::none().heard_by(&say))?;
    save(&renderer, "focus-1.png")?;

    let lens = renderer.scene().lens;
    renderer.set_lens(
        Lens {
            focus_distance_m: 1.5 * lens.focus_distance_m,
            ..lens
        },
        &Watcher::none(),
    )?;
    renderer.advance(Budget::Complete, &Watcher::none())?;
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
