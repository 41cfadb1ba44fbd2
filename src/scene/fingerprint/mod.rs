//! Fingerprints tell scenes apart by what they hold.

pub(crate) mod content;
mod parts;
#[cfg(test)]
mod tests;

pub use content::{Content, ContentHash};
pub(crate) use content::{content, content_by_name};

use super::{Scene, Settings};

impl Scene {
    /// 32 hexadecimal digits of everything that the converged film depends on, contents of all files included: geometry, materials, textures,
    /// photograph, lights, camera, lens, exposure, path depth. How it is sampled (rays per pixel, seed, estimator, sampler, backend), the
    /// composite and its combination, the camera stages, names and places on disk do not matter. The same on every machine.
    pub fn fingerprint(&self) -> String {
        let mut hash = ContentHash::default();
        let Settings {
            max_bounces,
            clamp_indirect,
            exposure,
            backdrop,
            multiple_scattering,
            rays_per_pixel: _,
            seed: _,
            estimator: _,
            sampler: _,
            composite: _,
            combine: _,
            backend: _,
            upright_photo: _,
        } = &self.settings;
        let Self {
            name: _,
            path: _,
            inputs: _,
            stages: _,
            allowed: _,
            focal_length_mm: _,
            photo_file: _,
            photo,
            camera,
            lens,
            environment,
            lights,
            objects,
            shutter,
            camera_path,
            focus_path,
            settings: _,
            warnings: _,
        } = self;
        (
            max_bounces,
            (clamp_indirect, (exposure, (backdrop, multiple_scattering))),
        )
            .add_to(&mut hash);
        (photo, (camera, lens)).add_to(&mut hash);
        (environment, lights).add_to(&mut hash);
        (objects, (shutter, camera_path)).add_to(&mut hash);
        // Scenes from before there were such keys keep their fingerprint.
        if !focus_path.is_empty() {
            focus_path.add_to(&mut hash);
        }
        hash.finish()
    }
}
