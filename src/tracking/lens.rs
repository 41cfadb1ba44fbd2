//! The camera without its pose: where an ideal point falls, and how that changes.

use glam::{DMat2, DVec2};

use crate::distortion::{Distortion, LENS_RADIAL, distort, undistort};

/// Parameters of a lens that can be solved for: fx fy cx cy k1 k2 p1 p2.
pub const LENS_PARAMETERS: usize = 8;

/// Pinhole intrinsics with OpenCV's distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// fx and fy, pixels.
    pub focal: DVec2,
    /// Principal point, pixels, corner origin.
    pub centre: DVec2,
    pub distortion: Distortion,
}

impl Lens {
    /// Without distortion, its principal point in the middle.
    pub fn ideal(width: usize, height: usize, focal: f64) -> Self {
        Self {
            focal: DVec2::splat(focal),
            centre: 0.5 * DVec2::new(width as f64, height as f64),
            distortion: Distortion::NONE,
        }
    }

    fn distorted(&self, ideal: DVec2) -> DVec2 {
        let Distortion {
            model,
            coefficients,
        } = &self.distortion;
        distort(*model, coefficients, ideal.to_array()).into()
    }

    /// Of a point at depth 1, x right, y down.
    pub fn pixel_of(&self, ideal: DVec2) -> DVec2 {
        self.focal * self.distorted(ideal) + self.centre
    }

    /// `None`: the lens sees nothing there.
    pub fn ideal_of(&self, pixel: DVec2) -> Option<DVec2> {
        let distorted = (pixel - self.centre) / self.focal;
        undistort(&self.distortion, distorted.to_array()).map(DVec2::from)
    }

    /// The same by a few of Newton's steps from an ideal point nearby.
    pub fn ideal_near(&self, pixel: DVec2, near: DVec2) -> DVec2 {
        let mut ideal = near;
        for _ in 0..4 {
            let error = self.pixel_of(ideal) - pixel;
            if error.length_squared() < 1e-18 {
                break;
            }
            ideal -= self.by_ideal(ideal).inverse() * error;
        }
        ideal
    }

    /// Pixels by ideal coordinates.
    pub fn by_ideal(&self, ideal: DVec2) -> DMat2 {
        let slopes = match self.distortion.model {
            LENS_RADIAL => self.radial_slopes(ideal),
            _ => {
                const H: f64 = 1e-6;
                let slope = |step: DVec2| {
                    (self.distorted(ideal + step) - self.distorted(ideal - step)) / (2.0 * H)
                };
                DMat2::from_cols(slope(DVec2::X * H), slope(DVec2::Y * H))
            }
        };
        DMat2::from_diagonal(self.focal) * slopes
    }

    fn radial_slopes(&self, ideal: DVec2) -> DMat2 {
        let [k1, k2, p1, p2, k3, ..] = self.distortion.coefficients;
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3);
        let mixed = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        DMat2::from_cols(
            DVec2::new(
                radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
                mixed,
            ),
            DVec2::new(
                mixed,
                radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
            ),
        )
    }

    /// Pixels by fx fy cx cy k1 k2 p1 p2, x and y.
    pub fn by_parameters(&self, ideal: DVec2) -> [[f64; LENS_PARAMETERS]; 2] {
        let DVec2 { x, y } = ideal;
        let r2 = x * x + y * y;
        let d = self.distorted(ideal);
        let DVec2 { x: fx, y: fy } = self.focal;
        let (xy, xx, yy) = (2.0 * x * y, r2 + 2.0 * x * x, r2 + 2.0 * y * y);
        [
            [
                d.x,
                0.0,
                1.0,
                0.0,
                fx * x * r2,
                fx * x * r2 * r2,
                fx * xy,
                fx * xx,
            ],
            [
                0.0,
                d.y,
                0.0,
                1.0,
                fy * y * r2,
                fy * y * r2 * r2,
                fy * yy,
                fy * xy,
            ],
        ]
    }

    /// fx fy cx cy k1 k2 p1 p2.
    pub fn parameters(&self) -> [f64; LENS_PARAMETERS] {
        let [k1, k2, p1, p2, ..] = self.distortion.coefficients;
        let (f, c) = (self.focal, self.centre);
        [f.x, f.y, c.x, c.y, k1, k2, p1, p2]
    }

    pub fn set_parameters(&mut self, [fx, fy, cx, cy, k @ ..]: [f64; LENS_PARAMETERS]) {
        self.focal = DVec2::new(fx, fy);
        self.centre = DVec2::new(cx, cy);
        self.distortion.coefficients[..4].copy_from_slice(&k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens() -> Lens {
        let k = [-0.276, 0.194, 0.002, -0.001];
        Lens {
            focal: DVec2::new(698.2, 697.0),
            centre: DVec2::new(313.2, 255.7),
            distortion: Distortion::opencv(&k).unwrap(),
        }
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let (lens, ideal, h) = (lens(), DVec2::new(0.31, -0.22), 1e-6);
        let numeric =
            |step: DVec2| (lens.pixel_of(ideal + step) - lens.pixel_of(ideal - step)) / (2.0 * h);
        let slopes = lens.by_ideal(ideal);
        assert!((slopes.x_axis - numeric(DVec2::X * h)).length() < 1e-5);
        assert!((slopes.y_axis - numeric(DVec2::Y * h)).length() < 1e-5);
        assert!(
            (slopes.x_axis - numeric(DVec2::Y * h)).length() > 1.0,
            "control"
        );
        let slopes = lens.by_parameters(ideal);
        for k in 0..LENS_PARAMETERS {
            let moved = |step: f64| {
                let (mut other, mut parameters) = (lens, lens.parameters());
                parameters[k] += step;
                other.set_parameters(parameters);
                other.pixel_of(ideal)
            };
            let numeric = (moved(h) - moved(-h)) / (2.0 * h);
            let own = DVec2::new(slopes[0][k], slopes[1][k]);
            assert!(
                (own - numeric).length() < 1e-5,
                "parameter {k}: {own} {numeric}"
            );
        }
    }

    #[test]
    fn newton_from_nearby_finds_the_ideal_point() {
        let lens = lens();
        let pixel = DVec2::new(600.0, 30.0);
        let exact = lens.ideal_of(pixel).unwrap();
        let near = lens.ideal_near(pixel, exact + DVec2::new(0.02, -0.01));
        assert!((near - exact).length() < 1e-10);
    }
}
