//! Jobs for render farms: one render, cut into tasks that any engine may run in any order, repeat and kill.
//!
//! A job is a folder: `shot/` holds all that is read, `output/` what the tasks write, and beside them lies what an engine reads. Nothing here
//! schedules, retries or copies: the engine does.

mod bundle;
mod makefile;
mod new_folder;
mod openjd;
mod parts;
mod slurm;

use std::path::PathBuf;

pub use bundle::{Bundle, gather};
pub use new_folder::write_new_folder;
pub use parts::{even, in_chunks};

/// Of a job's folder: what is read.
pub const SHOT: &str = "shot";
/// Of a job's folder: what is written.
pub const OUTPUT: &str = "output";

/// Why a job or a bundle cannot be written, in one line.
#[derive(Debug, thiserror::Error)]
pub enum FarmError {
    #[error("{}: {action}: {source}", path.display())]
    Io {
        path: PathBuf,
        action: &'static str,
        source: std::io::Error,
    },
    /// "problem; expected ...; mend".
    #[error("{0}")]
    Unfit(String),
}

/// Numbers from the first to the last, both included: frames, or rays per pixel.
pub type Part = (u32, u32);

/// A word of a task's command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Word {
    Text(String),
    /// A file below [`SHOT`] or [`OUTPUT`], by its path in there.
    Shot(String),
    Output(String),
    /// The task's part, "16-31".
    Part,
    /// The file in [`OUTPUT`] that the part's rays go to.
    PartFile,
}

impl Word {
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }
}

/// The file of a part's rays, in [`OUTPUT`].
pub fn part_file(part: &str) -> String {
    format!("rays_{part}.exr")
}

/// What hosts have to offer; `None`: nothing is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requirements {
    pub cpus: Option<u32>,
    pub memory_mib: Option<u64>,
    pub gpus: Option<u32>,
}

/// One render, as tasks and what puts them together.
#[derive(Clone, Debug)]
pub struct Job {
    pub name: String,
    /// What a part counts: "Frames" or "Rays".
    pub unit: &'static str,
    pub parts: Vec<Part>,
    /// Frames in a task, where an engine may form the tasks itself.
    pub chunk: Option<u32>,
    /// Arguments of the program.
    pub task: Vec<Word>,
    pub merge: Vec<Word>,
    /// A shell command in the output's folder, after all else.
    pub encode: Option<String>,
    pub requirements: Requirements,
}

/// Who runs the tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    OpenJd,
    Slurm,
    Make,
}

impl Job {
    /// The files that the engine reads, by their names in the job's folder.
    ///
    /// # Errors
    /// The job has words or numbers that the engine cannot take.
    pub fn files(&self, engine: Engine) -> Result<Vec<(&'static str, String)>, FarmError> {
        match engine {
            Engine::OpenJd => openjd::files(self),
            Engine::Slurm => Ok(slurm::files(self)),
            Engine::Make => Ok(makefile::files(self)),
        }
    }
}

fn part_text((first, last): Part) -> String {
    format!("{first}-{last}")
}

/// The program's arguments as a shell reads them, from the job's folder; `part` stands for the task's part in double quotes.
fn shell_words(words: &[Word], part: &str) -> String {
    let word = |word: &Word| match word {
        Word::Text(text) => quoted(text),
        Word::Shot(path) => quoted(&below(SHOT, path)),
        Word::Output(path) => quoted(&below(OUTPUT, path)),
        Word::Part => format!("\"{part}\""),
        Word::PartFile => format!("\"{OUTPUT}/{}\"", part_file(part)),
    };
    words.iter().map(word).collect::<Vec<_>>().join(" ")
}

fn below(folder: &str, path: &str) -> String {
    match path {
        "" => folder.to_owned(),
        _ => format!("{folder}/{path}"),
    }
}

/// As a shell takes it for one word.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+".contains(c);
    match !text.is_empty() && text.chars().all(is_plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', r"'\''")),
    }
}

#[cfg(test)]
mod tests;
