//! What the window shows of a film: the picture, or one of its planes in false colours.

use glam::Vec4;
use rayon::prelude::*;

use crate::film::{Picture, Planes};
use crate::output::code8;
use crate::scene::srgb::encode8;
use crate::scene::{Camera, Choice, Lens, Photo};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum View {
    /// As it is delivered.
    #[default]
    Picture,
    Photograph,
    /// The real world without the virtual one, as it is modelled.
    Real,
    /// Both worlds, as they are modelled.
    Mixed,
    /// Mixed less real, grey where it is 0.
    Difference,
    Mask,
    /// The nearer the brighter.
    Depth,
    Normal,
    /// Its square root, ten times as bright.
    Variance,
    /// What lies in focus is green: its circle of confusion is smaller than a pixel and a half.
    Focus,
}

impl Choice for View {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("picture", Self::Picture),
        ("photograph", Self::Photograph),
        ("real", Self::Real),
        ("mixed", Self::Mixed),
        ("difference", Self::Difference),
        ("mask", Self::Mask),
        ("depth", Self::Depth),
        ("normal", Self::Normal),
        ("variance", Self::Variance),
        ("focus", Self::Focus),
    ];
}

impl View {
    /// The real radiance is traced everywhere for it.
    pub fn needs_real(self) -> bool {
        matches!(self, Self::Real | Self::Mixed)
    }

    pub fn needs_planes(self) -> bool {
        !matches!(self, Self::Picture | Self::Photograph)
    }
}

/// Radius in pixels within which a thing counts as sharp.
const SHARP_PX: f64 = 0.75;

/// Diameter of the circle of confusion of a point at `depth_m` along the view axis, pixels.
pub fn confusion_px(lens: &Lens, camera: &Camera, depth_m: f64) -> f64 {
    let defocus = match (depth_m.is_finite(), lens.focus_distance_m.is_finite()) {
        (true, true) => (1.0 / depth_m - 1.0 / lens.focus_distance_m).abs(),
        (true, false) => 1.0 / depth_m,
        (false, true) => 1.0 / lens.focus_distance_m,
        (false, false) => 0.0,
    };
    2.0 * lens.aperture_radius_m * defocus * camera.fx
}

/// Codes of a plane in false colours, row-major; `picture` and `planes` are of one size.
pub fn false_colours(
    view: View,
    picture: &Picture,
    planes: &Planes,
    lens: &Lens,
    camera: &Camera,
) -> Vec<[u8; 3]> {
    let rgb = |colour: [f32; 3]| colour.map(encode8);
    let grey = |value: f32| [encode8(value); 3];
    let each = |f: &(dyn Fn(usize) -> [u8; 3] + Sync)| -> Vec<[u8; 3]> {
        (0..picture.linear.len()).into_par_iter().map(f).collect()
    };
    match view {
        View::Picture | View::Photograph => each(&|i| rgb(picture.linear[i])),
        View::Real => each(&|i| rgb(planes.real[i])),
        View::Mixed => each(&|i| rgb(planes.mixed[i])),
        View::Difference => each(&|i| rgb(planes.difference[i].map(|d| 0.2 + d))),
        View::Mask => each(&|i| grey(planes.mask[i])),
        View::Variance => each(&|i| rgb(planes.variance[i].map(|v| 10.0 * v.max(0.0).sqrt()))),
        View::Normal => each(&|i| {
            let code = |x: f32| ((0.5 + 0.5 * x) * 255.0).round() as u8;
            planes.normal.get(i).map_or([0; 3], |n| n.map(code))
        }),
        View::Depth => {
            let known = || {
                planes
                    .depth
                    .iter()
                    .copied()
                    .filter(|d| d.is_finite() && *d > 0.0)
            };
            let near = known().fold(f32::INFINITY, f32::min);
            let far = known().fold(near, f32::max);
            let span = (1.0 / near - 1.0 / far).max(f32::MIN_POSITIVE);
            each(&|i| match planes.depth.get(i) {
                Some(depth) if depth.is_finite() && *depth > 0.0 => {
                    grey(0.02 + 0.98 * ((1.0 / depth - 1.0 / far) / span))
                }
                _ => [0; 3],
            })
        }
        View::Focus => each(&|i| {
            let [r, g, b] = picture.linear[i];
            let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            let depth = planes.depth.get(i).map_or(f64::INFINITY, |d| f64::from(*d));
            match confusion_px(lens, camera, depth) < 2.0 * SHARP_PX && depth.is_finite() {
                true => rgb([0.3 * luminance, 0.25 + 0.75 * luminance, 0.3 * luminance]),
                false => grey(0.6 * luminance),
            }
        }),
    }
}

