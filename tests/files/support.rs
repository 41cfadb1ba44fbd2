//! Small scenes, and where in their pictures the virtual object is.

use std::process::Output;

use image::RgbImage;

use crate::support::{Folder, assert_refused, stderr};

/// A ball of this radius at the origin, under white light; whoever renders it brings the intrinsics.
pub fn ball(radius: f64) -> String {
    format!(
        "[camera]\n[environment]\nradiance = [1, 1, 1]\n[[virtual]]\nshape = \"sphere\"\nscale = {radius}\n\
         material = {{ base_color = [0.9, 0.1, 0.1], roughness = 1.0, specular = 0.0 }}\n\
         [render]\nrays_per_pixel = 16\nbackend = \"cpu\"\n"
    )
}

/// [`ball`] with a focal length of its own, for trajectories that bring poses alone.
pub fn ball_with_camera() -> String {
    ball(0.2).replace("[camera]\n", "[camera]\nvertical_fov_deg = 40\n")
}

/// The focal length of [`ball_with_camera`] for 48 rows.
pub const FOCAL_PX: f64 = 65.939_458_066_910_94;

impl Folder {
    /// Grey frames of 64 x 48 with these names in `frames/`.
    pub fn grey_frames(&self, names: &[&str]) {
        for name in names {
            let path = format!("frames/{name}");
            let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
            self.create(folder);
            self.save(&path, 64, 48, |_, _| [60; 3]);
        }
    }

    /// The whole command after `mixray sequence scene.toml --frames`, into `out`.
    pub fn run_sequence(&self, frames: &str, trajectory: &str, more: &str) -> Output {
        self.run(&format!(
            "sequence scene.toml --frames {frames} --trajectory {trajectory} -o out --overwrite {more}"
        ))
    }

    /// What the program said on its standard error.
    pub fn sequence_of(&self, frames: &str, trajectory: &str, more: &str) -> String {
        let output = self.run_sequence(frames, trajectory, more);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stderr(&output)
    }

    pub fn refuse_sequence_of(&self, frames: &str, trajectory: &str, part: &str) {
        assert_refused(&self.run_sequence(frames, trajectory, ""), part);
    }

    /// Where the ball is in a frame of `out`, pixels.
    pub fn ball_at(&self, name: &str) -> [f64; 2] {
        centroid(&self.open(&format!("out/{name}")))
    }
}

/// Of what is redder than grey.
pub fn centroid(picture: &RgbImage) -> [f64; 2] {
    let mut sums = [0.0; 3];
    for (x, y, pixel) in picture.enumerate_pixels() {
        if i32::from(pixel[0]) - i32::from(pixel[1]) > 40 {
            let at = [f64::from(x) + 0.5, f64::from(y) + 0.5, 1.0];
            sums = [0, 1, 2].map(|i| sums[i] + at[i]);
        }
    }
    assert!(sums[2] > 0.0, "nothing is red");
    [sums[0] / sums[2], sums[1] / sums[2]]
}
