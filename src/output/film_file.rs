//! A film in an OpenEXR file: its sums to the last bit, beside the planes of any other picture file, and what it is a part of.

use std::path::Path;

use bytemuck::Zeroable;

use super::ChannelFile;
use super::channels::{Channels, push_channel};
use super::exr_file::write_layers;
use super::exr_header::is_seal_broken;
use super::film_note::{FORM, FilmNote, NOTE, NOTE_OF_FORM_1};
use super::{ExrPicture, OutputError, Target};
use crate::film::{Film, GroupSums, GuideSums, PixelSums, SplatSums, Sum3};
use crate::refusal::Refusal;
use crate::scene::Combine;

/// As [`super::write_exr`], with the film's sums and what they are a part of.
///
/// # Errors
/// If the file cannot be written; what was there before then still is.
pub fn write_film(
    target: &Target,
    exr: &ExrPicture,
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
    if !film.groups.is_empty() {
        for (name, get, _) in group_fields() {
            let samples = film.groups.iter().map(get).collect::<Vec<f32>>();
            push_channel(&mut channels, &name, samples);
        }
    }
    let text = note.to_text(folder_of(target.path()));
    write_layers(target, exr, channels, [(NOTE, text.as_str())].into_iter())
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
/// In one line: the file cannot be read, has changed since it was written, holds no film or one of another form, or sums that are not finite.
pub fn read_film(path: &Path) -> Result<(Film, FilmNote), Refusal> {
    film_in(&ChannelFile::bytes_of(path)?, path)
}

/// As [`read_film`]; `None`: what is there is such a film, or nothing at all, that was damaged.
///
/// # Errors
/// As [`read_film`], but for damages.
#[cfg(feature = "cli")]
pub(crate) fn read_film_if_whole(path: &Path) -> Result<Option<(Film, FilmNote)>, Refusal> {
    let bytes = ChannelFile::bytes_of(path)?;
    let is_blank = bytes.iter().all(|byte| *byte == 0);
    let has_note = || (bytes.windows(NOTE.len())).any(|window| window == NOTE.as_bytes());
    if is_blank || is_seal_broken(&bytes) && has_note() {
        return Ok(None);
    }
    film_in(&bytes, path).map(Some)
}

fn film_in(bytes: &[u8], path: &Path) -> Result<(Film, FilmNote), Refusal> {
    let refused = |problem: String| Refusal::from(format!("{}: {problem}", path.display()));
    if is_seal_broken(bytes) {
        let problem =
            "it is not as it was written; expected a whole film; it is damaged: render it again";
        return Err(refused(problem.to_owned()));
    }
    let file = ChannelFile::decode(bytes).map_err(|problem| refused(problem.to_string()))?;
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
        groups: Vec::new(),
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
    if note.combine == Combine::Robust {
        film.set_groups(true);
        for (name, _, set) in group_fields() {
            fill(&mut film.groups, finite(file, &name)?, set);
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

const RGB: [&str; 3] = ["R", "G", "B"];
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

/// A sum by its name.
type NamedSum<R> = (&'static str, fn(&R) -> &Sum3, fn(&mut R) -> &mut Sum3);

fn group_fields() -> impl Iterator<Item = Field<GroupSums, f32, String>> {
    const SUMS: [NamedSum<GroupSums>; 4] = [
        ("diff_0", |g| &g.diff[0], |g| &mut g.diff[0]),
        ("diff_1", |g| &g.diff[1], |g| &mut g.diff[1]),
        ("diff_2", |g| &g.diff[2], |g| &mut g.diff[2]),
        ("diff_3", |g| &g.diff[3], |g| &mut g.diff[3]),
    ];
    (SUMS.into_iter()).flat_map(|(name, get, get_mut)| sum3_fields(name, RGB, get, get_mut))
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
mod tests;
