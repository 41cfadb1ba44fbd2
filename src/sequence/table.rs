//! Tables that a user writes about frames: values between commas, comments behind #, headings in the first line if any.

use std::path::Path;

use super::SequenceError;
use crate::decode::{MAX_TEXT_BYTES, read_text};
use crate::scene::trajectory::EntryKey;

/// The lines of a table with their numbers, without headings, which begin with `heading`, and empty ones. `what`: of what it is a table;
/// `failure` makes the error of a line.
///
/// # Errors
/// The file cannot be read, or a line is none.
pub(super) fn read_table(
    path: &Path,
    what: &str,
    heading: &str,
    failure: &dyn Fn(u64, String) -> SequenceError,
) -> Result<Vec<(u64, Vec<String>)>, SequenceError> {
    let text = read_text(path, MAX_TEXT_BYTES).map_err(|reason| {
        SequenceError::Unfit(format!(
            "{}: it cannot be read ({reason}); expected a table of {what}; correct the path",
            path.display()
        ))
    })?;
    let mut table = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut lines = Vec::new();
    for (index, record) in table.records().enumerate() {
        let record = record.map_err(|error| failure(index as u64 + 1, error.to_string()))?;
        let number = record.position().map_or(0, csv::Position::line);
        let words: Vec<String> = record.iter().map(str::to_owned).collect();
        if words != [""] && (index > 0 || words[0] != heading) {
            lines.push((number, words));
        }
    }
    Ok(lines)
}

/// A frame by its number or the name of its file.
pub(super) fn frame_key(word: &str) -> EntryKey {
    match word.parse() {
        Ok(number) => EntryKey::Number(number),
        Err(_) => EntryKey::Name(word.to_owned()),
    }
}
