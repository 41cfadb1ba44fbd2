//! Where models are put down so that they can be looked at at once: on the real surface, in view, of a size that fits.

use glam::{DVec2, DVec3};

use super::camera::ray;
use crate::scene::Camera;
use crate::scene::projection::project;

/// Triangles of the real world.
pub struct RealWorld {
    pub triangles: Vec<[DVec3; 3]>,
}

/// A model put down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub translation: DVec3,
    /// About Y, so that its front looks at the camera.
    pub yaw_deg: f64,
    pub scale: f64,
    /// `false`: nothing real was found there, and it floats.
    pub rests: bool,
}

/// A box that is seen as at most this share of the picture's height and at least that one keeps its size.
const FITTING: std::ops::Range<f64> = 0.06..0.6;
/// Of the picture's height, for models that do not fit.
const WANTED: f64 = 0.28;
/// Where in the picture a place is looked for, one after the other: shares of the height from the top.
const ROWS: [f64; 9] = [0.62, 0.68, 0.74, 0.8, 0.86, 0.92, 0.56, 0.5, 0.44];
/// To the side, shares of the width.
const COLUMNS: [f64; 5] = [0.0, -0.06, 0.06, -0.12, 0.12];
/// Of a model's box, as it would stand: what the camera has to see of it, if it can stand anywhere so.
const SEEN: f64 = 0.99;
/// Half the spot that has to be level, share of the width.
const SPOT: f64 = 0.025;
/// The steepest slope that carries a model.
const MOST_SLOPE: f64 = 0.2;
/// Of models that have nothing to stand on, metres.
const FLOATING_M: f64 = 2.0;

impl RealWorld {
    /// The nearest point that a pixel shows.
    pub fn seen(&self, camera: &Camera, pixel: DVec2) -> Option<DVec3> {
        let (origin, direction) = ray(camera, pixel)?;
        let nearest = (self.triangles.iter())
            .filter_map(|triangle| distance(origin, direction, triangle))
            .min_by(f64::total_cmp)?;
        Some(origin + direction * nearest)
    }

    /// How much of an upright box, whose base's middle stands at `foot`, is in front of everything real, and in the picture.
    fn share_seen(&self, camera: &Camera, foot: DVec3, size: DVec3) -> f64 {
        let eye = camera.world_from_camera.w_axis.truncate();
        let aside = (foot - eye).cross(DVec3::Y).normalize_or_zero();
        let half = 0.5 * size.x.max(size.z);
        let steps = [0.15, 0.5, 0.85, 1.0];
        let places = steps.iter().flat_map(|up| {
            [-1.0, -0.5, 0.0, 0.5, 1.0]
                .map(|side| foot + DVec3::Y * (up * size.y) + aside * (side * half))
        });
        let is_seen = |place: DVec3| {
            let Some(pixel) = project(camera, place).map(DVec3::truncate) else {
                return false;
            };
            let inside = pixel.cmpgt(DVec2::ZERO).all()
                && pixel.x < f64::from(camera.width)
                && pixel.y < f64::from(camera.height);
            let nearest = self.seen(camera, pixel).map(|point| (point - eye).length());
            inside && nearest.is_none_or(|nearest| nearest > (place - eye).length())
        };
        let seen: Vec<bool> = places.map(is_seen).collect();
        seen.iter().filter(|seen| **seen).count() as f64 / seen.len() as f64
    }

    /// A level spot about a pixel: its point in the middle height of what was tried.
    fn level_spot(&self, camera: &Camera, pixel: DVec2) -> Option<DVec3> {
        let reach = SPOT * f64::from(camera.width);
        let around = [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|d| pixel + reach * d);
        let middle = self.seen(camera, pixel)?;
        let mut heights = vec![middle.y];
        for at in around {
            let point = self.seen(camera, at)?;
            let offset = point - middle;
            if offset.y.abs() > MOST_SLOPE * DVec2::new(offset.x, offset.z).length() {
                return None;
            }
            heights.push(point.y);
        }
        heights.sort_by(f64::total_cmp);
        Some(DVec3::new(middle.x, heights[heights.len() / 2], middle.z))
    }
}

/// Möller and Trumbore 1997.
fn distance(origin: DVec3, direction: DVec3, [a, b, c]: &[DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (*b - *a, *c - *a);
    let across = direction.cross(ac);
    let determinant = ab.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let from = origin - *a;
    let u = from.dot(across) / determinant;
    let other = from.cross(ab);
    let v = direction.dot(other) / determinant;
    let t = ac.dot(other) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-9).then_some(t)
}

