//! What lights a starter scene: an environment of the user's, a mirror ball, or the photograph itself, and the sun if it is shown.

use std::path::{Path, PathBuf};

use glam::DMat3;

use super::mirror_ball::{Ball, clipped_share, unwrap};
use super::panorama::{GUESSED_ALBEDO, of_photograph};
use super::sun::{Sun, sun_of_shadow};
use super::view::ground_radiance;
use super::{Claim, Request};
use crate::film::Picture;
use crate::refusal::Refusal;
use crate::scene::{Camera, Photo};

/// Lights of a scene.
pub struct Lighting {
    pub environment: Claim<Surroundings>,
    pub sun: Option<Claim<Sun>>,
}

/// An environment that is there already, or one to write.
pub enum Surroundings {
    Given(PathBuf),
    Made(Picture),
}

impl Lighting {
    /// # Errors
    /// What was given cannot be read, or the shadow is none of the ground's.
    pub fn of(photo: &Photo, camera: &Camera, request: &Request) -> Result<Self, Refusal> {
        let sun = match request.shadow {
            Some(shadow) => Some(sun_of_shadow(photo, camera, shadow)?),
            None => None,
        };
        let environment = match (&request.environment, &request.mirror_ball) {
            (Some(path), _) => Claim::new(
                Surroundings::Given(path.clone()),
                "Light: the environment as given.",
            ),
            (None, Some(path)) => of_ball(path, camera, request)?,
            (None, None) => {
                let shaded = sun.as_ref().map_or(1.0, |(_, share)| *share);
                let ground = ground_radiance(photo, camera).map(|c| c * shaded as f32);
                let panorama = of_photograph(photo, camera, ground);
                let basis = format!(
                    "Light: guessed. What the photograph shows is kept, its edges are extended over the rest, and the sky that is not seen is brightened {:.2} times, so that ground that reflects {:.0}% looks as bright as it does. Directions of lights outside of the picture are not known: shadows are softer than they are. Better: --sun, --mirror-ball or --environment.",
                    panorama.gain,
                    100.0 * GUESSED_ALBEDO
                );
                Claim::new(Surroundings::Made(panorama.picture), basis)
            }
        };
        Ok(Self {
            environment,
            sun: sun.map(|(claim, _)| claim),
        })
    }
}

fn of_ball(
    path: &Path,
    camera: &Camera,
    request: &Request,
) -> Result<Claim<Surroundings>, Refusal> {
    let named = |problem: Refusal| Refusal::from(format!("{}: {problem}", path.display()));
    let (photo, _) = Photo::read(path).map_err(named)?;
    let ball = request.ball.unwrap_or_else(|| Ball::inscribed(&photo));
    let picture = unwrap(&photo, ball, DMat3::from_mat4(camera.world_from_camera));
    let clipped = clipped_share(&photo, ball);
    let basis = format!(
        "Light: a mirror ball, {}, taken for one that was photographed from the photograph's own place and from far away, and that reflects all. {}",
        match request.ball {
            Some(_) => "its circle as given",
            None => "its circle the largest about the middle of its photograph",
        },
        match clipped > 0.0 {
            true => format!(
                "{:.2}% of it is as bright as the file can say: lights there are brighter than they are here, by an unknown factor.",
                100.0 * clipped
            ),
            false => "Nothing of it is clipped.".to_owned(),
        }
    );
    Ok(Claim::new(Surroundings::Made(picture), basis))
}
