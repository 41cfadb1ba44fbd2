//! The sun, from where an object's top and the tip of its shadow are seen.

use glam::{DVec2, DVec3};

use super::Claim;
use super::camera::{ground_point, ray};
use super::panorama::GUESSED_ALBEDO;
use crate::math::luminance;
use crate::refusal::Refusal;
use crate::scene::{Camera, Photo};

/// What the user shows of a shadow, pixels, corner origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shadow {
    pub top: DVec2,
    pub tip: DVec2,
    /// Where the top's plumb line meets the ground.
    pub foot: Option<DVec2>,
}

/// Light from far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Of travel, world space, unit length.
    pub direction: DVec3,
    /// On a surface that faces it, in the photograph's units.
    pub irradiance: [f64; 3],
}

/// The sun that throws the shadow on the ground, and the share of the ground's light that reaches the shadow.
///
/// # Errors
/// The tip or the foot shows no ground, or the sun would be below the horizon.
pub fn sun_of_shadow(
    photo: &Photo,
    camera: &Camera,
    shadow: Shadow,
) -> Result<(Claim<Sun>, f64), Refusal> {
    let tip = ground_point(camera, shadow.tip).ok_or(
        "--sun: the shadow's tip lies above the horizon; expected a point of the ground; correct it or give --horizon",
    )?;
    let foot = match shadow.foot {
        Some(foot) => Some(ground_point(camera, foot).ok_or(
            "--sun: the object's foot lies above the horizon; expected a point of the ground; correct it or give --horizon",
        )?),
        None => None,
    };
    let (origin, towards) = ray(camera, shadow.top)
        .ok_or("--sun: the lens has no ray at the object's top; expected a point of the photograph; correct it")?;
    let top = match foot {
        Some(foot) => {
            // Over the foot: where the ray's distance from the camera, seen from above, is the foot's.
            let flat = |v: DVec3| DVec2::new(v.x, v.z);
            let along = flat(foot - origin).dot(flat(towards)) / flat(towards).length_squared();
            origin + towards * along
        }
        // Beside its shadow: as far from the camera's plane as the tip.
        None => {
            let forward = -camera.world_from_camera.z_axis.truncate();
            origin + towards * ((tip - origin).dot(forward) / towards.dot(forward))
        }
    };
    let direction = (tip - top).normalize();
    if !(direction.y < -0.02) {
        return Err("--sun: the sun would stand below the horizon; expected the object's top and its shadow's tip in this order; correct them".into());
    }
    let inside = foot.unwrap_or(DVec3::new(top.x, 0.0, top.z));
    let (lit, dark) = brightness(photo, camera, tip, inside);
    let share = match lit > 0.0 && dark < 0.95 * lit {
        true => (dark / lit).max(0.02),
        false => 0.5,
    };
    let seen = share < 0.5 || dark < 0.95 * lit;
    let sun_on_ground = std::f64::consts::PI * lit * (1.0 - share) / GUESSED_ALBEDO;
    let irradiance = [sun_on_ground / -direction.y; 3];
    let elevation = (-direction.y).asin().to_degrees();
    let basis = format!(
        "{elevation:.0} degrees high, {}; its strength {}, for ground that reflects {:.0}% (guessed)",
        match shadow.foot {
            Some(_) => "from the object's foot, top and shadow: +- 3 degrees",
            None =>
                "guessed, as if the shadow lay beside its object: +- 25 degrees; name the foot as a third point",
        },
        match seen {
            true => "from the shadow's contrast",
            false => "guessed, as no shadow is seen there",
        },
        100.0 * GUESSED_ALBEDO,
    );
    Ok((
        Claim::new(
            Sun {
                direction,
                irradiance,
            },
            basis,
        ),
        share,
    ))
}

/// Mean luminance of the ground beyond the tip, and of the shadow.
fn brightness(photo: &Photo, camera: &Camera, tip: DVec3, foot: DVec3) -> (f64, f64) {
    let mean = |shares: [f64; 3]| {
        let seen = shares.into_iter().filter_map(|share| {
            let at = crate::scene::projection::project(camera, tip.lerp(foot, share))?;
            let inside = at.x >= 0.0
                && at.y >= 0.0
                && at.x < f64::from(photo.width)
                && at.y < f64::from(photo.height);
            let pixel = at.y as usize * photo.width as usize + at.x as usize;
            inside.then(|| f64::from(luminance(photo.linear[pixel].into())))
        });
        let seen: Vec<f64> = seen.collect();
        seen.iter().sum::<f64>() / seen.len().max(1) as f64
    };
    (mean([-0.15, -0.2, -0.25]), mean([0.15, 0.25, 0.35]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::projection::project;
    use crate::start::camera::{camera_over_ground, up_of_pitch};

    #[test]
    fn a_post_and_its_shadow_tell_the_sun() {
        let camera = camera_over_ground((640, 480), 500.0, up_of_pitch(20.0), 1.6);
        let (foot, top) = (DVec3::new(0.3, 0.0, -4.0), DVec3::new(0.3, 0.8, -4.0));
        let truth = DVec3::new(-0.5, -0.7, 0.6).normalize();
        let tip = top - truth * (top.y / truth.y);
        let pixel = |p: DVec3| project(&camera, p).unwrap().truncate();
        // Lit ground of 0.4, a shadow of 0.1.
        let mut photo = Photo::from_srgb8(640, 480, vec![[0; 3]; 640 * 480]);
        photo.linear = vec![[0.4; 3]; 640 * 480];
        for step in 0..1000 {
            let at = pixel(tip.lerp(foot, f64::from(step) / 1000.0)).as_ivec2();
            for (dx, dy) in (-2..3).flat_map(|dx| (-2..3).map(move |dy| (dx, dy))) {
                photo.linear[((at.y + dy) * 640 + at.x + dx) as usize] = [0.1; 3];
            }
        }
        let shadow = Shadow {
            top: pixel(top),
            tip: pixel(tip),
            foot: Some(pixel(foot)),
        };
        let (claim, share) = sun_of_shadow(&photo, &camera, shadow).unwrap();
        assert!(claim.value.direction.distance(truth) < 1e-6, "{claim:?}");
        assert!((share - 0.25).abs() < 1e-6);
        let sun = claim.value.irradiance[0] * -truth.y * GUESSED_ALBEDO / std::f64::consts::PI;
        assert!((sun - 0.3).abs() < 1e-6, "{sun}");

        let two_clicks = Shadow {
            foot: None,
            ..shadow
        };
        let (guess, _) = sun_of_shadow(&photo, &camera, two_clicks).unwrap();
        assert!(guess.basis.contains("guessed, as if"), "{guess:?}");
        assert!(guess.value.direction.distance(truth) > 0.05, "control");
        let swapped = Shadow {
            top: shadow.tip,
            tip: shadow.top,
            foot: None,
        };
        assert!(sun_of_shadow(&photo, &camera, swapped).is_err());
    }
}
