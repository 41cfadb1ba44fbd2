//! Straight edges of a picture: regions of pixels whose gradients agree, as by the LSD of Grompone von Gioi et al. (2010), here without its
//! test against chance, which the search for vanishing points makes for all of them together.

use glam::DVec2;

/// Luminance codes, 0 to 255, row-major from the top left.
#[derive(Clone, Debug)]
pub struct Grey {
    pub width: usize,
    pub height: usize,
    pub codes: Vec<f32>,
}

/// An edge between two places, pixels, corner origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    pub from: DVec2,
    pub to: DVec2,
}

/// How far a pixel's gradient may turn from its region's, radians.
const TOLERANCE: f64 = 22.5 * std::f64::consts::PI / 180.0;
/// Straight regions are this thin: spread of their gradients' weight across, pixels rms.
const MOST_SPREAD_PX: f64 = 1.2;
/// Pixels of a region per pixel of its length, so that it has no gaps.
const LEAST_DENSITY: f64 = 0.8;
/// Of the diagonal.
const LEAST_LENGTH: f64 = 0.02;

impl Segment {
    pub fn length(self) -> f64 {
        self.from.distance(self.to)
    }
}

impl Grey {
    /// Bilinear between pixel centres, the border's value beyond. Pixels, corner origin.
    pub fn at(&self, place: DVec2) -> f64 {
        let x = (place.x - 0.5).clamp(0.0, self.width as f64 - 1.001);
        let y = (place.y - 0.5).clamp(0.0, self.height as f64 - 1.001);
        let (column, row) = (x as usize, y as usize);
        let (a, b) = (x - column as f64, y - row as f64);
        let code = |column: usize, row: usize| f64::from(self.codes[row * self.width + column]);
        let upper = code(column, row) * (1.0 - a) + code(column + 1, row) * a;
        let lower = code(column, row + 1) * (1.0 - a) + code(column + 1, row + 1) * a;
        upper * (1.0 - b) + lower * b
    }

    /// Smoothed by 1 4 6 4 1 along both axes: edges of 8-bit pictures are coarse.
    fn smoothed(&self) -> Self {
        let (width, height) = (self.width, self.height);
        let pass = |codes: &[f32], along_x: bool| -> Vec<f32> {
            let at = |x: usize, y: usize, d: i64| {
                let clamp =
                    |v: usize, most: usize| (v as i64 + d).clamp(0, most as i64 - 1) as usize;
                match along_x {
                    true => codes[y * width + clamp(x, width)],
                    false => codes[clamp(y, height) * width + x],
                }
            };
            (0..width * height)
                .map(|i| {
                    let (x, y) = (i % width, i / width);
                    let outer = at(x, y, -2) + at(x, y, 2);
                    let inner = at(x, y, -1) + at(x, y, 1);
                    (outer + 4.0 * inner + 6.0 * at(x, y, 0)) / 16.0
                })
                .collect()
        };
        Self {
            codes: pass(&pass(&self.codes, true), false),
            ..*self
        }
    }
}

/// Central differences.
struct Gradients {
    width: usize,
    height: usize,
    vectors: Vec<DVec2>,
}

impl Gradients {
    fn of(grey: &Grey) -> Self {
        let (width, height) = (grey.width, grey.height);
        let mut vectors = vec![DVec2::ZERO; width * height];
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let at = |x: usize, y: usize| f64::from(grey.codes[y * width + x]);
                let across = at(x + 1, y) - at(x - 1, y);
                let down = at(x, y + 1) - at(x, y - 1);
                vectors[y * width + x] = 0.5 * DVec2::new(across, down);
            }
        }
        Self {
            width,
            height,
            vectors,
        }
    }

    fn place(&self, pixel: usize) -> DVec2 {
        DVec2::new(
            (pixel % self.width) as f64 + 0.5,
            (pixel / self.width) as f64 + 0.5,
        )
    }

    /// All that touch each other from `seed` on and whose gradients agree with their mean.
    fn grow(&self, seed: usize, taken: &mut [bool]) -> Vec<usize> {
        let mut region = vec![seed];
        taken[seed] = true;
        let mut sum = self.vectors[seed].normalize();
        let least = TOLERANCE.cos();
        let mut next = 0;
        while next < region.len() {
            let (x, y) = (region[next] % self.width, region[next] / self.width);
            next += 1;
            for (nx, ny) in (x.max(1) - 1..(x + 2).min(self.width))
                .flat_map(|nx| (y.max(1) - 1..(y + 2).min(self.height)).map(move |ny| (nx, ny)))
            {
                let pixel = ny * self.width + nx;
                let vector = self.vectors[pixel];
                if !taken[pixel] && vector.dot(sum) > least * vector.length() * sum.length() {
                    taken[pixel] = true;
                    region.push(pixel);
                    sum += vector.normalize();
                }
            }
        }
        region
    }

    /// The line through a region by the weight of its gradients, and the spread across it.
    fn fit(&self, region: &[usize]) -> (Segment, f64) {
        let weighted = || {
            let weight = |pixel: &usize| (self.place(*pixel), self.vectors[*pixel].length());
            region.iter().map(weight)
        };
        let total: f64 = weighted().map(|(_, w)| w).sum();
        let mean = weighted().map(|(p, w)| p * w).sum::<DVec2>() / total;
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (p, w) in weighted() {
            let d = p - mean;
            xx += w * d.x * d.x;
            xy += w * d.x * d.y;
            yy += w * d.y * d.y;
        }
        let direction = DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy));
        let along = |pixel: &usize| (self.place(*pixel) - mean).dot(direction);
        let low = region.iter().map(along).fold(f64::INFINITY, f64::min);
        let high = region.iter().map(along).fold(f64::NEG_INFINITY, f64::max);
        let across: f64 = weighted()
            .map(|(p, w)| w * (p - mean).perp_dot(direction).powi(2))
            .sum();
        let segment = Segment {
            from: mean + low * direction,
            to: mean + high * direction,
        };
        (segment, (across / total).sqrt())
    }

    /// The straight part of a region about its seed, the first; `None`: there is none of `least_px`.
    fn straight(&self, mut region: Vec<usize>, least_px: f64) -> Option<Segment> {
        let seed = self.place(region[0]);
        loop {
            if (region.len() as f64) < least_px {
                return None;
            }
            let (segment, spread) = self.fit(&region);
            let length = segment.length();
            if length < least_px {
                return None;
            }
            if spread <= MOST_SPREAD_PX && region.len() as f64 >= LEAST_DENSITY * length {
                return Some(segment);
            }
            let reach = segment.from.distance(seed).max(segment.to.distance(seed));
            region.retain(|pixel| self.place(*pixel).distance(seed) < 0.75 * reach);
        }
    }
}

