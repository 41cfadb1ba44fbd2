//! The focal length that a camera notes in its photograph (EXIF 2.32).

use std::io::Cursor;
use std::path::Path;

use exif::{Exif, In, Reader, Tag, Value};

use super::Claim;
use super::scene_text::ThinLens;
use crate::decode::{MAX_PICTURE_BYTES, read_file};
use crate::refusal::Refusal;

/// Diagonal of the 36 x 24 mm frame, by which CIPA DC-X001 compares cameras.
const FULL_FRAME_DIAGONAL_MM: f64 = 43.266_615_305_567_87;
/// How far sides may differ from the noted ones before a photograph counts as cropped.
const SAME_SHAPE: f64 = 0.02;

/// The focal length in pixels of a photograph of `size` pixels as stored; `None`: its file says nothing of it.
///
/// # Errors
/// The file cannot be read.
pub fn noted_focal_length(path: &Path, size: (u32, u32)) -> Result<Option<Claim<f64>>, Refusal> {
    let bytes = read_file(path, MAX_PICTURE_BYTES)?;
    // Without tags, or with broken ones, a photograph is as good as any.
    let tags = Reader::new().read_from_container(&mut Cursor::new(bytes));
    Ok(tags.ok().and_then(|tags| focal_length(&tags, size)))
}

/// The focal length in pixels of a photograph of `size` pixels, as its camera notes it; `None`: it does not, or has not taken the whole of it.
pub fn focal_px_of_whole(path: &Path, (width, height): (u32, u32)) -> Option<f64> {
    let bytes = read_file(path, MAX_PICTURE_BYTES).ok()?;
    let tags = Reader::new().read_from_container(&mut Cursor::new(bytes));
    let tags = tags.ok()?;
    if cropped(&tags, f64::from(width), f64::from(height)) {
        return None;
    }
    focal_length(&tags, (width, height)).map(|focal| focal.value)
}

/// The lens as the camera notes it; its focus is not noted. `None`: not all of it is there.
pub fn noted_lens(path: &Path) -> Option<ThinLens> {
    let bytes = read_file(path, MAX_PICTURE_BYTES).ok()?;
    let tags = Reader::new().read_from_container(&mut Cursor::new(bytes));
    thin_lens(&tags.ok()?)
}

fn thin_lens(tags: &Exif) -> Option<ThinLens> {
    Some(ThinLens {
        f_number: number(tags, Tag::FNumber)?,
        focal_length_mm: number(tags, Tag::FocalLength)?,
        focus_distance_m: f64::INFINITY,
    })
}

fn focal_length(tags: &Exif, (width, height): (u32, u32)) -> Option<Claim<f64>> {
    let (w, h) = (f64::from(width), f64::from(height));
    let cropped = cropped(tags, w, h);
    let sure = match cropped {
        true => "+- 30%: the photograph has been cropped since",
        false => "+- 3%",
    };
    if let Some(mm) = number(tags, Tag::FocalLengthIn35mmFilm) {
        let focal_px = mm * w.hypot(h) / FULL_FRAME_DIAGONAL_MM;
        let basis = format!("from the camera's tag: as {mm} mm on 35 mm film; {sure}");
        return Some(Claim::new(focal_px, basis));
    }
    let mm = number(tags, Tag::FocalLength)?;
    let per_unit = number(tags, Tag::FocalPlaneXResolution)?;
    let unit_mm = match number(tags, Tag::FocalPlaneResolutionUnit).unwrap_or(2.0) as u32 {
        3 => 10.0,
        4 => 1.0,
        5 => 1e-3,
        _ => 25.4,
    };
    // The sensor's pixels are counted in the size that the camera wrote.
    let shrunk = number(tags, Tag::PixelXDimension).map_or(1.0, |noted| w / noted);
    let basis = format!("from the camera's tags: {mm} mm, and the pitch of its pixels; {sure}");
    Some(Claim::new(mm * per_unit / unit_mm * shrunk, basis))
}

