//! A film in an OpenEXR file: its sums to the last bit, beside the planes of any other picture file, and what it is a part of.

use std::path::{Path, PathBuf};

use bytemuck::Zeroable;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::ChannelFile;
use super::exr_file::{Channels, push_channel, write_layers};
use super::{Metadata, OutputError, Target};
use crate::film::{Film, GuideSums, Picture, PixelSums, Planes, SplatSums, Sum3};
use crate::renderer::Without;
use crate::scene::{Choice, Composite, Estimator, Overrides, SamplerKind, Scene, Settings};

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
    /// Savings that were left out, as far as films show it ([`Without::of_films`]): real rays that edge pixels lack are traced as the others were.
    #[serde(with = "savings")]
    pub without: Without,
}

/// The attribute that holds a [`FilmNote`] as JSON.
const NOTE: &str = "mixray.film";
/// The attribute that films of the first form had.
const NOTE_OF_FORM_1: &str = "mixray.film.version";
/// The form of note and channels that this program writes and reads.
const FORM: u32 = 3;

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
    fn to_text(&self, folder: &Path) -> String {
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
    fn from_text(text: &str, folder: &Path) -> Result<Self, String> {
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

/// As [`super::write_exr`], with the film's sums and what they are a part of.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_film(
    target: &Target,
    picture: &Picture,
    planes: &Planes,
    metadata: &Metadata,
    film: &Film,
    note: &FilmNote,
) -> Result<(), OutputError> {
    let mut channels = Channels::new();
    for (name, get, _) in float_fields() {
        let samples = film.pixels.iter().map(get).collect::<Vec<f32>>();
        push_channel(&mut channels, &name, samples);
    }
    for (name, get, _) in count_fields() {
        let samples = film.pixels.iter().map(get).collect::<Vec<u32>>();
        push_channel(&mut channels, name, samples);
    }
    if !film.guides.is_empty() {
        for (name, get, _) in guide_fields() {
            let samples = film.guides.iter().map(get).collect::<Vec<f32>>();
            push_channel(&mut channels, &name, samples);
        }
        let hits: Vec<u32> = film.guides.iter().map(|g| g.hits).collect();
        push_channel(&mut channels, GUIDE_HITS, hits);
    }
    if !film.splats.is_empty() {
        for (name, get, _) in splat_fields() {
            let samples = film.splats.iter().map(get).collect::<Vec<u32>>();
            push_channel(&mut channels, &name, samples);
        }
    }
    let text = note.to_text(folder_of(target.path()));
    write_layers(
        target,
        picture,
        planes,
        metadata,
        channels,
        [(NOTE, text.as_str())].into_iter(),
    )
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// The film of a file that [`write_film`] wrote.
///
/// # Errors
/// In one line: the file cannot be read, holds no film or one of another form, or sums that are not finite.
pub fn read_film(path: &Path) -> Result<(Film, FilmNote), String> {
    let file = ChannelFile::read(path)?;
    let refused = |problem: String| format!("{}: {problem}", path.display());
    let Some(text) = file.texts.get(NOTE) else {
        return Err(refused(match file.texts.contains_key(NOTE_OF_FORM_1) {
            true => format!("is a film written by mixray of an earlier form; expected form {FORM}; render it again"),
            false => "holds no film, only a picture; expected a film; films come from `mixray render --range`".to_owned(),
        }));
    };
    let note = FilmNote::from_text(text, folder_of(path)).map_err(refused)?;
    let film = film_of(&file, &note).map_err(refused)?;
    Ok((film, note))
}

/// # Errors
/// As "problem; expected; mend": a channel is missing, or holds a value that is not finite.
fn film_of(file: &ChannelFile, note: &FilmNote) -> Result<Film, String> {
    let count = file.width as usize * file.height as usize;
    let mut film = Film {
        width: file.width,
        height: file.height,
        first_sample: note.range.0,
        pixels: vec![PixelSums::zeroed(); count],
        guides: Vec::new(),
        splats: Vec::new(),
    };
    for (name, _, set) in float_fields() {
        fill(&mut film.pixels, finite(file, &name)?, set);
    }
    for (name, _, set) in count_fields() {
        let samples = file.counts.get(name).ok_or_else(|| missing(name))?;
        fill(&mut film.pixels, samples, set);
    }
    if let Some(hits) = file.counts.get(GUIDE_HITS) {
        film.guides = vec![GuideSums::zeroed(); count];
        fill(&mut film.guides, hits, |guide, hits| guide.hits = hits);
        for (name, _, set) in guide_fields() {
            fill(&mut film.guides, finite(file, &name)?, set);
        }
    }
    if splat_fields().any(|(name, _, _)| file.counts.contains_key(&name)) {
        film.set_photons(true);
        for (name, _, set) in splat_fields() {
            let samples = file.counts.get(&name).ok_or_else(|| missing(&name))?;
            fill(&mut film.splats, samples, set);
        }
    }
    Ok(film)
}

fn fill<R, T: Copy>(records: &mut [R], samples: &[T], set: impl Fn(&mut R, T)) {
    for (record, sample) in records.iter_mut().zip(samples) {
        set(record, *sample);
    }
}

/// Sums are finite, as samples that are not are kept out of them.
fn finite<'a>(file: &'a ChannelFile, name: &str) -> Result<&'a [f32], String> {
    let samples = file.floats.get(name).ok_or_else(|| missing(name))?;
    match samples.iter().position(|sample| !sample.is_finite()) {
        None => Ok(samples),
        Some(at) => {
            let (x, y) = (at % file.width as usize, at / file.width as usize);
            Err(format!(
                "{name} of pixel ({x}, {y}) is {}; expected finite sums; the film is damaged: render it again",
                samples[at]
            ))
        }
    }
}

