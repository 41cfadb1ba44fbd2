//! Measures what `mixray new` reads of cameras from straight lines and squares: `cargo run --release --example measure_lines [VIEWS]`.
//!
//! Writes the table of docs/start.md. VIEWS is what `cargo run --release --example generate_scenes views` makes, else `target/views`. The videos lie in
//! `../shared/data`; ffmpeg decodes the one that is MPEG-4.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::{DMat4, DVec3};
use mixray::scene::Photo;
use mixray::start::lines_of;
use mixray::video::{FrameSource, Taken};
use serde_json::Value;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Frames of each video, evenly spread over those whose pose is known.
const FRAMES: usize = 48;
/// What is right: as a share of the focal length, and degrees.
const MOST_FOCAL: f64 = 0.1;
const MOST_UP_DEG: f64 = 2.0;
const PAGE: &str = "docs/start.md";
const HEAD: &str = "<!-- lines -->\n";
const END: &str = "<!-- end -->";

/// What is known of a photograph's camera.
struct Truth {
    name: String,
    focal_px: f64,
    up: DVec3,
}

/// Counts over a set of photographs.
#[derive(Default)]
struct Row {
    photographs: usize,
    claims: usize,
    right: usize,
    focal_within: usize,
    up_within: usize,
}

impl Row {
    fn add(&mut self, photo: &Photo, truth: Option<&Truth>) {
        self.photographs += 1;
        let Some(lines) = lines_of(photo, None) else {
            return;
        };
        self.claims += 1;
        let Some(truth) = truth else {
            return;
        };
        let focal = lines.focal_px / truth.focal_px - 1.0;
        let up_deg = (lines.up.dot(truth.up).clamp(-1.0, 1.0))
            .acos()
            .to_degrees();
        self.right += usize::from(focal.abs() < MOST_FOCAL && up_deg < MOST_UP_DEG);
        self.focal_within += usize::from(focal.abs() < lines.focal_sigma);
        self.up_within += usize::from(up_deg < lines.up_sigma_deg);
        eprintln!(
            "{}: focal length {:+.1}% +- {:.1}%, up {up_deg:.2} +- {:.2} degrees, {:?}",
            truth.name,
            100.0 * focal,
            100.0 * lines.focal_sigma,
            lines.up_sigma_deg,
            lines.basis
        );
    }

    fn text(&self, name: &str) -> String {
        format!(
            "| {name} | {} | {} | {} | {} | {} |\n",
            self.photographs, self.claims, self.right, self.focal_within, self.up_within
        )
    }
}

fn main() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = root.join("../shared/data");
    let views = std::env::args_os().nth(1).map(PathBuf::from);
    let mut table = "| of | photographs | claims | right | focal length within its deviation | up within its deviation |\n\
                     | --- | --- | --- | --- | --- | --- |\n"
        .to_owned();
    let rendered = rendered(&views.unwrap_or(root.join("target/views")))?;
    table += &rendered.text("photographs by `generate_scenes views`, 25 to 90 degrees wide");
    let chessboard = data.join("webcam_chessboard_video");
    let row = video(&chessboard.join("movie.mjpeg"), &chessboard)?;
    table += &row.text("frames of the chessboard's video");
    let markers = data.join("webcam_marker_grid_video");
    let folder = tempfile::tempdir()?;
    let stream = folder.path().join("movie.y4m");
    let decoded = Command::new("ffmpeg")
        .args(["-loglevel", "error", "-i"])
        .arg(markers.join("movie.mp4"))
        .args(["-pix_fmt", "yuv420p", "-f", "yuv4mpegpipe"])
        .arg(&stream)
        .status()?;
    if !decoded.success() {
        return Err("ffmpeg does not decode the markers' video".into());
    }
    table +=
        &video(&stream, &markers)?.text("frames of the markers' video, whose lens bends lines");
    let mut none = Row::default();
    for name in ["focus_stack_pcb", "real_blur_photos"] {
        for entry in std::fs::read_dir(data.join(name))? {
            let path = entry?.path();
            if path.extension().is_some_and(|ending| ending == "jpg") {
                none.add(&Photo::read(&path)?.0, None);
            }
        }
    }
    table += &none.text("circuit boards, blurred texts and a licence plate");
    print!("{table}");
    let page = std::fs::read_to_string(root.join(PAGE))?;
    let (before, rest) = page.split_once(HEAD).ok_or("the page has no table")?;
    let (_, after) = rest.split_once(END).ok_or("the table has no end")?;
    Ok(std::fs::write(
        root.join(PAGE),
        format!("{before}{HEAD}{table}{END}{after}"),
    )?)
}

fn rendered(folder: &Path) -> Result<Row> {
    let list: Vec<Value> =
        serde_json::from_str(&std::fs::read_to_string(folder.join("views.json"))?)?;
    let mut row = Row::default();
    for view in list {
        let name = view["photo"].as_str().ok_or("no photo")?;
        let truth = Truth {
            name: name.to_owned(),
            focal_px: view["focal_px"].as_f64().ok_or("no focal length")?,
            up: serde_json::from_value::<[f64; 3]>(view["up"].clone())?.into(),
        };
        row.add(&Photo::read(&folder.join(name))?.0, Some(&truth));
    }
    Ok(row)
}

/// Some of the frames that `folder` has poses of.
fn video(stream: &Path, folder: &Path) -> Result<Row> {
    let trajectory = std::fs::read_to_string(folder.join("trajectory.json"))?;
    let trajectory: Value = serde_json::from_str(&trajectory)?;
    let focal_px = trajectory["fx"].as_f64().ok_or("no focal length")?;
    let frames = trajectory["frames"].as_array().ok_or("no frames")?;
    let mut posed: Vec<(u64, DVec3)> = Vec::new();
    for frame in frames {
        let pose =
            serde_json::from_value::<Option<[[f64; 4]; 4]>>(frame["camera_to_world_gltf"].clone())?;
        if let Some(rows) = pose {
            let camera_from_world = DMat4::from_cols_array_2d(&rows).transpose().inverse();
            let number = frame["frame"].as_u64().ok_or("no number")?;
            posed.push((number, camera_from_world.transform_vector3(DVec3::Y)));
        }
    }
    let chosen: Vec<(u64, DVec3)> = (0..FRAMES)
        .map(|i| posed[i * posed.len() / FRAMES])
        .collect();
    let mut row = Row::default();
    let mut source = FrameSource::open(stream)?;
    let mut number = 0;
    while let Some((name, taken)) = source.next(&|_| true)? {
        if let Some((_, up)) = chosen.iter().find(|(own, _)| *own == number)
            && let Taken::Whole(frame) = taken
        {
            let truth = Truth {
                name: format!("{name:?}"),
                focal_px,
                up: *up,
            };
            row.add(&frame.photo, Some(&truth));
        }
        number += 1;
    }
    Ok(row)
}
