//! A photograph's own edges: straight, isolated, unclipped ones, each as its profile across, four bins a pixel.
//!
//! The slanted-edge method of ISO 12233, at whatever edges a picture has: a line is fitted to the centroids of the gradient, row by row, and all pixels
//! near it are sorted by their distance from it. In linear light.

use rayon::prelude::*;

/// Half of a window's side, pixels: how far an edge has to be straight.
const HALF: i32 = 10;
/// From one window to the next, pixels.
const STRIDE: i32 = 8;
/// Furthest distance from the edge that is looked at, pixels.
const FAR: i32 = 9;
/// Bins a pixel.
pub(super) const FINE: i32 = 4;
/// Bins of a profile, from -[`FAR`] to [`FAR`] pixels.
pub const BINS: usize = (2 * FAR * FINE) as usize;
/// From this distance on an edge has to be over, pixels.
const PLATEAU: f64 = 5.5;
/// Smallest step, linear.
const LEAST_CONTRAST: f64 = 0.03;
/// Largest deviation of a row's centroid from the line, root mean square, pixels.
const CROOKED_PX: f64 = 0.5;
/// Largest deviation on the sides, in steps.
const UNEVEN: f64 = 0.15;
/// Slope of a normal distribution's edge at 10% of the step, over the mean slope from there to 50%.
const SLOPE_AT_TENTH: f64 = 0.56;
/// Linear values from here on may be clipped.
const CLIPPED: f32 = 0.97;

/// An edge of a photograph.
#[derive(Clone, Debug)]
pub struct Edge {
    /// Pixels, from the picture's top left corner.
    pub centre_px: [f64; 2],
    /// Unit, from dark to bright.
    pub normal: [f64; 2],
    /// By channel: 0 on the dark side, 1 on the bright one; bin i is at [`distance_px`] of i from where green is 0.5.
    pub profiles: [[f64; BINS]; 3],
    /// From 10% to 90% of green's step, pixels.
    pub spread_px: f64,
    /// Standard deviation of that: as far as what is uneven on both sides moves the crossings.
    pub spread_error_px: f64,
    /// By channel: distance of its half from that of green, along the normal, pixels.
    pub shift_px: [f64; 3],
}

/// Distance of a bin's middle from the edge, pixels.
pub fn distance_px(bin: usize) -> f64 {
    (bin as f64 + 0.5) / f64::from(FINE) - f64::from(FAR)
}

/// The edges of a linear picture, row-major from the top left.
pub fn edges_of(linear: &[[f32; 3]], (width, height): (u32, u32)) -> Vec<Edge> {
    let picture = Pixels {
        linear,
        width: width as i32,
        height: height as i32,
    };
    let margin = HALF + FAR;
    let rows = (margin..picture.height - margin).into_par_iter();
    rows.filter(|y| (y - margin) % STRIDE == 0)
        .flat_map_iter(|y| {
            let columns = (margin..picture.width - margin).step_by(STRIDE as usize);
            columns.filter_map(move |x| picture.edge_near(x, y))
        })
        .collect()
}

#[derive(Clone, Copy)]
struct Pixels<'a> {
    linear: &'a [[f32; 3]],
    width: i32,
    height: i32,
}

/// x = at + slope y about the window's centre; of a picture with x and y exchanged where the edge lies.
#[derive(Clone, Copy)]
struct Line {
    is_upright: bool,
    at: f64,
    slope: f64,
    /// 1 where the bright side is that of larger x, else -1.
    sign: f64,
}

impl Line {
    fn normal(&self) -> [f64; 2] {
        let scale = self.sign / self.slope.hypot(1.0);
        let (across, along) = (scale, -scale * self.slope);
        if self.is_upright {
            [across, along]
        } else {
            [along, across]
        }
    }
}

