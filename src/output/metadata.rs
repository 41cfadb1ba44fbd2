//! What an EXR file says of how it was made: nothing that differs between equal renders.

use std::collections::HashMap;

use exr::prelude::Text;
use exr::prelude::attribute::AttributeValue;

use super::exr_text::text_value;
use crate::distortion::LENS_FISHEYE;
use crate::renderer::Renderer;
use crate::scene::{
    Aperture, Camera, Choice, Combine, Composite, Estimator, Exposure, Lens, MotionBlurMethod,
    MotionBlurSettings, SamplerKind, Scene,
};

/// What the file says about how it was made.
#[derive(Clone, Debug)]
pub struct Metadata {
    pub rays_per_pixel: u32,
    pub max_bounces: u32,
    pub seed: u32,
    pub estimator: Estimator,
    pub sampler: SamplerKind,
    pub camera: Camera,
    pub lens: Lens,
    pub composite: Composite,
    pub combine: Combine,
    /// Scene radiance is times 2 to the power of this, as fitted where the scene says "auto".
    pub exposure_ev: f64,
    /// Stages that the picture went through after the composite.
    pub stages: String,
    /// [`Scene::fingerprint`](crate::scene::Scene::fingerprint).
    pub scene_hash: String,
    /// Independent scrambles that the variance plane is taken from; `None`: it is that of the samples.
    pub scrambles: Option<u32>,
    /// A filter has smoothed the picture.
    pub filtered: bool,
}

impl Metadata {
    /// Of a picture as rendered: fewer rays per pixel than the scene asks for where the render was ended early.
    pub fn of(renderer: &Renderer, scene_hash: String) -> Self {
        let scene = renderer.scene();
        Self {
            rays_per_pixel: renderer.samples(),
            filtered: renderer.filter().is_some(),
            scrambles: renderer.stated().map(|stated| stated.scrambles),
            max_bounces: scene.settings.max_bounces,
            seed: scene.settings.seed,
            estimator: scene.settings.estimator,
            sampler: scene.settings.sampler,
            camera: scene.camera.clone(),
            lens: scene.lens,
            composite: scene.settings.composite,
            combine: scene.settings.combine,
            exposure_ev: match scene.settings.exposure {
                Exposure::Ev(ev) => ev,
                // Fitted before the first ray.
                Exposure::Auto => 0.0,
            },
            stages: stages_of(scene),
            scene_hash,
        }
    }

    pub(super) fn attributes(&self) -> HashMap<Text, AttributeValue> {
        let text = text_value;
        let number = |x: u32| AttributeValue::F64(f64::from(x));
        let aperture = match self.lens.aperture {
            Aperture::Disc => "disc".to_owned(),
            Aperture::Square => "square".to_owned(),
            Aperture::Blades(count) => format!("{count} blades"),
        };
        let camera = &self.camera;
        let rows = camera.world_from_camera.transpose().to_cols_array();
        let lens = &camera.distortion;
        let is_fisheye = lens.model == LENS_FISHEYE;
        let count = if is_fisheye { 4 } else { 12 };
        let given = &lens.coefficients[..count];
        let distortion = given
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(" ");
        let lens_model = if is_fisheye { "fisheye" } else { "opencv" };
        let filter = if self.filtered {
            "preview: the difference is smoothed, biased"
        } else {
            "none"
        };
        let variance = match self.scrambles {
            Some(count) => format!("of the mean of {count} independent scrambles"),
            None => "of the samples: an upper estimate".to_owned(),
        };
        [
            ("mixray.version", text(env!("CARGO_PKG_VERSION"))),
            ("mixray.raysPerPixel", number(self.rays_per_pixel)),
            ("mixray.maxBounces", number(self.max_bounces)),
            ("mixray.seed", number(self.seed)),
            ("mixray.estimator", text(self.estimator.name())),
            ("mixray.sampler", text(self.sampler.name())),
            ("mixray.composite", text(self.composite.name())),
            ("mixray.combine", text(self.combine.name())),
            ("mixray.exposureEv", AttributeValue::F64(self.exposure_ev)),
            ("mixray.stages", text(&self.stages)),
            ("mixray.sceneHash", text(&self.scene_hash)),
            (
                "mixray.lens.apertureRadius",
                AttributeValue::F64(self.lens.aperture_radius_m),
            ),
            (
                "mixray.lens.focusDistance",
                AttributeValue::F64(self.lens.focus_distance_m),
            ),
            ("mixray.lens.aperture", text(&aperture)),
            ("mixray.variance", text(&variance)),
            ("mixray.filter", text(filter)),
            ("mixray.camera.fx", AttributeValue::F64(camera.fx)),
            ("mixray.camera.fy", AttributeValue::F64(camera.fy)),
            ("mixray.camera.cx", AttributeValue::F64(camera.cx)),
            ("mixray.camera.cy", AttributeValue::F64(camera.cy)),
            ("mixray.camera.distortion", text(&distortion)),
            ("mixray.camera.lensModel", text(lens_model)),
            // Rows, column vectors: the scene file's own order.
            (
                "mixray.camera.worldFromCamera",
                AttributeValue::Matrix4x4(rows.map(|x| x as f32)),
            ),
        ]
        .into_iter()
        .map(|(name, value)| (Text::from(name), value))
        .collect()
    }
}

/// Those that the scene asks for, in the order in which a picture goes through them, or "none".
fn stages_of(scene: &Scene) -> String {
    let stages = &scene.stages;
    let copies = |blur: &MotionBlurSettings| blur.method == MotionBlurMethod::Copies;
    let names = [
        (stages.antialias.as_ref()).map(|antialias| format!("antialias (beta {})", antialias.beta)),
        (stages.motion_blur.as_ref().filter(|blur| copies(blur))).map(|_| "copies".to_owned()),
        (stages.sharpness.as_ref()).map(|_| "sharpness".to_owned()),
        (stages.noise.as_ref())
            .map(|noise| format!("noise ({}, scale {})", noise.method.name(), noise.scale)),
        (stages.cartoon.as_ref()).map(|cartoon| format!("cartoon ({})", cartoon.style.name())),
    ];
    let names: Vec<String> = names.into_iter().flatten().collect();
    match names.is_empty() {
        true => "none".to_owned(),
        false => names.join(", "),
    }
}

#[cfg(test)]
pub(super) mod test_support {
    use super::*;
    use crate::scene::Distortion;

    /// Of a picture of 3 x 2 pixels.
    pub(in crate::output) fn metadata() -> Metadata {
        Metadata {
            rays_per_pixel: 40,
            max_bounces: 3,
            seed: 1,
            estimator: Estimator::Paper,
            sampler: SamplerKind::Cmj,
            camera: Camera {
                width: 3,
                height: 2,
                fx: 1.0,
                fy: 1.0,
                cx: 1.5,
                cy: 1.0,
                distortion: Distortion::NONE,
                world_from_camera: glam::DMat4::IDENTITY,
            },
            lens: Lens::PINHOLE,
            composite: Composite::Additive,
            combine: Combine::Mean,
            exposure_ev: 0.0,
            stages: "none".to_owned(),
            scene_hash: "0123456789abcdef0123456789abcdef".to_owned(),
            scrambles: None,
            filtered: false,
        }
    }
}