/// Puts down the `index`-th of `count` models with this box.
pub fn place(
    world: &RealWorld,
    camera: &Camera,
    (index, count): (usize, usize),
    (low, high): (DVec3, DVec3),
) -> Placement {
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let column = (index + 1) as f64 / (count + 1) as f64;
    let pixels = ROWS.iter().flat_map(|row| {
        let pixel = move |offset: &f64| DVec2::new(column + offset, *row) * size;
        COLUMNS.iter().map(pixel)
    });
    let pose = camera.world_from_camera;
    let eye = pose.w_axis.truncate();
    let scale_at = |point: DVec3| {
        let depth = -pose.inverse().transform_point3(point).z;
        let share = (high - low).length() / (depth * size.y / camera.fy);
        match FITTING.contains(&share) {
            true => 1.0,
            false => two_digits(WANTED / share),
        }
    };
    // The first that is wholly in view, else the one that is most so.
    let mut spot: Option<(DVec3, f64)> = None;
    for point in pixels.filter_map(|pixel| world.level_spot(camera, pixel)) {
        let seen = world.share_seen(camera, point, scale_at(point) * (high - low));
        if spot.is_none_or(|(_, most)| seen > most) {
            spot = Some((point, seen));
        }
        if seen >= SEEN {
            break;
        }
    }
    let spot = spot.map(|(point, _)| point);
    let point = spot.unwrap_or_else(|| {
        let towards = ray(camera, DVec2::new(column, 0.5) * size)
            .map_or(-pose.z_axis.truncate(), |(_, direction)| direction);
        eye + FLOATING_M * towards
    });
    let scale = scale_at(point);
    let yaw = (eye.x - point.x).atan2(eye.z - point.z);
    let base = DVec3::new(0.5 * (low.x + high.x), low.y, 0.5 * (low.z + high.z));
    let turned = glam::DQuat::from_rotation_y(yaw) * (scale * base);
    Placement {
        translation: point - turned,
        yaw_deg: yaw.to_degrees(),
        scale,
        rests: spot.is_some(),
    }
}

fn two_digits(x: f64) -> f64 {
    let unit = 10_f64.powf(x.log10().floor() - 1.0);
    // Written as a decimal, so that 0.14 is not 0.14000000000000001.
    let rounded = format!("{:.9}", (x / unit).round() * unit);
    rounded.parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start::camera::{camera_over_ground, up_of_pitch};

    fn square(height: f64, half: f64) -> [[DVec3; 3]; 2] {
        let at = |x: f64, z: f64| DVec3::new(x * half, height, z * half - 2.0);
        let [a, b, c, d] = [at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0), at(-1.0, -1.0)];
        [[a, b, c], [a, c, d]]
    }

    #[test]
    fn a_model_stands_where_it_is_seen() {
        let camera = camera_over_ground((640, 480), 500.0, up_of_pitch(25.0), 1.5);
        let world = RealWorld {
            triangles: square(0.0, 50.0).to_vec(),
        };
        let model = (DVec3::new(-1.0, -2.0, -1.0), DVec3::new(1.0, 2.0, 3.0));
        let placed = place(&world, &camera, (0, 1), model);
        assert!(placed.rests);
        let turn = glam::DQuat::from_rotation_y(placed.yaw_deg.to_radians());
        let base = placed.translation + turn * (placed.scale * DVec3::new(0.0, -2.0, 1.0));
        assert!(base.y.abs() < 1e-9, "{base}");
        let seen = project(&camera, base).unwrap();
        assert!((seen.x - 320.0).abs() < 1e-6 && (seen.y - 0.62 * 480.0).abs() < 1e-6);
        assert!(placed.scale < 0.5, "it was larger than the view");
        let small = (DVec3::splat(-0.2), DVec3::splat(0.2));
        assert_eq!(place(&world, &camera, (0, 1), small).scale, 1.0);
        let two = [0, 1].map(|i| place(&world, &camera, (i, 2), small).translation.x);
        assert!(two[0] < -0.2 && two[1] > 0.2, "{two:?}");
    }

    /// A wall before the first spot would hide what stands there.
    #[test]
    fn a_model_does_not_stand_behind_real_things() {
        let camera = camera_over_ground((640, 480), 500.0, up_of_pitch(25.0), 1.5);
        let small = (DVec3::splat(-0.2), DVec3::splat(0.2));
        let mut world = RealWorld {
            triangles: square(0.0, 50.0).to_vec(),
        };
        let open = place(&world, &camera, (0, 1), small);
        let foot = open.translation - 0.2 * DVec3::Y;
        let at = |x: f64, y: f64| DVec3::new(foot.x + x, y, foot.z + 0.3);
        world
            .triangles
            .push([at(-0.4, 0.0), at(0.4, 0.0), at(0.4, 0.4)]);
        world
            .triangles
            .push([at(-0.4, 0.0), at(0.4, 0.4), at(-0.4, 0.4)]);
        let placed = place(&world, &camera, (0, 1), small);
        let seen = |placement: Placement| {
            let foot = placement.translation - 0.2 * DVec3::Y;
            world.share_seen(&camera, foot, DVec3::splat(0.4))
        };
        assert!(seen(placed) >= SEEN, "{placed:?}");
        assert!(seen(open) < SEEN, "control");
    }

    #[test]
    fn edges_carry_nothing() {
        let camera = camera_over_ground((640, 480), 500.0, up_of_pitch(25.0), 1.5);
        let mut triangles = square(0.0, 50.0).to_vec();
        // A table whose edge is where a model would be put down first.
        let edge = DVec3::new(0.0, 0.5, -2.0);
        triangles.extend(square(0.5, 0.3));
        let world = RealWorld { triangles };
        let row = project(&camera, edge).unwrap().y;
        assert!(row > 100.0);
        let small = (DVec3::splat(-0.1), DVec3::splat(0.1));
        let placed = place(&world, &camera, (0, 1), small);
        let height = placed.translation.y - 0.1;
        assert!(
            height.abs() < 1e-9 || (height - 0.5).abs() < 1e-9,
            "{height}"
        );
        let nothing = RealWorld { triangles: vec![] };
        assert!(!place(&nothing, &camera, (0, 1), small).rests);
    }
}
