//! The stages that a scene asks for, in their order.

use super::EncodedImage;
use super::cartoon::cartoon;
use crate::film::Picture;
use crate::scene::Stages;

/// Applies the stages to a composite. Without a stage it comes back as it is.
pub fn finish(picture: Picture, stages: &Stages) -> Picture {
    match &stages.cartoon {
        Some(settings) => cartoon(&EncodedImage::from_picture(&picture), settings, false)
            .image
            .to_picture(),
        None => picture,
    }
}