impl Pixels<'_> {
    fn at(&self, x: i32, y: i32) -> [f32; 3] {
        self.linear[(y * self.width + x) as usize]
    }

    /// Sobel's, of green.
    fn gradient(&self, x: i32, y: i32) -> [f64; 2] {
        let green = |dx: i32, dy: i32| f64::from(self.at(x + dx, y + dy)[1]);
        let gx = green(1, -1) - green(-1, -1) + 2.0 * (green(1, 0) - green(-1, 0)) + green(1, 1)
            - green(-1, 1);
        let gy = green(-1, 1) - green(-1, -1) + 2.0 * (green(0, 1) - green(0, -1)) + green(1, 1)
            - green(1, -1);
        [gx / 8.0, gy / 8.0]
    }

    /// The edge through the window about that pixel, if there is one and nothing else.
    fn edge_near(&self, x: i32, y: i32) -> Option<Edge> {
        let mut line = self.rough_line(x, y)?;
        for _ in 0..2 {
            line = self.refined(x, y, line)?;
        }
        // The window that has it in its middle takes it.
        let near = f64::from(STRIDE) / 2.0;
        if !(-near..near).contains(&line.at) {
            return None;
        }
        self.sampled(x, y, line)
    }

    /// From the structure tensor.
    fn rough_line(&self, x: i32, y: i32) -> Option<Line> {
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        let (mut sum, mut sum_x, mut sum_y) = ([0.0; 2], 0.0, 0.0);
        for dy in -HALF..=HALF {
            for dx in -HALF..=HALF {
                let [gx, gy] = self.gradient(x + dx, y + dy);
                xx += gx * gx;
                xy += gx * gy;
                yy += gy * gy;
                sum = [sum[0] + gx, sum[1] + gy];
                let weight = gx * gx + gy * gy;
                sum_x += weight * f64::from(dx);
                sum_y += weight * f64::from(dy);
            }
        }
        let all = xx + yy;
        let one_way = (xx - yy).hypot(2.0 * xy);
        // An edge across the window has squares of (step / width)^2 over its width and length.
        let least = LEAST_CONTRAST * LEAST_CONTRAST / 8.0 * f64::from(2 * HALF);
        if all < least || one_way < 0.8 * all {
            return None;
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let (nx, ny) = (angle.cos(), angle.sin());
        let (px, py) = (sum_x / all, sum_y / all);
        let is_upright = nx.abs() >= ny.abs();
        let (across, along, step) = if is_upright {
            (nx, ny, sum[0])
        } else {
            (ny, nx, sum[1])
        };
        let slope = -along / across;
        let (p, q) = if is_upright { (px, py) } else { (py, px) };
        Some(Line {
            is_upright,
            at: p - slope * q,
            slope,
            sign: step.signum(),
        })
    }

    /// By least squares through the centroids of the gradient, row by row.
    fn refined(&self, x: i32, y: i32, line: Line) -> Option<Line> {
        let reach = 5;
        let mut points = Vec::with_capacity(2 * HALF as usize + 1);
        for row in -HALF..=HALF {
            let guess = (line.at + line.slope * f64::from(row)).round() as i32;
            if guess.abs() > HALF {
                continue;
            }
            let (mut sum, mut moment) = (0.0, 0.0);
            for column in guess - reach..=guess + reach {
                let (dx, dy) = if line.is_upright {
                    (column, row)
                } else {
                    (row, column)
                };
                let [gx, gy] = self.gradient(x + dx, y + dy);
                let across = line.sign * if line.is_upright { gx } else { gy };
                sum += across;
                moment += across * f64::from(column);
            }
            if sum <= 0.0 {
                return None;
            }
            points.push((f64::from(row), moment / sum));
        }
        if points.len() < 3 * HALF as usize / 2 {
            return None;
        }
        let n = points.len() as f64;
        let mean = |value: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / n;
        let (row, column) = (mean(&|p| p.0), mean(&|p| p.1));
        let spread = mean(&|p| (p.0 - row).powi(2));
        let slope = mean(&|p| (p.0 - row) * (p.1 - column)) / spread;
        let at = column - slope * row;
        let crooked = mean(&|p| (p.1 - at - slope * p.0).powi(2)).sqrt();
        (crooked < CROOKED_PX).then_some(Line { at, slope, ..line })
    }

    fn sampled(&self, x: i32, y: i32, line: Line) -> Option<Edge> {
        let normal = line.normal();
        let offset = if line.is_upright {
            [line.at, 0.0]
        } else {
            [0.0, line.at]
        };
        let mut sums = [[0.0f64; 3]; BINS];
        let mut counts = [0u32; BINS];
        let around = HALF + FAR;
        for dy in -around..=around {
            for dx in -around..=around {
                let from = [f64::from(dx) - offset[0], f64::from(dy) - offset[1]];
                let across = from[0] * normal[0] + from[1] * normal[1];
                let along = from[1] * normal[0] - from[0] * normal[1];
                let bin = ((across + f64::from(FAR)) * f64::from(FINE)).floor();
                if along.abs() > f64::from(HALF) || !(0.0..BINS as f64).contains(&bin) {
                    continue;
                }
                if !(0..self.width).contains(&(x + dx)) || !(0..self.height).contains(&(y + dy)) {
                    return None;
                }
                let value = self.at(x + dx, y + dy);
                if value[1] <= 0.0 || value.iter().any(|v| *v >= CLIPPED) {
                    return None;
                }
                counts[bin as usize] += 1;
                for (sum, value) in sums[bin as usize].iter_mut().zip(value) {
                    *sum += f64::from(value);
                }
            }
        }
        // At some angles the pixels' distances leave bins empty.
        if counts.contains(&0) {
            return None;
        }
        let profiles = [0, 1, 2].map(|c| {
            let means = std::array::from_fn(|bin| sums[bin][c] / f64::from(counts[bin]));
            // The other channels' steps may be small and their noise large.
            normalised(means, if c == 1 { UNEVEN } else { 3.0 * UNEVEN })
        });
        let [Some((red, _)), Some((green, uneven)), Some((blue, _))] = profiles else {
            return None;
        };
        let halves = [red, green, blue].map(|profile| crossing(&profile, 0.5));
        let [Some(red_half), Some(half), Some(blue_half)] = halves else {
            return None;
        };
        let (tenth, rest) = (crossing(&green, 0.1)?, crossing(&green, 0.9)?);
        let spread_px = rest - tenth;
        let steepness = SLOPE_AT_TENTH * 0.4;
        let spread_error_px = uneven / steepness * (half - tenth).hypot(rest - half);
        if half.abs() > 1.0 {
            return None;
        }
        Some(Edge {
            centre_px: [
                f64::from(x) + 0.5 + offset[0],
                f64::from(y) + 0.5 + offset[1],
            ],
            normal,
            profiles: [red, green, blue].map(|profile| shifted(&profile, half)),
            spread_px,
            spread_error_px,
            shift_px: [red_half - half, 0.0, blue_half - half],
        })
    }
}

