//! The report as one HTML page that needs no other file.

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::ImageResult;
use pulldown_cmark::html::push_html;
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use super::{Axis, Plot, Report, Shot, Truth, difference_png, markdown, picture_png};
use crate::scene::Composite;

const STYLE: &str = "
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 1700px; padding: 0 1.5em; color: #222; background: #fff; }
h1 { font-size: 1.5em; } h2 { font-size: 1.2em; margin-top: 2em; border-top: 1px solid #ddd; padding-top: 1em; }
pre { background: #f4f4f4; padding: .7em 1em; overflow-x: auto; }
table { border-collapse: collapse; } th, td { padding: .25em .7em; text-align: right; white-space: nowrap; }
table.figures { font-size: 13px; } table.figures tr:nth-child(even) { background: #f6f6f6; }
th:nth-child(-n+2), td:nth-child(-n+2) { text-align: left; }
.scroll { overflow-x: auto; }
.plots { display: flex; flex-wrap: wrap; gap: 1em; } .plots svg { flex: 1 1 560px; max-width: 800px; height: auto; border: 1px solid #ddd; }
.pictures td { text-align: center; vertical-align: top; font-size: 13px; }
.pictures img { display: block; image-rendering: pixelated; width: 320px; }
";

/// The page. `shots` and `truths` (by scene and composite) are the pictures to show; a difference is shown with one gain a scene.
///
/// # Errors
/// If a picture cannot be encoded.
pub fn page(
    report: &Report,
    plots: &[Plot],
    shots: &[Shot],
    truths: &[(String, Composite, Truth)],
) -> ImageResult<String> {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>mixray bench</title>\n<style>{STYLE}</style></head><body>\n<h1>mixray: error against time</h1>\n"
    );
    out += &from_markdown(&markdown(report));
    let mut scenes: Vec<&str> = report.rows.iter().map(|r| r.scene.as_str()).collect();
    scenes.dedup();
    for scene in scenes {
        let _ = writeln!(out, "<h2>{}</h2>\n<div class=\"plots\">", escaped(scene));
        for plot in plots.iter().filter(|p| p.scene == scene) {
            // An XML declaration, if any, has no place inside a page.
            let start = plot.svg.find("<svg").unwrap_or(0);
            let label = match plot.axis {
                Axis::Secs => "error against time",
                Axis::RaysPerPixel => "error against rays per pixel",
            };
            let svg = scalable(&plot.svg[start..]);
            let _ = writeln!(out, "<!-- {label} -->{svg}");
        }
        out += "</div>\n";
        let of_scene: Vec<&Shot> = shots.iter().filter(|s| s.scene == scene).collect();
        out += &pictures(scene, &of_scene, truths)?;
    }
    out += "</body></html>\n";
    Ok(out)
}

/// A row a method, a column a number of rays; in each cell the picture over its difference.
fn pictures(
    scene: &str,
    shots: &[&Shot],
    truths: &[(String, Composite, Truth)],
) -> ImageResult<String> {
    let truth_of = |composite: Composite| {
        let found = truths
            .iter()
            .find(|(name, of, _)| name == scene && *of == composite);
        found.map(|(.., truth)| truth)
    };
    let mut levels: Vec<u32> = shots.iter().map(|s| s.rays_per_pixel).collect();
    levels.sort_unstable();
    levels.dedup();
    // A goal's limit is no number of rays that anything took.
    let by_rays: Vec<&Shot> = (shots.iter().copied())
        .filter(|s| s.method.goal.is_none())
        .collect();
    let mut counts: Vec<u32> = by_rays.iter().map(|s| s.rays_per_pixel).collect();
    counts.sort_unstable();
    counts.dedup();
    let gain = gain(&by_rays, counts.get(counts.len() / 2).copied(), &truth_of);
    let mut out = format!(
        "<p>Pictures of each method's first run, and under each the difference from the reference times {gain} about grey: brighter is too bright.</p>\n<div class=\"scroll\"><table class=\"pictures\">\n"
    );
    let mut shown_reference = Vec::new();
    let mut rows: Vec<super::Method> = Vec::new();
    for shot in shots {
        if !rows.contains(&shot.method) {
            rows.push(shot.method);
        }
    }
    for method in rows {
        let Some(truth) = truth_of(method.composite) else {
            continue;
        };
        if !shown_reference.contains(&method.composite) {
            shown_reference.push(method.composite);
            let png = inline(&picture_png(&truth.picture)?);
            let _ = writeln!(out, "<tr><td>reference<br>{png}</td></tr>");
        }
        out += "<tr>";
        for level in &levels {
            let shot = shots
                .iter()
                .find(|s| s.method == method && s.rays_per_pixel == *level);
            let Some(shot) = shot else {
                out += "<td></td>";
                continue;
            };
            let picture = inline(&picture_png(&shot.picture)?);
            let difference = inline(&difference_png(&shot.picture, &truth.picture, gain)?);
            let at_most = match method.goal {
                Some(_) => "at most ",
                None => "",
            };
            let _ = write!(
                out,
                "<td>{}, {at_most}{level} rays per pixel<br>{picture}{difference}</td>",
                escaped(&method.label())
            );
        }
        out += "</tr>\n";
    }
    out += "</table></div>\n";
    Ok(out)
}

/// A power of two that shows the root mean square error at `level` rays per pixel as about an eighth of the range.
fn gain<'a>(
    shots: &[&Shot],
    level: Option<u32>,
    truth_of: &dyn Fn(Composite) -> Option<&'a Truth>,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for shot in shots.iter().filter(|s| Some(s.rays_per_pixel) == level) {
        let Some(truth) = truth_of(shot.method.composite) else {
            continue;
        };
        let pairs = shot.picture.linear.as_flattened().iter();
        for (test, reference) in pairs.zip(truth.picture.linear.as_flattened()) {
            sum += f64::from(test - reference).powi(2);
            count += 1;
        }
    }
    let rms = (sum / count.max(1) as f64).sqrt();
    if rms > 0.0 {
        (0.125 / rms).log2().round().exp2()
    } else {
        1.0
    }
}

/// An SVG that scales with its column: the size becomes the view box.
fn scalable(svg: &str) -> String {
    let end = svg.find('>').unwrap_or(0);
    let (head, rest) = svg.split_at(end);
    if head.contains("viewBox") {
        let without_size: Vec<&str> = head
            .split(' ')
            .filter(|part| !part.starts_with("width=") && !part.starts_with("height="))
            .collect();
        return without_size.join(" ") + rest;
    }
    svg.to_owned()
}

fn inline(png: &[u8]) -> String {
    format!(
        "<img alt=\"\" src=\"data:image/png;base64,{}\">",
        STANDARD.encode(png)
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// As HTML; what looks like HTML in it is text.
fn from_markdown(text: &str) -> String {
    let events = Parser::new_ext(text, Options::ENABLE_TABLES).map(|event| match event {
        Event::Html(text) | Event::InlineHtml(text) => Event::Text(text),
        Event::Start(Tag::Table(_)) => {
            Event::Html("<div class=\"scroll\"><table class=\"figures\">".into())
        }
        Event::End(TagEnd::Table) => Event::Html("</tbody></table></div>\n".into()),
        event => event,
    });
    let mut out = String::new();
    push_html(&mut out, events);
    out
}

#[cfg(test)]
mod tests;
