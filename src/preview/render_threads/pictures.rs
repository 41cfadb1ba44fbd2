//! What the two renderers show.

use std::sync::Arc;

use super::{Level, Shown, Wanted};
use crate::film::Picture;
use crate::output::picture_codes8;
use crate::preview::view::{View, false_colours, over_photo};
use crate::renderer::Renderer;
use crate::scene::Photo;
use crate::stages::finish;

/// Enlarged over the whole photograph.
pub(super) fn coarse_picture(renderer: &Renderer, wanted: &Wanted) -> Shown {
    let small = renderer.picture();
    // Planes would be filtered once more, which takes as long as the rays.
    let pixels = renderer.film().pixels.iter();
    let mask: Vec<f32> = pixels
        .map(|sums| sums.m as f32 / sums.n.max(1) as f32)
        .collect();
    let camera = &wanted.scene.camera;
    let size = [camera.width, camera.height];
    let photo = wanted.scene.photo.as_ref();
    let small_photo = renderer.scene().photo.as_ref();
    let (codes, [width, height]) = match wanted.view {
        View::Picture => (over_photo(&small, &mask, small_photo, photo, size), size),
        View::Photograph => (photo_codes(photo, size), size),
        view => {
            let scene = renderer.scene();
            let codes = false_colours(view, &small, &renderer.planes(), &scene.lens, &scene.camera);
            (codes, [small.width, small.height])
        }
    };
    shown(
        renderer,
        Level::Coarse,
        wanted,
        codes,
        [width, height],
        small,
    )
}

/// As it is delivered.
pub(super) fn fine_picture(renderer: &Renderer, wanted: &Wanted) -> Shown {
    let scene = renderer.scene();
    let delivered = renderer.delivered().picture;
    let finished = finish(delivered, renderer.film(), scene, 0, None, None);
    let photo = scene.photo.as_ref();
    let picture = finished.picture;
    let size = [picture.width, picture.height];
    let codes = match wanted.view {
        View::Picture => picture_codes8(&picture, photo),
        View::Photograph => photo_codes(photo, size),
        view => false_colours(
            view,
            &picture,
            &renderer.planes(),
            &scene.lens,
            &scene.camera,
        ),
    };
    let mut shown = shown(renderer, Level::Fine, wanted, codes, size, picture);
    shown.notes.extend(finished.notes);
    shown
}

fn shown(
    renderer: &Renderer,
    level: Level,
    wanted: &Wanted,
    codes: Vec<[u8; 3]>,
    [width, height]: [u32; 2],
    picture: Picture,
) -> Shown {
    Shown {
        revision: wanted.revision,
        level,
        view: wanted.view,
        width,
        height,
        codes,
        picture,
        scene: Arc::downgrade(&wanted.scene),
        composition: wanted.composition.clone(),
        samples: renderer.samples(),
        samples_total: wanted.composition.rays_per_pixel,
        device: renderer.device_name(),
        notes: renderer.notes().to_vec(),
    }
}

/// The photograph as it is shown; black without one.
pub fn photo_codes(photo: Option<&Photo>, [width, height]: [u32; 2]) -> Vec<[u8; 3]> {
    let linear = photo.map_or_else(
        || vec![[0.0; 3]; width as usize * height as usize],
        |photo| photo.linear.clone(),
    );
    let picture = Picture {
        width,
        height,
        linear,
    };
    picture_codes8(&picture, photo)
}
