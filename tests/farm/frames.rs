//! Frames shared among tasks are those of one run.

use crate::sequence::support::BALL;
use crate::support::Folder;

/// Far enough apart for the coordinates' origin to move, with an exposure that is fitted to the first posed frame, and a focus that is pulled.
fn folder() -> Folder {
    let folder = Folder::new();
    let scene = BALL.replace("[render]\n", "[render]\nexposure_ev = \"auto\"\n");
    folder.write("scene.toml", scene);
    folder.frames(7, 0.4);
    folder.trajectory(7, 0.4, &[0, 4]);
    folder
}

const PULL: [&str; 2] = ["--focus-pull", "1..3"];

#[test]
fn parts_in_any_order_are_one_run() {
    let folder = folder();
    let to = |out: &str, more: &[&str]| {
        folder.sequence(&[&["--frames", "in", "-o", out], &PULL[..], more].concat())
    };
    to("whole", &[]);
    let whole = folder.frames_of("whole");
    assert_eq!(whole.len(), 7);
    for part in ["6", "2-4", "0..2", "5-5"] {
        to("parts", &["--part", part]);
    }
    assert_eq!(folder.frames_of("parts"), whole);
    let said = to("parts", &["--part", "2-4"]);
    assert!(
        said.contains("0 rendered") && said.contains("3 kept"),
        "{said}"
    );
    let said = to("parts", &[]);
    assert!(
        said.contains("0 rendered") && said.contains("7 kept"),
        "{said}"
    );
    // Control: a range of its own is another render, whose exposure is fitted and whose focus is pulled over other frames.
    to("range", &["--range", "2..5"]);
    assert_ne!(folder.frames_of("range")[0], whole[2]);
    let other = ["--frames", "in", "-o", "parts", "--range", "2..5"];
    folder.refuse_sequence(&other, "another render");
    let nothing = ["--frames", "in", "-o", "none", "--part", "7-9"];
    folder.refuse_sequence(&nothing, "--part");
}

#[test]
fn progress_is_told_to_an_engine() {
    let folder = folder();
    let to = ["--frames", "in", "-o", "out", "--progress", "openjd"];
    let said = folder.sequence(&to);
    let told: Vec<f64> = (said.lines())
        .filter_map(|line| line.strip_prefix("openjd_progress: ")?.parse().ok())
        .collect();
    assert!(told.is_sorted() && told.len() > 2, "{said}");
    assert_eq!((told[0], told[told.len() - 1]), (0.0, 100.0), "{said}");
    assert!(said.contains("openjd_status: f_0003.png"), "{said}");
    let said = folder.sequence(&["--frames", "in", "-o", "other"]);
    assert!(!said.contains("openjd"), "control: {said}");
    let both = ["--frames", "in", "-o", "-", "--progress", "openjd"];
    folder.refuse_sequence(&both, "standard output");
}
