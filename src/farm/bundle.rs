//! A scene with all files that it names, in one folder or one zip file, by relative paths.

use std::fs::File;
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use flate2::Compression;
use flate2::write::DeflateEncoder;
use rawzip::{CompressionMethod, ZipArchiveWriter};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::FarmError;
use crate::decode::{MAX_TEXT_BYTES, read_file, split_layer};
use crate::files::{self, resolved};
use crate::scene::Scene;

/// Where files go that do not lie in the scene's folder.
const OTHERS: &str = "files";

/// Files by the names that they get, with `/` between folders.
#[derive(Clone, Debug, Default)]
pub struct Bundle {
    files: Vec<(String, Contents)>,
}

#[derive(Clone, Debug)]
enum Contents {
    File(PathBuf),
    Text(String),
}

/// The scene file, first, and all that it names. Where all lies in the scene's folder every file keeps its name; else the others lie below
/// `files/` as they lay to each other, and the paths in the scene file follow.
///
/// # Errors
/// The scene file cannot be read again, or a name is not UTF-8.
pub fn gather(scene: &Scene) -> Result<Bundle, FarmError> {
    let place = clean(&scene.path);
    let home = place.parent().unwrap_or(Path::new("/"));
    let mut others: Vec<PathBuf> = (scene.inputs.iter().map(|path| clean(path)))
        .filter(|path| *path != place)
        .collect();
    others.sort();
    others.dedup();
    let is_home = others.iter().all(|path| path.starts_with(home));
    let root = match is_home {
        true => home.to_path_buf(),
        false => common_folder(&others),
    };
    let name_of = |path: &Path| -> Result<String, FarmError> {
        let below = plain_name(path.strip_prefix(&root).unwrap_or(path))?;
        Ok(match is_home {
            true => below,
            false => format!("{OTHERS}/{below}"),
        })
    };
    let unreadable = |problem: String| {
        FarmError::Unfit(format!(
            "{}: {problem}; expected the scene file; correct the path",
            scene.path.display()
        ))
    };
    let bytes = read_file(&scene.path, MAX_TEXT_BYTES).map_err(unreadable)?;
    let text = String::from_utf8(bytes).map_err(|error| unreadable(error.to_string()))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let document = DeTable::parse(text).map_err(|error| unreadable(error.to_string()))?;
    let mut rewritten = text.to_owned();
    let mut strings = Vec::new();
    for value in document.get_ref().values() {
        collect_strings(value, &mut strings);
    }
    // From the end, so that places before stay.
    strings.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    for (span, string) in strings {
        let named = home.join(string);
        let (file, layer) = split_layer(&named);
        let moves = !is_home
            || Path::new(string).is_absolute()
            || Path::new(string)
                .components()
                .any(|c| c == Component::ParentDir);
        let file = clean(&file);
        if !moves || others.binary_search(&file).is_err() {
            continue;
        }
        let layer = layer.map(|layer| format!("#{layer}")).unwrap_or_default();
        let name = toml::Value::String(name_of(&file)? + &layer);
        rewritten.replace_range(span, &name.to_string());
    }
    let own = plain_name(Path::new(place.file_name().unwrap_or_default()))?;
    let mut bundle = Bundle::default();
    bundle.files.push((own, Contents::Text(rewritten)));
    for path in &others {
        bundle.add(name_of(path)?, path);
    }
    Ok(bundle)
}

impl Bundle {
    /// The first file's name: the scene file.
    pub fn scene_file(&self) -> &str {
        self.files.first().map_or("", |(name, _)| name)
    }

    pub fn len(&self) -> usize {
        self.files.len()
    }

    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// The same files, below a folder.
    pub fn below(&self, folder: &str) -> Self {
        let files = self.files.iter();
        let below =
            |(name, contents): &(String, Contents)| (format!("{folder}/{name}"), contents.clone());
        Self {
            files: files.map(below).collect(),
        }
    }

    /// One more file.
    pub fn add(&mut self, name: impl Into<String>, path: &Path) {
        self.files.push((name.into(), Contents::File(path.into())));
    }

