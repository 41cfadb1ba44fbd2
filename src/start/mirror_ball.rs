//! A photograph of a mirror ball as an environment.

use glam::{DMat3, DVec2, DVec3};

use super::panorama::gather;
use crate::film::Picture;
use crate::math::luminance;
use crate::scene::Photo;

/// Where the ball is in its photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Pixels, corner origin.
    pub centre: DVec2,
    pub radius_px: f64,
}

impl Ball {
    /// The largest circle about the middle: the photograph is cut to the ball.
    pub fn inscribed(photo: &Photo) -> Self {
        let size = DVec2::new(f64::from(photo.width), f64::from(photo.height));
        Self {
            centre: 0.5 * size,
            radius_px: 0.5 * size.min_element(),
        }
    }
}

/// Unwraps a ball seen from far away. `world_from_camera` is the rotation of the camera that took it.
pub fn unwrap(photo: &Photo, ball: Ball, world_from_camera: DMat3) -> Picture {
    let camera_from_world = world_from_camera.transpose();
    let (picture, _) = gather(|direction| {
        // A ball shows a direction where its normal is half way from there to the camera; straight behind it, nowhere.
        let normal = (camera_from_world * direction + DVec3::Z).try_normalize()?;
        let offset = DVec2::new(normal.x, -normal.y);
        // Next to the rim a pixel holds all that is behind.
        (offset.length() < 1.0 - 1.0 / ball.radius_px).then_some(())?;
        bilinear(photo, ball.centre + ball.radius_px * offset)
    });
    picture
}

fn bilinear(photo: &Photo, pixel: DVec2) -> Option<[f32; 3]> {
    let (width, height) = (photo.width as usize, photo.height as usize);
    let at = pixel - 0.5;
    let inside =
        pixel.cmpge(DVec2::ZERO).all() && pixel.x < width as f64 && pixel.y < height as f64;
    let clamp = |x: f64, most: usize| x.clamp(0.0, (most - 1) as f64) as usize;
    let texel = |x: f64, y: f64| photo.linear[clamp(y, height) * width + clamp(x, width)];
    let (low, share) = (at.floor(), (at - at.floor()).as_vec2());
    inside.then(|| {
        let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)]
            .map(|(dx, dy)| texel(low.x + dx, low.y + dy));
        std::array::from_fn(|c| {
            let top = corners[0][c] * (1.0 - share.x) + corners[1][c] * share.x;
            let bottom = corners[2][c] * (1.0 - share.x) + corners[3][c] * share.x;
            top * (1.0 - share.y) + bottom * share.y
        })
    })
}

/// The share of the ball's pixels that are as bright as the file can say: lights there are brighter than they are told.
pub fn clipped_share(photo: &Photo, ball: Ball) -> f64 {
    let (mut all, mut clipped) = (0_usize, 0_usize);
    for (i, pixel) in photo.linear.iter().enumerate() {
        let at = DVec2::new(
            (i % photo.width as usize) as f64 + 0.5,
            (i / photo.width as usize) as f64 + 0.5,
        );
        if at.distance(ball.centre) < ball.radius_px {
            all += 1;
            clipped += usize::from(luminance((*pixel).into()) >= 0.98);
        }
    }
    clipped as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball that mirrors a smooth world.
    fn world(direction: DVec3) -> [f32; 3] {
        [
            (0.5 + 0.5 * direction.x) as f32,
            (0.5 + 0.5 * direction.y) as f32,
            (0.5 + 0.5 * direction.z) as f32,
        ]
    }

    fn ball_in(world_from_camera: DMat3) -> Photo {
        const SIDE: u32 = 200;
        let linear = (0..SIDE * SIDE).map(|i| {
            let x = (f64::from(i % SIDE) + 0.5) / 100.0 - 1.0;
            let y = 1.0 - (f64::from(i / SIDE) + 0.5) / 100.0;
            let z = (1.0 - x * x - y * y).max(0.0).sqrt();
            let normal = DVec3::new(x, y, z);
            // The law of mirrors, with the eye at +Z.
            world(world_from_camera * (2.0 * z * normal - DVec3::Z).normalize())
        });
        let mut photo = Photo::from_srgb8(SIDE, SIDE, vec![[0; 3]; (SIDE * SIDE) as usize]);
        photo.linear = linear.collect();
        photo
    }

    #[test]
    fn a_ball_shows_the_world_behind_the_camera_too() {
        let turned = DMat3::from_rotation_x(-0.4);
        let photo = ball_in(turned);
        let picture = unwrap(&photo, Ball::inscribed(&photo), turned);
        let at = |x: usize, y: usize| picture.linear[y * 512 + x];
        let middle = |direction: DVec3, texel: [f32; 3], most: f32| {
            let truth = world(direction);
            (0..3).all(|c| (truth[c] - texel[c]).abs() < most)
        };
        assert!(middle(DVec3::Z, at(0, 128), 0.02), "{:?}", at(0, 128));
        assert!(middle(DVec3::X, at(384, 128), 0.02), "{:?}", at(384, 128));
        assert!(middle(DVec3::Y, at(256, 0), 0.02), "{:?}", at(256, 0));
        assert!(!middle(DVec3::NEG_X, at(384, 128), 0.02), "control");
        // What lies straight behind the ball is in its rim alone.
        assert!(
            middle(DVec3::NEG_Z, at(256, 128), 0.2),
            "{:?}",
            at(256, 128)
        );
    }

    #[test]
    fn clipped_lights_are_told() {
        let mut photo = ball_in(DMat3::IDENTITY);
        let ball = Ball::inscribed(&photo);
        let before = clipped_share(&photo, ball);
        for y in 95..105 {
            for x in 95..105 {
                photo.linear[y * 200 + x] = [1.0; 3];
            }
        }
        let share = clipped_share(&photo, ball) - before;
        assert!((share - 100.0 / 31416.0).abs() < 1e-4, "{share}");
    }
}
