//! What an EXR file of a render holds.

use super::channels::is_half;
use super::{ExrLayer, ExrLayers, Metadata};
use crate::film::{Film, Parts, Picture, Planes, planes};
use crate::renderer::{Mattes, MotionVectors, Renderer};
use crate::scene::{Composite, EncodedPhoto, Photo};
use crate::stages::{Added, Finished};

/// A picture with its layers, linear Rec.709. Those that are empty are left out of the file.
#[derive(Clone, Debug)]
pub struct ExrPicture {
    /// R, G and B, opaque.
    pub picture: Picture,
    pub planes: Planes,
    pub parts: Parts,
    /// What stages added to the composite.
    pub added: Added,
    /// What moves where; `None`: nobody asked.
    pub motion: Option<MotionVectors>,
    /// The objects apart; `None`: nobody asked.
    pub mattes: Option<Mattes>,
    /// `None`: of a frame that is passed on as it came.
    pub metadata: Option<Metadata>,
    /// The photograph has finer steps than half floats: R, G and B keep all of its bits.
    pub keeps_photo: bool,
}

impl ExrPicture {
    /// The picture and its planes alone.
    pub fn new(picture: Picture, planes: Planes, metadata: Metadata) -> Self {
        Self {
            picture,
            planes,
            parts: Parts::default(),
            added: Added::default(),
            motion: None,
            mattes: None,
            metadata: Some(metadata),
            keeps_photo: false,
        }
    }

    /// A render with these layers; `finished` is what the stages made of `shown`, whose film the parts are taken from.
    pub fn of(
        renderer: &Renderer,
        metadata: Metadata,
        shown: &Film,
        finished: Finished,
        layers: &ExrLayers,
    ) -> Self {
        let scene = renderer.scene();
        let mut exr = Self::new(finished.picture, renderer.planes(), metadata);
        if layers.need_parts() {
            exr.parts = Parts::of(shown, scene.settings.composite);
        }
        exr.added = finished.added;
        exr.keeps_photo = scene.photo.as_ref().is_some_and(is_fine);
        exr.pick(layers);
        exr
    }

    /// A frame in which nothing is virtual, of a sequence that has virtual objects of these names.
    pub fn untouched(
        photo: &Photo,
        composite: Composite,
        layers: &ExrLayers,
        objects: &[String],
    ) -> Self {
        let film = Film::new(photo.width, photo.height, 0, layers.need_guides());
        let mut exr = Self {
            picture: Picture {
                width: photo.width,
                height: photo.height,
                linear: photo.linear.clone(),
            },
            planes: planes(&film, None),
            parts: Parts::of(&film, composite),
            added: Added {
                sharpness: vec![[0.0; 3]; film.pixels.len()],
                noise: vec![[0.0; 3]; film.pixels.len()],
            },
            motion: (layers.need_motion()).then(|| MotionVectors::none(film.pixels.len())),
            mattes: (layers.need_mattes())
                .then(|| Mattes::empty(objects.to_vec(), film.pixels.len())),
            metadata: None,
            keeps_photo: is_fine(photo),
        };
        exr.pick(layers);
        exr
    }

    /// Empties what is not among these, so that it is left out.
    fn pick(&mut self, layers: &ExrLayers) {
        let ExrPicture {
            picture,
            planes,
            parts,
            added,
            ..
        } = self;
        let colours = [
            (ExrLayer::Virtual, &mut parts.virtual_light),
            (ExrLayer::Change, &mut parts.change),
            (ExrLayer::Ratio, &mut parts.ratio),
            (ExrLayer::Sharpness, &mut added.sharpness),
            (ExrLayer::Noise, &mut added.noise),
            (ExrLayer::Composite, &mut picture.linear),
            (ExrLayer::Mixed, &mut planes.mixed),
            (ExrLayer::Real, &mut planes.real),
            (ExrLayer::Difference, &mut planes.difference),
            (ExrLayer::Albedo, &mut planes.albedo),
            (ExrLayer::Variance, &mut planes.variance),
            (ExrLayer::Normal, &mut planes.normal),
        ];
        for (layer, values) in colours {
            if !layers.has(layer) {
                values.clear();
            }
        }
        let numbers = [
            (ExrLayer::Virtual, &mut parts.coverage),
            (ExrLayer::Mask, &mut planes.mask),
            (ExrLayer::Depth, &mut planes.depth),
            (ExrLayer::Samples, &mut planes.samples),
        ];
        for (layer, values) in numbers {
            if !layers.has(layer) {
                values.clear();
            }
        }
    }
}

/// Whether half floats, which tell all codes of 8 bits apart, lose bits of it.
fn is_fine(photo: &Photo) -> bool {
    match &photo.encoded {
        EncodedPhoto::Codes8(_) => false,
        EncodedPhoto::Codes16(_) => true,
        EncodedPhoto::Linear => !photo.linear.iter().flatten().all(|value| is_half(*value)),
    }
}