/// Codes of a small picture over the whole photograph: what was added is enlarged, the photograph stays sharp.
///
/// `mask` is the small picture's virtual share, `small_photo` the photograph that it was composited over.
pub fn over_photo(
    small: &Picture,
    mask: &[f32],
    small_photo: Option<&Photo>,
    photo: Option<&Photo>,
    size: [u32; 2],
) -> Vec<[u8; 3]> {
    let [width, height] = size;
    // What is added, premultiplied, and how much of the photograph it hides.
    let layer: Vec<Vec4> = (0..small.linear.len())
        .map(|i| {
            let ic = small_photo.map_or([0.0; 3], |photo| photo.linear[i]);
            let [r, g, b] = [0, 1, 2].map(|c| small.linear[i][c] - ic[c] * (1.0 - mask[i]));
            Vec4::new(r, g, b, mask[i])
        })
        .collect();
    let (small_width, small_height) = (small.width as usize, small.height as usize);
    let step_x = small.width as f32 / width as f32;
    let step_y = small.height as f32 / height as f32;
    // The two neighbours of a position and the weight of the second.
    let neighbours = |at: f32, count: usize| {
        let at = (at - 0.5).clamp(0.0, (count - 1) as f32);
        let first = at as usize;
        (first, (first + 1).min(count - 1), at - first as f32)
    };
    let between = |a: Vec4, b: Vec4, share: f32| a * (1.0 - share) + b * share;
    let columns: Vec<_> = (0..width)
        .map(|x| neighbours((x as f32 + 0.5) * step_x, small_width))
        .collect();
    let code = code8(photo);
    let mut codes = vec![[0; 3]; width as usize * height as usize];
    (codes.par_chunks_mut(width as usize).enumerate()).for_each(|(y, row)| {
        let (y0, y1, v) = neighbours((y as f32 + 0.5) * step_y, small_height);
        let of_row = |y: usize| &layer[y * small_width..][..small_width];
        let pairs = of_row(y0).iter().zip(of_row(y1));
        let small: Vec<Vec4> = pairs.map(|(a, b)| between(*a, *b, v)).collect();
        for ((x, pixel), &(x0, x1, u)) in row.iter_mut().enumerate().zip(&columns) {
            let [r, g, b, a] = between(small[x0], small[x1], u).to_array();
            let at = y * width as usize + x;
            let ic = photo.map_or([0.0; 3], |photo| photo.linear[at]);
            let [r, g, b] = [(r, ic[0]), (g, ic[1]), (b, ic[2])].map(|(x, ic)| x + ic * (1.0 - a));
            *pixel = code(at, [r, g, b]);
        }
    });
    codes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Aperture, Distortion};

    #[test]
    fn a_point_in_focus_has_no_circle() {
        let camera = Camera {
            width: 640,
            height: 480,
            fx: 1000.0,
            fy: 1000.0,
            cx: 320.0,
            cy: 240.0,
            distortion: Distortion::NONE,
            world_from_camera: glam::DMat4::IDENTITY,
        };
        let lens = Lens {
            aperture_radius_m: 0.01,
            focus_distance_m: 2.0,
            aperture: Aperture::Disc,
            blade_rotation_deg: 0.0,
            focal_length_m: 0.0,
        };
        assert_eq!(confusion_px(&lens, &camera, 2.0), 0.0);
        // 2 r |z - f| / (z f) fx
        assert!((confusion_px(&lens, &camera, 4.0) - 5.0).abs() < 1e-12);
        assert!((confusion_px(&lens, &camera, f64::INFINITY) - 10.0).abs() < 1e-12);
    }

    #[test]
    fn the_photograph_stays_sharp_where_nothing_was_added() {
        let codes: Vec<[u8; 3]> = (0..64_u8)
            .map(|i| [i * 3, 255 - i, (i * 31) % 255])
            .collect();
        let photo = Photo::from_srgb8(8, 8, codes.clone());
        let small_photo = Photo::from_srgb8(2, 2, vec![[9, 9, 9]; 4]);
        let mut small = Picture {
            width: 2,
            height: 2,
            linear: small_photo.linear.clone(),
        };
        let shown = |small: &Picture, mask: &[f32]| {
            over_photo(small, mask, Some(&small_photo), Some(&photo), [8, 8])
        };
        assert_eq!(shown(&small, &[0.0; 4]), codes);
        small.linear[3] = [1.0; 3];
        let covered = shown(&small, &[0.0, 0.0, 0.0, 1.0]);
        assert_eq!(covered[63], [255; 3]);
        assert_eq!(covered[0], codes[0]);
        assert_ne!(covered[36], codes[36], "in between");
    }
}
