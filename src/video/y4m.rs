//! YUV4MPEG2 streams, 8 bits a sample.
//!
//! By hand: a header line and raw planes, where a frame that is not rendered has to pass byte for byte, and errors say how to mend the stream.

use std::io::Read;

use super::{Place, VideoError};
use crate::decode::{check_size, ensure_memory};
use crate::refusal::Refusal;

/// How many pixels share a colour sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chroma {
    /// 2 x 2.
    C420,
    /// 2 x 1.
    C422,
    /// Each its own.
    C444,
}

impl Chroma {
    /// Pixels along x and y that share a sample.
    pub fn block(self) -> (u32, u32) {
        match self {
            Self::C420 => (2, 2),
            Self::C422 => (2, 1),
            Self::C444 => (1, 1),
        }
    }
}

/// Of a frame at most: its planes, its codes and its linear light.
const BYTES_PER_PX: u64 = 18;

/// What a stream says before its first frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    pub width: u32,
    pub height: u32,
    pub chroma: Chroma,
    /// Luma 0 to 255 in place of 16 to 235.
    pub full_range: bool,
    /// Frames a second as a fraction, where the stream says.
    pub rate: Option<(u32, u32)>,
    /// The line as it was read or is written, without its end.
    pub line: String,
}

impl Header {
    /// A header of this program's own, its colours not shared between pixels.
    pub fn new(width: u32, height: u32, frames_per_second: Option<f64>) -> Self {
        let rate = frames_per_second.map(|rate| {
            let whole = rate.round();
            if (rate - whole).abs() < 1e-9 {
                (whole as u32, 1)
            } else {
                ((rate * 1001.0).round() as u32, 1001)
            }
        });
        let (num, den) = rate.unwrap_or((25, 1));
        Self {
            width,
            height,
            chroma: Chroma::C444,
            full_range: false,
            rate,
            line: format!(
                "YUV4MPEG2 W{width} H{height} F{num}:{den} Ip A1:1 C444 XCOLORRANGE=LIMITED"
            ),
        }
    }

    /// Parses the first line of a stream: "problem; expected ...; how to mend".
    pub fn parse(line: &str) -> Result<Self, Refusal> {
        let Some(rest) = line.strip_prefix("YUV4MPEG2") else {
            return Err("it does not begin with YUV4MPEG2; expected a Y4M stream; make one with `ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe -`".into());
        };
        let (mut width, mut height, mut rate) = (None, None, None);
        let (mut chroma, mut full_range) = (Chroma::C420, false);
        for word in rest.split_ascii_whitespace() {
            let mut letters = word.chars();
            let key = letters.next().unwrap_or_default();
            let value = letters.as_str();
            let side = || match value.parse::<u32>() {
                Ok(side) if (1..=32768).contains(&side) => Ok(Some(side)),
                _ => Err(format!(
                    "its size is {word}; expected W and H from 1 to 32768; make the stream again"
                )),
            };
            match key {
                'W' => width = side()?,
                'H' => height = side()?,
                'F' => rate = parse_rate(value),
                'I' if !["p", "?"].contains(&value) => {
                    return Err(format!(
                        "it is interlaced ({word}); expected whole frames; deinterlace it (ffmpeg -vf yadif)"
                    ).into());
                }
                'C' => {
                    chroma = match value {
                        "420" | "420jpeg" | "420mpeg2" | "420paldv" => Chroma::C420,
                        "422" => Chroma::C422,
                        "444" => Chroma::C444,
                        _ => {
                            return Err(format!(
                                "its samples are {word}; expected C420, C422 or C444 of 8 bits; convert it (ffmpeg -pix_fmt yuv420p)"
                            ).into());
                        }
                    }
                }
                'X' if value == "COLORRANGE=FULL" => full_range = true,
                _ => {}
            }
        }
        let (Some(width), Some(height)) = (width, height) else {
            return Err("its header lacks W or H; expected both; make the stream again".into());
        };
        check_size(width.into(), height.into())?;
        ensure_memory((width, height), BYTES_PER_PX)?;
        Ok(Self {
            width,
            height,
            chroma,
            full_range,
            rate,
            line: line.to_owned(),
        })
    }

