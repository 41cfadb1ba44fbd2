use super::*;

fn profile() -> NoiseProfile {
    let mut profile = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 0.5 }, 4);
    profile.autocorrelation[1][2][4] = 0.25;
    profile.channel_correlation = [0.5, -0.125, 0.0];
    profile.bins[2].filled[1] = true;
    profile.bins[1].samples = [1, 2, 3_000_000_000];
    for bin in &mut profile.bins {
        // Values that six decimals hold.
        bin.sigma = [1.5, 0.25, 2.0];
        (bin.low, bin.high) = ([1.0; 3], [3.0; 3]);
    }
    profile.sources = vec!["a \"quoted\" folder\\with: 3 frames".into()];
    profile
}

#[test]
fn the_file_survives_a_round_trip() {
    let text = profile().to_toml();
    assert_eq!(NoiseProfile::from_toml(&text).unwrap(), profile(), "{text}");
    let changed = text.replace("sigma = [1.500000", "sigma = [1.500001");
    assert_ne!(
        NoiseProfile::from_toml(&changed).unwrap(),
        profile(),
        "control"
    );
}

#[test]
fn other_files_are_refused_with_the_reason() {
    let text = profile().to_toml();
    for (from, to, part) in [
        (
            "version = 1",
            "version = 2",
            "version 2; expected version 1",
        ),
        (
            "mixray noise profile\"",
            "other\"",
            "its format is \"other\"",
        ),
        (
            "mixray noise profile\"",
            "of two\\nlines\"",
            "its format is \"of two\\nlines\"",
        ),
        ("sigma = [1.5", "sigma = [-1.5", "0 to 255 DN"),
        ("sigma = [1.5", "sigma = [nan", "no noise profile"),
        ("0.250000", "2.5", "within -1 and 1"),
        ("[fit]", "[fits]", "no noise profile"),
        ("filled", "full", "no noise profile"),
    ] {
        let message = NoiseProfile::from_toml(&text.replace(from, to))
            .unwrap_err()
            .to_string();
        assert!(message.contains(part), "{message}");
    }
    let three = text.rsplit_once("\n[[bin]]").unwrap().0;
    assert!(
        NoiseProfile::from_toml(three)
            .unwrap_err()
            .to_string()
            .contains("3 bins")
    );
    assert!(
        NoiseProfile::from_toml("a = 1")
            .unwrap_err()
            .to_string()
            .contains("no noise profile")
    );
}

#[test]
fn bins_are_those_that_the_paper_means() {
    assert_eq!(
        [0.0, 63.9, 64.0, 255.0, 300.0, -3.0].map(|c| bin_index(c, 4)),
        [0, 0, 1, 3, 3, 0]
    );
    assert_eq!(bin_index(200.0, 1), 0);
}
