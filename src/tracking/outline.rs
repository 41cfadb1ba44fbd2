//! Outlines of dark regions: a threshold by the mean around each pixel, then the cracks between dark and light pixels, followed once around.

use glam::DVec2;

use super::light::LightImage;

/// Dark is what has less than this share of the mean around it, ...
const DARK_SHARE: f32 = 0.9;
/// ... and this much less light besides, so that black noise is no pattern.
const LEAST_DIFFERENCE: f32 = 0.001;
/// Steps of an outline that can hold a marker.
const LEAST_STEPS: usize = 32;

/// Dark pixels in a frame of light ones, one pixel wide.
struct DarkMap {
    stride: usize,
    is_dark: Vec<bool>,
}

impl DarkMap {
    /// Against the mean of a square of 2 `radius` + 1 pixels.
    fn of(image: &LightImage, sums: &Sums, radius: usize) -> Self {
        let (width, height) = (image.width, image.height);
        let stride = width + 2;
        let mut is_dark = vec![false; stride * (height + 2)];
        // Columns whose squares lie inside the picture.
        let inner = radius.min(width)..width.saturating_sub(radius).max(radius.min(width));
        for y in 0..height {
            let rows = (y.saturating_sub(radius), (y + radius + 1).min(height));
            let line = &mut is_dark[(y + 1) * stride + 1..][..width];
            let values = &image.values[y * width..][..width];
            let edges = (0..inner.start).chain(inner.end..width);
            for x in edges {
                let columns = (x.saturating_sub(radius), (x + radius + 1).min(width));
                line[x] = darker(values[x], sums.mean(columns, rows));
            }
            let means = sums.means(2 * radius + 1, rows);
            let places = line[inner.clone()].iter_mut().zip(&values[inner.clone()]);
            for ((dark, value), mean) in places.zip(means) {
                *dark = darker(*value, mean);
            }
        }
        Self { stride, is_dark }
    }
}

fn darker(value: f32, mean: f32) -> bool {
    value < DARK_SHARE * mean - LEAST_DIFFERENCE
}

/// Sums over rectangles from the top left; they wrap around, differences of them do not.
pub struct Sums {
    stride: usize,
    sums: Vec<u32>,
}

const STEPS: f32 = 65_535.0;

impl Sums {
    pub fn of(image: &LightImage) -> Self {
        let stride = image.width + 1;
        let mut sums = vec![0_u32; stride * (image.height + 1)];
        for y in 0..image.height {
            let mut row = 0_u32;
            let (above, below) = sums[y * stride..].split_at_mut(stride);
            let values = &image.values[y * image.width..][..image.width];
            let places = below[1..stride].iter_mut().zip(&above[1..]);
            for ((sum, above), value) in places.zip(values) {
                row = row.wrapping_add((value * STEPS) as u32);
                *sum = above.wrapping_add(row);
            }
        }
        Self { stride, sums }
    }

    fn mean(&self, (x0, x1): (usize, usize), (y0, y1): (usize, usize)) -> f32 {
        let at = |x: usize, y: usize| self.sums[y * self.stride + x];
        let sum = at(x1, y1)
            .wrapping_add(at(x0, y0))
            .wrapping_sub(at(x1, y0))
            .wrapping_sub(at(x0, y1));
        sum as f32 / (STEPS * ((x1 - x0) * (y1 - y0)) as f32)
    }

    /// Of all rectangles of this width between two rows, from left to right.
    fn means(&self, width: usize, (y0, y1): (usize, usize)) -> impl Iterator<Item = f32> {
        let row = |y: usize| &self.sums[y * self.stride..][..self.stride];
        let (above, below) = (row(y0), row(y1));
        let right = above.iter().zip(below).skip(width);
        let all = STEPS * (width * (y1 - y0)) as f32;
        (above.iter().zip(below).zip(right)).map(move |((a0, b0), (a1, b1))| {
            let sum = b1.wrapping_add(*a0).wrapping_sub(*a1).wrapping_sub(*b0);
            sum as f32 / all
        })
    }
}

/// Closed outlines, clockwise in the picture, of dark regions that do not touch its border: middles of the cracks, pixels, corner origin. `sums`
/// are the picture's.
pub fn dark_outlines(image: &LightImage, sums: &Sums, radius: usize) -> Vec<Vec<DVec2>> {
    let map = DarkMap::of(image, sums, radius);
    let stride = map.stride;
    let mut followed = vec![false; map.is_dark.len()];
    let mut outlines = Vec::new();
    let longest = 4 * (image.width + image.height);
    // Most regions are grains of noise: their points need no room of their own.
    let mut points = Vec::new();
    let rows = map
        .is_dark
        .chunks_exact(stride)
        .zip(map.is_dark[stride..].chunks_exact(stride));
    for (row, (above, own)) in rows.enumerate() {
        for (column, (above, own)) in above.iter().zip(own).enumerate() {
            let start = (row + 1) * stride + column;
            if *above || !own || followed[start] {
                continue;
            }
            follow(&map, (column, row + 1), &mut followed, &mut points);
            let is_inside = |p: &DVec2| {
                p.x > 0.0 && p.y > 0.0 && p.x < image.width as f64 && p.y < image.height as f64
            };
            if (LEAST_STEPS..longest).contains(&points.len())
                && points.iter().all(is_inside)
                && area(&points) > 0.0
            {
                outlines.push(points.clone());
            }
        }
    }
    outlines
}

