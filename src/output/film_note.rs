//! What a film file says of the render that it is a part of.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::renderer::Without;
use crate::scene::{
    Choice, Combine, Composite, Estimator, Overrides, SamplerKind, Scene, Settings,
};

/// What a film is a part of: only parts of one render can be put together.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FilmNote {
    /// Of the program that rendered it.
    pub version: String,
    /// [`Scene::fingerprint`]: this names the scene.
    pub fingerprint: String,
    /// Where to look for the scene file. In the file it is relative to the film's folder; `None`: there is no way from one to the other.
    pub scene: Option<PathBuf>,
    /// The samples that every pixel within reach has taken: first and end.
    pub range: (u32, u32),
    /// Rays per pixel of the whole render.
    pub total: u32,
    pub max_bounces: u32,
    pub seed: u32,
    #[serde(with = "by_name")]
    pub estimator: Estimator,
    #[serde(with = "by_name")]
    pub sampler: SamplerKind,
    #[serde(with = "by_name")]
    pub composite: Composite,
    #[serde(with = "by_name")]
    pub combine: Combine,
    /// Savings that were left out, as far as films show it ([`Without::of_films`]): real rays that edge pixels lack are traced as the others were.
    #[serde(with = "savings")]
    pub without: Without,
}

/// The attribute that holds a [`FilmNote`] as JSON.
pub(super) const NOTE: &str = "mixray.film";
/// The attribute that films of the first form had.
pub(super) const NOTE_OF_FORM_1: &str = "mixray.film.version";
/// The form of note and channels that this program writes and reads.
pub(super) const FORM: u32 = 4;

#[derive(Serialize)]
struct WrittenNote<'a> {
    form: u32,
    #[serde(flatten)]
    note: &'a FilmNote,
}

#[derive(Deserialize)]
struct Form {
    form: u32,
}

/// Choices by their names.
mod by_name {
    use super::*;

    pub(super) fn serialize<T: Choice, S: Serializer>(
        choice: &T,
        to: S,
    ) -> Result<S::Ok, S::Error> {
        to.serialize_str(choice.name())
    }

    pub(super) fn deserialize<'de, T: Choice, D: Deserializer<'de>>(
        from: D,
    ) -> Result<T, D::Error> {
        let name = String::deserialize(from)?;
        let unknown = || serde::de::Error::custom(format!("\"{name}\" is not known"));
        T::from_name(&name).ok_or_else(unknown)
    }
}

/// Savings by their names.
mod savings {
    use super::*;

    pub(super) fn serialize<S: Serializer>(without: &Without, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&without.names())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Without, D::Error> {
        let names = String::deserialize(from)?;
        let unknown = || serde::de::Error::custom(format!("the savings \"{names}\" are not known"));
        Without::from_names(&names).ok_or_else(unknown)
    }
}

impl FilmNote {
    /// Of a film that holds these samples of the scene's rays per pixel.
    pub fn new(scene: &Scene, range: (u32, u32), without: Without) -> Self {
        let settings = &scene.settings;
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            fingerprint: scene.fingerprint(),
            scene: scene.path.canonicalize().ok(),
            range,
            total: settings.rays_per_pixel,
            max_bounces: settings.max_bounces,
            seed: settings.seed,
            estimator: settings.estimator,
            sampler: settings.sampler,
            composite: settings.composite,
            combine: settings.combine,
            without,
        }
    }

    /// The settings that give the scene back as it was rendered.
    pub fn overrides(&self) -> Overrides {
        Overrides {
            rays_per_pixel: Some(self.total),
            max_bounces: Some(self.max_bounces),
            seed: Some(self.seed),
            estimator: Some(self.estimator),
            sampler: Some(self.sampler),
            composite: Some(self.composite),
            combine: Some(self.combine),
            backend: None,
        }
    }

    /// Why films with these notes are not parts of one render; the ranges are not looked at.
    pub fn mismatch(&self, other: &Self) -> Option<String> {
        let differ = |what: &str, a: &str, b: &str| {
            (a != b).then(|| format!("the films differ in their {what}: {a} and {b}"))
        };
        let number = |what: &str, a: u32, b: u32| differ(what, &a.to_string(), &b.to_string());
        differ("program version", &self.version, &other.version)
            .or_else(|| number("rays per pixel in all", self.total, other.total))
            .or_else(|| number("seed", self.seed, other.seed))
            .or_else(|| number("path depth", self.max_bounces, other.max_bounces))
            .or_else(|| differ("estimator", self.estimator.name(), other.estimator.name()))
            .or_else(|| differ("sampler", self.sampler.name(), other.sampler.name()))
            .or_else(|| differ("composite", self.composite.name(), other.composite.name()))
            .or_else(|| differ("combination", self.combine.name(), other.combine.name()))
            .or_else(|| {
                let [a, b] = [self.without, other.without].map(Without::names);
                differ("savings left out (--no-skip)", &a, &b)
            })
            .or_else(|| {
                (self.fingerprint != other.fingerprint).then(|| {
                    format!(
                        "the films are of different scenes: {} and {}",
                        self.fingerprint, other.fingerprint
                    )
                })
            })
    }

    /// The note as it stands in a film of that folder.
    pub(super) fn to_text(&self, folder: &Path) -> String {
        let way = |scene: &PathBuf| {
            let way = pathdiff::diff_paths(scene, folder.canonicalize().ok()?)?;
            // JSON holds no other.
            way.to_str().is_some().then_some(way)
        };
        let note = Self {
            scene: self.scene.as_ref().and_then(way),
            ..self.clone()
        };
        let written = WrittenNote {
            form: FORM,
            note: &note,
        };
        serde_json::to_string(&written).unwrap_or_default()
    }

    /// The note of a film in that folder.
    ///
    /// # Errors
    /// What is wrong with it, as "problem; expected; mend".
    pub(super) fn from_text(text: &str, folder: &Path) -> Result<Self, String> {
        let damaged = |what: &str| {
            format!(
                "its note is damaged ({what}); expected what `mixray render --range` writes; render it again"
            )
        };
        let form: Form = serde_json::from_str(text).map_err(|error| damaged(&error.to_string()))?;
        if form.form != FORM {
            return Err(format!(
                "is a film of form {}; expected form {FORM}; merge it with the program that rendered it, or render it again",
                form.form
            ));
        }
        let mut note: Self =
            serde_json::from_str(text).map_err(|error| damaged(&error.to_string()))?;
        let (first, end) = note.range;
        if !(first < end && end <= note.total && note.total <= Settings::MAX_RAYS_PER_PIXEL) {
            return Err(damaged(&format!("rays {first}..{end} of {}", note.total)));
        }
        // A film from elsewhere names no place of this machine.
        let hint = note.scene.filter(|scene| scene.is_relative());
        note.scene = hint.map(|scene| folder.join(scene));
        Ok(note)
    }
}

#[cfg(test)]
pub(super) mod tests;