/// The straight edges of a picture, the longest first, where codes change by `edge` a pixel and more.
pub fn segments(grey: &Grey, edge: f32) -> Vec<Segment> {
    if grey.width < 3 || grey.height < 3 {
        return Vec::new();
    }
    let gradients = Gradients::of(&grey.smoothed());
    let strength: Vec<f32> = (gradients.vectors.iter())
        .map(|vector| vector.length() as f32)
        .collect();
    let mut taken: Vec<bool> = strength.iter().map(|s| *s < edge).collect();
    let mut order: Vec<usize> = (0..taken.len()).filter(|pixel| !taken[*pixel]).collect();
    order.sort_by(|a, b| strength[*b].total_cmp(&strength[*a]));
    let least_px = LEAST_LENGTH * (grey.width as f64).hypot(grey.height as f64);
    let mut found = Vec::new();
    for seed in order {
        if !taken[seed] {
            let region = gradients.grow(seed, &mut taken);
            found.extend(gradients.straight(region, least_px));
        }
    }
    found.sort_by(|a: &Segment, b| b.length().total_cmp(&a.length()));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dark square, turned, smooth at its edges.
    fn square(turn: f64) -> Grey {
        let axis = DVec2::from_angle(turn);
        let codes = (0..120 * 100).map(|i| {
            let at = DVec2::new(f64::from(i % 120) + 0.5, f64::from(i / 120) + 0.5);
            let d = at - DVec2::new(60.0, 50.0);
            let (u, v) = (d.dot(axis), d.perp_dot(axis));
            let inside = |x: f64| (30.0 - x.abs() + 0.5).clamp(0.0, 1.0);
            (200.0 - 150.0 * inside(u) * inside(v)) as f32
        });
        Grey {
            width: 120,
            height: 100,
            codes: codes.collect(),
        }
    }

    #[test]
    fn the_sides_of_a_square_are_found_to_a_fraction_of_a_pixel() {
        for turn in [0.0, 0.2, 0.6] {
            let mut found = segments(&square(turn), 5.0);
            // Corners, rounded by the smoothing, make short ones.
            found.retain(|segment| segment.length() > 20.0);
            assert_eq!(found.len(), 4, "{turn}");
            let axis = DVec2::from_angle(turn);
            for segment in found {
                let d = 0.5 * (segment.from + segment.to) - DVec2::new(60.0, 50.0);
                let (u, v) = (d.dot(axis).abs(), d.perp_dot(axis).abs());
                assert!((u.max(v) - 30.0).abs() < 0.15, "{segment:?} {u} {v}");
                let lean = (segment.to - segment.from).normalize().dot(axis).abs();
                let off = lean.min((1.0 - lean * lean).max(0.0).sqrt());
                assert!(off < 0.005, "{off}");
                assert!((segment.length() - 60.0).abs() < 5.0);
            }
        }
    }

    #[test]
    fn discs_and_flat_pictures_have_no_long_edges() {
        let disc = (0..120 * 100).map(|i| {
            let at = DVec2::new(f64::from(i % 120) - 60.0, f64::from(i / 120) - 50.0);
            (100.0 + 100.0 * (30.0 - at.length()).clamp(-0.5, 0.5)) as f32
        });
        let grey = |codes: Vec<f32>| Grey {
            width: 120,
            height: 100,
            codes,
        };
        let longest = |grey: &Grey| segments(grey, 5.0).first().map_or(0.0, |s| s.length());
        assert!(longest(&grey(disc.collect())) < 30.0);
        assert_eq!(longest(&grey(vec![90.0; 12000])), 0.0);
        assert!(longest(&square(0.3)) > 50.0, "control");
    }
}
