//! Renders a video through the library: a ball of copper rolls over the table of the demo's photograph, which a camera on a tripod films.
//!
//! `cargo run --release --example video -- video` writes the frames that come in, the poses, the scene and the frames that go out into a
//! folder.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use mixray::renderer::Watcher;
use mixray::scene;
use mixray::sequence::{Event, SequenceOptions, render_sequence};

const FRAMES: u32 = 12;
const FRAMES_PER_SECOND: u32 = 12;
const RADIUS_M: f64 = 0.022;

const BALL: &str = r#"
[[virtual]]
shape = "sphere"
name = "copper"
scale = 0.022
material = { base_color = [0.95, 0.64, 0.54], metallic = 1.0, roughness = 0.2 }
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(
        std::env::args()
            .nth(1)
            .unwrap_or_else(|| "video".to_owned()),
    );
    let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/demo");
    let frames = folder.join("in");
    std::fs::create_dir_all(&frames)?;
    for number in 0..FRAMES {
        let frame = frames.join(format!("frame_{number:03}.png"));
        std::fs::copy(demo.join("photo.png"), frame)?;
    }
    std::fs::write(folder.join("scene.toml"), scene_text(&demo)?)?;
    std::fs::write(folder.join("poses.json"), poses(&demo)?)?;

    let mut options = SequenceOptions::new(
        folder.join("scene.toml"),
        frames,
        folder.join("poses.json"),
        folder.join("out"),
    );
    options.overrides.rays_per_pixel = Some(16);
    options.overwrite = true;
    let hear = |event: &Event<'_>| match event {
        Event::Ends { label, .. } => eprintln!("{label} is there"),
        Event::Warning(text) | Event::Note(text) => eprintln!("{text}"),
        _ => {}
    };
    let rendered = render_sequence(&options, &Watcher::none(), &hear)?;
    print!("{}", rendered.stats.text(&options.output.to_string_lossy()));
    Ok(())
}

/// The demo's photograph, camera, light and proxy, and a ball in place of what is added there.
fn scene_text(demo: &Path) -> std::io::Result<String> {
    let text = std::fs::read_to_string(demo.join("scene.toml"))?;
    let mut text = (text.split("# What is added.").next().unwrap_or_default()).to_owned();
    for name in ["photo.png", "env.exr", "room.glb", "props.glb"] {
        let quoted = |name: &str| toml::Value::from(name).to_string();
        let path = demo.join(name);
        text = text.replace(&quoted(name), &quoted(&path.to_string_lossy()));
    }
    text += BALL;
    let seconds = f64::from(FRAMES) / f64::from(FRAMES_PER_SECOND);
    let (from, to) = ([-0.15, RADIUS_M, 0.22], [0.17, RADIUS_M, 0.16]);
    let turns_deg = -((to[0] - from[0]) / RADIUS_M).to_degrees();
    // More than half a turn between two keys would be taken the short way round.
    let keys = 8;
    for key in 0..=keys {
        let share = f64::from(key) / f64::from(keys);
        let at: [f64; 3] = std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis]));
        let _ = write!(
            text,
            "[[virtual.motion]]\ntime_secs = {:?}\ntranslation = {at:?}\nrotation_deg = [0.0, 0.0, {:?}]\n",
            share * seconds,
            share * turns_deg
        );
    }
    text += "[shutter]\nexposure_secs = 0.04\n";
    Ok(text)
}

/// The demo's camera in every frame.
fn poses(demo: &Path) -> Result<String, Box<dyn std::error::Error>> {
    let scene = scene::load(&demo.join("scene.toml"))?;
    // Rows of a matrix for column vectors.
    let rows = scene
        .camera
        .world_from_camera
        .transpose()
        .to_cols_array_2d();
    let frames: Vec<String> = (0..FRAMES)
        .map(|number| format!(r#"{{"frame": {number}, "world_from_camera": {rows:?}}}"#))
        .collect();
    Ok(format!(
        r#"{{"frames_per_second": {FRAMES_PER_SECOND}, "frames": [{}]}}"#,
        frames.join(",\n")
    ))
}
