//! Where two markers are in the frames of a video, for what is measured between them.

use std::path::Path;

use glam::DVec2;

use super::TrackError;
use super::choice::choose_code;
use super::light::{LightImage, Luma, Tone};
use super::line::Line;
use super::marker::find_markers;
use super::quad::Quad;
use crate::scene::trajectory::EntryKey;
use crate::sequence::Sighting;
use crate::video::{FrameSource, Taken};

/// Frames that are looked at, spread over those that can be counted beforehand.
const MOST_FRAMES: usize = 60;

/// The middles of the markers with these ids, of whichever family is found.
///
/// # Errors
/// Nothing can be read, or no family of markers is recognised.
pub fn sight_markers(path: &Path, ids: [u32; 2]) -> Result<Vec<Sighting>, TrackError> {
    let mut source = FrameSource::open(path)?;
    let step = source
        .names()
        .map_or(1, |names| names.len().div_ceil(MOST_FRAMES))
        .max(1);
    let mut frames = Vec::new();
    while frames.len() < MOST_FRAMES
        && let Some((name, taken)) =
            source.next(&|name| (name.place as usize).is_multiple_of(step))?
    {
        if let Taken::Whole(frame) = taken {
            frames.push((name, Luma::of(&frame.photo)));
        }
    }
    let lumas: Vec<Luma> = frames.iter().map(|(_, luma)| luma.clone()).collect();
    let code = choose_code(&lumas, None)?.code;
    let mut sightings = Vec::new();
    for (name, luma) in frames {
        let seen = find_markers(
            &LightImage::of(&luma, Tone::Srgb),
            std::slice::from_ref(&code),
        );
        for marker in seen.markers.iter().filter(|m| ids.contains(&m.id)) {
            let Some(pixel) = middle(&marker.corners) else {
                continue;
            };
            sightings.push(Sighting {
                point: marker.id.to_string(),
                frame: match &name.file {
                    Some(file) => EntryKey::Name(file.clone()),
                    None => EntryKey::Number(name.number),
                },
                pixel,
            });
        }
    }
    Ok(sightings)
}

/// Where the diagonals cross: the middle of the square, however it is seen.
fn middle(corners: &Quad) -> Option<DVec2> {
    let [a, b, c, d] = *corners;
    Line::robust(&[a, c]).crossing(&Line::robust(&[b, d]))
}
