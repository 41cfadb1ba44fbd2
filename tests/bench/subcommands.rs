//! Which measurement takes which flags, and what the measurements were called when they were flags.

use super::support::folder;

/// What each takes beside its own, and what it has no use for.
#[test]
fn each_measurement_refuses_the_flags_of_others() {
    let folder = folder();
    let of_rows = "--goal-rpp 64,--reference-error 1,--reference-rpp 64,--filter,--against r.json";
    for (measurement, others) in [
        ("growth", "--rpp 4"),
        ("stress", "--rpp 4,--seed 2,--shrink 2"),
        ("paper-table", "--rpp 4"),
        ("gpu-time scene.toml", "--backends gpu,--repeats 2"),
    ] {
        for flag in of_rows.split(',').chain(others.split(',')) {
            let output = folder.run(&format!("bench {measurement} {flag}"));
            assert_eq!(output.status.code(), Some(2), "{measurement} {flag}");
            let message = String::from_utf8_lossy(&output.stderr);
            assert!(message.contains("unexpected argument"), "{message}");
        }
        let help = folder.succeed(&format!("bench {measurement} --help"));
        assert!(help.contains("--write-docs") && help.contains("--threads"));
    }
}

#[test]
fn the_flags_of_before_name_the_subcommand() {
    let folder = folder();
    for (before, now) in [
        ("scene.toml --ablate", "`mixray bench ablate SCENE...`"),
        ("--growth", "`mixray bench growth [WHAT,...]`"),
        (
            "--growth=rays,lights -o x",
            "`mixray bench growth [WHAT,...]`",
        ),
        ("--paper-table --backends cpu", "`mixray bench paper-table`"),
        ("--stress --write-docs page.md", "`mixray bench stress`"),
        (
            "scene.toml --gpu-time --rpp 4",
            "`mixray bench gpu-time SCENE...`",
        ),
    ] {
        folder.refuse(&format!("bench {before}"), now);
    }
    assert!(!folder.path("x").exists(), "nothing was written");
    folder.refuse("bench", "`mixray bench SCENE...`");
}

#[test]
fn gpu_time_has_a_row_a_count_of_rays() {
    let folder = folder();
    folder.write("page.md", "<!-- gpu-time -->\n<!-- end -->\n");
    let shown = folder.succeed("bench gpu-time scene.toml --rpp 4,1,4 -o out --write-docs page.md");
    let times = &folder.json("out/gpu-time.json")["times"];
    let rays: Vec<u64> = (times.as_array().unwrap().iter())
        .map(|time| time["rays_per_pixel"].as_u64().unwrap())
        .collect();
    assert_eq!(rays, [1, 4], "ascending, each once: {shown}");
    assert!(
        folder
            .read("page.md")
            .contains("    mixray bench gpu-time scene.toml")
    );
    folder.refuse("bench gpu-time none.toml -o none", "none.toml");
    assert!(!folder.path("none").exists());
}

/// All of it takes minutes: a figure into a page that lacks the place ends before it begins.
#[test]
fn stress_wants_a_page_with_its_section() {
    let folder = folder();
    folder.write("page.md", "<!-- bench -->\n<!-- end -->\n");
    folder.refuse(
        "bench stress --write-docs page.md -o out",
        "<!-- stress -->",
    );
    assert!(!folder.path("out").exists());
}
