//! PLY and OBJ proxies are the mesh that was written, in every form; what is none is refused by name.

use std::path::Path;

use mixray::scene::{self, Scene};

use crate::support::Folder;

const HEAD: &str =
    "[camera]\nwidth = 8\nheight = 6\nvertical_fov_deg = 40\n[environment]\nradiance = [1, 1, 1]\n";

/// A square and a triangle beside it; the third vertex is used by both.
const POSITIONS: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 0.0, -1.0],
    [0.0, 0.5, -1.0],
    [2.0, 0.0, -1.0],
];

fn proxy(folder: &Folder, file: &str, side: &str) -> Result<Scene, String> {
    let text = format!("{HEAD}[[{side}]]\nmesh = \"{file}\"\n");
    folder.write("scene.toml", &text);
    scene::load(&folder.path("scene.toml")).map_err(|error| error.to_string())
}

/// Corners of its triangles, sorted.
fn corners(scene: &Scene) -> Vec<[[f32; 3]; 3]> {
    let primitive = &scene.objects[0].instances[0].primitive;
    assert_eq!(primitive.positions.len(), primitive.normals.len());
    let corner = |vertex: u32| primitive.positions[vertex as usize];
    let mut all: Vec<_> = primitive.triangles.iter().map(|t| t.map(corner)).collect();
    all.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    all
}

fn expected() -> Vec<[[f32; 3]; 3]> {
    let mut all: Vec<_> = [[0, 1, 2], [0, 2, 3], [1, 4, 2]]
        .map(|t: [usize; 3]| t.map(|i| POSITIONS[i]))
        .into();
    all.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    all
}

fn header(format: &str, counts: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment a scan\nelement camera 1\nproperty float view\nelement vertex 5\nproperty float x\nproperty double y\n\
         property float z\nproperty uchar red\nelement face 2\nproperty uchar flags\nproperty list {counts} int vertex_indices\nend_header\n"
    )
}

fn text_ply() -> String {
    let mut text = header("ascii", "uchar") + "7\n";
    for [x, y, z] in POSITIONS {
        text += &format!("{x} {y} {z} 200\n");
    }
    text + "1 4 0 1 2 3\n1 3 1 4 2\n"
}

fn binary_ply(is_big: bool) -> Vec<u8> {
    let name = if is_big {
        "binary_big_endian"
    } else {
        "binary_little_endian"
    };
    let mut bytes = header(name, "ushort").into_bytes();
    let mut put = |mut value: Vec<u8>| {
        if is_big {
            value.reverse();
        }
        bytes.extend(value);
    };
    put(7_f32.to_le_bytes().into());
    for [x, y, z] in POSITIONS {
        put(x.to_le_bytes().into());
        put(f64::from(y).to_le_bytes().into());
        put(z.to_le_bytes().into());
        put(vec![200]);
    }
    for face in [&[0_i32, 1, 2, 3][..], &[1, 4, 2]] {
        put(vec![1]);
        put((face.len() as u16).to_le_bytes().into());
        face.iter()
            .for_each(|vertex| put(vertex.to_le_bytes().into()));
    }
    bytes
}

#[test]
fn every_form_of_ply_and_obj_is_the_same_mesh() {
    let folder = Folder::new();
    folder.write("text.ply", text_ply());
    folder.write("windows.ply", text_ply().replace('\n', "\r\n"));
    folder.write("little.ply", binary_ply(false));
    folder.write("big.ply", binary_ply(true));
    let mut obj = "# a scan\nmtllib scan.mtl\no desk\n".to_owned();
    for [x, y, z] in POSITIONS {
        obj += &format!("v {x} {y} {z} 0.5 0.5 0.5\n");
    }
    folder.write(
        "a.obj",
        obj.clone() + "vt 0 0\nf 1/1 2/1 3/1 4/1\nf 2//1 5//1 3//1\n",
    );
    folder.write("b.obj", obj.clone() + "f -5 -4 -3 -2\ns off\nf 2 5 3\n");
    for file in [
        "text.ply",
        "windows.ply",
        "little.ply",
        "big.ply",
        "a.obj",
        "b.obj",
    ] {
        let scene = proxy(&folder, file, "real").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(corners(&scene), expected(), "{file}");
    }
    folder.write("c.obj", obj + "f 1 2 3 4\nf 2 5 1\n");
    let other = proxy(&folder, "c.obj", "real").expect("loads");
    assert_ne!(corners(&other), expected(), "control");
}

