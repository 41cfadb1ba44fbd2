//! Whether the camera rests.

use glam::{DMat4, DVec2, DVec3};

use crate::scene::Camera;

/// What moves by less in the picture does not show; poses differ by some of it from frame to frame.
const STILL_PX: f64 = 1.5;
/// Seconds that it takes until a camera that has not moved rests.
const SETTLING_SECS: f64 = 0.5;

/// Remembers since when the camera has been where it is.
#[derive(Clone, Debug, Default)]
pub struct Rest {
    /// Seconds, and world from camera.
    since: Option<(f64, DMat4)>,
}

impl Rest {
    /// Whether it rests; it was seen at `camera` after so many seconds.
    pub fn seen(&mut self, camera: &Camera, secs: f64) -> bool {
        let pose = camera.world_from_camera;
        match self.since {
            Some((since, place)) if moved_px(camera, place) <= STILL_PX => {
                secs - since >= SETTLING_SECS
            }
            _ => {
                self.since = Some((secs, pose));
                false
            }
        }
    }

    /// It was not seen.
    pub fn lost(&mut self) {
        self.since = None;
    }
}

/// How far the picture of what is as far as the world's origin has moved at most since the camera was there: in its middle and its corners.
fn moved_px(camera: &Camera, world_from_camera: DMat4) -> f64 {
    let there = camera.world_from_camera.inverse() * world_from_camera;
    let depth = world_from_camera.w_axis.truncate().length();
    let (x, y) = (
        0.5 * f64::from(camera.width) / camera.fx,
        0.5 * f64::from(camera.height) / camera.fy,
    );
    let places = [(0.0, 0.0), (x, y), (-x, y), (x, -y), (-x, -y)];
    let moved = places.map(|(x, y)| {
        let now = there.transform_point3(depth * DVec3::new(x, y, -1.0));
        if now.z >= 0.0 {
            return f64::INFINITY;
        }
        let off = now.truncate() / -now.z - DVec2::new(x, y);
        (off.x * camera.fx).hypot(off.y * camera.fy)
    });
    moved.into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Distortion;

    fn camera(x_m: f64, turned: f64) -> Camera {
        Camera {
            width: 640,
            height: 480,
            fx: 600.0,
            fy: 600.0,
            cx: 320.0,
            cy: 240.0,
            distortion: Distortion::NONE,
            world_from_camera: DMat4::from_translation(DVec3::new(x_m, 0.0, 0.6))
                * DMat4::from_rotation_y(turned),
        }
    }

    #[test]
    fn a_pixel_is_a_millimetre_of_way_or_a_tenth_of_a_degree() {
        let from = camera(0.0, 0.0).world_from_camera;
        assert!((moved_px(&camera(0.001, 0.0), from) - 1.0).abs() < 1e-3);
        let turned = moved_px(&camera(0.0, 0.1_f64.to_radians()), from);
        assert!((1.0..1.4).contains(&turned), "{turned}");
        let behind = moved_px(&camera(0.0, std::f64::consts::PI), from);
        assert_eq!(behind, f64::INFINITY);
    }

    #[test]
    fn it_rests_after_half_a_second_in_one_place_and_no_slow_way_is_rest() {
        let mut rest = Rest::default();
        let noise = |frame: usize| 0.0004 * [0.0, 1.0, -1.0][frame % 3];
        let resting: Vec<bool> = (0..10)
            .map(|frame| rest.seen(&camera(noise(frame), 0.0), 0.1 * frame as f64))
            .collect();
        assert_eq!(resting.iter().filter(|rests| **rests).count(), 5);
        assert!(!rest.seen(&camera(0.01, 0.0), 1.0), "it moves");
        rest.lost();
        assert!(!rest.seen(&camera(0.01, 0.0), 2.0), "it was not seen");
        let mut slow = Rest::default();
        let ever = (0..40).any(|frame| {
            slow.seen(
                &camera(0.0005 * f64::from(frame), 0.0),
                0.1 * f64::from(frame),
            )
        });
        assert!(!ever, "half a millimetre a frame");
    }
}
