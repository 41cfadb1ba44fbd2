//! The light around a photograph: as the part of a lat-long panorama that it shows, its edges extended over the rest.

use glam::{DVec2, DVec3};

use crate::film::Picture;
use crate::math::luminance;
use crate::scene::projection::project;
use crate::scene::{Camera, Photo};

const WIDTH: usize = 512;
const HEIGHT: usize = 256;
/// Of the sum of all directions over the ground that a panorama lights: the reflectance of what a photograph shows, as a mean.
pub const GUESSED_ALBEDO: f64 = 0.4;
/// The unseen sky is this much brighter than the picture's extension at most, and by as much darker at least.
const MOST_GAIN: f64 = 16.0;

/// A panorama, and what was guessed for it.
pub struct Panorama {
    pub picture: Picture,
    /// On the radiance of what the photograph does not show above the horizon.
    pub gain: f64,
}

/// Direction of a texel's centre, world space; the centre column is -Z.
fn direction(x: usize, y: usize) -> DVec3 {
    let azimuth = ((x as f64 + 0.5) / WIDTH as f64 - 0.5) * std::f64::consts::TAU;
    let polar = (y as f64 + 0.5) / HEIGHT as f64 * std::f64::consts::PI;
    let (sin, cos) = polar.sin_cos();
    DVec3::new(sin * azimuth.sin(), cos, -sin * azimuth.cos())
}

/// Solid angle of a texel of a row, steradians.
fn solid_angle(y: usize) -> f64 {
    let edge = |y: usize| (y as f64 / HEIGHT as f64 * std::f64::consts::PI).cos();
    (edge(y) - edge(y + 1)) * std::f64::consts::TAU / WIDTH as f64
}

/// The panorama of a lookup by direction, which is extended to where it knows nothing.
pub fn gather(look_up: impl Fn(DVec3) -> Option<[f32; 3]>) -> (Picture, Vec<bool>) {
    let texels: Vec<Option<[f32; 3]>> = (0..WIDTH * HEIGHT)
        .map(|i| look_up(direction(i % WIDTH, i / WIDTH)))
        .collect();
    let known = texels.iter().map(Option::is_some).collect();
    let picture = Picture {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        linear: extended(WIDTH, &texels),
    };
    (picture, known)
}

/// Unknown texels take the mean of their neighbourhood, which grows until it knows something (pull-push, Gortler et al. 1996).
fn extended(width: usize, texels: &[Option<[f32; 3]>]) -> Vec<[f32; 3]> {
    let height = texels.len() / width;
    if width < 2 || height < 2 {
        let known: Vec<[f32; 3]> = texels.iter().flatten().copied().collect();
        let mean = mean(&known).unwrap_or_default();
        return texels.iter().map(|texel| texel.unwrap_or(mean)).collect();
    }
    let (half_width, half_height) = (width / 2, height / 2);
    let halved: Vec<Option<[f32; 3]>> = (0..half_width * half_height)
        .map(|i| {
            let (x, y) = (2 * (i % half_width), 2 * (i / half_width));
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)];
            let known: Vec<[f32; 3]> = (four.iter())
                .filter_map(|(dx, dy)| texels[(y + dy) * width + x + dx])
                .collect();
            mean(&known)
        })
        .collect();
    let coarse = extended(half_width, &halved);
    let bilinear = |x: usize, y: usize| {
        let (u, v) = (0.5 * x as f64 - 0.25, 0.5 * y as f64 - 0.25);
        let (fu, fv) = (u - u.floor(), v - v.floor());
        let column = |dx: i64| (u.floor() as i64 + dx).rem_euclid(half_width as i64) as usize;
        let row = |dy: i64| (v.floor() as i64 + dy).clamp(0, half_height as i64 - 1) as usize;
        std::array::from_fn(|channel| {
            let at = |dx, dy| f64::from(coarse[row(dy) * half_width + column(dx)][channel]);
            let top = at(0, 0) * (1.0 - fu) + at(1, 0) * fu;
            let bottom = at(0, 1) * (1.0 - fu) + at(1, 1) * fu;
            (top * (1.0 - fv) + bottom * fv) as f32
        })
    };
    (texels.iter().enumerate())
        .map(|(i, texel)| texel.unwrap_or_else(|| bilinear(i % width, i / width)))
        .collect()
}

fn mean(colours: &[[f32; 3]]) -> Option<[f32; 3]> {
    let count = colours.len() as f32;
    let sum = |channel: usize| colours.iter().map(|c| c[channel]).sum::<f32>();
    (!colours.is_empty()).then(|| [0, 1, 2].map(|channel| sum(channel) / count))
}

