//! A small scene in a folder, and the built program.

use std::path::PathBuf;
use std::process::{Command, Output};

/// A ball over a textured floor, out of focus: background, edge and virtual pixels.
pub const SCENE: &str = "\
[photo]
image = \"photo.png\"
[camera]
vertical_fov_deg = 45
position = [0, 0.6, 2]
look_at = [0, 0.2, 0]
[lens]
aperture_radius_m = 0.05
focus_distance_m = 1.2
[environment]
radiance = [0.8, 0.9, 1.0]
[[light]]
kind = \"quad\"
corner = [-0.5, 2, -0.5]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [3, 3, 3]
[[real]]
shape = \"quad\"
corner = [-3, 0, 3]
edge_u = [6, 0, 0]
edge_v = [0, 0, -6]
material = { base_color = [0.5, 0.4, 0.3] }
[[virtual]]
shape = \"sphere\"
scale = 0.3
segments = 32
translation = [0, 0.31, 0]
material = { base_color = [0.3, 0.5, 0.7] }
[render]
max_bounces = 2
backend = \"cpu\"
";

pub struct Folder(pub tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        let photo = image::RgbImage::from_fn(24, 16, |x, y| {
            image::Rgb([(x * 10) as u8, (y * 15) as u8, (x * y) as u8])
        });
        photo.save(folder.path("photo.png")).unwrap();
        folder.write("scene.toml", SCENE);
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.read(name)).unwrap()
    }

    pub fn run(&self, arguments: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_mixray"))
            .current_dir(self.0.path())
            .args(arguments.split_whitespace())
            .output()
            .unwrap()
    }

    pub fn succeed(&self, arguments: &str) -> String {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {message}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    /// Exit code 2 and one line that begins with "error:" and holds `part`.
    pub fn refuse(&self, arguments: &str, part: &str) {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.starts_with("error:"), "{message}");
        assert!(message.contains(part), "{message} lacks {part}");
        assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    }
}

pub const QUICK: &str =
    "bench scene.toml --backends cpu --rpp 1,4 --repeats 2 --reference-error 0.5 -o out";
