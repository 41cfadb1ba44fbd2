//! Edits of the scene's text, which is then read anew: what comes and goes.

use std::path::Path;
use std::sync::Arc;

use glam::DVec2;

use super::Session;
use crate::preview::composition::{Placement, virtual_objects};
use crate::preview::document::{Document, name_of};

/// Of files that [`Session::take_file`] takes.
pub const TAKEN_ENDINGS: [&str; 9] = [
    "toml", "glb", "gltf", "png", "jpg", "jpeg", "webp", "hdr", "exr",
];

impl Session {
    /// A file that was dropped: a scene, a mesh, or an image; at that position of the photograph.
    pub fn take_file(&mut self, file: &Path, pixel: Option<DVec2>) {
        let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("toml") => self.switch(file),
            Some("glb" | "gltf") => {
                let at = pixel
                    .and_then(|pixel| self.pick(pixel))
                    .map(|pick| pick.point);
                let placement = Placement {
                    translation: at.unwrap_or_default(),
                    ..Placement::IDENTITY
                };
                let name = name_of(file, &self.path);
                self.rewrite("add", |document| document.add_mesh(&name, &placement));
            }
            Some("hdr" | "exr") => {
                let name = name_of(file, &self.path);
                self.rewrite("environment", |d| d.set_image("environment", &name));
            }
            Some("png" | "jpg" | "jpeg" | "webp") => {
                let name = name_of(file, &self.path);
                self.rewrite("photograph", |d| d.set_image("photo", &name));
            }
            _ => {
                self.problem = Some(format!(
                    "{}: nothing to do with it; expected a scene (.toml), a mesh (.glb, .gltf), a photograph (.png, .jpg) or an \
                     environment (.exr, .hdr); drop one of these",
                    file.display()
                ));
            }
        }
    }

    /// Takes an object out.
    pub fn remove(&mut self, object: usize) {
        let Some(loaded) = &self.loaded else {
            return;
        };
        let place = virtual_objects(&loaded.scene).position(|index| index == object);
        if let Some(place) = place {
            self.rewrite("remove", |document| document.remove_virtual(place));
        }
    }

    /// An edit of the text, which is then read anew.
    fn rewrite(&mut self, change: &'static str, edit: impl FnOnce(&mut Document)) {
        let document = self.text().map(|text| Document::parse(&text));
        if let Some(Ok(mut document)) = document {
            edit(&mut document);
            self.read(Arc::from(document.text()), None, Some(change), false);
        }
    }
}
