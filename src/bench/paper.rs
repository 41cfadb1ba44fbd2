//! The frame rates of Kan and Kaufmann 2012 (Table 1) and ours on a scene like theirs.

use std::fmt::Write as _;

use serde::Serialize;

use super::columns::aligned;
use super::{Machine, Row};

/// A scene file: 720 x 576 pixels, about 100,000 triangles, an area light, a wide aperture.
pub const PAPER_SCENE: &str = include_str!("../../scenes/paper/scene.toml");

/// Rays per pixel and frames per second of the paper's Table 1, taken at 720 x 576 on a GeForce GTX 590.
const PUBLISHED: [(u32, f64); 3] = [(1, 59.0), (25, 12.0), (49, 7.0)];

/// One method at one of the paper's numbers of rays per pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PaperRow {
    pub rays_per_pixel: u32,
    pub primary_rays: u64,
    pub published_fps: f64,
    pub method: String,
    pub device: String,
    pub runs: usize,
    /// Frames per second: pilot, samples and composite, with the acceleration structures built and the shaders compiled.
    pub fps: f64,
    pub wall_secs: f64,
    pub wall_secs_sd: f64,
    pub cpu_secs: f64,
    pub rays_traced: u64,
    pub mrays_per_sec: f64,
}

/// The paper's numbers of rays per pixel.
pub fn paper_rays_per_pixel() -> Vec<u32> {
    PUBLISHED.iter().map(|(rays, _)| *rays).collect()
}

/// From measured rows; rows of other numbers of rays are left out.
pub fn paper_rows(rows: &[Row]) -> Vec<PaperRow> {
    let published = |rays| PUBLISHED.iter().find(|(known, _)| *known == rays);
    rows.iter()
        .filter_map(|row| {
            let (rays_per_pixel, published_fps) = *published(row.rays_per_pixel)?;
            let pixels = u64::from(row.width) * u64::from(row.height);
            let rays = &row.rays;
            Some(PaperRow {
                rays_per_pixel,
                primary_rays: pixels * u64::from(rays_per_pixel),
                published_fps,
                method: row.method.label(),
                device: row.device.clone(),
                runs: row.runs.len(),
                fps: 1.0 / row.wall_secs,
                wall_secs: row.wall_secs,
                wall_secs_sd: row.wall_secs_sd,
                cpu_secs: row.cpu_secs,
                rays_traced: rays.mixed + rays.real + rays.mixed_shadow + rays.real_shadow,
                mrays_per_sec: row.mrays_per_sec,
            })
        })
        .collect()
}

const HEADS: [&str; 10] = [
    "method",
    "device",
    "rays/px",
    "primary rays",
    "published fps",
    "fps",
    "wall s",
    "CPU s",
    "Mrays",
    "Mrays/s",
];

fn cells(row: &PaperRow) -> Vec<String> {
    let decimals = if row.wall_secs < 1.0 { 4 } else { 2 };
    vec![
        row.method.clone(),
        row.device.clone(),
        row.rays_per_pixel.to_string(),
        format!("{:.1} M", row.primary_rays as f64 / 1e6),
        row.published_fps.to_string(),
        format!("{:.3}", row.fps),
        format!(
            "{:.decimals$} ±{:.decimals$}",
            row.wall_secs, row.wall_secs_sd
        ),
        format!("{:.decimals$}", row.cpu_secs),
        format!("{:.2}", row.rays_traced as f64 / 1e6),
        format!("{:.2}", row.mrays_per_sec),
    ]
}

fn preamble(machine: &Machine, rows: &[PaperRow]) -> Vec<String> {
    let mut lines = vec![format!(
        "{}, {} threads, {}; {} runs a row in turns, after one untimed run of each method; ± is the standard deviation",
        machine.cpu,
        machine.threads,
        machine.os,
        rows.iter().map(|r| r.runs).min().unwrap_or(0)
    )];
    if let Some(gpu) = &machine.gpu {
        let kind = if gpu.hardware { "" } else { ", software" };
        lines.push(format!("GPU {}{kind}; driver {}", gpu.name, gpu.driver));
    }
    lines.push(
        "published: Kan and Kaufmann 2012, Table 1, 720 x 576, a GeForce GTX 590, their own scenes"
            .to_owned(),
    );
    lines
}

/// For a terminal.
pub fn paper_text(machine: &Machine, rows: &[PaperRow]) -> String {
    let mut all = vec![HEADS.map(str::to_owned).to_vec()];
    all.extend(rows.iter().map(cells));
    preamble(machine, rows).join("\n") + "\n" + &aligned(&all)
}

/// The same as Markdown, with the command.
pub fn paper_markdown(command: &str, machine: &Machine, rows: &[PaperRow]) -> String {
    let mut out = format!("    {command}\n\n");
    for line in preamble(machine, rows) {
        let _ = writeln!(out, "- {line}");
    }
    let _ = writeln!(out, "\n| {} |", HEADS.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(HEADS.len()));
    for row in rows {
        let _ = writeln!(out, "| {} |", cells(row).join(" | "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::test_support::report;

    #[test]
    fn the_scene_is_as_the_table_says() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("paper.toml");
        std::fs::write(&path, PAPER_SCENE).unwrap();
        let scene = crate::scene::load(&path).unwrap();
        assert_eq!((scene.camera.width, scene.camera.height), (720, 576));
        let instances = scene.objects.iter().flat_map(|o| &o.instances);
        let triangles: usize = instances.map(|i| i.primitive.triangles.len()).sum();
        assert!((95_000..105_000).contains(&triangles), "{triangles}");
        assert!(scene.lens.aperture_radius_m > 0.0 && scene.lights.len() == 1);
    }

    #[test]
    fn primary_rays_are_the_papers() {
        let mut row = report().rows.remove(0);
        (row.width, row.height, row.wall_secs) = (720, 576, 0.25);
        let of = |rays: u32| {
            let row = Row {
                rays_per_pixel: rays,
                ..row.clone()
            };
            paper_rows(&[row])
        };
        for (rays, millions, fps) in [(1, 0.4, 59.0), (25, 10.4, 12.0), (49, 20.3, 7.0)] {
            let rows = of(rays);
            assert!((rows[0].primary_rays as f64 / 1e6 - millions).abs() < 0.05);
            assert_eq!((rows[0].published_fps, rows[0].fps), (fps, 4.0));
        }
        assert!(of(2).is_empty(), "the paper gives no other");
    }
}
