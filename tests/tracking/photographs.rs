//! Pictures without markers: nothing is found in them.

use std::path::{Path, PathBuf};

use mixray::scene::Photo;
use mixray::tracking::{Flatness, Luma, Target, Tone, TrackOptions, prepare, read_patterns};
use mixray::video::{FrameSource, Taken};

use super::patterns::prepared;
use crate::support::shared_data;

fn pictures(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_picture = path
            .extension()
            .is_some_and(|e| e == "png" || e == "jpg" || e == "jpeg");
        if path.is_dir() {
            pictures(&path, found);
        } else if is_picture {
            found.push(path);
        }
    }
}

#[test]
fn no_marker_is_invented() {
    let Some(data) = shared_data("") else {
        return;
    };
    let mut found = Vec::new();
    pictures(&data, &mut found);
    found.retain(|path| {
        !path
            .components()
            .any(|part| part.as_os_str() == "webcam_marker_grid_video")
    });
    let mut lumas: Vec<Luma> = (found.iter())
        .filter_map(|path| Photo::read(path).ok())
        .map(|(photo, _)| Luma::of(&photo))
        .collect();
    let mut chessboard =
        FrameSource::open(&data.join("webcam_chessboard_video/movie.mjpeg")).unwrap();
    while let Some((_, taken)) = chessboard.next(&|_| true).unwrap() {
        if let Taken::Whole(frame) = taken {
            lumas.push(Luma::of(&frame.photo));
        }
    }
    assert!(lumas.len() >= 200, "{}", lumas.len());
    let options = TrackOptions {
        readout: None,
        target: Target::Markers { side_m: 0.04 },
        code: None,
        lens: None,
        fix_lens: false,
        tone: Some(Tone::Srgb),
        flatness: Flatness::RIGID,
    };
    let folder = prepared();
    let files = ["f.patt", "ring.patt", "steps.patt", "strokes.patt"];
    let files = files.map(|name| folder.path(name));
    let patterns = TrackOptions {
        code: Some(read_patterns(&files, 0.5).unwrap()),
        ..options.clone()
    };
    for luma in lumas {
        for options in [&options, &patterns] {
            let found = prepare(options, std::slice::from_ref(&luma));
            assert!(
                found.is_err(),
                "{:?} in a picture of {} x {}",
                found.unwrap().1,
                luma.width,
                luma.height
            );
        }
    }
}
