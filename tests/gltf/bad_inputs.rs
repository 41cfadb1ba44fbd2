//! Broken files: an error of one line or a clean scene, and never a panic or a hang.

use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::Duration;

use mixray::scene::gltf::{GltfError, GltfScene, Problem, load_gltf};
use serde_json::{Value, json};

use super::check_scene;
use crate::support::{gltf_files, shared_data};

/// Loads on a thread of its own, so that a panic or a hang becomes a test failure that names the file.
pub fn load_guarded(path: &Path) -> Result<GltfScene, GltfError> {
    let (sender, receiver) = mpsc::channel();
    let owned = path.to_path_buf();
    std::thread::spawn(move || {
        let _ = sender.send(load_gltf(&owned));
    });
    match receiver.recv_timeout(Duration::from_secs(60)) {
        Ok(result) => result,
        Err(mpsc::RecvTimeoutError::Timeout) => panic!("{} hangs", path.display()),
        Err(mpsc::RecvTimeoutError::Disconnected) => panic!("{} panics", path.display()),
    }
}

/// A loaded scene is clean, an error is one line that names its file.
pub fn check_outcome(path: &Path, outcome: &Result<GltfScene, GltfError>) -> Result<(), String> {
    match outcome {
        Ok(scene) => check_scene(scene),
        Err(error) => {
            let line = error.to_string();
            let name = path.file_name().unwrap().to_string_lossy();
            if line.chars().any(char::is_control) {
                return Err(format!("not one line: {line:?}"));
            }
            if !line.contains(&*name) {
                return Err(format!("does not name its file: {line}"));
            }
            Ok(())
        }
    }
}

#[test]
fn every_bad_file_is_an_error_or_a_clean_scene() {
    for folder in ["gltf_bad_inputs", "gltf_unsupported_extensions"] {
        let Some(root) = shared_data(folder) else {
            continue;
        };
        let files = gltf_files(&root);
        assert!(files.len() >= 5);
        for path in files {
            let outcome = load_guarded(&path);
            check_outcome(&path, &outcome)
                .unwrap_or_else(|reason| panic!("{}: {reason}", path.display()));
        }
    }
}

/// Files that the Khronos validator finds no error in, and that mixray still refuses.
const REFUSED_THOUGH_VALID: &[(&str, &str)] = &[
    (
        "asset/min_version_valid.gltf",
        "asks for glTF 2.1 features, which mixray does not know",
    ),
    (
        "root/named_objects.gltf",
        "draws from a buffer without uri, whose bytes only an application could supply",
    ),
    (
        "root/unused_objects.gltf",
        "draws from a buffer without uri, whose bytes only an application could supply",
    ),
];

/// Refused only once everything in the file is drawn.
const REFUSED_WHEN_DRAWN: &[(&str, &str)] = &[
    (
        "image/unrecognized_format.gltf",
        "shows an image of a format that glTF does not know",
    ),
    (
        "material/valid.gltf",
        "uses texture coordinate sets above 1, which mixray does not read",
    ),
];

fn validator_corpus() -> Option<PathBuf> {
    shared_data("gltf_bad_inputs/validator_corpus")
}

fn is_valid_to_khronos(path: &Path) -> bool {
    let report = PathBuf::from(format!("{}.report.json", path.display()));
    let report: Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    report["issues"]["numErrors"] == 0
}

fn refusal<'a>(table: &[(&str, &'a str)], name: &str) -> Option<&'a str> {
    table
        .iter()
        .find(|(file, _)| *file == name)
        .map(|(_, reason)| *reason)
}

#[test]
fn what_the_khronos_validator_accepts_loads() {
    let Some(root) = validator_corpus() else {
        return;
    };
    let (mut valid, mut refused) = (0, 0);
    for path in gltf_files(&root) {
        if !is_valid_to_khronos(&path) {
            continue;
        }
        valid += 1;
        let name = path.strip_prefix(&root).unwrap().to_string_lossy();
        let expected = refusal(REFUSED_THOUGH_VALID, &name);
        match (load_gltf(&path), expected) {
            (Ok(_), None) => {}
            (Err(_), Some(_)) => refused += 1,
            (Ok(_), Some(reason)) => panic!("{name} loads now, though it {reason}"),
            (Err(error), None) => panic!("{error}"),
        }
    }
    assert_eq!((valid, refused), (73, REFUSED_THOUGH_VALID.len()));
}

