//! Where the frames of a video go, as the name of the output says.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::files::final_target;
use crate::output::{Format, OutputError, check_folder_name, extension_among};
use crate::scene::trajectory::FrameName;

/// The note of a render in its folder of frames.
pub(super) const FOLDER_NOTE: &str = "mixray-sequence.json";

/// What an output may be, for whoever named another.
const EXPECTED: &str = "a folder for the frames, a pattern like out.####.exr or out.####.png, a file that ends in .y4m, or - for a stream";
/// Most digits of a pattern.
const MAX_DIGITS: usize = 9;

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameOutput {
    /// A Y4M stream on standard output.
    Stdout,
    /// A Y4M file; links resolved.
    Y4m(PathBuf),
    Pictures(Pictures),
}

/// A picture a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pictures {
    /// Links resolved.
    pub folder: PathBuf,
    pub format: Format,
    /// `None`: called as the frames that come in, or `frame_000012`.
    pub pattern: Option<Pattern>,
}

/// Names that hold the frame's number: `out.####.exr`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    before: String,
    digits: usize,
    after: String,
}

impl FrameOutput {
    /// `-`, a Y4M file, a pattern with `#` for digits, or a folder; `format` is that of pictures, as asked for.
    ///
    /// # Errors
    /// The name promises what cannot be written, or another format than the one asked for.
    pub fn of(path: &Path, format: Option<Format>) -> Result<Self, OutputError> {
        let refused = |expected: String| OutputError::Extension {
            path: path.into(),
            expected,
        };
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        let is_stream = path == Path::new("-");
        let is_film = path.extension().is_some_and(|e| e == "y4m");
        if is_stream || is_film {
            return match format {
                Some(format) => Err(refused(format!(
                    "a folder or a pattern for --format {}",
                    format.extension()
                ))),
                None if is_stream => Ok(Self::Stdout),
                None => Ok(Self::Y4m(final_target(path))),
            };
        }
        if !name.contains('#') || path.is_dir() {
            check_folder_name(path, EXPECTED)?;
            return Ok(Self::Pictures(Pictures {
                folder: final_target(path),
                format: format.unwrap_or(Format::Png),
                pattern: None,
            }));
        }
        let of_name = match extension_among(path, &["png", "exr"]) {
            Ok(Some("png")) => Format::Png,
            Ok(Some(_)) => Format::Exr,
            _ => return Err(refused(EXPECTED.to_owned())),
        };
        if format.is_some_and(|format| format != of_name) {
            return Err(refused(format!(
                "{} without --format, or its own format there",
                path.display()
            )));
        }
        let pattern = Pattern::of(name).ok_or_else(|| {
            refused(format!(
                "one run of 1 to {MAX_DIGITS} # before the end, like out.####.exr"
            ))
        })?;
        Ok(Self::Pictures(Pictures {
            folder: match path.parent() {
                Some(folder) if folder != Path::new("") => final_target(folder),
                _ => PathBuf::from("."),
            },
            format: of_name,
            pattern: Some(pattern),
        }))
    }

    /// The format of pictures.
    pub fn format(&self) -> Option<Format> {
        match self {
            Self::Pictures(pictures) => Some(pictures.format),
            Self::Stdout | Self::Y4m(_) => None,
        }
    }
}

impl Pictures {
    pub(super) fn file_of(&self, name: &FrameName) -> PathBuf {
        let extension = self.format.extension();
        if let Some(Pattern {
            before,
            digits,
            after,
        }) = &self.pattern
        {
            let number = name.number;
            return (self.folder).join(format!("{before}{number:0digits$}{after}.{extension}"));
        }
        let stem = match &name.file {
            Some(file) => Path::new(file)
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned(),
            None => format!("frame_{:06}", name.number),
        };
        self.folder.join(format!("{stem}.{extension}"))
    }

    /// What tells the frames of one render from those of another.
    pub(super) fn note(&self) -> PathBuf {
        match &self.pattern {
            None => self.folder.join(FOLDER_NOTE),
            Some(pattern) => self.folder.join(format!(
                "{}#{}.{}.mixray-sequence.json",
                pattern.before,
                pattern.after,
                self.format.extension()
            )),
        }
    }