/// From 0 to 1, if there is a step, and its sides deviate by no more than `uneven` steps; and by how many they do.
fn normalised(profile: [f64; BINS], uneven: f64) -> Option<([f64; BINS], f64)> {
    let side = |wanted: &dyn Fn(f64) -> bool| {
        let values: Vec<f64> = (0..BINS)
            .filter(|bin| wanted(distance_px(*bin)))
            .map(|bin| profile[bin])
            .collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        (mean, spread.sqrt())
    };
    let (dark, dark_spread) = side(&|d| d < -PLATEAU);
    let (bright, bright_spread) = side(&|d| d > PLATEAU);
    let step = bright - dark;
    let spread = dark_spread.max(bright_spread);
    let is_edge = step > 0.5 * LEAST_CONTRAST && spread < uneven * step;
    is_edge.then(|| (profile.map(|value| (value - dark) / step), spread / step))
}

/// Where a profile passes `level`, from the middle outwards, pixels.
pub(super) fn crossing(profile: &[f64; BINS], level: f64) -> Option<f64> {
    let middle = BINS / 2;
    let passes = |bin: usize| profile[bin] <= level && profile[bin + 1] > level;
    let nearest = (0..middle).find_map(|off| {
        let below = middle - 1 - off;
        let above = (middle - 1 + off).min(BINS - 2);
        [below, above].into_iter().find(|bin| passes(*bin))
    })?;
    let (low, high) = (profile[nearest], profile[nearest + 1]);
    Some(distance_px(nearest) + (level - low) / (high - low) / f64::from(FINE))
}

/// Moved so that what was at `by` pixels is at 0; linear between bins.
fn shifted(profile: &[f64; BINS], by: f64) -> [f64; BINS] {
    std::array::from_fn(|bin| {
        let at = (bin as f64 + by * f64::from(FINE)).clamp(0.0, (BINS - 1) as f64);
        let low = (at as usize).min(BINS - 2);
        profile[low] + (at - low as f64) * (profile[low + 1] - profile[low])
    })
}
