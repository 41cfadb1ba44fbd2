//! How many threads the CPU's work takes.

use clap::Args;

use super::{Failure, pool};

#[derive(Debug, Args)]
pub(super) struct ThreadsFlag {
    /// CPU threads [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl ThreadsFlag {
    /// Once, before anything runs on several threads.
    pub(super) fn start(&self) -> Result<(), Failure> {
        pool::start(self.threads)
    }
}
