//! OpenEXR: the header is read and held against the limits first, then only the channels that are wanted are decoded.

mod names;

use crate::refusal::Refusal;
use std::collections::HashSet;
use std::io::Cursor;
use std::path::Path;

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::Chunk;
use ::exr::block::reader::{ChunksReader, Reader};
use ::exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, SampleType, Text};
use ::exr::meta::header::Header;
use ::exr::prelude::{FlatSamples, Vec2, f16};
use rayon::prelude::*;

use names::{Place, pick, pick_named};

use super::channels::ChannelFile;
use super::file::{MAX_PICTURE_BYTES, read_file};
use super::{ALPHA, ImageFile, Pixels, Tags, broken, check_size, ensure_memory, guarded};

/// Most channels of a part.
const MAX_CHANNELS: usize = 1024;
/// A block takes at least its place in the table, its own place and its length.
const LEAST_BLOCK_BYTES: usize = 16;

impl ChannelFile {
    /// # Errors
    /// Why it cannot be read, in one line that begins with the path.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        Self::decode(&Self::bytes_of(path)?)
            .map_err(|problem| format!("{}: {problem}", path.display()).into())
    }

    /// The bytes of an OpenEXR file.
    ///
    /// # Errors
    /// As [`ChannelFile::read`].
    pub(crate) fn bytes_of(path: &Path) -> Result<Vec<u8>, Refusal> {
        Ok(read_file(path, MAX_PICTURE_BYTES).map_err(|reason| {
            format!(
                "{}: it cannot be read ({reason}); expected an .exr file; correct the path or the rights",
                path.display()
            )
        })?)
    }

    /// Decodes the bytes of an OpenEXR file.
    ///
    /// # Errors
    /// Why they cannot be used, in one line.
    pub fn decode(bytes: &[u8]) -> Result<Self, Refusal> {
        if !bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            return Err("it is no OpenEXR file; expected .exr; convert it".into());
        }
        Ok(guarded(|| read_channels(bytes)).unwrap_or_else(|thrown| Err(broken(thrown)))?)
    }
}

/// The channels of a file's first part.
fn read_channels(bytes: &[u8]) -> Result<ChannelFile, String> {
    let headers = read_headers(bytes)?;
    let header = headers.first().ok_or_else(|| broken("it has no part"))?;
    let (width, height) = size_of(header)?;
    let mut file = ChannelFile {
        width,
        height,
        ..ChannelFile::default()
    };
    let all: Vec<usize> = (0..header.channels.list.len()).collect();
    for (index, samples) in all.iter().zip(read_part(bytes, &headers, 0, &all)?) {
        let name = text_of(&header.channels.list[*index].name);
        match samples {
            FlatSamples::U32(samples) => {
                file.counts.insert(name, samples);
            }
            floats => {
                file.floats.insert(name, into_f32(floats));
            }
        }
    }
    for (name, value) in &header.own_attributes.other {
        if let AttributeValue::Text(text) = value {
            file.texts.insert(text_of(name), text_of(text));
        }
    }
    Ok(file)
}