    /// Whether a file of this name may be a frame of a render to here.
    pub(super) fn may_be_frame(&self, file: &Path) -> bool {
        let Some(pattern) = &self.pattern else {
            return matches!(extension_among(file, &["png", "exr"]), Ok(Some(_)));
        };
        (file.file_name().and_then(OsStr::to_str))
            .and_then(|name| pattern.number_in(name, self.format))
            .is_some()
    }

    /// Whether it is what a frame of a stream is called.
    pub(super) fn is_numbered(&self, name: &OsStr) -> bool {
        let Some(name) = name.to_str() else {
            return false;
        };
        let frame = Pattern {
            before: "frame_".to_owned(),
            digits: 6,
            after: String::new(),
        };
        let pattern = self.pattern.as_ref().unwrap_or(&frame);
        pattern.number_in(name, self.format).is_some()
    }
}

impl Pattern {
    fn of(name: &str) -> Option<Self> {
        let stem = name.rsplit_once('.')?.0;
        let before = stem.split('#').next()?;
        let rest = &stem[before.len()..];
        let after = rest.trim_start_matches('#');
        let digits = rest.len() - after.len();
        let is_one_run = (1..=MAX_DIGITS).contains(&digits) && !after.contains('#');
        is_one_run.then(|| Self {
            before: before.to_owned(),
            digits,
            after: after.to_owned(),
        })
    }

    /// The number in a name that is this pattern's.
    fn number_in(&self, name: &str, format: Format) -> Option<u32> {
        let stem = name.strip_suffix(format.extension())?.strip_suffix('.')?;
        let number = stem
            .strip_prefix(self.before.as_str())?
            .strip_suffix(self.after.as_str())?;
        let digits = self.digits;
        let value: u32 = number.parse().ok()?;
        (*number == *format!("{value:0digits$}")).then_some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures(path: &str, format: Option<Format>) -> Pictures {
        match FrameOutput::of(Path::new(path), format) {
            Ok(FrameOutput::Pictures(pictures)) => pictures,
            other => panic!("{path}: {other:?}"),
        }
    }

    fn frame(number: u32) -> FrameName {
        FrameName::of_stream(number, "a stream")
    }

    #[test]
    fn names_tell_where_frames_go() {
        let of = |path: &str, format| FrameOutput::of(Path::new(path), format);
        assert_eq!(of("-", None).ok(), Some(FrameOutput::Stdout));
        assert_eq!(
            of("a.y4m", None).ok(),
            Some(FrameOutput::Y4m("a.y4m".into()))
        );
        let folder = pictures("take.01", None);
        assert_eq!(
            folder.file_of(&frame(7)),
            Path::new("take.01/frame_000007.png")
        );
        let exr = pictures("out", Some(Format::Exr));
        assert_eq!(exr.file_of(&frame(7)), Path::new("out/frame_000007.exr"));
        let pattern = pictures("shot/out.####.exr", None);
        assert_eq!(pattern.file_of(&frame(7)), Path::new("shot/out.0007.exr"));
        assert_eq!(
            pattern.file_of(&frame(12345)),
            Path::new("shot/out.12345.exr")
        );
        for (path, format) in [
            ("out.exr", None),
            ("out.mp4", None),
            ("out.####.jpg", None),
            ("out.####", None),
            ("o#t.##.exr", None),
            ("out.####.exr", Some(Format::Png)),
            ("a.y4m", Some(Format::Exr)),
            ("-", Some(Format::Png)),
        ] {
            let message = of(path, format).unwrap_err().to_string();
            assert!(message.contains("; expected "), "{message}");
        }
    }

    #[test]
    fn numbered_frames_are_known_by_their_names() {
        let png = pictures("out", None);
        for (name, is) in [
            ("frame_000012.png", true),
            ("frame_1234567.png", true),
            ("frame_12.png", false),
            ("frame_000012.exr", false),
        ] {
            assert_eq!(png.is_numbered(OsStr::new(name)), is, "{name}");
        }
        let pattern = pictures("a.##_l.exr", None);
        for (name, is) in [
            ("a.07_l.exr", true),
            ("a.123_l.exr", true),
            ("a.7_l.exr", false),
            ("a.007_l.exr", false),
            ("a.07.exr", false),
        ] {
            assert_eq!(pattern.is_numbered(OsStr::new(name)), is, "{name}");
            assert_eq!(pattern.may_be_frame(Path::new(name)), is, "{name}");
        }
    }
}