fn missing(name: &str) -> String {
    format!(
        "the film has no channel {name}; expected all of its sums; the film is damaged: render it again"
    )
}

const GUIDE_HITS: &str = "sums.hits.Y";

/// A channel's name, and how its samples are read from and written to a record.
type Field<R, T, N> = (N, Box<dyn Fn(&R) -> T>, Box<dyn Fn(&mut R, T)>);

/// What photons brought, each number as a low and a high word.
fn splat_fields() -> impl Iterator<Item = Field<SplatSums, u32, String>> {
    const SUMS: usize = size_of::<SplatSums>() / size_of::<u64>();
    const NAMES: [&str; SUMS] = [
        "diff.R",
        "diff.G",
        "diff.B",
        "m_im.R",
        "m_im.G",
        "m_im.B",
        "sq.R",
        "sq.G",
        "sq.B",
        "photons.Y",
    ];
    let word = |at: usize, shift: u32| -> Field<SplatSums, u32, String> {
        let (sum, axis) = NAMES[at].split_once('.').unwrap_or((NAMES[at], "Y"));
        let part = if shift == 0 { "lo" } else { "hi" };
        (
            format!("splats.{sum}.{part}.{axis}"),
            Box::new(move |sums| (splat_words(sums)[at] >> shift) as u32),
            Box::new(move |sums, bits| {
                let word: &mut [u64; SUMS] = bytemuck::cast_mut(sums);
                word[at] |= u64::from(bits) << shift;
            }),
        )
    };
    (0..SUMS).flat_map(move |at| [word(at, 0), word(at, 32)])
}

fn splat_words(sums: &SplatSums) -> [u64; size_of::<SplatSums>() / size_of::<u64>()] {
    bytemuck::cast(*sums)
}

/// Six channels of three double-floats.
fn sum3_fields<R: 'static>(
    name: &'static str,
    axes: [&'static str; 3],
    get: fn(&R) -> &Sum3,
    get_mut: fn(&mut R) -> &mut Sum3,
) -> Vec<Field<R, f32, String>> {
    let mut fields: Vec<Field<R, f32, String>> = Vec::new();
    for (c, axis) in axes.into_iter().enumerate() {
        fields.push((
            format!("sums.{name}.hi.{axis}"),
            Box::new(move |r| get(r).hi[c]),
            Box::new(move |r, x| get_mut(r).hi[c] = x),
        ));
        fields.push((
            format!("sums.{name}.lo.{axis}"),
            Box::new(move |r| get(r).lo[c]),
            Box::new(move |r, x| get_mut(r).lo[c] = x),
        ));
    }
    fields
}

