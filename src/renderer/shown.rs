//! What a film shows.

use std::borrow::Cow;

use super::Renderer;
use crate::film::{Film, Picture, Planes, composite, estimated_error, filter_difference, planes};

impl Renderer {
    /// The film as pictures show it.
    fn shown(&self) -> Cow<'_, Film> {
        if self.core.options.filter {
            Cow::Owned(filter_difference(&self.core.film, &self.surfaces))
        } else {
            Cow::Borrowed(&self.core.film)
        }
    }

    /// The film composited over the photograph.
    pub fn picture(&self) -> Picture {
        composite(
            &self.shown(),
            self.core.scene.photo.as_ref(),
            self.core.scene.settings.composite,
        )
    }

    /// The variance plane is that of the scrambles where there are any, else that of the samples.
    pub fn planes(&self) -> Planes {
        let mut planes = planes(&self.shown(), self.core.scene.photo.as_ref());
        if let Some(stated) = &self.stated {
            planes.variance.clone_from(&stated.variance);
        }
        planes
    }

    /// Root-mean-square error of the picture, linear: from the scrambles where there are any, else from the variance of the samples, which
    /// overstates that of a stratified sampler.
    pub fn error(&self) -> f64 {
        match &self.stated {
            Some(stated) => stated.rms(),
            None => estimated_error(&self.core.film, self.core.scene.photo.as_ref()),
        }
    }
}
