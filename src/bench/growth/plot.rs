//! Seconds against work, log over log, a line a method.

use super::{Curve, Law};
use crate::bench::chart::{Chart, Guide, Legend, padded, ticks_at};
use crate::scene::Choice;

/// Decades that the seconds span at least: a flat line shall look flat.
const LEAST_DECADES: f64 = 2.0;

/// SVG and PNG of one law's curves; `None` of none.
///
/// # Errors
/// If the drawing library refuses, which it should not.
pub fn growth_plot(law: Law, curves: &[Curve]) -> Option<Result<(String, Vec<u8>), String>> {
    let curves: Vec<&Curve> = curves.iter().filter(|c| c.law == law).collect();
    chart(law, &curves).map(|chart| chart.render())
}

fn chart(law: Law, curves: &[&Curve]) -> Option<Chart> {
    let lines: Vec<(String, Vec<(f64, f64)>)> = curves
        .iter()
        .map(|curve| {
            let label = match &curve.exponent {
                Some(fit) => format!("{}: exponent {:.2}", curve.method, fit.slope),
                None => curve.method.clone(),
            };
            let points = curve.points.iter();
            let logs = points.map(|p| ((p.work as f64).log10(), p.secs.log10()));
            (label, logs.collect())
        })
        .collect();
    let points = || lines.iter().flat_map(|(_, points)| points);
    let x_range = padded(points().map(|p| p.0))?;
    let (low, high) = padded(points().map(|p| p.1))?;
    let more = (0.5 * (LEAST_DECADES - (high - low))).max(0.0);
    let (_, steepest) = law.expected();
    let lowest = points()
        .map(|p| p.1 - steepest * p.0)
        .fold(f64::MAX, f64::min);
    let by_wall = curves.iter().any(|curve| curve.cost == "wall");
    Some(Chart {
        title: format!("{}: {} against {}", law.name(), law.timed(), law.unit()),
        x_label: law.unit().to_owned(),
        y_label: if by_wall {
            "seconds (GPU: on the clock)"
        } else {
            "processor seconds"
        }
        .to_owned(),
        x_ticks: ticks_at(points().map(|p| p.0)),
        x_range,
        y_range: (low - more, high + more),
        guide: Some(Guide {
            label: format!("slope {steepest}: expected at most"),
            ends: [x_range.0, x_range.1].map(|x| (x, lowest + steepest * x)),
        }),
        lines,
        legend: Legend::UpperLeft,
    })
}

#[cfg(test)]
mod tests {
    use super::super::test_support::curve;
    use super::*;

    #[test]
    fn a_law_has_its_curves_and_no_others() {
        let curves = [curve(Law::Objects, 0.1), curve(Law::Lights, 0.02)];
        let (svg, png) = growth_plot(Law::Objects, &curves).unwrap().unwrap();
        assert!(svg.contains("exponent 0.10") && svg.contains("virtual objects"));
        assert!(
            !svg.contains("exponent 0.02"),
            "control: another law's curve"
        );
        assert!(image::load_from_memory(&png).is_ok());
        assert!(growth_plot(Law::Build, &curves).is_none());
    }
}
