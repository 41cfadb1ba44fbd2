//! Error against time and against rays per pixel, log over log, a line a method: SVG and PNG.

use super::chart::{Chart, Guide, Legend, padded, ticks, ticks_at};
use super::{Report, Row};

/// What stands along the bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    Secs,
    RaysPerPixel,
}

/// A finished plot.
#[derive(Clone, Debug)]
pub struct Plot {
    pub scene: String,
    pub axis: Axis,
    pub svg: String,
    pub png: Vec<u8>,
}

#[derive(Debug, thiserror::Error)]
#[error("the plot of {scene} cannot be drawn: {reason}")]
pub struct PlotError {
    scene: String,
    reason: String,
}

/// Two plots a scene; a scene without a single error above 0 has none.
///
/// # Errors
/// If the drawing library refuses, which it should not.
pub fn plots(report: &Report) -> Result<Vec<Plot>, PlotError> {
    let mut scenes: Vec<&str> = report.rows.iter().map(|r| r.scene.as_str()).collect();
    scenes.dedup();
    let mut plots = Vec::new();
    for scene in scenes {
        // A row with a goal is no point of a line.
        let by_rays = report.rows.iter().filter(|r| r.method.goal.is_none());
        let rows: Vec<&Row> = by_rays.filter(|r| r.scene == scene).collect();
        for axis in [Axis::Secs, Axis::RaysPerPixel] {
            if let Some(chart) = chart_of(&rows, axis) {
                let (svg, png) = chart.render().map_err(|reason| PlotError {
                    scene: scene.to_owned(),
                    reason,
                })?;
                let scene = scene.to_owned();
                plots.push(Plot {
                    scene,
                    axis,
                    svg,
                    png,
                });
            }
        }
    }
    Ok(plots)
}

/// Without a point above 0 there is none.
fn chart_of(rows: &[&Row], axis: Axis) -> Option<Chart> {
    let first = rows.first()?;
    let by_wall = rows.iter().any(|r| r.cost == "wall");
    let x_of = |row: &Row| match axis {
        Axis::RaysPerPixel => f64::from(row.rays_per_pixel),
        Axis::Secs if by_wall => row.wall_secs,
        Axis::Secs => row.cpu_secs,
    };
    let mut lines: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for row in rows {
        let (x, y) = (x_of(row), row.errors.all.rmse);
        if x <= 0.0 || y <= 0.0 {
            continue;
        }
        let (label, point) = (row.method.label(), (x.log10(), y.log10()));
        match lines.iter_mut().find(|(known, _)| *known == label) {
            Some((_, points)) => points.push(point),
            None => lines.push((label, vec![point])),
        }
    }
    let points = || lines.iter().flat_map(|(_, points)| points);
    let x_range = padded(points().map(|p| p.0))?;
    let y_range = padded(points().map(|p| p.1))?;
    let x_ticks = match axis {
        Axis::RaysPerPixel => ticks_at(points().map(|p| p.0)),
        Axis::Secs => ticks(x_range),
    };
    let guide = (axis == Axis::RaysPerPixel).then(|| {
        let top = points().map(|p| p.1 + 0.5 * p.0).fold(f64::MIN, f64::max);
        Guide {
            label: "slope -1/2: independent samples".to_owned(),
            ends: [x_range.0, x_range.1].map(|x| (x, top - 0.5 * x)),
        }
    });
    Some(Chart {
        title: format!("{}, {} x {}", first.scene, first.width, first.height),
        x_label: match axis {
            Axis::RaysPerPixel => "rays per pixel".to_owned(),
            Axis::Secs if by_wall => format!("seconds on the clock, {}", first.device),
            Axis::Secs => "processor seconds, all threads".to_owned(),
        },
        x_ticks,
        y_label: "RMSE, linear".to_owned(),
        x_range,
        y_range,
        lines,
        guide,
        legend: Legend::UpperRight,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::chart::COLOURS;
    use crate::bench::record::test_support::report;

    #[test]
    fn every_method_has_its_line() {
        let mut report = report();
        report.rows[1].rays_per_pixel = 16;
        let plots = plots(&report).unwrap();
        assert_eq!(plots.len(), 2);
        for plot in &plots {
            assert!(plot.svg.contains("cpu direct sobol"), "the legend");
            assert!(plot.svg.contains("cpu paper jittered"));
            let image = image::load_from_memory(&plot.png).unwrap().into_rgb8();
            assert_eq!(image.dimensions(), (1600, 1040));
            for colour in &COLOURS[..2] {
                let shown = image
                    .pixels()
                    .any(|p| p.0 == [colour.0, colour.1, colour.2]);
                assert!(shown, "{colour:?}");
            }
            let third = COLOURS[2];
            let shown = image.pixels().any(|p| p.0 == [third.0, third.1, third.2]);
            assert!(!shown, "control: there is no third method");
        }
        report.rows.iter_mut().for_each(|r| r.errors.all.rmse = 0.0);
        assert!(super::plots(&report).unwrap().is_empty());
    }
}
