//! Parts of a still are kept if they are this render's, and refused by name if not.

use mixray::output::read_film;

use crate::support::{Folder, assert_refused, stderr};

const SCENE: &str = "[camera]\nwidth = 24\nheight = 16\nfx = 30\n[environment]\nradiance = [0.6, 0.6, 0.6]\n[[real]]\nshape = \"quad\"\ncorner = [-2, -0.3, 1]\n\
    edge_u = [6, 0, 0]\nedge_v = [0, 0, -6]\nmaterial = { base_color = [0.5, 0.5, 0.5] }\n[[virtual]]\nshape = \"sphere\"\nsegments = 12\nscale = 0.3\n\
    translation = [0, 0, -2]\n[photo]\nimage = \"photo.png\"\n[render]\nrays_per_pixel = 16\nbackend = \"cpu\"\nmax_bounces = 1\n";

/// As the program seals its files: the hash of all bytes, with zeros for its own digits.
fn seal(file: &mut [u8]) {
    let head = b"mixray.seal\0string\0";
    let at = file.windows(head.len()).position(|bytes| bytes == head);
    let digits = at.expect("is sealed") + head.len() + 4;
    file[digits..digits + 64].fill(b'0');
    let hash = blake3::hash(file).to_hex();
    file[digits..digits + 64].copy_from_slice(hash.as_bytes());
}

fn render(folder: &Folder, more: &str) -> String {
    folder.succeed(&format!("render scene.toml --resume {more}"))
}

#[test]
fn a_finished_part_is_kept_and_another_one_refused() {
    let folder = Folder::with_scene(SCENE);
    let part = "--range 4-7 -o part.exr";
    assert!(!render(&folder, part).contains("kept"));
    let bytes = folder.bytes("part.exr");
    assert!(render(&folder, part).contains("kept"));
    assert!(folder.bytes("part.exr") == bytes);
    for (more, problem) in [
        ("--range 8-11 -o part.exr", "rays 4..8"),
        ("--range 4-7 -o part.exr --seed 3", "seed"),
        ("--range 4-7 -o part.exr --rpp 32", "rays per pixel in all"),
    ] {
        folder.refuse(&format!("render scene.toml --resume {more}"), problem);
        folder.refuse(&format!("render scene.toml --resume {more}"), "part.exr");
    }
    folder.write("scene.toml", SCENE.replace("scale = 0.3", "scale = 0.2"));
    let again = format!("render scene.toml --resume {part}");
    folder.refuse(&again, "different scenes");
    folder.write("scene.toml", SCENE);
    // What is no film is nobody's to replace.
    folder.succeed("render scene.toml --rpp 1 -o picture.exr");
    let picture = "render scene.toml --resume --range 4-7 -o picture.exr";
    folder.refuse(picture, "holds no film");
    assert!(folder.bytes("part.exr") == bytes);
    // A part that was ended early goes on to its end.
    folder.succeed("render scene.toml --range 4-5 -o part.exr");
    assert!(!render(&folder, part).contains("kept"));
    assert_eq!(
        read_film(&folder.path("part.exr")).expect("a film").1.range,
        (4, 8)
    );
    let two = "render scene.toml --resume --range 4-7 -o a.exr -o a.png";
    assert_refused(&folder.run(two), "--resume");
}

/// What a power cut or a bad disk has left of a part is not kept, and does not stand in the way.
#[test]
fn a_damaged_part_is_rendered_again() {
    let folder = Folder::with_scene(SCENE);
    let part = "--range 4-7 -o part.exr";
    render(&folder, part);
    let whole = folder.bytes("part.exr");
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 4;
        bytes
    };
    for damaged in [
        Vec::new(),
        vec![0; whole.len()],
        whole[..whole.len() / 2].to_vec(),
        whole[..whole.len() - 1].to_vec(),
        [whole.as_slice(), b"more"].concat(),
        flipped(0),
        flipped(whole.len() / 2),
        flipped(whole.len() - 1),
    ] {
        folder.write("part.exr", &damaged);
        folder.refuse("merge part.exr part.exr -o out.png", "part.exr");
        let output = folder.run(&format!("render scene.toml --resume {part}"));
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains("part.exr: is damaged"), "{said}");
        assert!(folder.bytes("part.exr") == whole);
    }
    assert!(render(&folder, part).contains("kept"), "control");
}

/// A file of another version stands for one that another host has written.
#[test]
fn a_part_of_another_version_is_refused() {
    let folder = Folder::with_scene(SCENE);
    let part = "--range 0-3 -o part.exr";
    render(&folder, part);
    let mut bytes = folder.bytes("part.exr");
    let version = format!("\"version\":\"{}\"", env!("CARGO_PKG_VERSION"));
    let at = (bytes.windows(version.len()))
        .position(|window| window == version.as_bytes())
        .expect("the note");
    bytes[at + version.len() - 2] = b'9';
    seal(&mut bytes);
    folder.write("part.exr", bytes);
    let again = format!("render scene.toml --resume {part}");
    folder.refuse(&again, "program version");
}