/// Adds nodes, meshes, materials and textures to a document so that everything in it is drawn: most of the corpus declares
/// broken things and then shows nothing. Meshes from the index returned on use accessors for what they may not be meant for.
fn draw_everything(json: &mut Value) -> usize {
    let Some(root) = json.as_object_mut() else {
        return 0;
    };
    let count = |root: &serde_json::Map<String, Value>, key: &str| {
        root.get(key).and_then(Value::as_array).map_or(0, Vec::len)
    };
    let push = |root: &mut serde_json::Map<String, Value>, key: &str, item: Value| {
        let list = root.entry(key).or_insert_with(|| json!([]));
        if let Some(list) = list.as_array_mut() {
            list.push(item);
        }
    };
    let images = count(root, "images");
    for image in 0..images {
        push(root, "textures", json!({ "source": image }));
    }
    for texture in 0..count(root, "textures") {
        let material =
            json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": texture } } });
        push(root, "materials", material);
    }
    let (buffers, views) = (count(root, "buffers"), count(root, "bufferViews"));
    let accessors = count(root, "accessors");
    // One triangle with uv 0: (0,0,0), (1,0,0), (0,1,0), then 24 zero bytes.
    let one = "%00%00%80%3f";
    let zero = "%00%00%00%00";
    let triangle = [zero, zero, zero, one, zero, zero, zero, one, zero].concat() + &zero.repeat(6);
    push(
        root,
        "buffers",
        json!({ "byteLength": 60, "uri": format!("data:,{triangle}") }),
    );
    push(
        root,
        "bufferViews",
        json!({ "buffer": buffers, "byteLength": 60 }),
    );
    let accessor = |offset: u32, kind: &str| json!({ "bufferView": views, "byteOffset": offset, "count": 3, "componentType": 5126, "type": kind });
    push(root, "accessors", accessor(0, "VEC3"));
    push(root, "accessors", accessor(36, "VEC2"));
    let attributes = json!({ "POSITION": accessors, "TEXCOORD_0": accessors + 1 });
    for material in 0..count(root, "materials") {
        let primitive = json!({ "attributes": attributes, "material": material });
        push(root, "meshes", json!({ "primitives": [primitive] }));
    }
    let misused = count(root, "meshes");
    for accessor in 0..accessors {
        for semantic in ["POSITION", "NORMAL", "COLOR_0"] {
            let mut attributes = json!({ "POSITION": accessors });
            attributes[semantic] = json!(accessor);
            let primitive = json!({ "attributes": attributes });
            push(root, "meshes", json!({ "primitives": [primitive] }));
        }
        let primitive = json!({ "attributes": { "POSITION": accessors }, "indices": accessor });
        push(root, "meshes", json!({ "primitives": [primitive] }));
    }
    misused
}

/// The document that draws one of the meshes alone, since the first error would hide the others.
fn show_mesh(json: &Value, mesh: usize) -> Value {
    let mut json = json.clone();
    json["nodes"] = json!([{ "mesh": mesh }]);
    json["scenes"] = json!([{ "nodes": [0] }]);
    json["scene"] = json!(0);
    json
}

#[test]
fn whatever_the_corpus_declares_can_be_drawn_or_is_refused() {
    let Some(root) = validator_corpus() else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (mut drawn, mut errors) = (0, 0);
    for path in gltf_files(&root) {
        let Some(mut json) = std::fs::read(&path)
            .ok()
            .and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok())
        else {
            continue;
        };
        let name = path
            .strip_prefix(&root)
            .unwrap()
            .to_string_lossy()
            .into_owned();
        let misused = draw_everything(&mut json);
        absolute_uris(&mut json, path.parent().unwrap());
        let copy = folder.path().join("drawn.gltf");
        for mesh in 0..json["meshes"].as_array().map_or(0, Vec::len) {
            std::fs::write(&copy, serde_json::to_vec(&show_mesh(&json, mesh)).unwrap()).unwrap();
            let outcome = load_guarded(&copy);
            check_outcome(&copy, &outcome).unwrap_or_else(|reason| panic!("{name}: {reason}"));
            drawn += 1;
            match outcome {
                Ok(_) => {}
                Err(error) => {
                    errors += 1;
                    let excused = mesh >= misused
                        || refusal(REFUSED_THOUGH_VALID, &name).is_some()
                        || refusal(REFUSED_WHEN_DRAWN, &name).is_some();
                    assert!(
                        !is_valid_to_khronos(&path) || excused,
                        "{name}, mesh {mesh}: {error}"
                    );
                }
            }
        }
    }
    // Both happen often: the test draws something, and meets errors.
    assert!(
        drawn > 500 && errors > 100,
        "{drawn} drawn, {errors} errors"
    );
}

