//! `mixray bench growth`.

use super::support::folder;

#[test]
fn growth_has_a_curve_a_law_and_method() {
    let folder = folder();
    folder.write("page.md", "a\n<!-- growth -->\n<!-- end -->\nb\n");
    let table = folder.succeed(
        "bench growth rays,objects --shrink 16 --repeats 1 --backends cpu -o out --write-docs page.md",
    );
    assert!(
        table.contains("virtual objects") && table.contains("expected"),
        "{table}"
    );
    let curves = &folder.json("out/growth.json")["curves"];
    let laws: Vec<&str> = curves
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["law"].as_str().unwrap())
        .collect();
    assert_eq!(
        laws,
        ["rays", "rays", "objects", "objects"],
        "two methods each"
    );
    assert_eq!(curves[0]["points"].as_array().unwrap().len(), 5);
    // The paper's rays are as many as asked for, whatever the time they take.
    let exponent = curves[1]["rays_exponent"]["slope"].as_f64().unwrap();
    assert!((exponent - 1.0).abs() < 0.02, "{exponent}");
    assert!(
        folder.path("out/growth-rays.svg").exists()
            && folder.path("out/growth-objects.png").exists()
    );
    assert!(
        !folder.path("out/growth-build.svg").exists(),
        "control: was not asked for"
    );
    assert!(
        folder
            .read("page.md")
            .contains("| render | cpu paper jittered |")
    );
    assert_eq!(folder.read("out/growth.csv").lines().count(), 21);
    for wrong in ["bench growth scene.toml", "bench growth moons"] {
        assert_eq!(folder.run(wrong).status.code(), Some(2), "{wrong}");
    }
}
