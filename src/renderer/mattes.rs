//! Which virtual object covers how much of each pixel: the camera rays of the film's samples once more, on the CPU whatever rendered them.

use std::cmp::Reverse;

use rayon::prelude::*;

use super::core::Core;
use super::{Driver, RenderError, Renderer};
use crate::cpu::render::first_virtual_triangle;
use crate::packed::NONE;
use crate::scene::{Object, Scene, Side};

/// Objects of one pixel that are told apart.
const MAX_RANKS: usize = 6;

/// The virtual objects of a picture, and how much of each pixel they cover: depth of field, motion and borders included.
#[derive(Clone, Debug, PartialEq)]
pub struct Mattes {
    /// Of the scene's virtual objects, in their order; of several of one name the later ones are numbered ("ball.2").
    pub names: Vec<String>,
    /// By rank, the widest coverage first: for each pixel, row-major from the top left, an index of `names` and the share of the pixel's rays
    /// that met that object first, 0 to 1; (0, 0) where there is none.
    pub ranks: Vec<Vec<(u32, f32)>>,
}

impl Mattes {
    /// Of a picture of this scene that shows none of its objects.
    pub fn empty(names: Vec<String>, pixels: usize) -> Self {
        let count = names.len().min(MAX_RANKS);
        Self {
            names,
            ranks: vec![vec![(0, 0.0); pixels]; count],
        }
    }

    /// The names that a scene's virtual objects have in mattes.
    pub fn names_of(scene: &Scene) -> Vec<String> {
        unlike(&scene.objects[first_virtual(scene)..])
    }
}

/// Rays of one pixel, by the object of the scene that they met first.
type Tally = Vec<(u32, u32)>;

impl Renderer {
    /// The coverage of each virtual object: their sum is the film's M. A film that [`Renderer::render_to_error`] made is looked at with as many
    /// other rays a pixel.
    ///
    /// # Errors
    /// As [`Renderer::advance`].
    pub fn mattes(&mut self) -> Result<Mattes, RenderError> {
        let core = &mut self.core;
        let mut tallies = vec![Tally::new(); core.film.pixels.len()];
        match &self.driver {
            Driver::Still => look(core, &mut tallies, |_| u32::MAX),
            Driver::Moving(moving) => moving.each_instant(core, |core, ends| {
                look(core, &mut tallies, |row| ends[row]);
            })?,
        }
        Ok(ranked(core, &tallies))
    }
}

/// Takes up the film's samples before `end_of_row`, in rays per pixel, that are not in the tallies.
fn look(core: &Core, tallies: &mut [Tally], end_of_row: impl Fn(usize) -> u32 + Sync) {
    let (film, packed) = (&core.film, &core.packed);
    let pixels = tallies.par_iter_mut().enumerate();
    // Where no ray of the render met anything virtual none does.
    let shows = pixels.filter(|(pixel, _)| film.pixels[*pixel].m > 0);
    shows.for_each(|(pixel, tally)| {
        let first = film.first_index(pixel);
        let seen: u32 = tally.iter().map(|(_, rays)| rays).sum();
        let end = end_of_row(pixel / film.width as usize);
        let factor = film.pixels[pixel].sample_factor.max(1);
        let end = end.saturating_mul(factor).min(first + film.pixels[pixel].n);
        for index in first + seen..end {
            let object = match first_virtual_triangle(packed, pixel as u32, index) {
                NONE => NONE,
                triangle => packed.triangles[triangle as usize].object,
            };
            match tally.iter_mut().find(|(other, _)| *other == object) {
                Some((_, rays)) => *rays += 1,
                None => tally.push((object, 1)),
            }
        }
    });
}

fn ranked(core: &Core, tallies: &[Tally]) -> Mattes {
    let mut mattes = Mattes::empty(Mattes::names_of(&core.scene), tallies.len());
    let first = first_virtual(&core.scene) as u32;
    for (pixel, tally) in tallies.iter().enumerate() {
        let taken = core.film.pixels[pixel].n as f32;
        let mut covering: Vec<_> = tally.iter().filter(|(object, _)| *object != NONE).collect();
        covering.sort_by_key(|(object, rays)| (Reverse(*rays), *object));
        for (rank, (object, rays)) in mattes.ranks.iter_mut().zip(covering) {
            rank[pixel] = (object - first, *rays as f32 / taken);
        }
    }
    mattes
}

/// Real objects come before the virtual ones.
fn first_virtual(scene: &Scene) -> usize {
    scene
        .objects
        .partition_point(|object| object.side == Side::Real)
}

/// The objects' names, with a number behind those that an earlier one has.
fn unlike(objects: &[Object]) -> Vec<String> {
    let mut names = Vec::<String>::new();
    for object in objects {
        let numbered = (2..).map(|number| format!("{}.{number}", object.name));
        let mut candidates = std::iter::once(object.name.clone()).chain(numbered);
        names.extend(candidates.find(|name| !names.contains(name)));
    }
    names
}