fn absolute_uris(json: &mut Value, folder: &Path) {
    for list in ["buffers", "images"] {
        let items = json.get_mut(list).and_then(Value::as_array_mut);
        for item in items.into_iter().flatten() {
            if let Some(uri) = item["uri"].as_str()
                && !uri.contains(':')
            {
                item["uri"] = json!(folder.join(uri));
            }
        }
    }
}

/// What is wrong in a file is what its message says.
#[test]
fn errors_name_what_is_wrong() {
    let expected = [
        (
            "assimp_BoxWithInfinites/BoxWithInfinites.glb",
            "Mesh / primitive 0, POSITION: vertex 0 is not finite",
        ),
        (
            "assimp_IndexOutOfRange/IndexOutOfRange.gltf",
            "index 255 is out of range; there are 24 vertices",
        ),
        ("assimp_MissingBin/BoxTextured.gltf", "BoxTextured0.bin"),
        (
            "assimp_RecursiveNodes/RecursiveNodes.gltf",
            "its own ancestor",
        ),
        (
            "tinygltf_BoundsChecking/integer-out-of-bounds.gltf",
            "bufferViews[0]",
        ),
        (
            "validator_corpus/asset/1_0_version.gltf",
            "version `1.0`; expected 2.0",
        ),
        (
            "validator_corpus/glb/length_mismatch.glb",
            "states 49 bytes, but the file has 48",
        ),
        (
            "validator_corpus/glb/invalid_version.glb",
            "version 0; expected 2",
        ),
        (
            "validator_corpus/node/unresolved_mesh.gltf",
            "refers to mesh 0; there are 0",
        ),
        ("validator_corpus/json/invalid_syntax.gltf", "line 1 column"),
    ];
    let Some(root) = shared_data("gltf_bad_inputs") else {
        return;
    };
    for (name, fragment) in expected {
        let line = load_gltf(&root.join(name)).unwrap_err().to_string();
        assert!(line.contains(fragment), "{line}");
    }
}

#[test]
fn compressed_meshes_are_refused_with_the_way_to_convert_them() {
    let Some(root) = shared_data("gltf_unsupported_extensions") else {
        return;
    };
    for path in gltf_files(&root) {
        let error = load_gltf(&path).unwrap_err();
        let draco = path.to_string_lossy().contains("Draco");
        let wanted = if draco {
            "KHR_draco_mesh_compression"
        } else {
            "EXT_meshopt_compression"
        };
        assert!(
            matches!(&error.problem, Problem::Extension { name, .. } if name == wanted),
            "{error}"
        );
        assert!(error.to_string().contains("gltf-transform"));
    }
}

/// Negative control: the checks above do find what they look for.
#[test]
fn the_checks_notice_broken_scenes() {
    let Some(root) = shared_data("gltf_models") else {
        return;
    };
    let good = load_gltf(&root.join("BoxTextured.glb")).unwrap();
    assert_eq!(check_scene(&good), Ok(()));
    let broken = |change: fn(&mut mixray::scene::Primitive)| {
        let mut scene = good.clone();
        let mut primitive = (*scene.instances[0].primitive).clone();
        change(&mut primitive);
        scene.instances[0].primitive = primitive.into();
        check_scene(&scene)
    };
    assert!(broken(|p| p.positions[0][0] = f32::NAN).is_err());
    assert!(broken(|p| p.normals[0] = [0.0; 3]).is_err());
    assert!(broken(|p| p.triangles[0][0] = 1000).is_err());
    assert!(broken(|p| p.triangles[0] = [0, 1, 1]).is_err());
    assert!(broken(|p| p.uvs[0].truncate(1)).is_err());
    let path = Path::new("file.gltf");
    let two_lines: Result<GltfScene, GltfError> = Err(GltfError {
        path: "other.gltf".into(),
        problem: Problem::Unreadable("x".into()),
    });
    assert!(check_outcome(path, &two_lines).is_err());
}