    /// Writes all files below a folder, which is made where it is not there.
    ///
    /// # Errors
    /// A file cannot be read or written.
    pub fn write_into(&self, folder: &Path) -> Result<(), FarmError> {
        for (name, contents) in &self.files {
            let path = folder.join(name);
            let parent = path.parent().unwrap_or(folder);
            std::fs::create_dir_all(parent).map_err(failed(parent, "cannot be made"))?;
            let mut file = File::create_new(&path).map_err(failed(&path, "cannot be written"))?;
            contents.copy_to(&mut file, &path)?;
        }
        Ok(())
    }

    /// Writes a zip file, the files in their order and without times, so that the same scene gives the same bytes.
    ///
    /// # Errors
    /// A file cannot be read or the zip file cannot be written.
    pub fn write_zip(&self, out: impl Write, path: &Path) -> Result<(), FarmError> {
        let broken = |error: rawzip::Error| {
            failed(path, "cannot be written")(io::Error::other(error.to_string()))
        };
        let unwritable = failed(path, "cannot be written");
        let mut zip = ZipArchiveWriter::new(out);
        for (name, contents) in &self.files {
            let file = zip.new_file(name.as_str()).unix_permissions(0o644);
            let file = file.compression_method(CompressionMethod::DEFLATE);
            let (mut entry, config) = file.start().map_err(broken)?;
            let encoder = DeflateEncoder::new(&mut entry, Compression::default());
            let mut writer = config.wrap(encoder);
            contents.copy_to(&mut writer, path)?;
            let (encoder, descriptor) = writer.finish().map_err(broken)?;
            encoder.finish().map_err(&unwritable)?;
            entry.finish(descriptor).map_err(broken)?;
        }
        zip.finish().map_err(broken)?;
        Ok(())
    }
}

impl Contents {
    /// `to`: for messages.
    fn copy_to(&self, out: &mut impl Write, to: &Path) -> Result<(), FarmError> {
        match self {
            Self::Text(text) => out.write_all(text.as_bytes()),
            Self::File(path) => {
                let mut file = files::open(path).map_err(failed(path, "cannot be read"))?;
                io::copy(&mut file, out).map(drop)
            }
        }
        .map_err(failed(to, "cannot be written"))
    }
}

pub(super) fn failed(path: &Path, action: &'static str) -> impl Fn(io::Error) -> FarmError {
    move |source| FarmError::Io {
        path: path.into(),
        action,
        source,
    }
}

/// Absolute, without `.` and `..`, links kept where that names the same file.
fn clean(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let mut clean = PathBuf::new();
    for component in absolute.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir => {
                clean.pop();
            }
            _ => clean.push(component),
        }
    }
    match resolved(&clean) == resolved(&absolute) {
        true => clean,
        false => resolved(&absolute),
    }
}

fn common_folder(paths: &[PathBuf]) -> PathBuf {
    let mut folders = paths.iter().filter_map(|path| path.parent());
    let first = folders.next().unwrap_or(Path::new("/"));
    folders.fold(first.to_path_buf(), |common, folder| {
        let is_common = |ancestor: &&Path| folder.starts_with(ancestor);
        let shared = common.ancestors().find(is_common);
        shared.unwrap_or(Path::new("")).to_path_buf()
    })
}

/// Folders and name with `/` between them.
fn plain_name(path: &Path) -> Result<String, FarmError> {
    let words = path.components().filter_map(|component| match component {
        Component::Normal(word) => Some(word),
        _ => None,
    });
    let words: Option<Vec<&str>> = words.map(|word| word.to_str()).collect();
    words.map(|words| words.join("/")).ok_or_else(|| {
        FarmError::Unfit(format!(
            "{}: its name is not UTF-8; expected one that every host can read; rename it",
            path.display()
        ))
    })
}

/// Strings with their places in the text, quotes included.
fn collect_strings<'a>(value: &'a Spanned<DeValue<'a>>, into: &mut Vec<(Range<usize>, &'a str)>) {
    match value.get_ref() {
        DeValue::String(string) => into.push((value.span(), string)),
        DeValue::Array(array) => array.iter().for_each(|value| collect_strings(value, into)),
        DeValue::Table(table) => table
            .values()
            .for_each(|value| collect_strings(value, into)),
        _ => {}
    }
}