/// From the top of a pixel around its region, which lies to the right of the way; regions join along sides, not at corners.
fn follow(
    map: &DarkMap,
    (column, row): (usize, usize),
    followed: &mut [bool],
    points: &mut Vec<DVec2>,
) {
    // Right, down, left, up.
    const WAYS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
    let stride = map.stride as isize;
    let start = (row * map.stride + column) as isize;
    points.clear();
    // The vertex at the top left of pixel `at`, its place, and the way from it.
    let (mut at, mut way) = (start, 0_usize);
    let (mut x, mut y) = (column as isize - 1, row as isize - 1);
    loop {
        let (dx, dy) = WAYS[way];
        if way == 0 {
            followed[at as usize] = true;
        }
        points.push(DVec2::new((2 * x + dx) as f64, (2 * y + dy) as f64) * 0.5);
        at += dx + dy * stride;
        (x, y) = (x + dx, y + dy);
        let (right_ahead, left_ahead) = match way {
            0 => (at, at - stride),
            1 => (at - 1, at),
            2 => (at - 1 - stride, at - 1),
            _ => (at - stride, at - 1 - stride),
        };
        if !map.is_dark[right_ahead as usize] {
            way = (way + 1) % 4;
        } else if map.is_dark[left_ahead as usize] {
            way = (way + 3) % 4;
        }
        if at == start && way == 0 {
            return;
        }
    }
}

/// Of a closed polygon, above 0 where it runs clockwise in a picture.
pub fn area(points: &[DVec2]) -> f64 {
    let next = points.iter().cycle().skip(1);
    0.5 * points
        .iter()
        .zip(next)
        .map(|(a, b)| a.perp_dot(*b))
        .sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(dark: &[(usize, usize)]) -> LightImage {
        let mut values = vec![0.8; 40 * 30];
        for (x, y) in dark {
            values[y * 40 + x] = 0.05;
        }
        LightImage {
            width: 40,
            height: 30,
            values,
        }
    }

    fn outlines(image: &LightImage) -> Vec<Vec<DVec2>> {
        dark_outlines(image, &Sums::of(image), 12)
    }

    #[test]
    fn rows_of_means_are_the_means_one_by_one() {
        let mut image = picture(&[(3, 4), (20, 11)]);
        let values = image.values.iter_mut().enumerate();
        values.for_each(|(k, value)| *value = (k * 37 % 101) as f32 / 101.0);
        let sums = Sums::of(&image);
        let row: Vec<f32> = sums.means(9, (2, 11)).collect();
        assert_eq!(row.len(), 40 - 9 + 1);
        for (x, mean) in row.into_iter().enumerate() {
            assert_eq!(mean, sums.mean((x, x + 9), (2, 11)));
        }
        let of_both = DarkMap::of(&image, &sums, 8).is_dark;
        let alone = (0..30).flat_map(|y| (0..40).map(move |x| (x, y)));
        for (x, y) in alone {
            let columns = (usize::saturating_sub(x, 8), (x + 9).min(40));
            let rows = (usize::saturating_sub(y, 8), (y + 9).min(30));
            let dark = darker(image.values[y * 40 + x], sums.mean(columns, rows));
            assert_eq!(of_both[(y + 1) * 42 + x + 1], dark, "{x} {y}");
        }
    }

    #[test]
    fn an_outline_runs_once_around_at_the_cracks() {
        let square: Vec<_> = (10..20)
            .flat_map(|y| (12..24).map(move |x| (x, y)))
            .collect();
        let found = outlines(&picture(&square));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].len(), 2 * (12 + 10));
        let (least, most) =
            (found[0].iter()).fold((DVec2::MAX, DVec2::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
        assert_eq!(
            (least, most),
            (DVec2::new(12.0, 10.0), DVec2::new(24.0, 20.0))
        );
        assert!(area(&found[0]) > 115.0);
    }

    #[test]
    fn what_touches_the_border_or_is_a_hole_has_none() {
        let cut: Vec<_> = (0..20).flat_map(|y| (0..12).map(move |x| (x, y))).collect();
        assert!(outlines(&picture(&cut)).is_empty());
        let ring: Vec<_> = (5..25)
            .flat_map(|y| (8..30).map(move |x| (x, y)))
            .filter(|(x, y)| !((12..26).contains(x) && (9..21).contains(y)))
            .collect();
        assert_eq!(outlines(&picture(&ring)).len(), 1);
    }
}
