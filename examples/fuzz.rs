//! Reads damaged files for hours: `cargo run --release --example fuzz -- --hours N [--inputs N] [--reader NAME] [--first N]`.
//!
//! Ends with the first input that does what none may do; the same numbers make the same inputs again.

#[path = "../tests/faults/fuzz/mod.rs"]
mod fuzz;

use std::time::{Duration, Instant};

use clap::Parser;

/// Inputs of a reader between two looks at the clock and the memory.
const BATCH: u64 = 500;
/// Between two lines that say how far it is.
const TELL_EVERY: Duration = Duration::from_secs(60);
/// Most memory that the process may ever have held.
const MAX_BYTES: u64 = 2 << 30;

#[derive(Parser)]
struct Arguments {
    /// When to end
    #[arg(long, default_value_t = 1.0)]
    hours: f64,
    /// End after so many inputs of all readers together
    #[arg(long, default_value_t = u64::MAX)]
    inputs: u64,
    /// This reader only
    #[arg(long)]
    reader: Option<String>,
    /// Number of the first input of each reader
    #[arg(long, default_value_t = 0)]
    first: u64,
}

fn main() -> Result<(), String> {
    let arguments = Arguments::parse();
    let mut fuzzers = fuzz::Fuzzer::all();
    if let Some(name) = &arguments.reader {
        fuzzers.retain(|fuzzer| fuzzer.reader.name == name);
    }
    if fuzzers.is_empty() {
        return Err("there is no such reader".to_owned());
    }
    let begin = Instant::now();
    let time = Duration::try_from_secs_f64(arguments.hours * 3600.0).map_err(|e| e.to_string())?;
    let mut counts = vec![fuzz::Counts::default(); fuzzers.len()];
    let mut seconds = vec![0.0; fuzzers.len()];
    let (mut first, mut total) = (arguments.first, 0);
    let mut told = begin;
    while begin.elapsed() < time && total < arguments.inputs {
        for (index, fuzzer) in fuzzers.iter().enumerate() {
            let start = Instant::now();
            let batch = fuzzer.run(first..first + BATCH)?;
            check_memory()
                .map_err(|problem| format!("{} {first}: {problem}", fuzzer.reader.name))?;
            counts[index].read += batch.read;
            counts[index].refused += batch.refused;
            seconds[index] += start.elapsed().as_secs_f64();
            total += BATCH;
        }
        first += BATCH;
        if told.elapsed() >= TELL_EVERY {
            told = Instant::now();
            eprintln!("{total} inputs, up to number {first} of each reader");
        }
    }
    for ((fuzzer, counts), seconds) in fuzzers.iter().zip(&counts).zip(&seconds) {
        println!(
            "{:>15}: {:>8} read, {:>8} refused, {seconds:.0} s",
            fuzzer.reader.name, counts.read, counts.refused
        );
    }
    println!(
        "{total} inputs, up to number {first} of each reader, in {:.0} s",
        begin.elapsed().as_secs_f64()
    );
    Ok(())
}

/// That the process has not held more memory than it may.
///
/// # Errors
/// It has.
fn check_memory() -> Result<(), String> {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB"));
    let peak = peak.and_then(|kilobytes| kilobytes.trim().parse::<u64>().ok());
    match peak {
        Some(peak) if peak * 1024 > MAX_BYTES => Err(format!("{peak} kB of memory were held")),
        _ => Ok(()),
    }
}
