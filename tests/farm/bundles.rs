//! A bundle holds all that a scene reads, and the scene is the same.

use std::io::Read;

use mixray::scene::load;

use crate::support::Folder;

/// A scene that reads from its folder, from folders beside it, and by an absolute path.
fn folder() -> Folder {
    let folder = Folder::new();
    for name in ["shot/textures", "models/textures"] {
        folder.create(name);
    }
    folder.save("shot/photo.png", 24, 16, |x, y| {
        [x * 9, y * 9, 40].map(|c| c as u8)
    });
    folder.save("models/textures/sky.png", 8, 4, |x, _| [x as u8 * 20; 3]);
    let triangle: Vec<u8> = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    folder.write("models/textures/triangle.bin", triangle);
    folder.write("models/triangle.gltf", r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"uri": "textures/triangle.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}]}"#);
    let sky = folder.path("models/textures/sky.png");
    folder.write(
        "shot/scene.toml",
        format!(
            "# A comment that stays.\n[photo]\nimage = \"photo.png\"\n[camera]\nfx = 30\n[environment]\nimage = '{}'\n\
            [[virtual]]\nname = \"models\"\nmesh = \"../models/triangle.gltf\" # beside\ntranslation = [0, 0, -2]\n",
            sky.display()
        ),
    );
    folder
}

#[test]
fn files_from_anywhere_are_gathered() {
    let folder = folder();
    folder.refuse("render shot/scene.toml --sandbox", "outside");
    folder.succeed("bundle shot/scene.toml -o bundle");
    let scene = load(&folder.path("shot/scene.toml")).expect("loads");
    let copy = load(&folder.path("bundle/scene.toml")).expect("loads");
    assert_eq!(copy.fingerprint(), scene.fingerprint());
    let text = folder.read("bundle/scene.toml");
    assert!(
        text.starts_with("# A comment that stays.") && text.contains("# beside"),
        "{text}"
    );
    assert!(!text.contains(".."), "{text}");
    folder.succeed("render bundle/scene.toml --sandbox --rpp 1 -o picture.png");
    // Another bundle of the same scene is the same; one that is there is not written over.
    folder.refuse("bundle shot/scene.toml -o bundle", "is there already");
    folder.succeed("bundle shot/scene.toml -o a.zip");
    folder.succeed("bundle shot/scene.toml -o b.zip");
    assert!(folder.bytes("a.zip") == folder.bytes("b.zip"));
    let bytes = folder.bytes("a.zip");
    let zip = rawzip::ZipArchive::from_slice(&bytes).expect("a zip file");
    let mut names = Vec::new();
    let mut entries = zip.entries();
    while let Some(entry) = entries.next_entry().expect("an entry") {
        let name = entry.file_path().try_normalize().expect("a name");
        let name = name.as_ref().to_owned();
        let data = zip.get_entry(entry.wayfinder()).expect("its data");
        let inflated = flate2::bufread::DeflateDecoder::new(data.data());
        let mut read = Vec::new();
        (data.verifying_reader(inflated).read_to_end(&mut read)).expect("whole");
        assert!(read == folder.bytes(&format!("bundle/{name}")), "{name}");
        names.push(name);
    }
    assert_eq!((names.len(), names[0].as_str()), (5, "scene.toml"));
    let left = folder.entries();
    assert!(
        !left.iter().any(|name| name.starts_with(".mixray")),
        "{left:?}"
    );
}

#[test]
fn files_of_the_own_folder_keep_their_names() {
    let folder = Folder::with_scene("[photo]\nimage = \"./photo.png\"\n[camera]\nfx = 30\n");
    folder.succeed("bundle scene.toml -o bundle");
    assert_eq!(folder.read("bundle/scene.toml"), folder.read("scene.toml"));
    assert!(folder.bytes("bundle/photo.png") == folder.bytes("photo.png"));
    folder.refuse("bundle scene.toml -o scene.toml", "is an input of this run");
    folder.write("photo.zip", "a photograph");
    folder.write(
        "odd.toml",
        "[photo]\nimage = \"photo.zip\"\n[camera]\nfx = 30\n",
    );
    folder.write("photo.zip", folder.bytes("photo.png"));
    folder.refuse("bundle odd.toml -o photo.zip", "is an input of this run");
}
