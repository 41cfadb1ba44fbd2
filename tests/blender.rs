//! The Blender extension's conversions, which run without Blender, by Python's own tests; and `mixray export-blender`.

use std::process::{Command, Output};

use crate::support::{Folder, root, stderr};

/// `None`, said aloud: Python is not here.
fn python(arguments: &[&str]) -> Option<Output> {
    let output = Command::new("python3")
        .args(arguments)
        .current_dir(root())
        .output();
    if output.is_err() {
        eprintln!("SKIPPED: `python3` is not here");
    }
    output.ok()
}

#[test]
fn conversions_of_the_extension() {
    let tests = ["-m", "unittest", "discover", "-s", "blender/tests"];
    let Some(output) = python(&tests) else {
        return;
    };
    let said = stderr(&output);
    assert!(output.status.success() && said.contains("OK"), "{said}");
    assert!(!said.contains("Ran 0 tests"), "{said}");
}

#[test]
fn a_scene_as_a_script() {
    let folder = Folder::with_scene(
        "[photo]\nimage = \"photo.png\"\n[camera]\nfx = 20\ndistortion = [0.1, 0, 0, 0, 0]\n[[real]]\nshape = \"box\"\n",
    );
    let done = folder.run("export-blender scene.toml -o out.py");
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(stderr(&done).contains("distortion"), "{}", stderr(&done));
    let script = folder.read("out.py");
    assert!(script.contains("\"lens_mm\": 30.0"));
    assert!(script.contains("Not carried as it is:\n- "));
    folder.write(
        "plain.toml",
        "[camera]\nwidth = 8\nheight = 6\nfx = 20\n[[real]]\nshape = \"box\"\nmaterial = { base_color = [0.5, 0.5, 0.5] }\n",
    );
    folder.succeed("export-blender plain.toml -o plain.py");
    let script = folder.read("plain.py");
    assert!(script.contains("All of it is carried.\n\"\"\"") && !script.contains("Not carried"));
    assert!(folder.bytes("out.numbers").len() > 24 * 16 * 3);
    let refused = folder.run("export-blender scene.toml -o out.txt");
    assert_eq!(refused.status.code(), Some(2));
    // The script's own file of numbers may be an input.
    std::fs::copy(folder.path("scene.toml"), folder.path("own.numbers")).unwrap();
    let refused = folder.run("export-blender own.numbers -o own.py");
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
}
