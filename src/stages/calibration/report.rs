//! The calibration as a page: the paper's figures 3, 12 and 13, drawn as inline SVG.

use std::fmt::Write as _;

use super::Calibration;
use crate::stages::settings::NoiseProfile;

const COLORS: [&str; 3] = ["#c33", "#2a2", "#33c"];
const NAMES: [&str; 3] = ["red", "green", "blue"];

/// Width and height of a plot's frame, and its left and bottom margins, in SVG units.
const PLOT: (f64, f64) = (300.0, 180.0);
const MARGIN: (f64, f64) = (46.0, 34.0);

/// A page without scripts or other files.
pub fn report_html(calibration: &Calibration) -> String {
    let profile = &calibration.profile;
    let mut out = String::from(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Camera noise</title>\n\
         <style>body{font:14px sans-serif;max-width:1100px;margin:2em auto}table{border-collapse:collapse}\
         td,th{padding:2px 8px;text-align:right;border-bottom:1px solid #ddd}svg{margin:4px}</style>\n\
         <h1>Camera noise</h1><p>Unit: DN, 8-bit codes of the encoded picture. Rounding to codes is taken out of every sigma.</p><ul>\n",
    );
    for line in profile.sources.iter().chain(&calibration.notes) {
        let _ = writeln!(out, "<li>{}</li>", escaped(line));
    }
    out += "</ul>\n<h2>Standard deviation by intensity</h2>\n";
    for (c, name) in NAMES.iter().enumerate() {
        out += &sigma_plot(profile, c, name);
    }
    out += "<p>Bars: the bins, with their 95% confidence intervals; pale bars are filled from their neighbours. Line: the fit \
            sigma&sup2; = a y + b.</p>\n";
    out += &table(profile);
    out += "<h2>Channel variations</h2><p>Bars: how often each variation occurred; line: the normal distribution of the measured mean and \
            sigma, rounded to codes.</p>\n";
    for (bin, histograms) in calibration.histograms.iter().enumerate() {
        let counted: u64 = histograms.iter().flatten().sum();
        if counted == 0 {
            continue;
        }
        let _ = writeln!(
            out,
            "<h3>Intensity {} to {}</h3>",
            bin * 256 / profile.bins.len(),
            (bin + 1) * 256 / profile.bins.len()
        );
        for (c, histogram) in histograms.iter().enumerate() {
            out += &histogram_plot(
                histogram,
                profile.bins[bin].mean[c],
                profile.bins[bin].sigma[c],
                c,
            );
        }
    }
    out += "<h2>Correlation</h2>\n";
    for (c, name) in NAMES.iter().enumerate() {
        let _ = writeln!(out, "<h3>{name}</h3><table><tr><th></th>");
        for dx in -3..=3 {
            let _ = write!(out, "<th>dx {dx}</th>");
        }
        for (dy, row) in profile.autocorrelation[c].iter().enumerate() {
            let _ = write!(out, "</tr>\n<tr><th>dy {dy}</th>");
            for rho in row {
                let _ = write!(out, "<td>{rho:.3}</td>");
            }
        }
        out += "</tr></table>\n";
    }
    let [rg, rb, gb] = profile.channel_correlation;
    let _ = writeln!(
        out,
        "<p>Between channels in one pixel: red-green {rg:.3}, red-blue {rb:.3}, green-blue {gb:.3}.</p></html>"
    );
    out
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

fn table(profile: &NoiseProfile) -> String {
    let mut out = String::from(
        "<table><tr><th>intensity</th><th>channel</th><th>mean</th><th>sigma</th><th>95%</th><th>values</th><th></th></tr>\n",
    );
    for (index, bin) in profile.bins.iter().enumerate() {
        for (c, name) in NAMES.iter().enumerate() {
            let _ = writeln!(
                out,
                "<tr><td>{} to {}</td><td>{name}</td><td>{:.3}</td><td>{:.3}</td><td>{:.3} to {:.3}</td><td>{}</td><td>{}</td></tr>",
                index * 256 / profile.bins.len(),
                (index + 1) * 256 / profile.bins.len(),
                bin.mean[c],
                bin.sigma[c],
                bin.low[c],
                bin.high[c],
                bin.samples[c],
                if bin.filled[c] { "filled" } else { "" }
            );
        }
    }
    for (c, name) in NAMES.iter().enumerate() {
        let fit = profile.fit[c];
        let _ = writeln!(
            out,
            "<tr><td>fit</td><td>{name}</td><td colspan=\"5\">sigma&sup2; = {:.5} y + {:.4}</td></tr>",
            fit.a, fit.b
        );
    }
    out + "</table>\n"
}

/// An SVG frame with a title and the ends of both axes; `body` is drawn in 0..1 by 0..1, y up.
fn plot(title: &str, x_ends: [&str; 2], y_top: &str, body: &str) -> String {
    let (width, height) = PLOT;
    let (left, bottom) = MARGIN;
    format!(
        "<svg width=\"{w}\" height=\"{h}\" font-size=\"11\"><text x=\"{left}\" y=\"12\">{title}</text>\
         <g transform=\"translate({left},{floor}) scale({width},-{height})\">{body}</g>\
         <path d=\"M{left} 18V{floor}H{right}\" fill=\"none\" stroke=\"#000\"/>\
         <text x=\"{left}\" y=\"{low}\">{x0}</text><text x=\"{right}\" y=\"{low}\" text-anchor=\"end\">{x1}</text>\
         <text x=\"{beside}\" y=\"26\" text-anchor=\"end\">{y_top}</text><text x=\"{beside}\" y=\"{floor}\" text-anchor=\"end\">0</text></svg>\n",
        w = left + width + 8.0,
        h = 18.0 + height + bottom,
        floor = 18.0 + height,
        right = left + width,
        low = 18.0 + height + 14.0,
        beside = left - 4.0,
        x0 = x_ends[0],
        x1 = x_ends[1],
    )
}

/// Figures 12 and 13.
fn sigma_plot(profile: &NoiseProfile, c: usize, name: &str) -> String {
    let count = profile.bins.len() as f64;
    let top = profile
        .bins
        .iter()
        .map(|bin| bin.high[c])
        .fold(0.0, f64::max)
        * 1.1;
    let top = if top > 0.0 { top } else { 1.0 };
    let mut body = String::new();
    for (index, bin) in profile.bins.iter().enumerate() {
        let x = index as f64 / count;
        let opacity = if bin.filled[c] { 0.15 } else { 0.6 };
        let _ = write!(
            body,
            "<rect x=\"{:.4}\" y=\"0\" width=\"{:.4}\" height=\"{:.4}\" fill=\"{}\" fill-opacity=\"{opacity}\"/>\
             <path d=\"M{:.4} {:.4}V{:.4}\" stroke=\"#000\" stroke-width=\"0.004\"/>",
            x + 0.1 / count,
            0.8 / count,
            bin.sigma[c] / top,
            COLORS[c],
            x + 0.5 / count,
            bin.low[c] / top,
            bin.high[c] / top
        );
    }
    let points: Vec<String> = (0..=64)
        .map(|i| {
            let x = f64::from(i) / 64.0;
            let sigma = profile.fit[c].variance(255.0 * x).sqrt();
            format!("{x:.4},{:.4}", (sigma / top).min(1.0))
        })
        .collect();
    let _ = write!(
        body,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#000\" stroke-width=\"0.005\"/>",
        points.join(" ")
    );
    plot(
        &format!("{name}: sigma"),
        ["intensity 0", "255"],
        &format!("{top:.2}"),
        &body,
    )
}

/// Figure 3.
fn histogram_plot(histogram: &[u64], mean: f64, sigma: f64, c: usize) -> String {
    let total = histogram.iter().sum::<u64>().max(1) as f64;
    // What rounding adds belongs to the counted codes.
    let shown_sigma = (sigma * sigma + 1.0 / 12.0).sqrt();
    let reach = (4.0 * shown_sigma).ceil().clamp(3.0, 255.0);
    let density = |v: f64| {
        let z = (v - mean) / shown_sigma;
        (-0.5 * z * z).exp() / (shown_sigma * std::f64::consts::TAU.sqrt())
    };
    let entry = |v: f64| histogram[(v + 255.0) as usize] as f64 / total;
    let steps = reach as i32;
    let top = (-steps..=steps)
        .map(|v| entry(f64::from(v)))
        .fold(density(mean), f64::max)
        * 1.05;
    let width = 1.0 / (2.0 * reach + 1.0);
    let mut body = String::new();
    for v in -steps..=steps {
        let v = f64::from(v);
        let _ = write!(
            body,
            "<rect x=\"{:.4}\" y=\"0\" width=\"{:.4}\" height=\"{:.4}\" fill=\"{}\" fill-opacity=\"0.5\"/>",
            (v + reach) * width,
            width,
            entry(v) / top,
            COLORS[c]
        );
    }
    let points: Vec<String> = (0..=120)
        .map(|i| {
            let x = f64::from(i) / 120.0;
            let v = (x / width) - reach - 0.5;
            format!("{x:.4},{:.4}", density(v) / top)
        })
        .collect();
    let _ = write!(
        body,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#000\" stroke-width=\"0.005\"/>",
        points.join(" ")
    );
    plot(
        &format!("{}: variation, DN", NAMES[c]),
        [&format!("-{reach}"), &format!("{reach}")],
        &format!("{:.1}%", 100.0 * top),
        &body,
    )
}
