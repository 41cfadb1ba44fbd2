//! Valid inputs damaged at random and read: whatever is done to a file, it is read or refused in one line, without a panic, an abort, a hang
//! or a number that is not finite. Shared by the tests and `cargo run --release --example fuzz`.
//!
//! Every input follows from its reader and its number alone, so that what fails once fails again.

pub mod mutate;
mod readers;
pub mod seeds;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mutate::Random;
use readers::Reader;

/// Longest that one input may take. Inputs are of a few kilobytes.
const MAX_TIME: Duration = Duration::from_secs(10);

/// What a reader made of an input.
pub enum Outcome {
    Read,
    /// The message.
    Refused(String),
    /// Something that must never be, in words.
    Wrong(String),
}

/// How many inputs were read and how many refused.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    pub read: u64,
    pub refused: u64,
}

/// A reader with its valid files, in a folder of its own.
pub struct Fuzzer {
    pub reader: Reader,
    files: Vec<Vec<u8>>,
    folder: tempfile::TempDir,
}

impl Fuzzer {
    /// One for each reader of the program, each of which reads its undamaged files.
    ///
    /// # Panics
    /// A reader refuses a valid file.
    pub fn all() -> Vec<Self> {
        let all: Vec<Self> = (readers::all().into_iter())
            .map(|reader| Self {
                files: (reader.valid)(),
                folder: folder(),
                reader,
            })
            .collect();
        let problems: Vec<String> = all.iter().flat_map(Self::refused_valid_files).collect();
        assert!(problems.is_empty(), "{}", problems.join("\n"));
        all
    }

    fn refused_valid_files(&self) -> Vec<String> {
        let outcomes = (self.files.iter().enumerate()).map(|(index, file)| {
            let outcome = self.read(&(self.reader.wrap)(file.clone()));
            (index, outcome)
        });
        outcomes
            .filter_map(|(index, outcome)| match outcome {
                Outcome::Read => None,
                Outcome::Refused(reason) | Outcome::Wrong(reason) => Some(format!(
                    "{}: valid file {index}: {reason}",
                    self.reader.name
                )),
            })
            .collect()
    }

    /// Reads the inputs of these numbers.
    ///
    /// # Errors
    /// The first that does what none may do, in words that say how to make it again.
    pub fn run(&self, numbers: std::ops::Range<u64>) -> Result<Counts, String> {
        let mut counts = Counts::default();
        for number in numbers {
            let input = self.input(number);
            let start = Instant::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| self.read(&input)));
            let took = start.elapsed();
            let problem = match outcome {
                Ok(Outcome::Read) => {
                    counts.read += 1;
                    None
                }
                Ok(Outcome::Refused(message)) => {
                    counts.refused += 1;
                    let lines = message.lines().count();
                    (lines != 1).then(|| format!("a message of {lines} lines: {message:?}"))
                }
                Ok(Outcome::Wrong(problem)) => Some(problem),
                Err(_) => Some("it panics".to_owned()),
            };
            let problem = problem.or((took > MAX_TIME).then(|| format!("it takes {took:?}")));
            if let Some(problem) = problem {
                let kept = std::env::temp_dir().join(format!("fuzz-{}-{number}", self.reader.name));
                let kept_as = match std::fs::write(&kept, &input) {
                    Ok(()) => kept.display().to_string(),
                    Err(error) => format!("not kept: {error}"),
                };
                return Err(format!(
                    "{}, input {number} ({kept_as}): {problem}",
                    self.reader.name
                ));
            }
        }
        Ok(counts)
    }

    /// The damaged file of this number.
    fn input(&self, number: u64) -> Vec<u8> {
        let mut random = Random::new(number);
        let file = &self.files[random.below(self.files.len())];
        (self.reader.wrap)((self.reader.damage)(file, &mut random))
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join(self.reader.file)
    }

    fn read(&self, input: &[u8]) -> Outcome {
        let path = self.path();
        std::fs::write(&path, input).expect("a writable folder");
        (self.reader.read)(&path)
    }
}

/// In memory, where the system has such a place.
fn folder() -> tempfile::TempDir {
    let in_memory = Path::new("/dev/shm");
    tempfile::tempdir_in(in_memory)
        .or_else(|_| tempfile::tempdir())
        .expect("a temporary folder")
}
