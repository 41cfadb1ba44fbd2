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
    fn of(image: &LightImage, radius: usize) -> Self {
        let (width, height) = (image.width, image.height);
        let sums = Sums::of(image);
        let stride = width + 2;
        let mut is_dark = vec![false; stride * (height + 2)];
        for y in 0..height {
            let rows = (y.saturating_sub(radius), (y + radius + 1).min(height));
            let line = &mut is_dark[(y + 1) * stride + 1..][..width];
            let values = &image.values[y * width..][..width];
            for (x, (dark, value)) in line.iter_mut().zip(values).enumerate() {
                let columns = (x.saturating_sub(radius), (x + radius + 1).min(width));
                let mean = sums.mean(columns, rows);
                *dark = *value < DARK_SHARE * mean - LEAST_DIFFERENCE;
            }
        }
        Self { stride, is_dark }
    }
}

/// Sums over rectangles from the top left; they wrap around, differences of them do not.
struct Sums {
    stride: usize,
    sums: Vec<u32>,
}

const STEPS: f32 = 65_535.0;

impl Sums {
    fn of(image: &LightImage) -> Self {
        let stride = image.width + 1;
        let mut sums = vec![0_u32; stride * (image.height + 1)];
        for y in 0..image.height {
            let mut row = 0_u32;
            for x in 0..image.width {
                row = row.wrapping_add((image.values[y * image.width + x] * STEPS) as u32);
                let above = sums[y * stride + x + 1];
                sums[(y + 1) * stride + x + 1] = above.wrapping_add(row);
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
}

/// Closed outlines, clockwise in the picture, of dark regions that do not touch its border: middles of the cracks, pixels, corner origin.
pub fn dark_outlines(image: &LightImage, radius: usize) -> Vec<Vec<DVec2>> {
    let map = DarkMap::of(image, radius);
    let stride = map.stride;
    let mut followed = vec![false; map.is_dark.len()];
    let mut outlines = Vec::new();
    let longest = 4 * (image.width + image.height);
    for start in stride..map.is_dark.len() - stride {
        let has_top = map.is_dark[start] && !map.is_dark[start - stride];
        if !has_top || followed[start] {
            continue;
        }
        let points = follow(&map, start, &mut followed);
        let is_inside = points.iter().all(|p| {
            p.x > 0.0 && p.y > 0.0 && p.x < image.width as f64 && p.y < image.height as f64
        });
        if (LEAST_STEPS..longest).contains(&points.len()) && is_inside && area(&points) > 0.0 {
            outlines.push(points);
        }
    }
    outlines
}

/// From the top of a pixel around its region, which lies to the right of the way; regions join along sides, not at corners.
fn follow(map: &DarkMap, start: usize, followed: &mut [bool]) -> Vec<DVec2> {
    // Right, down, left, up.
    const WAYS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
    let stride = map.stride as isize;
    let mut points = Vec::new();
    // The vertex at the top left of pixel `at`, and the way from it.
    let (mut at, mut way) = (start as isize, 0_usize);
    loop {
        let (dx, dy) = WAYS[way];
        if way == 0 {
            followed[at as usize] = true;
        }
        let vertex = DVec2::new((at % stride) as f64 - 1.0, (at / stride) as f64 - 1.0);
        points.push(vertex + 0.5 * DVec2::new(dx as f64, dy as f64));
        at += dx + dy * stride;
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
        if at == start as isize && way == 0 {
            return points;
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

    #[test]
    fn an_outline_runs_once_around_at_the_cracks() {
        let square: Vec<_> = (10..20)
            .flat_map(|y| (12..24).map(move |x| (x, y)))
            .collect();
        let found = dark_outlines(&picture(&square), 12);
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
        assert!(dark_outlines(&picture(&cut), 12).is_empty());
        let ring: Vec<_> = (5..25)
            .flat_map(|y| (8..30).map(move |x| (x, y)))
            .filter(|(x, y)| !((12..26).contains(x) && (9..21).contains(y)))
            .collect();
        assert_eq!(dark_outlines(&picture(&ring), 12).len(), 1);
    }
}
