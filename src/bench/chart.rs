//! Lines through points, log over log: SVG and PNG.

use std::sync::Once;

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

use super::pictures::png;

/// DejaVu Sans (font/LICENSE), so that no font of the system is needed.
static FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");
const FONT_NAME: &str = "sans-serif";

const WIDTH: u32 = 800;
const HEIGHT: u32 = 520;
/// Pixels of the PNG for one of the SVG, and again as many are averaged for smooth lines.
const PNG_SCALE: u32 = 2;
const SMOOTHING: u32 = 2;

/// Colours that colour-blind readers tell apart (Okabe and Ito, 2008).
pub(super) const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
    RGBColor(160, 160, 40),
];

/// A straight line to compare with.
pub(super) struct Guide {
    pub label: String,
    pub ends: [(f64, f64); 2],
}

/// Where the names of the lines stand.
#[derive(Clone, Copy)]
pub(super) enum Legend {
    UpperLeft,
    UpperRight,
}

/// Base-10 logarithms throughout.
pub(super) struct Chart {
    pub title: String,
    pub x_label: String,
    pub y_label: String,
    pub x_ticks: Vec<f64>,
    pub x_range: (f64, f64),
    pub y_range: (f64, f64),
    pub lines: Vec<(String, Vec<(f64, f64)>)>,
    pub guide: Option<Guide>,
    pub legend: Legend,
}

impl Chart {
    /// As SVG and as PNG.
    pub(super) fn render(&self) -> Result<(String, Vec<u8>), String> {
        static REGISTERED: Once = Once::new();
        let mut usable = true;
        REGISTERED.call_once(|| {
            usable = register_font(FONT_NAME, FontStyle::Normal, FONT).is_ok();
        });
        if !usable {
            return Err("its font cannot be used".to_owned());
        }
        let mut svg = String::new();
        self.draw(SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)), 1)
            .map_err(|e| e.to_string())?;

        let fine = PNG_SCALE * SMOOTHING;
        let (width, height) = (WIDTH * fine, HEIGHT * fine);
        let mut pixels = vec![255u8; width as usize * height as usize * 3];
        self.draw(
            BitMapBackend::with_buffer(&mut pixels, (width, height)),
            fine,
        )
        .map_err(|e| e.to_string())?;
        let smooth = average(&pixels, width as usize, SMOOTHING as usize);
        let png = png(&smooth, WIDTH * PNG_SCALE, HEIGHT * PNG_SCALE).map_err(|e| e.to_string())?;
        Ok((svg, png))
    }

    /// `scale`: pixels of this backend for one of the SVG.
    fn draw<B: DrawingBackend>(
        &self,
        backend: B,
        scale: u32,
    ) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let font = |px: u32| (FONT_NAME, px * scale);
        let y_ticks = ticks(self.y_range);
        let area = backend.into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .caption(&self.title, font(18))
            .margin(10 * scale)
            .x_label_area_size(42 * scale)
            .y_label_area_size(64 * scale)
            .build_cartesian_2d(
                LogAxis::new(self.x_range, &self.x_ticks),
                LogAxis::new(self.y_range, &y_ticks),
            )?;
        chart
            .configure_mesh()
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_labels(self.x_ticks.len().max(2))
            .y_labels(y_ticks.len().max(2))
            .x_label_formatter(&|x| tick_label(*x))
            .y_label_formatter(&|y| tick_label(*y))
            .bold_line_style(RGBColor(225, 225, 225).stroke_width(scale))
            .light_line_style(TRANSPARENT)
            .label_style(font(13))
            .axis_desc_style(font(14))
            .draw()?;
        if let Some(guide) = &self.guide {
            let style = RGBColor(150, 150, 150).stroke_width(scale);
            let size = 5 * scale;
            chart
                .draw_series(DashedLineSeries::new(guide.ends, size, size, style))?
                .label(&guide.label)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 18 * scale as i32, y)], style)
                });
        }
        for (number, (label, points)) in self.lines.iter().enumerate() {
            let colour = COLOURS[number % COLOURS.len()];
            let style = colour.stroke_width(2 * scale);
            chart
                .draw_series(LineSeries::new(points.iter().copied(), style))?
                .label(label)
                .legend(move |(x, y)| {
                    PathElement::new([(x, y), (x + 18 * scale as i32, y)], style)
                });
            let dots = points
                .iter()
                .map(|point| Circle::new(*point, 4 * scale, colour.filled()));
            chart.draw_series(dots)?;
        }
        chart
            .configure_series_labels()
            .position(match self.legend {
                Legend::UpperLeft => SeriesLabelPosition::UpperLeft,
                Legend::UpperRight => SeriesLabelPosition::UpperRight,
            })
            .margin(8 * scale)
            .legend_area_size(24 * scale)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200).stroke_width(scale))
            .label_font(font(13))
            .draw()?;
        area.present()
    }
}

