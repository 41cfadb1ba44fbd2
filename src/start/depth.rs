//! Depth maps: read, and turned into a mesh.

use std::path::Path;

use glam::{DVec2, DVec3};

use crate::refusal::Refusal;
use crate::scene::{Camera, EncodedPhoto, Photo, projection};

/// What the numbers of a depth map mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthUnit {
    Millimetres,
    Metres,
    /// Metres times an unknown factor.
    Relative,
    /// An unknown factor over metres, as programs that guess depth write it: near is bright.
    Inverse,
}

impl DepthUnit {
    /// Names on a command line.
    pub const NAMES: [(&str, Self); 4] = [
        ("millimetres", Self::Millimetres),
        ("metres", Self::Metres),
        ("relative", Self::Relative),
        ("inverse", Self::Inverse),
    ];

    /// The scale is not known.
    pub fn is_relative(self) -> bool {
        matches!(self, Self::Relative | Self::Inverse)
    }
}

/// Depths along the view axis, row-major from the top left; NaN where there is none.
#[derive(Clone, Debug)]
pub struct DepthMap {
    pub width: usize,
    pub height: usize,
    pub depths_m: Vec<f64>,
    pub unit: DepthUnit,
}

/// A surface in world space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// Columns and rows of a mesh at most, so that it stays a rough model.
const MOST_CELLS: usize = 320;
/// Neighbours that differ by more than this share a cell are two surfaces.
const JUMP_PER_CELL: f64 = 0.04;
/// Depth that a relative map's median is given, metres.
const GUESSED_MEDIAN_M: f64 = 2.0;

impl DepthMap {
    /// Reads an image. Without a unit, 16-bit codes are millimetres, floats are metres, and 8-bit codes are inverse depth.
    ///
    /// # Errors
    /// It cannot be read or holds no depth, in one line without its path.
    pub fn read(path: &Path, unit: Option<DepthUnit>) -> Result<Self, Refusal> {
        let (photo, _) = Photo::read(path)?;
        let by_content = match &photo.encoded {
            EncodedPhoto::Codes8(_) => DepthUnit::Inverse,
            EncodedPhoto::Codes16(_) => DepthUnit::Millimetres,
            EncodedPhoto::Linear => DepthUnit::Metres,
        };
        let unit = unit.unwrap_or(by_content);
        let values: Vec<f64> = match &photo.encoded {
            EncodedPhoto::Codes8(codes) => codes.iter().map(|c| f64::from(c[0])).collect(),
            EncodedPhoto::Codes16(codes) => codes.iter().map(|c| f64::from(c[0])).collect(),
            EncodedPhoto::Linear => photo.linear.iter().map(|c| f64::from(c[0])).collect(),
        };
        Self::of_values((photo.width, photo.height), &values, unit)
    }

    /// # Errors
    /// No value is above 0.
    pub fn of_values(
        (width, height): (u32, u32),
        values: &[f64],
        unit: DepthUnit,
    ) -> Result<Self, Refusal> {
        let mut depths_m: Vec<f64> = (values.iter())
            .map(|value| match unit {
                _ if !(*value > 0.0 && value.is_finite()) => f64::NAN,
                DepthUnit::Millimetres => value / 1000.0,
                DepthUnit::Metres | DepthUnit::Relative => *value,
                DepthUnit::Inverse => 1.0 / value,
            })
            .collect();
        let mut known: Vec<f64> = (depths_m.iter().copied())
            .filter(|depth| depth.is_finite())
            .collect();
        if known.is_empty() {
            return Err(
                "it holds no depth above 0; expected distances along the view axis; name a depth map"
                    .into(),
            );
        }
        if unit.is_relative() {
            let middle = known.len() / 2;
            let (_, median, _) = known.select_nth_unstable_by(middle, f64::total_cmp);
            let factor = GUESSED_MEDIAN_M / *median;
            depths_m.iter_mut().for_each(|depth| *depth *= factor);
        }
        Ok(Self {
            width: width as usize,
            height: height as usize,
            depths_m,
            unit,
        })
    }

