//! The integration tests, all in one binary: `cargo test --release --test integration -- stages::` runs one folder's.

mod architecture;
mod backends;
mod bench;
mod blender;
mod checking;
mod cli;
mod compositing;
mod farm;
mod faults;
mod files;
mod gltf;
mod gltf_pictures;
mod interrupted;
mod invariants;
mod light_fit;
mod lines;
mod live;
mod overwriting;
#[cfg(feature = "preview")]
mod preview;
mod references;
mod sandbox;
mod scenes;
mod sequence;
mod smooth;
mod stages;
mod stress;
mod support;
mod tracking;
mod twins_sampling;

use std::path::{Path, PathBuf};

/// Files below a folder that no `mod` names: the compiler passes over them without a word.
fn orphans(folder: &Path, parent: &str) -> Vec<PathBuf> {
    let declarations = std::fs::read_to_string(folder.join(parent)).unwrap();
    let mut orphans = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap();
        let is_folder = path.join("mod.rs").is_file();
        let is_file = path.extension().is_some_and(|ending| ending == "rs")
            && !["main", "mod"].contains(&stem);
        if is_folder {
            orphans.extend(self::orphans(&path, "mod.rs"));
        }
        let declaration = format!("mod {stem};");
        if (is_folder || is_file) && !declarations.lines().any(|l| l.ends_with(&declaration)) {
            orphans.push(path);
        }
    }
    orphans
}

#[test]
fn every_file_is_a_module() {
    let found = orphans(&support::root().join("tests"), "main.rs");
    assert!(found.is_empty(), "no `mod` names {found:?}");
    let folder = support::Folder::new();
    folder.create("kinds");
    folder.write("main.rs", "mod kinds;\nmod named;\n");
    folder.write("named.rs", "");
    folder.write("kinds/mod.rs", "pub mod named;\n");
    folder.write("kinds/named.rs", "");
    folder.write("kinds/stray.rs", "");
    let control = [folder.path("kinds/stray.rs")];
    assert_eq!(orphans(folder.root(), "main.rs"), control);
}