    pub fn frames_per_second(&self) -> Option<f64> {
        let (num, den) = self.rate?;
        Some(f64::from(num) / f64::from(den))
    }

    /// Width and height of a colour plane.
    pub fn chroma_size(&self) -> (u32, u32) {
        let (x, y) = self.chroma.block();
        (self.width.div_ceil(x), self.height.div_ceil(y))
    }

    /// Of one frame, without the line before it.
    pub fn frame_bytes(&self) -> usize {
        let (w, h) = self.chroma_size();
        self.width as usize * self.height as usize + 2 * (w as usize * h as usize)
    }
}

fn parse_rate(value: &str) -> Option<(u32, u32)> {
    let (num, den) = value.split_once(':')?;
    let (num, den) = (num.parse().ok()?, den.parse().ok()?);
    (num > 0 && den > 0).then_some((num, den))
}

/// The longest line that a stream may have, bytes.
const MAX_LINE: usize = 4096;

/// Reads a stream frame by frame.
pub struct Y4mReader<R> {
    input: R,
    place: Place,
    header: Header,
    /// Frames read or skipped.
    frames: u32,
}

impl<R: Read> Y4mReader<R> {
    pub(crate) fn new(mut input: R, place: Place) -> Result<Self, VideoError> {
        let line = read_line(&mut input, &place)?.ok_or_else(|| {
            place.error("it is empty; expected a Y4M stream; make one with `ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe -`")
        })?;
        let header = Header::parse(&line).map_err(|problem| place.error(problem))?;
        Ok(Self {
            input,
            place,
            header,
            frames: 0,
        })
    }

    pub fn header(&self) -> &Header {
        &self.header
    }

    pub(crate) fn place(&self) -> &Place {
        &self.place
    }

    /// The planes of the next frame, one after the other; `None` at the end of the stream.
    ///
    /// # Errors
    /// The stream ends in the middle of a frame, or another one of other frames begins.
    pub fn next_frame(&mut self) -> Result<Option<Vec<u8>>, VideoError> {
        let number = self.frames;
        let Some(line) = read_line(&mut self.input, &self.place)? else {
            return Ok(None);
        };
        if let Some(rest) = line.strip_prefix("YUV4MPEG2") {
            return Err(self.place.error(format!(
                "another stream begins at frame {number} ({}); expected frames of one size, {} x {}; scale and join the parts first",
                rest.trim(),
                self.header.width,
                self.header.height
            )));
        }
        if line != "FRAME" && !line.starts_with("FRAME ") {
            return Err(self.place.error(format!(
                "frame {number} does not begin with FRAME; expected a whole Y4M stream; make it again"
            )));
        }
        let wanted = self.header.frame_bytes();
        let mut planes = Vec::with_capacity(wanted);
        let read = (&mut self.input)
            .take(wanted as u64)
            .read_to_end(&mut planes);
        read.map_err(|error| {
            self.place.error(format!(
                "it cannot be read ({error}); expected a Y4M stream; check where it comes from"
            ))
        })?;
        if planes.len() < wanted {
            return Err(self.place.error(format!(
                "it is truncated: frame {number} has {} of {wanted} bytes; expected whole frames; make the stream again, then go on with the same command",
                planes.len()
            )));
        }
        self.frames += 1;
        Ok(Some(planes))
    }
}

/// A line without its end; `None` at the end of the input.
fn read_line(input: &mut impl Read, place: &Place) -> Result<Option<String>, VideoError> {
    let mut line = Vec::new();
    let mut byte = [0];
    loop {
        let read = input.read(&mut byte).map_err(|error| {
            place.error(format!(
                "it cannot be read ({error}); expected a Y4M stream; check where it comes from"
            ))
        })?;
        match (read, byte[0]) {
            (0, _) if line.is_empty() => return Ok(None),
            (0, _) => {
                return Err(place.error("it is truncated in the middle of a line; expected whole frames; make the stream again"));
            }
            (_, b'\n') => return Ok(Some(String::from_utf8_lossy(&line).into_owned())),
            _ if line.len() >= MAX_LINE => {
                return Err(place.error("a line is longer than 4096 bytes; expected a Y4M stream; make the stream again"));
            }
            (_, byte) => line.push(byte),
        }
    }
}
