//! A thread that reads a stream as fast as it comes, and keeps its newest frame.

use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use super::LiveError;
use super::slot::{Counts, Fetched, Slot};
use crate::files;
use crate::video::{Header, Matrix, Place, VideoError, Y4mReader};

/// A frame of the stream, not yet decoded.
#[derive(Debug)]
pub struct Arrived {
    /// From 0, dropped ones counted.
    pub number: u32,
    pub planes: Vec<u8>,
    /// Its last byte was read.
    pub at: Instant,
}

/// The reading end.
pub struct Intake {
    pub header: Header,
    slot: Arc<Slot<Arrived, VideoError>>,
}

impl Intake {
    /// Waits for the stream's first line, `-` being standard input.
    ///
    /// # Errors
    /// There is no Y4M stream.
    pub fn open(path: &Path, matrix: Option<Matrix>) -> Result<Self, LiveError> {
        let (input, place): (Box<dyn Read + Send>, _) = if path == Path::new("-") {
            files::standard_input().map_err(|error| Place::Stdin.error(error.to_string()))?;
            (Box::new(std::io::stdin()), Place::Stdin)
        } else {
            let place = Place::File(path.into());
            let file = files::open(path).map_err(|error| {
                place.error(format!(
                    "it cannot be read ({error}); expected a Y4M stream; correct the path"
                ))
            })?;
            (Box::new(file), place)
        };
        let mut reader = Y4mReader::new(BufReader::new(input), place)?;
        if let Some(matrix) = matrix {
            reader.set_matrix(matrix);
        }
        let header = reader.header().clone();
        let slot = Arc::new(Slot::default());
        let filled = Arc::clone(&slot);
        let spawned = thread::Builder::new().spawn(move || fill(&mut reader, &filled));
        spawned.map_err(|error| {
            LiveError::Unfit(format!(
                "no thread can be made to read the stream ({error}); expected room for one; raise ulimit -u"
            ))
        })?;
        Ok(Self { header, slot })
    }

    /// The newest frame, as soon as there is one that was not taken before.
    pub fn take(&self, most: Duration) -> Fetched<Arrived, VideoError> {
        self.slot.take(most)
    }

    pub fn counts(&self) -> Counts {
        self.slot.counts()
    }
}

fn fill(reader: &mut Y4mReader<impl Read>, slot: &Slot<Arrived, VideoError>) {
    for number in 0.. {
        match reader.next_at_once() {
            Ok(Some(planes)) => slot.put(Arrived {
                number,
                planes,
                at: Instant::now(),
            }),
            Ok(None) => return slot.end(Ok(())),
            Err(problem) => return slot.end(Err(problem)),
        }
    }
}