fn cropped(tags: &Exif, width: f64, height: f64) -> bool {
    let noted = (
        number(tags, Tag::PixelXDimension),
        number(tags, Tag::PixelYDimension),
    );
    let (Some(noted_width), Some(noted_height)) = noted else {
        return false;
    };
    let shape = width.max(height) / width.min(height);
    let noted_shape = noted_width.max(noted_height) / noted_width.min(noted_height);
    (shape / noted_shape - 1.0).abs() > SAME_SHAPE
}

/// Above 0 and finite.
fn number(tags: &Exif, tag: Tag) -> Option<f64> {
    let value = match &tags.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(ratios) => ratios.first()?.to_f64(),
        value => f64::from(value.get_uint(0)?),
    };
    (value > 0.0 && value.is_finite()).then_some(value)
}

#[cfg(test)]
mod tests {
    use exif::experimental::Writer;
    use exif::{Field, Rational};

    use super::*;

    const SIZE: (u32, u32) = (4000, 3000);

    fn read(fields: &[(Tag, Value)], size: (u32, u32)) -> Option<Claim<f64>> {
        let fields: Vec<Field> = (fields.iter())
            .map(|(tag, value)| Field {
                tag: *tag,
                ifd_num: In::PRIMARY,
                value: value.clone(),
            })
            .collect();
        let mut writer = Writer::new();
        fields.iter().for_each(|field| writer.push_field(field));
        let mut block = Cursor::new(Vec::new());
        writer.write(&mut block, false).unwrap();
        let tags = Reader::new().read_raw(block.into_inner()).unwrap();
        focal_length(&tags, size)
    }

    fn ratio(num: u32, denom: u32) -> Value {
        Value::Rational(vec![Rational { num, denom }])
    }

    #[test]
    fn the_equivalent_of_film_counts_by_the_diagonal() {
        let film = (Tag::FocalLengthIn35mmFilm, Value::Short(vec![26]));
        let claim = read(std::slice::from_ref(&film), SIZE).unwrap();
        let truth = 26.0 * 5000.0 / f64::hypot(36.0, 24.0);
        assert!((claim.value - truth).abs() < 1e-9, "{claim:?}");
        assert!(claim.basis.ends_with("+- 3%"), "{claim:?}");
        // The picture turned on its side is the same camera's.
        let upright = read(std::slice::from_ref(&film), (3000, 4000)).unwrap();
        assert_eq!(upright.value, claim.value);
        let unknown = (Tag::FocalLengthIn35mmFilm, Value::Short(vec![0]));
        assert_eq!(read(&[unknown], SIZE), None, "0: not known");
    }

    #[test]
    fn the_pitch_of_pixels_serves_where_film_is_not_named() {
        let tags = |unit: u16| {
            [
                (Tag::FocalLength, ratio(50, 1)),
                (Tag::FocalPlaneXResolution, ratio(4_000_000, 1000)),
                (Tag::FocalPlaneResolutionUnit, Value::Short(vec![unit])),
                (Tag::PixelXDimension, Value::Long(vec![8000])),
                (Tag::PixelYDimension, Value::Long(vec![6000])),
            ]
        };
        let inches = read(&tags(2), SIZE).unwrap().value;
        assert!((inches - 50.0 * 4000.0 / 25.4 * 0.5).abs() < 1e-9);
        let centimetres = read(&tags(3), SIZE).unwrap().value;
        assert!((centimetres - 50.0 * 400.0 * 0.5).abs() < 1e-9);
        assert_eq!(read(&tags(2)[..1], SIZE), None, "a length in mm alone");
        assert_eq!(read(&tags(2)[3..], SIZE), None, "no length");
    }

    #[test]
    fn a_cropped_photograph_is_less_sure() {
        let tags = [
            (Tag::FocalLengthIn35mmFilm, Value::Short(vec![26])),
            (Tag::PixelXDimension, Value::Long(vec![4000])),
            (Tag::PixelYDimension, Value::Long(vec![3000])),
        ];
        assert!(!read(&tags, SIZE).unwrap().basis.contains("cropped"));
        assert!(read(&tags, (3000, 3000)).unwrap().basis.contains("cropped"));
    }
}
