//! Which layers an EXR file has, and what they cost.

use mixray::output::ChannelFile;

use super::support::ball;
use crate::support::{Folder, stderr};

/// A small ball before a wide floor that it hardly touches.
fn folder() -> Folder {
    let folder = Folder::new();
    let scene = ball(0.05).replace(
        "[camera]\n",
        "[camera]\nwidth = 64\nheight = 48\nfx = 60\nposition = [0, 0.6, 3]\nlook_at = [0, 0, 0]\n",
    );
    folder.write(
        "scene.toml",
        scene + "[[real]]\nshape = \"quad\"\ncorner = [-4, -0.06, -4]\nedge_u = [0, 0, 8]\nedge_v = [8, 0, 0]\nmaterial = { base_color = [0.5, 0.5, 0.5] }\n",
    );
    folder
}

/// Names of layers of `out.exr`, and how many rays were traced in the real world.
fn render(folder: &Folder, more: &str) -> (Vec<String>, u64) {
    folder.succeed(&format!(
        "render scene.toml -o out.exr --stats s.json {more}"
    ));
    let exr = exr::meta::MetaData::read_from_file(folder.path("out.exr"), true).expect("reads");
    let mut names: Vec<String> = (exr.headers[0].channels.list.iter())
        .map(|channel| {
            let name = channel.name.to_string();
            name.rsplit_once('.')
                .map_or(String::new(), |(layer, _)| layer.to_owned())
        })
        .collect();
    names.dedup();
    names.sort();
    names.dedup();
    (names, rays_in_the_real_world(folder))
}

fn rays_in_the_real_world(folder: &Folder) -> u64 {
    let stats = folder.json("s.json");
    let count = |kind: &str| stats["rays"][kind].as_u64().expect("a count");
    count("real") + count("real_shadow")
}

/// Films of sample ranges trace no more than a picture does, and what is asked for later is made up for.
#[test]
fn exr_layers_of_films() {
    let folder = folder();
    let part = |range: &str, layers: &str| {
        render(&folder, &format!("--range {range} {layers}"));
        std::fs::rename(folder.path("out.exr"), folder.path(&format!("{range}.exr")))
            .expect("renames");
        rays_in_the_real_world(&folder)
    };
    let merge = |layers: &str| {
        folder.succeed(&format!("merge 0..8.exr 8..16.exr {layers} -o merged.exr"));
        let exr =
            exr::meta::MetaData::read_from_file(folder.path("merged.exr"), true).expect("reads");
        let channels = exr.headers[0].channels.list.iter();
        let names: Vec<String> = channels.map(|channel| channel.name.to_string()).collect();
        names
    };
    let bare = part("0..8", "") + part("8..16", "");
    let (usual, of_picture) = render(&folder, "");
    // What an edge lacks whose other side is in the other part is traced by the merge.
    assert!(bare <= of_picture, "{bare}, {of_picture}");
    let names = merge("");
    for layer in &usual {
        let starts = |name: &String| name.starts_with(&format!("{layer}."));
        assert!(layer.is_empty() || names.iter().any(starts), "{layer}");
    }
    assert!(!names.iter().any(|name| name.starts_with("real.")));
    // The same, whether the parts or the merge have traced it.
    assert!(merge("--layers real,mixed").contains(&"real.R".to_owned()));
    let real =
        |path: &str| ChannelFile::read(&folder.path(path)).expect("reads").floats["real.R"].clone();
    let of_merge = real("merged.exr");
    let costly = part("0..8", "--layers real") + part("8..16", "--layers real");
    assert!(bare < costly, "control: {bare}, {costly}");
    merge("--layers real");
    let close = |a: &[f32], b: &[f32]| {
        a.iter()
            .zip(b)
            .all(|(a, b)| (a - b).abs() <= 1e-6 * a.abs())
    };
    assert!(close(&of_merge, &real("merged.exr")));
    assert!(of_merge.iter().any(|x| *x > 0.0), "control");
}

#[test]
fn exr_layers() {
    let folder = folder();
    let (usual, rays) = render(&folder, "");
    assert_eq!(
        usual,
        [
            "",
            "change",
            "depth",
            "difference",
            "mask",
            "normal",
            "samples",
            "variance",
            "virtual"
        ]
    );
    folder.succeed("render scene.toml -o out.png --stats s.json");
    let of_png = rays_in_the_real_world(&folder);
    let (few, bare) = render(
        &folder,
        "--layers composite,difference,mask,variance,samples",
    );
    assert_eq!(few, ["", "difference", "mask", "samples", "variance"]);
    assert_eq!(bare, of_png);
    let (all, costly) = render(&folder, "--layers composite,real,mixed,albedo");
    assert_eq!(all, ["", "albedo", "mixed", "real"]);
    // Depth and normal take the first hit of each ray, and no light.
    assert!(bare <= rays && rays < costly, "{bare}, {rays}, {costly}");
    assert_eq!(render(&folder, "--layers mask,depth").0, ["depth", "mask"]);
    assert!(
        render(&folder, "--composite quotient")
            .0
            .contains(&"ratio".to_owned())
    );
    let refused = folder.run("render scene.toml -o out.exr --layers beauty");
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("expected composite, virtual"));
}
