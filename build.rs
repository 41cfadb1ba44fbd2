//! Embeds `shaders/`: writes the table of its modules, name and source, to `OUT_DIR/shader_modules.rs`.
//!
//! The module of a file is named as Rust would name it: `shaders/light/cones.wgsl` is `light::cones`, and `mod.wgsl` is its folder.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    println!("cargo::rerun-if-changed=shaders");
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let mut files = Vec::new();
    collect(&root.join("shaders"), "", &mut files)?;
    files.sort();
    let rows: String = files
        .iter()
        .map(|(module, path)| format!("    ({module:?}, include_str!({path:?})),\n"))
        .collect();
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("set by cargo"));
    fs::write(out.join("shader_modules.rs"), format!("&[\n{rows}]\n"))
}

/// Every WGSL file under `folder`, whose module is `parent`.
fn collect(folder: &Path, parent: &str, files: &mut Vec<(String, PathBuf)>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let module = match (parent, name.as_ref()) {
            ("", name) => name.to_owned(),
            (parent, "mod") => parent.to_owned(),
            (parent, name) => format!("{parent}::{name}"),
        };
        if path.is_dir() {
            collect(&path, &module, files)?;
        } else if path
            .extension()
            .is_some_and(|extension| extension == "wgsl")
        {
            files.push((module, path));
        }
    }
    Ok(())
}