    /// The mesh of what `camera` sees so far away. The map may be of another resolution than the photograph.
    pub fn surface(&self, camera: &Camera) -> Surface {
        let step = self.width.max(self.height).div_ceil(MOST_CELLS);
        let (columns, rows) = (self.width / step, self.height / step);
        let scale = DVec2::new(
            f64::from(camera.width) / self.width as f64,
            f64::from(camera.height) / self.height as f64,
        );
        let mut surface = Surface::default();
        let mut vertices = vec![None; columns * rows];
        for (cell, vertex) in vertices.iter_mut().enumerate() {
            let (x, y) = ((cell % columns) * step, (cell / columns) * step);
            let depth = self.median_around(x, y, step);
            let pixel = (DVec2::new(x as f64, y as f64) + 0.5 * step as f64) * scale;
            let ideal = projection::undistort(camera, pixel.x, pixel.y);
            if let (Some(depth), Ok([right, down])) = (depth, ideal) {
                let seen = DVec3::new(right, -down, -1.0) * depth;
                *vertex = Some((surface.positions.len() as u32, depth));
                let point = camera.world_from_camera.transform_point3(seen);
                surface.positions.push(point);
            }
        }
        for y in 1..rows {
            for x in 1..columns {
                let at = |dx: usize, dy: usize| vertices[(y - 1 + dy) * columns + x - 1 + dx];
                let corners = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
                for triangle in [[0, 3, 2], [0, 2, 1]].map(|t| t.map(|corner| corners[corner])) {
                    if let [Some(a), Some(b), Some(c)] = triangle {
                        let low = a.1.min(b.1).min(c.1);
                        let high = a.1.max(b.1).max(c.1);
                        if high - low <= JUMP_PER_CELL * low {
                            surface.triangles.push([a.0, b.0, c.0]);
                        }
                    }
                }
            }
        }
        surface
    }

    /// Of a cell's pixels, if most of them have a depth.
    fn median_around(&self, x: usize, y: usize, step: usize) -> Option<f64> {
        let rows = y..(y + step).min(self.height);
        let mut known: Vec<f64> = rows
            .flat_map(|row| {
                let to = (x + step).min(self.width);
                self.depths_m[row * self.width + x..row * self.width + to].iter()
            })
            .copied()
            .filter(|depth| depth.is_finite())
            .collect();
        known.sort_by(f64::total_cmp);
        (2 * known.len() > step * step).then(|| known[known.len() / 2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start::camera::{camera_over_ground, ground_point, up_of_pitch};

    /// The ground that a camera sees, at half its resolution.
    fn ground() -> (Camera, Vec<f64>) {
        let camera = camera_over_ground((160, 120), 140.0, up_of_pitch(35.0), 1.2);
        let to_camera = camera.world_from_camera.inverse();
        let depths = (0..80 * 60).map(|i| {
            let pixel = DVec2::new(f64::from(i % 80) + 0.5, f64::from(i / 80) + 0.5) * 2.0;
            let point = ground_point(&camera, pixel);
            point.map_or(0.0, |p| -to_camera.transform_point3(p).z)
        });
        let depths = depths.collect();
        (camera, depths)
    }

    #[test]
    fn a_mesh_lies_where_the_depth_says() {
        let (camera, depths) = ground();
        let map = DepthMap::of_values((80, 60), &depths, DepthUnit::Metres).unwrap();
        let surface = map.surface(&camera);
        assert_eq!(surface.positions.len(), 80 * 60);
        let highest = surface
            .positions
            .iter()
            .map(|p| p.y.abs())
            .fold(0.0, f64::max);
        assert!(highest < 1e-9, "{highest}");
        let [a, b, c] = surface.triangles[0].map(|i| surface.positions[i as usize]);
        assert!((b - a).cross(c - a).y > 0.0, "it faces the camera");
        let millimetres: Vec<f64> = depths.iter().map(|d| d * 1000.0).collect();
        let same = DepthMap::of_values((80, 60), &millimetres, DepthUnit::Millimetres).unwrap();
        assert!((same.depths_m[0] - map.depths_m[0]).abs() < 1e-12);
        let wrong = DepthMap::of_values((80, 60), &depths, DepthUnit::Millimetres).unwrap();
        assert!(wrong.surface(&camera).positions[0].y > 1.0, "control");
    }

    #[test]
    fn scales_that_are_not_known_leave_the_shape() {
        let (camera, depths) = ground();
        let inverse: Vec<f64> = depths.iter().map(|d| 77.0 / d).collect();
        for (values, unit) in [
            (&depths, DepthUnit::Relative),
            (&inverse, DepthUnit::Inverse),
        ] {
            let map = DepthMap::of_values((80, 60), values, unit).unwrap();
            let ratio = map.depths_m[0] / depths[0];
            let constant = |i: usize| (map.depths_m[i] / depths[i] / ratio - 1.0).abs() < 1e-9;
            assert!((0..depths.len()).all(constant));
            assert!(!map.surface(&camera).triangles.is_empty());
        }
    }

    #[test]
    fn surfaces_end_where_depth_jumps() {
        let step = |i: usize| if i % 20 < 10 { 1.0 } else { 1.5 };
        let values: Vec<f64> = (0..400).map(step).collect();
        let camera = camera_over_ground((20, 20), 20.0, DVec3::Y, 1.0);
        let triangles = |values: &[f64]| {
            let map = DepthMap::of_values((20, 20), values, DepthUnit::Metres).unwrap();
            map.surface(&camera).triangles.len()
        };
        assert_eq!(triangles(&values), 2 * 19 * 18);
        assert_eq!(triangles(&[1.0; 400]), 2 * 19 * 19, "control");
        assert!(DepthMap::of_values((20, 20), &[0.0; 400], DepthUnit::Metres).is_err());
    }
}
