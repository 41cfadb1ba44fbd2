//! A number that tells two scenes apart.

use std::fmt::{self, Write};

use super::{Scene, Settings};

impl Scene {
    /// 16 hexadecimal digits of everything that the converged picture depends on, contents of all files included: geometry, materials, textures,
    /// photograph, lights, camera, lens, exposure, path depth. How it is sampled (rays per pixel, seed, estimator, sampler, backend), the
    /// composite and the scene's place on disk do not matter.
    pub fn fingerprint(&self) -> String {
        let mut hash = Fnv1a(0xcbf2_9ce4_8422_2325);
        let Settings {
            max_bounces,
            clamp_indirect,
            exposure,
            rays_per_pixel: _,
            seed: _,
            estimator: _,
            sampler: _,
            composite: _,
            backend: _,
        } = &self.settings;
        let Self {
            name: _,
            path: _,
            inputs: _,
            stages: _,
            photo,
            camera,
            lens,
            environment,
            lights,
            objects,
            shutter,
            camera_path,
            settings: _,
            warnings: _,
        } = self;
        // `Debug` writes every field, and numbers so that they read back exactly; the hash never fails.
        let _ = write!(
            hash,
            "{max_bounces} {clamp_indirect:?} {exposure:?} {camera:?} {lens:?} {environment:?} {lights:?} {objects:?} {shutter:?} {camera_path:?}"
        );
        if let Some(photo) = photo {
            let _ = write!(hash, "{} {}", photo.width, photo.height);
            hash.bytes(bytemuck::cast_slice(&photo.linear));
        }
        format!("{:016x}", hash.0)
    }
}

/// 16 hexadecimal digits of these texts.
pub fn fingerprint_of<'a>(texts: impl IntoIterator<Item = &'a str>) -> String {
    let mut hash = Fnv1a(0xcbf2_9ce4_8422_2325);
    for text in texts {
        hash.bytes(text.as_bytes());
        hash.bytes(&[0]);
    }
    format!("{:016x}", hash.0)
}

/// FNV-1a, 64 bits (Fowler, Noll, Vo).
struct Fnv1a(u64);

impl Fnv1a {
    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

impl Write for Fnv1a {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.bytes(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn fnv_1a_of_its_authors_test_vectors() {
        for (text, expected) in [
            ("", 0xcbf2_9ce4_8422_2325),
            ("a", 0xaf63_dc4c_8601_ec8c),
            ("foobar", 0x8594_4171_f739_67e8_u64),
        ] {
            let mut hash = Fnv1a(0xcbf2_9ce4_8422_2325);
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0, expected, "{text}");
        }
    }

    #[test]
    fn what_changes_the_picture_changes_the_fingerprint() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/far/scene.toml");
        let scene = crate::scene::load(&path).unwrap();
        let before = scene.fingerprint();
        let mut sampled_otherwise = scene.clone();
        sampled_otherwise.settings.seed += 1;
        sampled_otherwise.settings.rays_per_pixel += 1;
        sampled_otherwise.name.push('x');
        assert_eq!(sampled_otherwise.fingerprint(), before);

        let changes: [fn(&mut Scene); 5] = [
            |s| s.settings.max_bounces += 1,
            |s| s.lens.focus_distance_m += 1e-12,
            |s| s.photo.as_mut().unwrap().linear[77][1] += 1e-6,
            |s| s.lights.truncate(0),
            |s| {
                let primitive = &mut s.objects.last_mut().unwrap().instances[0].primitive;
                let mut moved = (**primitive).clone();
                moved.positions[3][0] = moved.positions[3][0].next_up();
                *primitive = std::sync::Arc::new(moved);
            },
        ];
        for (number, change) in changes.into_iter().enumerate() {
            let mut changed = scene.clone();
            change(&mut changed);
            assert_ne!(changed.fingerprint(), before, "change {number}");
        }
    }
}
