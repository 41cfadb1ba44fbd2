//! A camera, its photograph and its light with fewer pixels.

use std::f32::consts::PI;
use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;

use super::{Camera, EncodedPhoto, EnvironmentMap, Photo};

impl Camera {
    /// The same view in a picture whose sides are divided by this (0 counts as 1), and rounded up.
    pub fn coarser(&self, divisor: u32) -> Self {
        let divisor = divisor.max(1);
        let [width, height] = [self.width, self.height].map(|side| side.div_ceil(divisor));
        let [x, y] = [(width, self.width), (height, self.height)]
            .map(|(small, whole)| f64::from(small) / f64::from(whole));
        Self {
            width,
            height,
            fx: self.fx * x,
            cx: self.cx * x,
            fy: self.fy * y,
            cy: self.cy * y,
            ..self.clone()
        }
    }
}

impl Photo {
    /// The light of its pixels averaged in a picture of another, smaller size.
    pub fn averaged(&self, width: u32, height: u32) -> Self {
        let mut linear = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                let mut sum = Vec3::ZERO;
                let mut count = 0.0;
                for row in part(y, height, self.height) {
                    let begin = row * self.width as usize;
                    for column in part(x, width, self.width) {
                        sum += Vec3::from(self.linear[begin + column]);
                        count += 1.0;
                    }
                }
                linear.push((sum / count).to_array());
            }
        }
        Self {
            width,
            height,
            linear,
            encoded: EncodedPhoto::Linear,
            tags: self.tags.clone(),
        }
    }
}

impl EnvironmentMap {
    /// The same light from at most so many columns of directions; its power is kept.
    pub fn averaged(&self, most_columns: u32) -> Self {
        let Self::LatLong {
            width,
            height,
            texels,
        } = self
        else {
            return self.clone();
        };
        let columns = most_columns.clamp(1, *width);
        let rows = (u64::from(*height) * u64::from(columns)).div_ceil(u64::from(*width)) as u32;
        if (columns, rows) == (*width, *height) {
            return self.clone();
        }
        let mut averaged = Vec::with_capacity(columns as usize * rows as usize);
        for y in 0..rows {
            for x in 0..columns {
                let (mut sum, mut angles) = (Vec3::ZERO, 0.0);
                for row in part(y, rows, *height) {
                    let solid_angle = (PI * (row as f32 + 0.5) / *height as f32).sin();
                    let begin = row * *width as usize;
                    for column in part(x, columns, *width) {
                        sum += Vec3::from(texels[begin + column]) * solid_angle;
                        angles += solid_angle;
                    }
                }
                averaged.push((sum / angles).to_array());
            }
        }
        Self::LatLong {
            width: columns,
            height: rows,
            texels: Arc::new(averaged),
        }
    }
}

/// What the i-th of `small` averages of `whole`.
fn part(i: u32, small: u32, whole: u32) -> Range<usize> {
    let begin = u64::from(i) * u64::from(whole) / u64::from(small);
    let end = u64::from(i + 1) * u64::from(whole) / u64::from(small);
    begin as usize..(end as usize).max(begin as usize + 1)
}

#[cfg(test)]
mod tests {
    use glam::{DMat4, DVec3};

    use super::super::Distortion;
    use super::super::projection::project;
    use super::*;

    #[test]
    fn a_coarser_camera_sees_the_same_at_the_same_share_of_its_sides() {
        let camera = Camera {
            width: 641,
            height: 480,
            fx: 500.0,
            fy: 510.0,
            cx: 322.0,
            cy: 238.0,
            distortion: Distortion::NONE,
            world_from_camera: DMat4::IDENTITY,
        };
        let coarse = camera.coarser(3);
        assert_eq!((coarse.width, coarse.height), (214, 160));
        let point = DVec3::new(0.2, -0.1, -1.0);
        let [fine, small] = [&camera, &coarse].map(|c| project(c, point).unwrap());
        assert!((fine.x / 641.0 - small.x / 214.0).abs() < 1e-12);
        assert!((fine.y / 480.0 - small.y / 160.0).abs() < 1e-12);
        assert!((fine.x - small.x).abs() > 100.0, "control: in pixels");
        assert_eq!(camera.coarser(0).width, 641);
    }

    #[test]
    fn light_is_kept() {
        let codes = (0..35_u8).map(|i| [7 * i, 255 - 7 * i, 9]).collect();
        let photo = Photo::from_srgb8(7, 5, codes);
        let mean = |photo: &Photo, size: f32| {
            let sum: Vec3 = photo.linear.iter().copied().map(Vec3::from).sum();
            sum / size
        };
        let whole = photo.averaged(1, 1);
        assert!((mean(&whole, 1.0) - mean(&photo, 35.0)).length() < 1e-5);
        assert_eq!(photo.averaged(7, 5).linear, photo.linear);
    }

    /// The power of a map is its texels' by their solid angles. Control: their plain sum.
    #[test]
    fn fewer_directions_bring_the_same_light() {
        let texels: Vec<[f32; 3]> = (0..32 * 16)
            .map(|i| {
                [
                    i as f32,
                    (i * i % 97) as f32,
                    if i == 40 { 1e4 } else { 0.0 },
                ]
            })
            .collect();
        let map = EnvironmentMap::LatLong {
            width: 32,
            height: 16,
            texels: Arc::new(texels),
        };
        let power = |map: &EnvironmentMap, weight: fn(f32) -> f32| {
            let EnvironmentMap::LatLong {
                width,
                height,
                texels,
            } = map
            else {
                panic!("it is a map")
            };
            let rows = texels.chunks(*width as usize).enumerate();
            let sum: Vec3 = rows
                .map(|(y, row)| {
                    let weight = weight(PI * (y as f32 + 0.5) / *height as f32);
                    row.iter().copied().map(Vec3::from).sum::<Vec3>() * weight
                })
                .sum();
            sum / (*width * *height) as f32
        };
        let few = map.averaged(8);
        let [kept, of_all] = [&few, &map].map(|map| power(map, f32::sin));
        assert!(
            (kept / of_all - 1.0).abs().max_element() < 0.03,
            "{kept} {of_all}"
        );
        let [plain, of_all] = [&few, &map].map(|map| power(map, |_| 1.0));
        assert!((plain / of_all - 1.0).abs().max_element() > 0.05, "control");
        assert!(matches!(
            few,
            EnvironmentMap::LatLong {
                width: 8,
                height: 4,
                ..
            }
        ));
    }
}
