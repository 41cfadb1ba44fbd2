//! What follows from the rows together: slopes, and what a method needs for an error.

use crate::bench::{Method, Reach, Report, Row, Target, cost_to_reach, log_log_slope};

/// Slopes and targets from the rows.
pub(super) fn conclude(report: &mut Report, target_rmse: Option<f64>) {
    report.slopes.clear();
    report.targets.clear();
    let mut lines: Vec<(&str, Method)> = Vec::new();
    for row in report.rows.iter().filter(|r| r.method.goal.is_none()) {
        let line = (row.scene.as_str(), row.method);
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    for (scene, method) in lines {
        let rows: Vec<&Row> = report
            .rows
            .iter()
            .filter(|r| r.scene == scene && r.method == method)
            .collect();
        let points = |x: fn(&Row) -> f64| -> Vec<(f64, f64)> {
            let pairs = rows.iter().map(|row| (x(row), row.errors.all.rmse));
            pairs.collect()
        };
        let by_rays = points(|r| f64::from(r.rays_per_pixel));
        if let Some(slope) = log_log_slope(&by_rays) {
            let name = format!("{scene} {}", method.label());
            report.slopes.insert(name, slope);
        }
        if let Some(rmse) = target_rmse {
            let reach = |points: &[(f64, f64)]| -> Reach { cost_to_reach(points, rmse) };
            report.targets.push(Target {
                scene: scene.to_owned(),
                method,
                rmse,
                wall_secs: reach(&points(|r| r.wall_secs)),
                cpu_secs: reach(&points(|r| r.cpu_secs)),
                rays_per_pixel: reach(&by_rays),
            });
        }
    }
}
