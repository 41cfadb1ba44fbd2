//! What a film shows.

use std::borrow::Cow;

use super::core::Core;
use super::{Filter, Renderer};
use crate::cpu::estimator::evaluations_before;
use crate::film::{
    Combined, Film, GROUPS, Picture, Planes, combine_robustly, composite, composite_smoothed,
    enlarge, enlarged, estimated_error, filter_difference, filter_finally, group_counts, planes,
    smoothed_difference,
};
use crate::scene::Composite;

/// What is delivered of a film.
#[derive(Clone, Debug)]
pub struct Delivered<'a> {
    pub picture: Picture,
    /// The film that it is composited from, of the camera's size.
    pub film: Cow<'a, Film>,
    /// Of the difference in real pixels, the share that the robust combination gave to other pixels nearby; `None` for means.
    pub moved: Option<f64>,
}

impl Renderer {
    /// The film as pictures show it.
    fn shown(&self) -> Cow<'_, Film> {
        if self.core.options.filter == Some(Filter::Preview) {
            Cow::Owned(filter_difference(&self.core.film, &self.surfaces))
        } else {
            Cow::Borrowed(&self.core.film)
        }
    }

    /// Less is traced than the camera has pixels.
    fn is_coarse(&self) -> bool {
        let Core { film, scene, .. } = &self.core;
        (film.width, film.height) != (scene.camera.width, scene.camera.height)
    }

    /// The film in the size of the camera.
    fn whole<'a>(&self, film: Cow<'a, Film>) -> Cow<'a, Film> {
        if !self.is_coarse() {
            return film;
        }
        let camera = &self.core.scene.camera;
        let mode = self.core.scene.settings.composite;
        Cow::Owned(enlarged(&film, camera.width, camera.height, mode))
    }

    /// The film composited over the photograph: means of the samples.
    pub fn picture(&self) -> Picture {
        let Core { film, scene, .. } = &self.core;
        match self.core.options.filter {
            Some(Filter::Preview) if !self.is_coarse() => composite_smoothed(
                film,
                &smoothed_difference(film, &self.surfaces),
                scene.photo.as_ref(),
                scene.settings.composite,
            ),
            Some(Filter::Preview) => self.composited(&self.whole(self.shown())),
            Some(Filter::Final) | None => self.composited(&self.whole(Cow::Borrowed(film))),
        }
    }

    /// The film as it is delivered, of the size that is traced: with the scene's combination of samples, or filtered; and the share of the difference that
    /// the robust combination moved.
    fn combined(&self) -> (Cow<'_, Film>, Option<f64>) {
        let film = &self.core.film;
        // A quotient multiplies the photograph, whose grain would come into the difference as well.
        let photo = match self.core.scene.settings.composite {
            Composite::Additive => self.core.traced_photo(),
            Composite::Quotient => None,
        };
        let counts = |pixel| self.group_counts(pixel);
        match self.core.options.filter {
            Some(Filter::Final) => {
                let film = filter_finally(film, photo, &self.surfaces, counts);
                (Cow::Owned(film), None)
            }
            None if !film.groups.is_empty() => {
                let Combined { film, moved } = combine_robustly(film, photo, counts);
                (Cow::Owned(film), Some(moved))
            }
            Some(Filter::Preview) | None => (self.shown(), None),
        }
    }

    /// The picture as it is delivered.
    pub fn delivered(&self) -> Delivered<'_> {
        let (film, moved) = self.combined();
        let film = self.whole(film);
        Delivered {
            picture: self.composited(&film),
            film,
            moved,
        }
    }

    /// The film of [`Delivered`] in place of what `whole` held, which has the camera's size: memory that is there is used again.
    pub fn deliver_into(&self, whole: &mut Film) {
        let (film, _) = self.combined();
        match self.is_coarse() {
            true => enlarge(&film, self.core.scene.settings.composite, whole),
            false => *whole = film.into_owned(),
        }
    }

    /// Evaluations of a pixel's difference, by group.
    fn group_counts(&self, pixel: usize) -> [u32; GROUPS as usize] {
        let Core { film, packed, .. } = &self.core;
        let sums = &film.pixels[pixel];
        if self.stated.is_some() {
            return group_counts(0, sums.n / sums.sample_factor.max(1));
        }
        let first = film.first_index(pixel);
        let [first, end] =
            [first, first + sums.n].map(|index| evaluations_before(packed, pixel as u32, index));
        group_counts(first, end)
    }

    fn composited(&self, film: &Film) -> Picture {
        composite(
            film,
            self.core.scene.photo.as_ref(),
            self.core.scene.settings.composite,
        )
    }

    /// Of the size that is traced. The variance plane is that of the scrambles where there are any, else that of the samples.
    pub fn planes(&self) -> Planes {
        let mut planes = planes(&self.shown(), self.core.traced_photo());
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
            None => estimated_error(&self.core.film, self.core.traced_photo()),
        }
    }
}
