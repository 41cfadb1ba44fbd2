//! A film in an OpenEXR file: its sums to the last bit, beside the planes of any other picture file.

use std::path::Path;

use bytemuck::Zeroable;

use super::ChannelFile;
use super::exr_file::{Channels, push_channel, write_layers};
use super::{Metadata, OutputError, Target};
use crate::film::{Film, GuideSums, Picture, PixelSums, Planes, Sum3};
use crate::renderer::Without;
use crate::scene::{Choice, Composite, Estimator, Overrides, SamplerKind, Scene, Settings};

/// What a film is a part of: only parts of one render can be put together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilmNote {
    pub version: String,
    /// Where the scene file was.
    pub scene: String,
    /// [`Scene::fingerprint`].
    pub fingerprint: String,
    /// The samples that every pixel within reach has taken: first and end.
    pub range: (u32, u32),
    /// Rays per pixel of the whole render.
    pub total: u32,
    pub max_bounces: u32,
    pub seed: u32,
    pub estimator: Estimator,
    pub sampler: SamplerKind,
    pub composite: Composite,
    /// Savings that were left out, as far as films show it ([`Without::of_films`]): real rays that edge pixels lack are traced as the others were.
    pub without: Without,
}

/// Attribute names of [`FilmNote`], in its order.
const NOTE_NAMES: [&str; 12] = [
    "mixray.film.version",
    "mixray.film.scene",
    "mixray.film.fingerprint",
    "mixray.film.first",
    "mixray.film.end",
    "mixray.film.total",
    "mixray.film.maxBounces",
    "mixray.film.seed",
    "mixray.film.estimator",
    "mixray.film.sampler",
    "mixray.film.composite",
    "mixray.film.without",
];
/// Where the savings left out stand in [`NOTE_NAMES`].
const WITHOUT: usize = 11;

impl FilmNote {
    /// Of a film that holds these samples of the scene's rays per pixel.
    pub fn new(scene: &Scene, range: (u32, u32), without: Without) -> Self {
        let path = std::path::absolute(&scene.path).unwrap_or_else(|_| scene.path.clone());
        let settings = &scene.settings;
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: path.display().to_string(),
            fingerprint: scene.fingerprint(),
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
                        self.scene, other.scene
                    )
                })
            })
    }

    fn texts(&self) -> [String; 12] {
        [
            self.version.clone(),
            self.scene.clone(),
            self.fingerprint.clone(),
            self.range.0.to_string(),
            self.range.1.to_string(),
            self.total.to_string(),
            self.max_bounces.to_string(),
            self.seed.to_string(),
            self.estimator.name().to_owned(),
            self.sampler.name().to_owned(),
            self.composite.name().to_owned(),
            self.without.names(),
        ]
    }

    fn from_texts(text: &dyn Fn(usize) -> Option<String>, without: Without) -> Option<Self> {
        let number = |i| text(i)?.parse::<u32>().ok();
        let note = Self {
            version: text(0)?,
            scene: text(1)?,
            fingerprint: text(2)?,
            range: (number(3)?, number(4)?),
            total: number(5)?,
            max_bounces: number(6)?,
            seed: number(7)?,
            estimator: Estimator::from_name(&text(8)?)?,
            sampler: SamplerKind::from_name(&text(9)?)?,
            composite: Composite::from_name(&text(10)?)?,
            without,
        };
        let (first, end) = note.range;
        let is_range = first < end && end <= note.total;
        (is_range && note.total <= Settings::MAX_RAYS_PER_PIXEL).then_some(note)
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
    let texts = note.texts();
    let attributes = NOTE_NAMES.into_iter().zip(texts.iter().map(String::as_str));
    write_layers(target, picture, planes, metadata, channels, attributes)
}

/// The film of a file that [`write_film`] wrote.
///
/// # Errors
/// In one line: the file cannot be read, or holds no film.
pub fn read_film(path: &Path) -> Result<(Film, FilmNote), String> {
    let file = ChannelFile::read(path)?;
    if let Some((channel, x, y)) = first_not_finite(&file) {
        return Err(format!(
            "{}: {channel} is NaN or infinite at pixel ({x}, {y}); expected the finite sums of `mixray render --range`; render the part again",
            path.display()
        ));
    }
    let text = |i: usize| file.texts.get(NOTE_NAMES[i]).cloned();
    // Films had no such attribute before savings could be left out.
    let names = text(WITHOUT).unwrap_or_default();
    let without = Without::from_names(&names).ok_or_else(|| {
        format!(
            "{}: was rendered without savings that this build does not know ({names}); merge it with the build that rendered it, or render it again",
            path.display()
        )
    })?;
    let note = FilmNote::from_texts(&text, without);
    note.and_then(|note| Some((film_of(&file, &note)?, note)))
        .ok_or_else(|| {
            format!(
                "{}: holds no film, only a picture; films come from `mixray render --range`",
                path.display()
            )
        })
}

/// A channel of sums and a pixel where it is not finite. No render writes such: a sample that is not finite is counted and left out.
fn first_not_finite(file: &ChannelFile) -> Option<(&str, usize, usize)> {
    let sums = file
        .floats
        .iter()
        .filter(|(name, _)| name.starts_with("sums."));
    sums.into_iter().find_map(|(name, samples)| {
        let index = samples.iter().position(|sample| !sample.is_finite())?;
        let width = file.width as usize;
        Some((name.as_str(), index % width, index / width))
    })
}

fn film_of(file: &ChannelFile, note: &FilmNote) -> Option<Film> {
    let count = file.width as usize * file.height as usize;
    let mut film = Film {
        width: file.width,
        height: file.height,
        first_sample: note.range.0,
        pixels: vec![PixelSums::zeroed(); count],
        guides: Vec::new(),
    };
    for (name, _, set) in float_fields() {
        let samples = file.floats.get(&name)?;
        for (pixel, sample) in film.pixels.iter_mut().zip(samples) {
            set(pixel, *sample);
        }
    }
    for (name, _, set) in count_fields() {
        let samples = file.counts.get(name)?;
        for (pixel, sample) in film.pixels.iter_mut().zip(samples) {
            set(pixel, *sample);
        }
    }
    if let Some(hits) = file.counts.get(GUIDE_HITS) {
        film.guides = vec![GuideSums::zeroed(); count];
        for (guide, hits) in film.guides.iter_mut().zip(hits) {
            guide.hits = *hits;
        }
        for (name, _, set) in guide_fields() {
            let samples = file.floats.get(&name)?;
            for (guide, sample) in film.guides.iter_mut().zip(samples) {
                set(guide, *sample);
            }
        }
    }
    Some(film)
}

const GUIDE_HITS: &str = "sums.hits.Y";

/// A channel's name, and how its samples are read from and written to a record.
type Field<R, T, N> = (N, Box<dyn Fn(&R) -> T>, Box<dyn Fn(&mut R, T)>);

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
            scene: "/a b/ü.toml".into(),
            fingerprint: "0123456789abcdef".into(),
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

    #[test]
    fn a_note_without_savings_leaves_none_out() {
        let texts = note().texts();
        let text = |i: usize| texts.get(i).cloned();
        let read = FilmNote::from_texts(&text, Without::default()).unwrap();
        assert_eq!(read.without, Without::default());
        assert!(read.mismatch(&note()).is_some(), "control");
        assert_eq!(Without::from_names(""), Some(Without::default()));
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
