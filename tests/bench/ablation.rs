//! Rows without savings and rows to a goal.

use mixray::renderer::Skip;
use mixray::scene::Choice;

use super::support::{QUICK, folder};

/// The quick benchmark as this subcommand.
fn of(subcommand: &str) -> String {
    QUICK.replacen("bench", &format!("bench {subcommand}"), 1)
}

#[test]
fn each_saving_has_its_rows() {
    let folder = folder();
    let shown = folder.succeed(&format!("{} --goal-rpp 64", of("ablate")));
    let report = folder.json("out/results.json");
    let rows = report["rows"].as_array().unwrap();
    // paper, direct, and direct without ten savings, at two counts of rays; two goals with their savings and without.
    assert_eq!(rows.len(), 2 * (2 + 10) + 2 * 2);
    for (name, _) in Skip::CHOICES {
        let has_row = rows.iter().any(|row| row["without"] == *name);
        assert_eq!(has_row, *name != "specialisation", "{name}");
    }
    let rays_of = |row: &serde_json::Value| -> u64 {
        let rays = row["rays"].as_object().unwrap();
        rays.values().map(|count| count.as_u64().unwrap()).sum()
    };
    let rays = |without: serde_json::Value| {
        let row = rows.iter().find(|row| {
            row["estimator"] == "direct" && row["rays_per_pixel"] == 4 && row["without"] == without
        });
        rays_of(row.unwrap())
    };
    for saving in ["edge-real", "virtual-first"] {
        assert!(rays(saving.into()) > rays(serde_json::Value::Null));
    }
    let goals: Vec<_> = rows.iter().filter(|row| row["goal"].is_object()).collect();
    let [to_error, not_adaptive, to_noise, not_stopped] = goals.as_slice() else {
        panic!("{goals:?}");
    };
    // One digit of the error at the middle of 1 and 4 rays per pixel.
    let aim = to_error["goal"]["aim"]["target-error"].as_f64().unwrap();
    let usual = rows
        .iter()
        .find(|r| r["estimator"] == "direct" && r["rays_per_pixel"] == 4);
    let usual = usual.unwrap()["errors"]["all"]["rmse"].as_f64().unwrap();
    assert!((aim / usual - 1.0).abs() < 0.5, "{aim} {usual}");
    assert!(shown.contains(&format!("cpu direct sobol to error {aim} without adaptive")));
    assert!(rays_of(not_adaptive) >= rays_of(to_error));
    assert_eq!(not_adaptive["without"], "adaptive");
    assert!(shown.contains("cpu direct sobol to camera noise 0.02 y + 0.5 without camera-noise"));
    assert_eq!(to_noise["goal"]["aim"]["camera-noise"][2][0], 0.02);
    assert_eq!(not_stopped["without"], "camera-noise");
    let taken = |row: &serde_json::Value| row["mean_rays_per_pixel"].as_f64().unwrap();
    assert!(taken(to_noise) >= 16.0 && taken(to_noise) <= taken(not_stopped));
    assert_eq!(taken(not_stopped), 64.0);
}

#[test]
fn savings_and_goals_have_rows_by_name() {
    let folder = folder();
    folder.succeed(&format!(
        "{QUICK} --estimators direct --no-skip cones --no-skip cones --target-error 0.5 --camera-noise 0.5,20 --goal-rpp 16"
    ));
    let report = folder.json("out/results.json");
    let shown: Vec<String> = (report["rows"].as_array().unwrap().iter())
        .map(|row| format!("{} {}", row["without"], row["goal"]["aim"]))
        .collect();
    let noise = "{\"camera-noise\":[[0.5,20.0],[0.5,20.0],[0.5,20.0]]}";
    let expected = [
        "null null".to_owned(),
        "null null".to_owned(),
        "\"cones\" null".to_owned(),
        "\"cones\" null".to_owned(),
        "null {\"target-error\":0.5}".to_owned(),
        format!("null {noise}"),
    ];
    assert_eq!(shown, expected);
    folder.refuse(
        &format!("{QUICK} --no-skip specialisation"),
        "--backends gpu",
    );
    folder.refuse(&format!("{QUICK} --camera-noise 1"), "--camera-noise");
}

#[test]
fn flags_that_would_do_nothing_are_refused() {
    let folder = folder();
    for flag in [
        "--no-skip cones",
        "--no-skip specialisation",
        "--target-error 0.1",
        "--camera-noise 0.02,0.5",
        "--filter",
    ] {
        let name = flag.split(' ').next().unwrap();
        folder.refuse(&format!("{QUICK} --estimators paper {flag}"), name);
    }
    folder.refuse(
        &format!("{} --estimators paper", of("ablate")),
        "--estimators",
    );
    folder.refuse(&format!("{} --no-skip cones", of("ablate")), "--no-skip");
    folder.refuse(&format!("{QUICK} --goal-rpp 64"), "--goal-rpp");
    folder.refuse(
        &format!("{QUICK} --goal-rpp 64 --no-skip cones"),
        "--goal-rpp",
    );
    for flag in
        "no-skip cones,target-error 1,camera-noise 1,filter,goal-rpp 64,rpp 4,seed 2,reference-rpp 64"
            .split(',')
    {
        let output = folder.run(&format!("bench --report r.json --{flag}"));
        assert_eq!(output.status.code(), Some(2), "--{flag}");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains("cannot be used with"), "{message}");
    }
}
