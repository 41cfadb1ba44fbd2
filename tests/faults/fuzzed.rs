//! The fuzzer, for a minute; `cargo run --release --example fuzz -- --hours N` for longer.

use super::fuzz::Fuzzer;

/// Inputs of each reader.
const INPUTS: u64 = 1500;

#[test]
fn no_reader_panics_hangs_or_takes_what_is_not_finite() {
    for fuzzer in Fuzzer::all() {
        let name = fuzzer.reader.name;
        let counts = fuzzer
            .run(0..INPUTS)
            .unwrap_or_else(|problem| panic!("{problem}"));
        // Neither harmless nor all beyond repair.
        assert!(
            counts.read > INPUTS / 100 && counts.refused > INPUTS / 100,
            "{name}: {counts:?}"
        );
    }
}

#[test]
fn a_reader_that_panics_is_found() {
    let mut fuzzer = Fuzzer::all().swap_remove(0);
    fuzzer.reader.read = |path| {
        let text = std::fs::read(path).expect("was written");
        assert!(text.starts_with(b"\n[photo]"), "control");
        super::fuzz::Outcome::Read
    };
    let problem = fuzzer.run(0..INPUTS).expect_err("a panic");
    assert!(problem.contains("it panics"), "{problem}");
}