/// The picture among the parts and layers of a file, or the one of this name; its alpha is read `with_alpha`.
pub(super) fn read_picture(
    bytes: &[u8],
    layer: Option<&str>,
    with_alpha: bool,
) -> Result<ImageFile, String> {
    let headers = read_headers(bytes)?;
    let Place { part, rgb, alpha } = match layer {
        Some(layer) => pick_named(&headers, layer)?,
        None => pick(&headers)?,
    };
    let header = &headers[part];
    let window = header.shared_attributes.display_window;
    let (width, height) = check_size(window.size.x() as u64, window.size.y() as u64)?;
    let mut warnings = Vec::new();
    if header
        .shared_attributes
        .chromaticities
        .is_some_and(|c| !is_rec709(&c))
    {
        warnings.push("its chromaticities are ignored: it is read as linear Rec.709".to_owned());
    }
    let wide = header.shared_attributes.pixel_aspect;
    if (wide - 1.0).abs() > 1e-3 {
        warnings.push(format!(
            "its pixels are {wide} times as wide as high: give the camera `fx` and `fy` of its own pixels, not a field of view"
        ));
    }
    let mut wanted = rgb.to_vec();
    wanted.extend(alpha);
    wanted.dedup();
    let kept = if alpha.is_some() && with_alpha {
        16
    } else {
        12
    };
    // The planes are there until the pixels are.
    ensure_memory((width, height), kept + 4 * wanted.len() as u64)?;
    let planes: Vec<Vec<f32>> = read_part(bytes, &headers, part, &wanted)?
        .into_iter()
        .map(into_f32)
        .collect();
    let data = header.data_window();
    let meets = |axis: fn(&Vec2<i32>) -> i32| {
        let end = |bounds: IntegerBounds| axis(&bounds.max());
        axis(&data.position) <= end(window) && axis(&window.position) <= end(data)
    };
    if !(meets(|p| p.0) && meets(|p| p.1)) {
        return Err(format!(
            "its data window {} lies outside of its display window {}; expected a picture in the display window; render the frame again",
            shown(data),
            shown(window)
        ));
    }
    if data != window {
        warnings.push(format!(
            "its data window {} is not its display window {}: it is placed there, the rest is black",
            shown(data),
            shown(window)
        ));
    }
    let count = width as usize * height as usize;
    let mut pixels = vec![[0.0; 3]; count];
    let plane_of = |index: usize| {
        let plane = wanted.iter().position(|w| *w == index);
        plane.map_or(&[][..], |plane| &planes[plane])
    };
    for (channel, index) in rgb.into_iter().enumerate() {
        place(plane_of(index), data, window, |pixel, sample| {
            pixels[pixel][channel] = sample;
        });
    }
    let is_seen_through = |index: usize| plane_of(index).iter().any(|alpha| *alpha != 1.0);
    if !with_alpha && alpha.is_some_and(is_seen_through) {
        warnings.push(ALPHA.to_owned());
    }
    let mut coverage = Vec::new();
    if let Some(index) = alpha.filter(|_| with_alpha) {
        coverage = vec![0.0; count];
        place(plane_of(index), data, window, |pixel, sample| {
            coverage[pixel] = sample;
        });
    }
    Ok(ImageFile {
        width,
        height,
        pixels: Pixels::Linear(pixels),
        alpha: coverage,
        tags: Tags::default(),
        warnings,
    })
}

/// Each sample of `data` that lies in `window`, with its index there.
fn place(
    plane: &[f32],
    data: IntegerBounds,
    window: IntegerBounds,
    mut set: impl FnMut(usize, f32),
) {
    let offset = |axis: fn(&Vec2<i32>) -> i32| {
        i64::from(axis(&data.position)) - i64::from(axis(&window.position))
    };
    let (left, top) = (offset(|p| p.0), offset(|p| p.1));
    let inside = |at: i64, size: usize| usize::try_from(at).ok().filter(|at| *at < size);
    for (y, row) in plane.chunks_exact(data.size.0).enumerate() {
        let Some(to_y) = inside(top + y as i64, window.size.1) else {
            continue;
        };
        for (x, sample) in row.iter().enumerate() {
            if let Some(to_x) = inside(left + x as i64, window.size.0) {
                set(to_y * window.size.0 + to_x, *sample);
            }
        }
    }
}

fn shown(window: IntegerBounds) -> String {
    let (Vec2(x, y), end) = (window.position, window.max());
    format!("({x}, {y})..({}, {})", end.0, end.1)
}

/// The headers of a file, each within the limits and not beyond what the file can hold.
fn read_headers(bytes: &[u8]) -> Result<Vec<Header>, String> {
    let meta =
        ::exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    let mut blocks = 0_usize;
    for header in &meta.headers {
        size_of(header)?;
        let channels = header.channels.list.len();
        if !(1..=MAX_CHANNELS).contains(&channels) {
            return Err(format!(
                "a part has {channels} channels; expected 1 to {MAX_CHANNELS}; leave out what is not needed"
            ));
        }
        blocks = blocks.saturating_add(header.chunk_count);
    }
    if blocks.saturating_mul(LEAST_BLOCK_BYTES) > bytes.len() {
        return Err(broken(format!(
            "its header promises {blocks} blocks, more than its {} bytes can hold",
            bytes.len()
        )));
    }
    Ok(meta.headers.into_iter().collect())
}

fn size_of(header: &Header) -> Result<(u32, u32), String> {
    check_size(header.layer_size.x() as u64, header.layer_size.y() as u64)
}

