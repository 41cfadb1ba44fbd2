//! The integration tests, all in one binary: `cargo test --release --test integration -- stages::` runs one folder's.

mod backends;
mod bench;
mod cli;
mod faults;
mod gltf;
mod gltf_pictures;
mod invariants;
mod references;
mod scenes;
mod sequence;
mod smooth;
mod stages;
mod stress;
mod twins_sampling;

/// A file that no `mod` names would be left out without a word.
#[test]
fn every_file_is_a_module() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let mut orphans = Vec::new();
    let mut folders = vec![(root.clone(), "main.rs")];
    while let Some((folder, parent)) = folders.pop() {
        let declarations = std::fs::read_to_string(folder.join(parent)).unwrap();
        let is_declared = |name: &str| {
            let wanted = format!("mod {name};");
            declarations.lines().any(|line| line.ends_with(&wanted))
        };
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap();
            let is_folder = path.join("mod.rs").is_file();
            let is_file = path.extension().is_some_and(|ending| ending == "rs")
                && !["main", "mod"].contains(&stem);
            if (is_folder || is_file) && !is_declared(stem) {
                orphans.push(path.clone());
            }
            if is_folder {
                folders.push((path, "mod.rs"));
            }
        }
    }
    assert!(orphans.is_empty(), "no module: {orphans:?}");
}