fn float_fields() -> Vec<Field<PixelSums, f32, String>> {
    const RGB: [&str; 3] = ["R", "G", "B"];
    [
        sum3_fields("m_im", RGB, |p: &PixelSums| &p.m_im, |p| &mut p.m_im),
        sum3_fields("diff", RGB, |p: &PixelSums| &p.diff, |p| &mut p.diff),
        sum3_fields("m_ir", RGB, |p: &PixelSums| &p.m_ir, |p| &mut p.m_ir),
        sum3_fields("r_ir", RGB, |p: &PixelSums| &p.r_ir, |p| &mut p.r_ir),
        sum3_fields("sq", RGB, |p: &PixelSums| &p.sq, |p| &mut p.sq),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn count_fields() -> Vec<Field<PixelSums, u32, &'static str>> {
    vec![
        ("sums.n.Y", Box::new(|p| p.n), Box::new(|p, x| p.n = x)),
        ("sums.m.Y", Box::new(|p| p.m), Box::new(|p, x| p.m = x)),
        (
            "sums.n_real.Y",
            Box::new(|p| p.n_real),
            Box::new(|p, x| p.n_real = x),
        ),
        (
            "sums.non_finite.Y",
            Box::new(|p| p.non_finite),
            Box::new(|p, x| p.non_finite = x),
        ),
        (
            "sums.first_non_finite.Y",
            Box::new(|p| p.first_non_finite),
            Box::new(|p, x| p.first_non_finite = x),
        ),
        (
            "sums.sample_factor.Y",
            Box::new(|p| p.sample_factor),
            Box::new(|p, x| p.sample_factor = x),
        ),
    ]
}

fn guide_fields() -> Vec<Field<GuideSums, f32, String>> {
    let mut fields = sum3_fields(
        "normal",
        ["X", "Y", "Z"],
        |g: &GuideSums| &g.normal,
        |g| &mut g.normal,
    );
    fields.extend(sum3_fields(
        "albedo",
        ["R", "G", "B"],
        |g: &GuideSums| &g.albedo,
        |g| &mut g.albedo,
    ));
    fields.push((
        "sums.depth.hi.Z".to_owned(),
        Box::new(|g| g.depth_hi),
        Box::new(|g, x| g.depth_hi = x),
    ));
    fields.push((
        "sums.depth.lo.Z".to_owned(),
        Box::new(|g| g.depth_lo),
        Box::new(|g, x| g.depth_lo = x),
    ));
    fields
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Sample, guide_add, planes};
    use crate::renderer::Skip;
    use crate::scene::Camera;
    use glam::Vec3;

    fn film() -> Film {
        let mut film = Film::new(3, 2, 7, true);
        for pixel in 0..5 {
            for index in 0..40 {
                let x = ((pixel * 97 + index * 31) as f32 * 0.37).sin();
                let bad = pixel == 2 && index == 9;
                let sample = Sample {
                    is_virtual: (pixel + index) % 3 == 0,
                    contribution: Vec3::new(x, if bad { f32::NAN } else { x * 1e-7 }, x * 1e9),
                    real: Some(Vec3::splat(x.abs())),
                };
                film.add(pixel as usize, &sample);
                if index % 4 > 0 {
                    let normal = Vec3::new(x, 0.3, 0.1);
                    let guide = &mut film.guides[pixel as usize];
                    guide_add(guide, 1.0 + x.abs(), normal, Vec3::splat(x.abs()));
                }
            }
        }
        film
    }

    fn note() -> FilmNote {
        FilmNote {
            version: "1.2.3".into(),
            fingerprint: "0123456789abcdef".into(),
            scene: None,
            range: (7, 47),
            total: 100,
            max_bounces: 3,
            seed: u32::MAX,
            estimator: Estimator::Paper,
            sampler: SamplerKind::Cmj,
            composite: Composite::Quotient,
            without: [Skip::Plan, Skip::LastVertex].into_iter().collect(),
        }
    }

    fn written(film: &Film) -> (tempfile::TempDir, Target) {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::picture(&folder.path().join("a.exr")).unwrap();
        let picture = crate::film::composite(film, None, Composite::Additive);
        let metadata = Metadata {
            rays_per_pixel: 40,
            max_bounces: 3,
            seed: 1,
            estimator: Estimator::Paper,
            sampler: SamplerKind::Cmj,
            scrambles: None,
            filtered: false,
            camera: Camera {
                width: 3,
                height: 2,
                fx: 1.0,
                fy: 1.0,
                cx: 1.5,
                cy: 1.0,
                distortion: [0.0; 5],
                world_from_camera: glam::DMat4::IDENTITY,
            },
        };
        write_film(
            &target,
            &picture,
            &planes(film, None),
            &metadata,
            film,
            &note(),
        )
        .unwrap();
        (folder, target)
    }

    #[test]
    fn a_film_survives_its_file_bit_for_bit() {
        let film = film();
        let (_folder, target) = written(&film);
        let (read, read_note) = read_film(target.path()).unwrap();
        assert_eq!(read, film);
        assert_eq!(read_note, note());
        assert_eq!(film.non_finite_samples(), 1, "control: every field is used");

        let mut plain = film.clone();
        plain.guides.clear();
        let (_folder, target) = written(&plain);
        assert_eq!(read_film(target.path()).unwrap().0, plain);
    }

    /// The note holds the way from the film to the scene; both may move together.
    #[test]
    fn the_scene_is_looked_for_beside_the_film() {
        let root = tempfile::tempdir().unwrap();
        let (scenes, films) = (root.path().join("ü scenes"), root.path().join("films"));
        for folder in [&scenes, &films] {
            std::fs::create_dir(folder).unwrap();
        }
        let scene = scenes.join("a.toml");
        std::fs::write(&scene, "").unwrap();
        let here = FilmNote {
            scene: scene.canonicalize().ok(),
            ..note()
        };
        let text = here.to_text(&films);
        assert!(!text.contains(&*root.path().to_string_lossy()), "{text}");
        let found = FilmNote::from_text(&text, &films).unwrap().scene.unwrap();
        assert_eq!(found.canonicalize().ok(), here.scene);
        let elsewhere = FilmNote::from_text(&text, Path::new("/moved/films")).unwrap();
        assert_eq!(
            elsewhere.scene,
            Some("/moved/films/../ü scenes/a.toml".into())
        );
        let absolute = text.replace("../ü scenes", "/etc");
        assert_eq!(FilmNote::from_text(&absolute, &films).unwrap().scene, None);
    }

    #[test]
    fn notes_that_this_program_did_not_write_are_refused() {
        let text = note().to_text(Path::new("."));
        let read = |text: &str| FilmNote::from_text(text, Path::new("."));
        assert_eq!(read(&text), Ok(note()), "control");
        for (from, to, part) in [
            ("\"form\":2", "\"form\":3", "form 3; expected form 2"),
            ("\"form\":2,", "", "missing field `form`"),
            ("\"paper\"", "\"papers\"", "\"papers\" is not known"),
            ("plan", "plans", "plans"),
            ("[7,47]", "[47,7]", "rays 47..7 of 100"),
            ("[7,47]", "[7,101]", "rays 7..101 of 100"),
            ("\"seed\":4294967295", "\"seed\":4294967296", "u32"),
        ] {
            assert!(text.contains(from), "{text} lacks {from}");
            let message = read(&text.replace(from, to)).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn sums_that_are_not_finite_are_refused() {
        type Damage = fn(&mut Film);
        let damages: [(&str, Damage); 4] = [
            ("sums.m_im.hi.G of pixel (1, 1) is NaN", |f| {
                f.pixels[4].m_im.hi[1] = f32::NAN
            }),
            ("sums.sq.lo.B of pixel (2, 0) is inf", |f| {
                f.pixels[2].sq.lo[2] = f32::INFINITY
            }),
            ("sums.r_ir.hi.R of pixel (0, 0) is -inf", |f| {
                f.pixels[0].r_ir.hi[0] = f32::NEG_INFINITY
            }),
            ("sums.depth.hi.Z of pixel (0, 1) is NaN", |f| {
                f.guides[3].depth_hi = f32::NAN
            }),
        ];
        for (part, damage) in damages {
            let mut film = film();
            damage(&mut film);
            let (_folder, target) = written(&film);
            let message = read_film(target.path()).unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn every_difference_is_a_mismatch() {
        assert_eq!(note().mismatch(&note()), None);
        type Change = fn(&mut FilmNote);
        let changes: [(&str, Change); 9] = [
            ("version", |n| n.version.push('1')),
            ("rays per pixel", |n| n.total = 99),
            ("seed", |n| n.seed = 0),
            ("path depth", |n| n.max_bounces = 4),
            ("estimator", |n| n.estimator = Estimator::Direct),
            ("sampler", |n| n.sampler = SamplerKind::Sobol),
            ("composite", |n| n.composite = Composite::Additive),
            ("--no-skip", |n| n.without = Without::default()),
            ("scenes", |n| n.fingerprint.push('0')),
        ];
        for (word, change) in changes {
            let mut other = note();
            change(&mut other);
            let message = note().mismatch(&other).expect(word);
            assert!(message.contains(word), "{message}");
        }
    }
}