/// Of a photograph. `ground` is the mean radiance of what lies on the ground, out of direct sunlight: what is not seen above the horizon is
/// made so bright that ground of [`GUESSED_ALBEDO`] would look like it.
pub fn of_photograph(photo: &Photo, camera: &Camera, ground: [f32; 3]) -> Panorama {
    let small = Shrunk::of(photo);
    let (mut picture, known) = gather(|direction| {
        let origin = camera.world_from_camera.w_axis.truncate();
        let seen = project(camera, origin + direction)?;
        small.at(DVec2::new(seen.x, seen.y))
    });
    let (mut seen, mut unseen) = (0.0, 0.0);
    let above = WIDTH * HEIGHT / 2;
    for (i, known) in known.iter().enumerate().take(above) {
        let y = i / WIDTH;
        let weight = solid_angle(y) * direction(0, y).y;
        let part = weight * f64::from(luminance(picture.linear[i].into()));
        match known {
            true => seen += part,
            false => unseen += part,
        }
    }
    let wanted = std::f64::consts::PI * f64::from(luminance(ground.into())) / GUESSED_ALBEDO;
    let gain = match unseen > 0.0 {
        true => ((wanted - seen) / unseen).clamp(1.0 / MOST_GAIN, MOST_GAIN),
        false => 1.0,
    };
    for (texel, known) in picture.linear.iter_mut().zip(&known).take(above) {
        if !known {
            *texel = texel.map(|channel| channel * gain as f32);
        }
    }
    Panorama { picture, gain }
}

/// A photograph in means of blocks, about as coarse as a panorama.
struct Shrunk {
    block: usize,
    width: usize,
    size: DVec2,
    means: Vec<[f32; 3]>,
}

impl Shrunk {
    fn of(photo: &Photo) -> Self {
        let (width, height) = (photo.width as usize, photo.height as usize);
        let block = (width.max(height) / 128).max(1);
        let (columns, rows) = (width.div_ceil(block), height.div_ceil(block));
        let block_mean = |x: usize, y: usize| {
            let pixels: Vec<[f32; 3]> = (y * block..((y + 1) * block).min(height))
                .flat_map(|row| {
                    let to = ((x + 1) * block).min(width);
                    photo.linear[row * width + x * block..row * width + to].iter()
                })
                .map(|pixel| pixel.map(|channel| channel.max(0.0)))
                .collect();
            mean(&pixels).unwrap_or_default()
        };
        Self {
            block,
            width: columns,
            size: DVec2::new(width as f64, height as f64),
            means: (0..rows)
                .flat_map(|y| (0..columns).map(move |x| (x, y)))
                .map(|(x, y)| block_mean(x, y))
                .collect(),
        }
    }

    fn at(&self, pixel: DVec2) -> Option<[f32; 3]> {
        let inside = pixel.cmpge(DVec2::ZERO).all() && pixel.cmplt(self.size).all();
        let cell = |x: f64| x as usize / self.block;
        inside.then(|| self.means[cell(pixel.y) * self.width + cell(pixel.x)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start::camera::{camera_over_ground, up_of_pitch};

    #[test]
    fn all_directions_are_a_sphere() {
        let all: f64 = (0..HEIGHT).map(|y| solid_angle(y) * WIDTH as f64).sum();
        assert!((all - 4.0 * std::f64::consts::PI).abs() < 1e-9);
        let ahead = direction(WIDTH / 2, HEIGHT / 2);
        assert!(ahead.distance(DVec3::NEG_Z) < 0.02, "{ahead}");
        assert!(direction(3 * WIDTH / 4, HEIGHT / 2).x > 0.99);
    }

    #[test]
    fn what_is_shown_is_kept_and_the_rest_extended() {
        // Red on the left, blue on the right.
        let codes = (0..64 * 48).map(|i| match i % 64 < 32 {
            true => [255, 0, 0],
            false => [0, 0, 255],
        });
        let photo = Photo::from_srgb8(64, 48, codes.collect());
        let camera = camera_over_ground((64, 48), 60.0, up_of_pitch(5.0), 1.0);
        let panorama = of_photograph(&photo, &camera, [0.2; 3]);
        let at = |x: usize, y: usize| panorama.picture.linear[y * WIDTH + x];
        let (x, y) = (WIDTH / 2 - 4, HEIGHT / 2 + 8);
        assert_eq!(at(x, y), [1.0, 0.0, 0.0]);
        assert_eq!(at(WIDTH - x, y), [0.0, 0.0, 1.0]);
        let left = at(WIDTH / 4, HEIGHT / 2 + 8);
        assert!(left[0] > 2.0 * left[2], "the left is red: {left:?}");
    }

    #[test]
    fn the_sky_makes_the_ground_as_bright_as_it_is() {
        let photo = Photo::from_srgb8(64, 48, vec![[128; 3]; 64 * 48]);
        let camera = camera_over_ground((64, 48), 60.0, up_of_pitch(30.0), 1.0);
        let radiance = photo.linear[0];
        let panorama = of_photograph(&photo, &camera, radiance);
        let irradiance: f64 = (0..WIDTH * HEIGHT / 2)
            .map(|i| {
                let y = i / WIDTH;
                let texel = f64::from(panorama.picture.linear[i][0]);
                solid_angle(y) * direction(0, y).y * texel
            })
            .sum();
        let ground = GUESSED_ALBEDO * irradiance / std::f64::consts::PI;
        assert!((ground / f64::from(radiance[0]) - 1.0).abs() < 1e-3);
        assert!(panorama.gain > 2.0, "control: it was darker");
    }
}
