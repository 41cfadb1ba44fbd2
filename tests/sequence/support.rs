//! Scenes in memory, and a folder with frames, a trajectory and the built program.

use std::path::Path;

use mixray::renderer::{Renderer, RendererOptions, Watcher};
use mixray::scene::BackendChoice;

use crate::support::{Folder, complete, mask, scene};

/// A white square of 40 px in the middle of 96 x 24, one metre away, a pixel a centimetre.
pub const SQUARE: &str = "
[[virtual]]
shape = \"quad\"
corner = [-0.2, -0.4, -1]
edge_u = [0.4, 0, 0]
edge_v = [0, 0.8, 0]
material = { base_color = [1, 1, 1], unlit = true }
";
pub const CAMERA: &str = "[camera]\nwidth = 96\nheight = 24\nfx = 100\n";

pub fn render(text: &str, backend: BackendChoice) -> Renderer {
    let mut scene = scene(text);
    scene.settings.backend = backend;
    let mut renderer =
        Renderer::new(scene, RendererOptions::default(), &Watcher::none()).expect("the scene fits");
    complete(&mut renderer);
    renderer
}

/// M of a row.
pub fn mask_row(renderer: &Renderer, row: u32) -> Vec<f64> {
    let width = renderer.film().width as usize;
    mask(renderer.film())[row as usize * width..][..width].to_vec()
}

/// A ball over a floor, in front of the cameras of [`Folder::trajectory`].
pub const BALL: &str = "[camera]\nfx = 40\n[environment]\nradiance = [0.6, 0.6, 0.6]\n[[real]]\nshape = \"quad\"\ncorner = [-2, -0.3, 1]\nedge_u = [6, 0, 0]\nedge_v = [0, 0, -6]\n\
    material = { base_color = [0.5, 0.5, 0.5] }\n[[virtual]]\nshape = \"sphere\"\nsegments = 24\nscale = 0.3\ntranslation = [0, 0, -2]\nmaterial = { base_color = [0.8, 0.4, 0.2] }\n\
    [render]\nrays_per_pixel = 4\nbackend = \"cpu\"\nmax_bounces = 1\n";

impl Folder {
    /// Frame `number` of a stream whose every frame is another picture.
    pub fn save_frame(&self, name: &str, width: u32, height: u32, number: u32) {
        self.save(name, width, height, |x, y| {
            [0, 40, 80].map(|c| ((x * 5 + y * 3 + number * 17 + c) % 256) as u8)
        });
    }

    /// Frames 0 to `count` - 1 of 48 x 36 in `in/`, and a camera that steps to the right by `step_m` each, ten a second.
    pub fn frames(&self, count: u32, step_m: f64) {
        self.create("in");
        for number in 0..count {
            self.save_frame(&format!("in/f_{number:04}.png"), 48, 36, number);
        }
        self.trajectory(count, step_m, &[]);
    }

    pub fn trajectory(&self, count: u32, step_m: f64, nulls: &[u32]) {
        let frames: Vec<String> = (0..count)
            .map(|number| {
                let x = step_m * f64::from(number);
                match nulls.contains(&number) {
                    true => format!(r#"{{"frame": {number}, "world_from_camera": null}}"#),
                    false => format!(r#"{{"frame": {number}, "world_from_camera": [[1,0,0,{x}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}"#),
                }
            })
            .collect();
        let text = format!(
            r#"{{"frames_per_second": 10, "frames": [{}]}}"#,
            frames.join(", ")
        );
        self.write("poses.json", text);
    }

    /// `mixray sequence scene.toml --trajectory poses.json` and more; it must succeed. Its stdout.
    pub fn sequence(&self, more: &[&str]) -> String {
        self.succeed(&sequence(more))
    }

    /// The same, which must be refused in one line that holds `part`.
    pub fn refuse_sequence(&self, more: &[&str], part: &str) {
        self.refuse(&sequence(more), part);
    }

    /// Names and contents of the frames in a folder.
    pub fn frames_of(&self, name: &str) -> Vec<(String, Vec<u8>)> {
        frames_of(&self.path(name))
    }
}

pub fn sequence<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let mut arguments = vec!["sequence", "scene.toml", "--trajectory", "poses.json"];
    arguments.extend(more);
    arguments
}

pub fn frames_of(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut frames: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .map(|entries| {
            entries
                .map(|entry| entry.expect("reads").path())
                .filter(|path| path.extension().is_some_and(|e| e == "png" || e == "exr"))
                .map(|path| {
                    let name = path
                        .file_name()
                        .expect("a name")
                        .to_string_lossy()
                        .into_owned();
                    (name, std::fs::read(&path).expect("reads"))
                })
                .collect()
        })
        .unwrap_or_default();
    frames.sort();
    frames
}

/// A Y4M stream of 4:2:0 with these numbers for planes.
pub fn y4m(width: u32, height: u32, frames: u32) -> Vec<u8> {
    let mut bytes = format!("YUV4MPEG2 W{width} H{height} F10:1 Ip A1:1 C420jpeg\n").into_bytes();
    let size = width * height + 2 * (width.div_ceil(2) * height.div_ceil(2));
    for frame in 0..frames {
        bytes.extend(b"FRAME\n");
        bytes.extend((0..size).map(|i| (60 + (i * 7 + frame * 31) % 120) as u8));
    }
    bytes
}
