//! YUV4MPEG2 streams, 8 bits a sample.
//!
//! By hand: a header line and raw planes, where a frame that is not rendered has to pass byte for byte, and errors say how to mend the stream.

use std::io::Read;

use super::matrix::Matrix;
use super::{Place, VideoError};
use crate::decode::{check_size, ensure_memory, film_kind};
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
    /// By the height, unless the caller knows better.
    pub matrix: Matrix,
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
            matrix: Matrix::of_height(height),
            rate,
            line: format!(
                "YUV4MPEG2 W{width} H{height} F{num}:{den} Ip A1:1 C444 XCOLORRANGE=LIMITED"
            ),
        }
    }

    /// Parses the first line of a stream: "problem; expected ...; how to mend".
    pub fn parse(line: &str) -> Result<Self, Refusal> {
        let Some(rest) = line.strip_prefix(MAGIC) else {
            return Err(NO_SIGN.into());
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
            matrix: Matrix::of_height(height),
            rate,
            line: without_mark(line),
        })
    }

    /// What of the stream is passed over; `None`: nothing.
    pub(super) fn warning(&self) -> Option<String> {
        let word = (self.line.split_ascii_whitespace()).find_map(|word| word.strip_prefix('A'))?;
        let (wide, high) = parse_rate(word)?;
        (wide != high).then(|| {
            format!(
                "its pixels are {wide}:{high} as wide as high and are taken for square; scale it (ffmpeg -vf scale=iw*sar:ih,setsar=1)"
            )
        })
    }

    /// "BT.601, limited range".
    pub fn colours(&self) -> String {
        let range = if self.full_range { "full" } else { "limited" };
        format!("{}, {range} range", self.matrix.name())
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

/// Films of earlier versions of this program have a fingerprint in their header, which other programs take for one that is too long.
fn without_mark(line: &str) -> String {
    match line.contains(" XMIXRAY=") {
        true => {
            let words = line.split(' ').filter(|word| !word.starts_with("XMIXRAY="));
            words.collect::<Vec<_>>().join(" ")
        }
        false => line.to_owned(),
    }
}

fn parse_rate(value: &str) -> Option<(u32, u32)> {
    let (num, den) = value.split_once(':')?;
    let (num, den) = (num.parse().ok()?, den.parse().ok()?);
    (num > 0 && den > 0).then_some((num, den))
}

const MAGIC: &str = "YUV4MPEG2";
const MARKER: &str = "FRAME";
/// What stands for a lost sample.
pub(super) const GREY: u8 = 128;

/// The longest line that a stream may have, bytes.
const MAX_LINE: usize = 4096;

/// Of one frame, one plane after the other.
pub(crate) struct Planes {
    pub planes: Vec<u8>,
    /// Bytes of it are lost; what is lost is grey.
    pub problem: Option<VideoError>,
}

/// Reads a stream frame by frame.
pub struct Y4mReader<R> {
    input: R,
    /// Read beyond the last frame, before `input`.
    ahead: Vec<u8>,
    place: Place,
    header: Header,
    /// Frames read or skipped.
    frames: u32,
}

impl<R: Read> Y4mReader<R> {
    pub(crate) fn new(mut input: R, place: Place) -> Result<Self, VideoError> {
        let mut begin = Vec::new();
        (&mut input)
            .take(LONGEST_SIGN)
            .read_to_end(&mut begin)
            .map_err(|error| {
                place.error(format!(
                    "it cannot be read ({error}); expected a Y4M stream; check where it comes from"
                ))
            })?;
        if let Some(kind) = film_kind(&begin) {
            return Err(place.error(format!(
                "it is {kind}, no Y4M stream; expected frames without compression; convert it with `ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe -`"
            )));
        }
        let is_begun = MAGIC.as_bytes().starts_with(&begin);
        if !is_begun && !begin.starts_with(MAGIC.as_bytes()) {
            let is_mime = begin.starts_with(b"--") || begin.starts_with(b"\r\n--");
            let is_http = begin.starts_with(b"HTTP/") || begin.starts_with(b"Content-");
            let problem = match is_mime || is_http {
                true => MIME,
                false => NO_SIGN,
            };
            return Err(place.error(problem));
        }
        let mut input_from_start = begin.as_slice().chain(&mut input);
        let line = read_line(&mut input_from_start, &place)?.ok_or_else(|| {
            place.error("it is empty; expected a Y4M stream; make one with `ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe -`")
        })?;
        let header = Header::parse(&line).map_err(|problem| place.error(problem))?;
        let ahead = input_from_start.into_inner().0.to_vec();
        Ok(Self {
            input,
            place,
            header,
            ahead,
            frames: 0,
        })
    }

    pub fn header(&self) -> &Header {
        &self.header
    }

    pub(crate) fn set_matrix(&mut self, matrix: Matrix) {
        self.header.matrix = matrix;
    }

    /// Reads on to the end, so that whoever writes the stream is not cut off, unless `is_cancelled`.
    pub(crate) fn drain(&mut self, is_cancelled: &dyn Fn() -> bool) {
        let mut buffer = vec![0; 1 << 16];
        while !is_cancelled() && matches!(self.input.read(&mut buffer), Ok(1..)) {}
    }

    pub(crate) fn place(&self) -> &Place {
        &self.place
    }

    /// Reads the line before a frame; false at the end of the stream.
    fn begin_frame(&mut self) -> Result<bool, VideoError> {
        let number = self.frames;
        let ahead = std::mem::take(&mut self.ahead);
        let mut input = ahead.as_slice().chain(&mut self.input);
        let line = read_line(&mut input, &self.place)?;
        let (rest, _) = input.into_inner();
        self.ahead = rest.to_vec();
        let Some(line) = line else {
            return Ok(false);
        };
        if let Some(rest) = line.strip_prefix(MAGIC) {
            return Err(self.place.error(format!(
                "another stream begins at frame {number} ({}); expected frames of one size, {} x {}; scale and join the parts first",
                rest.trim(),
                self.header.width,
                self.header.height
            )));
        }
        if line != MARKER && !line.starts_with("FRAME ") {
            return Err(self.place.error(format!(
                "frame {number} does not begin with FRAME; expected a whole Y4M stream; make it again"
            )));
        }
        Ok(true)
    }

    /// The planes of the next frame as soon as its last byte is there, whatever follows it: [`Self::next_frame`] waits for the frame after it. `None` at
    /// the end of the stream.
    ///
    /// # Errors
    /// As [`Self::next_frame`], and where the frame is not whole.
    #[cfg(feature = "track")]
    pub(crate) fn next_at_once(&mut self) -> Result<Option<Vec<u8>>, VideoError> {
        if !self.begin_frame()? {
            return Ok(None);
        }
        let wanted = self.header.frame_bytes();
        let ahead = std::mem::take(&mut self.ahead);
        let mut input = ahead.as_slice().chain(&mut self.input).take(wanted as u64);
        let mut planes = Vec::with_capacity(wanted);
        input.read_to_end(&mut planes).map_err(|error| {
            self.place.error(format!(
                "it cannot be read ({error}); expected a Y4M stream; check where it comes from"
            ))
        })?;
        let number = self.frames;
        self.frames += 1;
        match planes.len() == wanted {
            true => Ok(Some(planes)),
            false => Err(self.place.error(format!(
                "it is truncated: frame {number} has {} of {wanted} bytes; expected whole frames; see why the program before the pipe ended",
                planes.len()
            ))),
        }
    }

    /// The planes of the next frame; `None` at the end of the stream. A frame is whole if another or the end follows it.
    ///
    /// # Errors
    /// The stream cannot be read, or another one of other frames begins.
    pub(crate) fn next_frame(&mut self) -> Result<Option<Planes>, VideoError> {
        let number = self.frames;
        if !self.begin_frame()? {
            return Ok(None);
        }
        let ahead = std::mem::take(&mut self.ahead);
        let mut input = ahead.as_slice().chain(&mut self.input);
        let wanted = self.header.frame_bytes();
        let unreadable = |error: std::io::Error| {
            self.place.error(format!(
                "it cannot be read ({error}); expected a Y4M stream; check where it comes from"
            ))
        };
        let mut planes = Vec::with_capacity(wanted);
        let mut read = |count: usize, bytes: &mut Vec<u8>| {
            (&mut input)
                .take(count as u64)
                .read_to_end(bytes)
                .map_err(unreadable)
        };
        read(wanted, &mut planes)?;
        let mut next = Vec::new();
        read(MARKER.len(), &mut next)?;
        self.frames += 1;
        let lost = |there: usize| {
            let what = match there < wanted {
                true => format!("it is truncated: frame {number} has {there} of {wanted} bytes"),
                false => format!("frame {} does not begin with FRAME", number + 1),
            };
            format!(
                "{what}; expected whole frames; make the stream again, or let such frames pass with --damaged-frames pass; then go on with the same command"
            )
        };
        if planes.len() < wanted {
            let problem = Some(self.place.error(lost(planes.len())));
            planes.resize(wanted, GREY);
            return Ok(Some(Planes { planes, problem }));
        }
        if next.is_empty() || next == MARKER.as_bytes() || MAGIC.as_bytes().starts_with(&next) {
            self.ahead = next;
            return Ok(Some(Planes {
                planes,
                problem: None,
            }));
        }
        // The next frame began before this one was full, or further on.
        let begins = |bytes: &[u8]| {
            let mut pairs = bytes.windows(MARKER.len() + 1);
            pairs.position(|at| at.starts_with(MARKER.as_bytes()) && b"\n ".contains(&at[5]))
        };
        let there = begins(&planes).unwrap_or(wanted);
        let mut rest = [&planes[there..], &next].concat();
        while there == wanted && begins(&rest).is_none() && read(wanted, &mut rest)? > 0 {}
        self.ahead = rest.split_off(begins(&rest).unwrap_or(rest.len()));
        planes[there..].fill(GREY);
        let problem = Some(self.place.error(lost(there)));
        Ok(Some(Planes { planes, problem }))
    }
}

/// As network cameras send them: `multipart/x-mixed-replace`.
const MIME: &str = "it is a stream of JPEG pictures with MIME headers between them, no Y4M stream; expected frames without them; convert it with `ffmpeg -f mpjpeg -i STREAM -pix_fmt yuv420p -f yuv4mpegpipe -`";

const NO_SIGN: &str = "it does not begin with YUV4MPEG2; expected a Y4M stream; make one with `ffmpeg -i VIDEO -pix_fmt yuv420p -f yuv4mpegpipe -`";

/// How many bytes tell the kinds of films apart.
const LONGEST_SIGN: u64 = 12;

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