/// The samples of these channels of a part.
fn read_part(
    bytes: &[u8],
    headers: &[Header],
    part: usize,
    wanted: &[usize],
) -> Result<Vec<FlatSamples>, String> {
    let header = &headers[part];
    let size = size_of(header)?;
    let batch = 2 * rayon::current_num_threads();
    ensure_part(header, size, wanted, batch)?;
    let count = size.0 as usize * size.1 as usize;
    let mut planes: Vec<FlatSamples> = wanted
        .iter()
        .map(|index| match header.channels.list[*index].sample_type {
            SampleType::F16 => FlatSamples::F16(vec![f16::ZERO; count]),
            SampleType::F32 => FlatSamples::F32(vec![0.0; count]),
            SampleType::U32 => FlatSamples::U32(vec![0; count]),
        })
        .collect();
    let reader = Reader::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    let mut chunks = reader
        .filter_chunks(false, |_, tile, block| {
            block.layer == part && tile.level_index == Vec2(0, 0)
        })
        .map_err(broken)?;
    let expected = chunks.expected_chunk_count();
    let meta = chunks.meta_data().clone();
    let mut seen = HashSet::new();
    loop {
        let compressed: Vec<Chunk> = chunks
            .by_ref()
            .take(batch)
            .collect::<Result<_, _>>()
            .map_err(broken)?;
        if compressed.is_empty() {
            break;
        }
        // The crate's own threads would end the program where a decoder panics.
        let blocks: Vec<UncompressedBlock> = compressed
            .into_par_iter()
            .map(|chunk| {
                guarded(|| UncompressedBlock::decompress_chunk(chunk, &meta, false))
                    .map_err(broken)?
                    .map_err(broken)
            })
            .collect::<Result<_, String>>()?;
        for block in &blocks {
            if block.index.layer != part || block.index.level != Vec2(0, 0) {
                return Err(broken("a block belongs to another part"));
            }
            seen.insert((block.index.pixel_position.0, block.index.pixel_position.1));
            copy_block(block, header, wanted, &mut planes)?;
        }
    }
    if seen.len() != expected {
        return Err(broken(format!(
            "{} of its {expected} blocks are there",
            seen.len()
        )));
    }
    Ok(planes)
}

/// Memory for the planes, those that become 32 bits wide once more, and the blocks in work.
fn ensure_part(
    header: &Header,
    size: (u32, u32),
    wanted: &[usize],
    batch: usize,
) -> Result<(), String> {
    let (lines, columns) = match header.blocks {
        ::exr::meta::BlockDescription::ScanLines => {
            (header.compression.scan_lines_per_block(), size.0 as usize)
        }
        ::exr::meta::BlockDescription::Tiles(tiles) => (tiles.tile_size.1, tiles.tile_size.0),
    };
    let block_pixels = lines.min(size.1 as usize) as u64 * columns.min(size.0 as usize) as u64;
    let pixels = u64::from(size.0) * u64::from(size.1);
    let in_work = (batch.min(header.chunk_count) as u64)
        .saturating_mul(2 * block_pixels * header.channels.bytes_per_pixel as u64);
    let what = format!(
        "decoding {} channels of its {} x {} pixels",
        wanted.len(),
        size.0,
        size.1
    );
    let needed = (pixels * 6 * wanted.len() as u64).saturating_add(in_work);
    crate::memory::ensure(needed, &what)
        .map_err(|shortage| format!("{shortage}; expected a smaller image; resize it"))
}

fn copy_block(
    block: &UncompressedBlock,
    header: &Header,
    wanted: &[usize],
    planes: &mut [FlatSamples],
) -> Result<(), String> {
    let width = header.layer_size.0;
    for line in block.lines(&header.channels) {
        let Some(plane) = wanted.iter().position(|w| *w == line.location.channel) else {
            continue;
        };
        let start = line.location.position.1 * width + line.location.position.0;
        let range = start..start + line.location.sample_count;
        match &mut planes[plane] {
            FlatSamples::F16(samples) => line.read_samples_into_slice(&mut samples[range]),
            FlatSamples::F32(samples) => line.read_samples_into_slice(&mut samples[range]),
            FlatSamples::U32(samples) => line.read_samples_into_slice(&mut samples[range]),
        }
        .map_err(broken)?;
    }
    Ok(())
}

fn into_f32(samples: FlatSamples) -> Vec<f32> {
    match samples {
        FlatSamples::F32(samples) => samples,
        FlatSamples::F16(samples) => samples.iter().map(|s| s.to_f32()).collect(),
        FlatSamples::U32(samples) => samples.iter().map(|s| *s as f32).collect(),
    }
}

/// UTF-8, which OpenEXR asks for, or else Latin-1, which the `exr` crate writes.
fn text_of(text: &Text) -> String {
    match std::str::from_utf8(text.as_slice()) {
        Ok(utf8) => utf8.to_owned(),
        Err(_) => text.to_string(),
    }
}

fn is_rec709(c: &Chromaticities) -> bool {
    let given = [
        c.red.0, c.red.1, c.green.0, c.green.1, c.blue.0, c.blue.1, c.white.0, c.white.1,
    ];
    let rec709 = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];
    given
        .iter()
        .zip(rec709)
        .all(|(given, rec709)| (given - rec709).abs() < 1e-3)
}

#[cfg(test)]
mod tests;