/// An axis of logarithms with lines just where the ticks are.
struct LogAxis {
    range: (f64, f64),
    ticks: Vec<f64>,
}

impl LogAxis {
    fn new(range: (f64, f64), ticks: &[f64]) -> Self {
        let ticks = ticks.to_vec();
        Self { range, ticks }
    }
}

impl Ranged for LogAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value - self.range.0) / (self.range.1 - self.range.0);
        limit.0 + (f64::from(limit.1 - limit.0) * share).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.range.0..self.range.1
    }
}

/// The values that are there, ascending.
pub(super) fn ticks_at(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut ticks: Vec<f64> = values.collect();
    ticks.sort_by(f64::total_cmp);
    ticks.dedup();
    ticks
}

/// A little more than the values span; `None` of none.
pub(super) fn padded(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    let pad = (0.06 * (high - low)).max(0.05);
    low.is_finite().then_some((low - pad, high + pad))
}

/// Where 1, 2 and 5 times powers of ten lie, thinned to powers of ten where those are many.
pub(super) fn ticks(range: (f64, f64)) -> Vec<f64> {
    let digits: &[f64] = match range.1 - range.0 {
        span if span < 0.4 => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        span if span < 4.0 => &[1.0, 2.0, 5.0],
        _ => &[1.0],
    };
    let decades = range.0.floor() as i32..=range.1.floor() as i32;
    decades
        .flat_map(|decade| digits.iter().map(move |d| d.log10() + f64::from(decade)))
        .filter(|tick| (range.0..=range.1).contains(tick))
        .collect()
}

/// 10 to the `log`, short.
fn tick_label(log: f64) -> String {
    let value = 10f64.powf(log);
    if !(1e-3..1e5).contains(&value) {
        return format!("{value:.1e}").replace(".0e", "e");
    }
    let decimals = (2.0 - log).floor().clamp(0.0, 5.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// Means of `side` x `side` pixels, RGB.
fn average(pixels: &[u8], width: usize, side: usize) -> Vec<u8> {
    let height = pixels.len() / 3 / width;
    let mut out = Vec::with_capacity(pixels.len() / (side * side));
    for y in 0..height / side {
        for x in 0..width / side {
            for c in 0..3 {
                let sum: usize = (0..side * side)
                    .map(|i| {
                        let (row, column) = (y * side + i / side, x * side + i % side);
                        usize::from(pixels[3 * (row * width + column) + c])
                    })
                    .sum();
                out.push(((sum + side * side / 2) / (side * side)) as u8);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        let values = |range: (f64, f64)| -> Vec<String> {
            ticks((range.0.log10(), range.1.log10()))
                .into_iter()
                .map(tick_label)
                .collect()
        };
        assert_eq!(values((0.004, 0.06)), ["0.005", "0.01", "0.02", "0.05"]);
        assert_eq!(values((0.9, 260.0)).join(" "), "1 2 5 10 20 50 100 200");
        assert_eq!(values((1e-6, 0.2)).last().unwrap(), "0.1");
        assert_eq!(values((1.1e-4, 2.4e-4)), ["1.5e-4", "2e-4"]);
        assert_eq!(values((1.1, 1.9)), ["1.5"]);
        assert_eq!(tick_label(49f64.log10()), "49");
    }
}