#[test]
fn damaged_meshes_are_refused_with_their_place() {
    let folder = Folder::new();
    let mut refused = |name: &str, bytes: &[u8], part: &str| {
        folder.write(name, bytes);
        let error = proxy(&folder, name, "real").expect_err(part);
        assert!(error.contains(part), "{part}: {error}");
        assert!(
            error.contains("scene.toml:8:8") && error.contains(name),
            "{error}"
        );
    };
    let text = text_ply();
    for (from, to, part) in [
        (
            "element vertex 5",
            "element vertex 4000000000",
            "more than its",
        ),
        (
            "element vertex 5",
            "element vertex 99999999999999999999",
            "no number",
        ),
        (
            "element face 2",
            "element face 4000000000000000000",
            "more than its",
        ),
        (
            "property float x",
            "property half x",
            "property is not understood",
        ),
        ("property float x", "property float u", "lack x, y or z"),
        (
            "ascii 1.0",
            "binary_middle_endian 1.0",
            "format is not known",
        ),
        ("end_header\n", "", "header is not understood"),
        ("1 3 1 4 2", "1 3 1 9 2", "asks for vertex 9 of 5"),
        ("1 3 1 4 2", "1 3 1 -4 2", "asks for vertex 4294967295 of 5"),
        ("1 3 1 4 2", "1 3 1 4", "is it cut off?"),
        (
            "1 3 1 4 2",
            "1 99999999 1 4 2",
            "a list of `vertex_indices` has 99999999",
        ),
        ("2 0 -1 200", "2 nan -1 200", "vertex 4 is at"),
        ("2 0 -1 200", "2 zero -1 200", "`zero` is no number"),
        ("element face 2", "element tristrips 2", "triangle strips"),
        ("element face 2", "element edge 2", "cloud of points"),
    ] {
        assert!(text.contains(from), "{from}");
        refused("a.ply", text.replace(from, to).as_bytes(), part);
    }
    let whole = binary_ply(false);
    refused("b.ply", &whole[..whole.len() - 1], "is it cut off?");
    refused("b.ply", b"ply\nformat ascii 1.0\n", "header has no end");
    refused(
        "b.ply",
        &[b"ply\n".as_slice(), &[b'x'; 1 << 17]].concat(),
        "header has no end",
    );
    for (obj, part) in [
        (
            "v 0 0 0\nv 1 0 0\nv 0 1\n",
            "line 3: a vertex without three numbers",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
            "line 4: a face asks for `4` of 3",
        ),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "asks for `0`"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n", "asks for `-4`"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "fewer than 3 corners"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "without area"),
        ("v inf 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "vertex 0 is at"),
        ("v 0 0 0\n", "cloud of points"),
    ] {
        refused("a.obj", obj.as_bytes(), part);
    }
}

/// No byte of a binary file brings more than an error.
#[test]
fn any_damage_is_an_error_or_another_mesh() {
    let folder = Folder::new();
    let whole = binary_ply(false);
    let (mut read, mut refused) = (0, 0);
    for at in 0..whole.len() {
        for value in [0, 0xff, whole[at] ^ 0x10] {
            let mut bytes = whole.clone();
            bytes[at] = value;
            folder.write("a.ply", &bytes);
            match proxy(&folder, "a.ply", "real") {
                Ok(_) => read += 1,
                Err(_) => refused += 1,
            }
        }
    }
    assert!(read > 50 && refused > 50, "{read} {refused}");
}

#[test]
fn other_formats_are_refused_by_name_with_the_way_to_gltf() {
    let folder = Folder::new();
    for (name, bytes, kind) in [
        (
            "a.fbx",
            &b"Kaydara FBX Binary  \0\x1a\0"[..],
            "an FBX model",
        ),
        ("a.bin", b"PXR-USDC\0\0", "a USD model"),
        ("a.usdz", b"PK\x03\x04", "a USD model"),
        ("a.stl", b"solid cube\nfacet normal 0 0 1\n", "an STL mesh"),
        ("a.blend", b"BLENDER-v300", "a Blender file"),
        ("a.dae", b"<?xml version=\"1.0\"?>", "a Collada model"),
    ] {
        folder.write(name, bytes);
        for side in ["real", "virtual"] {
            let error = proxy(&folder, name, side).expect_err(name);
            assert!(error.contains(&format!("it is {kind}")), "{error}");
            assert!(
                error.contains("Blender") && error.contains("glTF 2.0"),
                "{error}"
            );
        }
    }
    folder.write("a.ply", text_ply());
    let error = proxy(&folder, "a.ply", "virtual").expect_err("has no materials");
    assert!(error.contains("read in [[real]] alone"), "{error}");
    folder.write("a.glb", b"not glTF");
    let error = proxy(&folder, "a.glb", "real").expect_err("control");
    assert!(!error.contains("Blender"), "{error}");
}

#[test]
fn a_scene_file_that_is_none_is_called_by_its_name() {
    let folder = Folder::new();
    folder.save("a.png", 4, 4, |_, _| [9; 3]);
    folder.write("a.mp4", b"\0\0\0\x20ftypisom\0\0\x02\0isom");
    folder.write("a.glb", b"glTF\x02\0\0\0");
    folder.write("a.obj", "v 0 0 0\n");
    for (name, part) in [
        (
            "a.png",
            "it is a PNG picture, which goes with a scene as `image` in [photo]",
        ),
        ("a.mp4", "it is an MP4 or QuickTime film"),
        (
            "a.glb",
            "it is a glTF model, which goes with a scene as `mesh`",
        ),
        ("a.obj", "it is an OBJ mesh"),
    ] {
        folder.refuse(&format!("render {name}"), part);
    }
    folder.write("a.toml", "hello");
    let error = scene::load(Path::new(&folder.path("a.toml"))).expect_err("control");
    assert!(!error.to_string().contains("goes with a scene"), "{error}");
}
