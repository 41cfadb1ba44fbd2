//! Measures the camera stages and writes docs/stages.md: `cargo run --release --example measure_stages > docs/stages.md`.
//!
//! Everything is made here or stands under `scenes/`, but for one real sequence, which is left out where it is absent.

mod cameras;
mod frames;
mod speed;

use std::error::Error;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    println!("# The camera stages, measured\n");
    println!(
        "Made by `cargo run --release --example measure_stages > docs/stages.md`; nothing here is written by hand. {} CPU threads, mixray {}.\n",
        rayon::current_num_threads(),
        env!("CARGO_PKG_VERSION")
    );
    cameras::calibrations()?;
    cameras::round_trip()?;
    frames::soft_edge()?;
    frames::flicker();
    speed::cartoon()?;
    speed::noise()
}
