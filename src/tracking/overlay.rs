//! What was found, drawn over the frames, for people to look at.
//!
//! Green: sides as seen. Red crosses: points of the board as the pose puts them. Red, green and blue lines from the board's middle: x, y and z. A red frame:
//! no pose.

use std::io::{BufWriter, Write};
use std::path::Path;

use glam::{DVec2, DVec3};

use super::TrackError;
use super::canvas::Canvas;
use super::session::Session;
use super::tracker::TrackedFrame;
use crate::output::{OutputError, write_bytes};
use crate::scene::{EncodedPhoto, Photo};
use crate::video::{FrameSource, Header, Taken, encode_yuv};

/// Pictures of a sheet.
const COLUMNS: usize = 4;
const ROWS: usize = 3;
/// Width of a sheet at most, pixels.
const SHEET_WIDTH: usize = 1600;

impl Session {
    /// Reads the frames again; `draw` gets each with its number from 0 and what was found drawn on it.
    fn each(
        &self,
        video: &Path,
        draw: &mut dyn FnMut(usize, Canvas) -> Result<(), TrackError>,
    ) -> Result<(), TrackError> {
        if video == Path::new("-") {
            return Err(TrackError::input(
                "standard input cannot be read twice; expected a file or a folder to draw on; save the stream first",
            ));
        }
        let mut source = FrameSource::open(video)?;
        let mut index = 0;
        while let Some((_, taken)) = source.next(&|_| true)? {
            if let Taken::Whole(frame) = taken
                && let Some(tracked) = self.tracked.frames.get(index)
                && (frame.photo.width as usize, frame.photo.height as usize)
                    == (self.tracked.width, self.tracked.height)
            {
                let mut canvas = canvas_of(&frame.photo);
                self.draw(tracked, &mut canvas);
                draw(index, canvas)?;
            }
            index += 1;
        }
        Ok(())
    }

    fn draw(&self, frame: &TrackedFrame, canvas: &mut Canvas) {
        let solution = &self.tracked.solution;
        for group in &frame.sighting.groups {
            let corners: Vec<DVec2> = frame.sighting.observations[group.clone()]
                .iter()
                .map(|o| o.pixel)
                .collect();
            for k in 0..4 {
                canvas.line(corners[k], corners[(k + 1) % 4], [0, 230, 0]);
            }
        }
        let Ok(pose) = &frame.pose else {
            canvas.frame(6, [230, 0, 0]);
            return;
        };
        let place = |point: DVec3| {
            let seen = pose.fit.pose.of(point);
            (seen.z > 1e-3).then(|| solution.lens.pixel_of(DVec2::new(seen.x, seen.y) / seen.z))
        };
        for observation in &frame.sighting.observations {
            if let Some(at) = place(solution.points[observation.point]) {
                canvas.cross(at, 3.0, [255, 40, 40]);
            }
        }
        let middle = self.tracked.board.middle();
        let extent = solution
            .points
            .iter()
            .map(|p| p.distance(middle))
            .fold(0.0, f64::max);
        let axes = [
            (DVec3::X, [255, 0, 0]),
            (DVec3::Y, [0, 255, 0]),
            (DVec3::Z, [60, 120, 255]),
        ];
        for (axis, colour) in axes {
            // In short parts: the lens bends them.
            const PARTS: usize = 8;
            let along =
                |part: usize| place(middle + axis * (0.5 * extent * part as f64 / PARTS as f64));
            for part in 0..PARTS {
                if let (Some(from), Some(to)) = (along(part), along(part + 1)) {
                    canvas.line(from, to, colour);
                    canvas.line(from + DVec2::X, to + DVec2::X, colour);
                }
            }
        }
    }

    /// A Y4M film of all frames.
    ///
    /// # Errors
    /// The video cannot be read again, or the film not be written.
    pub fn write_overlay(&self, video: &Path, path: &Path) -> Result<(), TrackError> {
        let header = Header::new(
            self.tracked.width as u32,
            self.tracked.height as u32,
            self.frames_per_second,
        );
        let unwritable = |source: std::io::Error| {
            TrackError::input(format!(
                "{}: it cannot be written ({source}); expected room for the frames; name another place",
                path.display()
            ))
        };
        let folder = path
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        let part = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))
            .map_err(unwritable)?;
        let mut film = BufWriter::new(part);
        writeln!(film, "{}", header.line).map_err(unwritable)?;
        self.each(video, &mut |_, canvas| {
            let planes = encode_yuv(&header, &canvas.codes, None);
            film.write_all(b"FRAME\n")
                .and_then(|()| film.write_all(&planes))
                .map_err(unwritable)
        })?;
        let part = film
            .into_inner()
            .map_err(|error| unwritable(error.into_error()))?;
        part.persist(path)
            .map_err(|error| unwritable(error.error))?;
        Ok(())
    }

    /// A PNG of twelve frames, spread over the video, the worst fit among them.
    ///
    /// # Errors
    /// The video cannot be read again, or the picture not be written.
    pub fn write_sheet(&self, video: &Path, path: &Path) -> Result<(), TrackError> {
        let chosen = self.chosen_for_sheet();
        let by = (COLUMNS * self.tracked.width).div_ceil(SHEET_WIDTH);
        let (width, height) = (self.tracked.width / by, self.tracked.height / by);
        let mut sheet = Canvas {
            width: COLUMNS * width,
            height: ROWS * height,
            codes: vec![[0; 3]; COLUMNS * width * ROWS * height],
        };
        self.each(video, &mut |index, canvas| {
            if let Some(place) = chosen.iter().position(|frame| *frame == index) {
                sheet.paste(
                    &canvas.reduced(by),
                    place % COLUMNS * width,
                    place / COLUMNS * height,
                );
            }
            Ok(())
        })?;
        let mut png = std::io::Cursor::new(Vec::new());
        let codes = sheet.codes.as_flattened();
        image::write_buffer_with_format(
            &mut png,
            codes,
            sheet.width as u32,
            sheet.height as u32,
            image::ExtendedColorType::Rgb8,
            image::ImageFormat::Png,
        )
        .map_err(|error| {
            TrackError::input(format!(
                "{}: {error}; expected a picture; report this",
                path.display()
            ))
        })?;
        write_bytes(path, png.get_ref())
            .map_err(|error: OutputError| TrackError::input(error.to_string()))
    }

    fn chosen_for_sheet(&self) -> Vec<usize> {
        let frames = &self.tracked.frames;
        let count = (COLUMNS * ROWS).min(frames.len());
        let mut chosen: Vec<usize> = (0..count).map(|k| k * frames.len() / count).collect();
        let rms = |frame: &TrackedFrame| frame.pose.as_ref().map_or(0.0, |pose| pose.rms_px);
        let worst = (0..frames.len()).max_by(|a, b| rms(&frames[*a]).total_cmp(&rms(&frames[*b])));
        if let Some(worst) = worst.filter(|worst| !chosen.contains(worst)) {
            chosen.pop();
            chosen.push(worst);
        }
        chosen
    }
}

fn canvas_of(photo: &Photo) -> Canvas {
    let codes = match &photo.encoded {
        EncodedPhoto::Codes8(codes) => codes.clone(),
        EncodedPhoto::Codes16(codes) => codes.iter().map(|c| c.map(|x| (x >> 8) as u8)).collect(),
        EncodedPhoto::Linear => {
            let code = |x: &f32| (x.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0) as u8;
            photo
                .linear
                .iter()
                .map(|c| c.each_ref().map(code))
                .collect()
        }
    };
    Canvas {
        width: photo.width as usize,
        height: photo.height as usize,
        codes,
    }
}
