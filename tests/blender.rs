//! The Blender extension's conversions, which run without Blender, by Python's own tests.

use std::process::Command;

use crate::support::root;

#[test]
fn conversions_of_the_extension() {
    let run = |pattern: &str| {
        let mut python = Command::new("python3");
        python.args(["-m", "unittest", "discover", "-s", "blender/tests", "-k", pattern]);
        python.current_dir(root()).output()
    };
    let Ok(output) = run("*") else {
        eprintln!("not tested: `python3` is not here");
        return;
    };
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("OK") && !said.contains("Ran 0 tests"), "{said}");
    // Tests that are not found are no success.
    let none = run("no_such_test").unwrap();
    let said = String::from_utf8_lossy(&none.stderr);
    assert!(said.contains("Ran 0 tests"), "{said}");
}
