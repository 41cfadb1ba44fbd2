//! Films of sample ranges, put together.

use super::{RenderError, Renderer, RendererOptions, Without};
use crate::film::{Film, MergeError};
use crate::scene::Scene;
use crate::work::Watcher;

impl Renderer {
    /// A renderer that goes on from the film of an earlier one of the same scene, settings and savings left out: it stands at the film's last sample, which
    /// comes just before `end` in rays per pixel, and traces what edge pixels lack; `real_everywhere` as in [`RendererOptions`].
    ///
    /// # Errors
    /// As [`Renderer::new`]; or the film is of another size than the camera.
    pub fn with_film(
        scene: Scene,
        film: Film,
        end: u32,
        real_everywhere: bool,
        without: Without,
        watcher: &Watcher<'_>,
    ) -> Result<Self, RenderError> {
        let size = (scene.camera.width, scene.camera.height);
        if (film.width, film.height) != size {
            let sizes = MergeError::Size(film.width, film.height, size.0, size.1);
            return Err(sizes.into());
        }
        let options = RendererOptions {
            guides: !film.guides.is_empty(),
            real_everywhere,
            sample_range: Some((film.first_sample, end)),
            without,
            ..RendererOptions::default()
        };
        let mut renderer = Self::new(scene, options, watcher)?;
        // The film's samples were taken by its own plan: on a machine that rounds otherwise, another one than ours.
        for (info, sums) in renderer.core.packed.pixels.iter_mut().zip(&film.pixels) {
            info.sample_factor = sums.sample_factor.max(1);
        }
        renderer.core.film = film;
        renderer.core.film_is_new = false;
        renderer.driver.replay_real(&mut renderer.core)?;
        Ok(renderer)
    }

    /// Adds the film of another renderer of the same scene whose samples come just before or just after this one's, and traces what edge
    /// pixels then lack. The result equals one render of both ranges within 2 units in the last place.
    ///
    /// # Errors
    /// The films differ in size or planes, or their ranges leave a gap or overlap; nothing is changed then.
    pub fn merge(&mut self, other: &Film) -> Result<(), RenderError> {
        self.core.film_is_new = false;
        self.core.film.merge(other)?;
        let end = self.core.film.first_sample + self.samples();
        self.end_sample = self.end_sample.max(end);
        self.driver.replay_real(&mut self.core)
    }
}
