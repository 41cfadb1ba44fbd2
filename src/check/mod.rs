//! What a scene says that can hardly be meant, one line each: the problem and its mend. Nothing here ends a render.
//!
//! Heights are along +Y. Objects that move are not asked where they stand.

mod frame;
mod lights;
mod standing;

use std::fmt;

use crate::distortion::LENS_FISHEYE;
use crate::scene::check::Check;
use crate::scene::placing::{Foot, foot};
use crate::scene::{Choice, Exposure, Object, Scene, Side};

/// Stops by which "auto" would change the exposure, above which it is told.
const LARGE_EV: f64 = 1.0;
/// The same downwards where the proxy's albedo comes from the photograph, which may be dark: "auto" takes 0.5 for it.
const DARK_EV: f64 = 3.0;
/// How many times another focal length is longer or shorter: cameras round theirs, and count it by diagonal or by width.
const OTHER_FOCAL_LENGTH: f64 = 1.1;

/// One warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    pub check: Check,
    /// "problem; mend".
    pub message: String,
}

impl Finding {
    fn new(check: Check, message: String) -> Self {
        Self { check, message }
    }
}

/// The message, and how to silence it.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { check, message } = self;
        let name = check.name();
        write!(f, "{message} (meant so: [check] allow = [\"{name}\"])")
    }
}

/// What of the scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// All of it: a still from the scene's own camera.
    Still,
    /// Without the camera, which a trajectory brings.
    WithoutCamera,
}

/// All findings that the scene does not allow, without the exposure, which asks for rays: [`exposure`].
pub fn scene(scene: &Scene, extent: Extent) -> Vec<Finding> {
    let feet: Vec<Option<Foot>> = scene.objects.iter().map(foot_of).collect();
    let mut findings = lights::findings(scene);
    findings.extend(standing::findings(scene, &feet));
    if extent == Extent::Still {
        findings.extend(frame::findings(scene, &feet));
    }
    findings.retain(|finding| !scene.allowed.contains(&finding.check));
    findings
}

/// Of a virtual object that does not move.
fn foot_of(object: &Object) -> Option<Foot> {
    let stands = object.side == Side::Virtual && !object.is_animated();
    stands.then(|| foot(&object.instances, object.world_from_object))?
}

/// That the light does not fit the photograph; `fitted_ev` is what "auto" would take.
pub fn exposure(scene: &Scene, fitted_ev: Option<f64>) -> Option<Finding> {
    let (Exposure::Ev(ev), Some(fitted_ev)) = (scene.settings.exposure, fitted_ev) else {
        return None;
    };
    let off = fitted_ev - ev;
    let least = match scene.objects.iter().any(|object| object.albedo_from_photo) {
        true => -DARK_EV,
        false => -LARGE_EV,
    };
    if (least..=LARGE_EV).contains(&off) || scene.allowed.contains(&Check::Exposure) {
        return None;
    }
    let what = match off > 0.0 {
        true => "weak",
        false => "strong",
    };
    // Never "-0.0".
    let fitted_ev = (fitted_ev * 10.0).round() / 10.0 + 0.0;
    let finding = format!(
        "the light is {:.1} stops too {what} for the photograph: set exposure_ev = {fitted_ev:.1} or \"auto\" in [photo], or the strength of the lights",
        off.abs()
    );
    Some(Finding::new(Check::Exposure, finding))
}

/// The same, where a render says it by itself: `limited` is the share of the proxy that no albedo makes as bright as the photograph.
pub fn limited_albedo(scene: &Scene, limited: Option<f64>) -> Option<Finding> {
    let share = limited.filter(|_| !scene.allowed.contains(&Check::Exposure))?;
    let finding = format!(
        "{:.0}% of the proxy's albedo lies at its limit: the light does not fit the photograph, and shadows will be wrong; set exposure_ev = \"auto\", or composite = \"quotient\"",
        100.0 * share
    );
    Some(Finding::new(Check::Exposure, finding))
}

/// That the camera does not see as the one that took the photograph did; `noted_px` is what that one notes of its focal length.
pub fn focal_length(scene: &Scene, noted_px: Option<f64>) -> Option<Finding> {
    let camera = &scene.camera;
    let noted_px = noted_px.filter(|_| camera.distortion.model != LENS_FISHEYE)?;
    let has_px = (camera.fx * camera.fy).sqrt();
    let off = has_px / noted_px;
    if (1.0 / OTHER_FOCAL_LENGTH..=OTHER_FOCAL_LENGTH).contains(&off)
        || scene.allowed.contains(&Check::FocalLength)
    {
        return None;
    }
    let fov_deg = |focal_px: f64| {
        let half = f64::from(camera.height) / (2.0 * focal_px);
        (2.0 * half.atan()).to_degrees()
    };
    let finding = format!(
        "the photograph's camera notes a focal length of {noted_px:.0} pixels, the scene has {has_px:.0}: set vertical_fov_deg = {:.1} in [camera], which is {:.1} now",
        fov_deg(noted_px),
        fov_deg(has_px)
    );
    Some(Finding::new(Check::FocalLength, finding))
}

/// A length for people, metres.
struct Metres(f64);

impl fmt::Display for Metres {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            m if m < 0.01 => write!(f, "{:.1} mm", m * 1e3),
            m if m < 1.0 => write!(f, "{:.1} cm", m * 1e2),
            m if m < 1e4 => write!(f, "{m:.1} m"),
            m => write!(f, "{m:.1e} m"),
        }
    }
}
