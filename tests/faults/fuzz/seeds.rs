//! Valid files, each of a few kilobytes at most.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, SmallVec, Vec2, WritableImage, f16,
};
use image::{DynamicImage, ImageFormat, RgbImage};
use mixray::output::{ExrPicture, FilmNote, Metadata, Target, write_film};
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{NoiseFit, NoiseProfile, load};
use serde_json::{Value, json};

const WIDTH: usize = 16;
const HEIGHT: usize = 12;

fn picture() -> DynamicImage {
    let picture = RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        image::Rgb([(x * 16) as u8, (y * 20) as u8, (x * y * 3) as u8])
    });
    DynamicImage::from(picture)
}

fn encoded(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).expect("encodes");
    bytes.into_inner()
}

/// Corners of a tent, and its faces: a quad and two triangles.
const CORNERS: [[f32; 3]; 5] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 0.0, -1.0],
    [0.0, 0.0, -1.0],
    [0.5, 1.0, -0.5],
];
const FACES: [&[u8]; 3] = [&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4]];

/// Text, and binary of both byte orders with normals and an element that is passed over.
pub fn plys() -> Vec<Vec<u8>> {
    let header = |format: &str, more: &str, after: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment a tent\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n{more}element face 3\nproperty list uchar uchar vertex_indices\n{after}end_header\n"
        )
    };
    let words = |line: &[String]| line.join(" ") + "\n";
    let mut text = header("ascii", "", "");
    for corner in CORNERS {
        text += &words(&corner.map(|x| x.to_string()));
    }
    for face in FACES {
        let corners = face.iter().map(u8::to_string);
        text += &words(
            &std::iter::once(face.len().to_string())
                .chain(corners)
                .collect::<Vec<_>>(),
        );
    }
    let normals = "property float nx\nproperty float ny\nproperty float nz\n";
    let edges = "element edge 1\nproperty int vertex1\nproperty int vertex2\n";
    let binary = |format: &str, bytes_of: fn(f32) -> [u8; 4]| {
        let mut file = header(format, normals, edges).into_bytes();
        for corner in CORNERS {
            file.extend(corner.into_iter().chain([0.0, 1.0, 0.0]).flat_map(bytes_of));
        }
        for face in FACES {
            file.push(face.len() as u8);
            file.extend(face);
        }
        file.extend([0; 8]);
        file
    };
    vec![
        text.into_bytes(),
        binary("binary_little_endian", f32::to_le_bytes),
        binary("binary_big_endian", f32::to_be_bytes),
    ]
}

/// Numbers from 1 and back from the last, with and without textures and normals.
pub fn objs() -> Vec<Vec<u8>> {
    let mut text = "# a tent\nmtllib tent.mtl\no tent\n".to_owned();
    for [x, y, z] in CORNERS {
        text += &format!("v {x} {y} {z}\n");
    }
    text += "vt 0 0\nvn 0 1 0\ng sides\nf 1 2 3 4\nf 1/1 2/1 5/1\nf 2//1 3//1 5//1\nf -5 -1 -2\n";
    vec![text.into_bytes()]
}

pub fn pngs() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../data/palette.png").to_vec(),
        include_bytes!("../data/grey16.png").to_vec(),
        include_bytes!("../data/grey_alpha.png").to_vec(),
        encoded(&picture(), ImageFormat::Png),
        encoded(&picture().into_rgba16().into(), ImageFormat::Png),
    ]
}

pub fn jpegs() -> Vec<Vec<u8>> {
    vec![
        include_bytes!("../data/progressive.jpg").to_vec(),
        include_bytes!("../data/restart.jpg").to_vec(),
        include_bytes!("../data/cmyk.jpg").to_vec(),
        encoded(&picture(), ImageFormat::Jpeg),
    ]
}

pub fn hdrs() -> Vec<Vec<u8>> {
    vec![encoded(&picture().into_rgb32f().into(), ImageFormat::Hdr)]
}

/// As textures may be: PNG, JPEG and WebP.
pub fn textures() -> Vec<Vec<u8>> {
    let webps = [
        include_bytes!("../data/lossy.webp").to_vec(),
        include_bytes!("../data/lossless.webp").to_vec(),
    ];
    webps.into_iter().chain(pngs()).chain(jpegs()).collect()
}

/// One of each compression, in lines and in tiles.
pub fn exrs() -> Vec<Vec<u8>> {
    let scan = |compression| exr(compression, Blocks::ScanLines);
    vec![
        scan(Compression::Uncompressed),
        scan(Compression::RLE),
        scan(Compression::ZIP1),
        scan(Compression::ZIP16),
        scan(Compression::PIZ),
        scan(Compression::PXR24),
        scan(Compression::B44),
        exr(Compression::ZIP16, Blocks::Tiles(Vec2(7, 5))),
        exr(Compression::PIZ, Blocks::Tiles(Vec2(16, 16))),
    ]
}

fn exr(compression: Compression, blocks: Blocks) -> Vec<u8> {
    let value = |i: usize| (i % 37) as f32 * 0.1;
    let halves = |from: usize| (0..WIDTH * HEIGHT).map(move |i| f16::from_f32(value(i + from)));
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::from_vec(vec![
        AnyChannel::new("B", FlatSamples::F16(halves(0).collect())),
        AnyChannel::new("G", FlatSamples::F16(halves(5).collect())),
        AnyChannel::new(
            "R",
            FlatSamples::F32((0..WIDTH * HEIGHT).map(value).collect()),
        ),
        AnyChannel::new(
            "id",
            FlatSamples::U32((0..(WIDTH * HEIGHT) as u32).collect()),
        ),
    ]);
    let encoding = Encoding {
        compression,
        blocks,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new(
        Vec2(WIDTH, HEIGHT),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(channels),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .expect("encodes");
    bytes.into_inner()
}

/// The film of a small render, with all planes, without its seal.
pub fn films() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let scene = folder.path().join("scene.toml");
    let small = SCENE.replace("width = 32\nheight = 24", "width = 6\nheight = 4");
    std::fs::write(&scene, small.replace("16.0", "3.0")).expect("a writable folder");
    let mut scene = load(&scene).expect("a valid scene");
    scene.settings.rays_per_pixel = 4;
    scene.settings.backend = mixray::scene::BackendChoice::Cpu;
    let options = RendererOptions {
        guides: true,
        real_everywhere: true,
        sample_range: Some((0, 2)),
        ..RendererOptions::default()
    };
    let mut renderer = Renderer::new(scene, options, &Watcher::none()).expect("fits");
    renderer
        .advance(Budget::Complete, &Watcher::none())
        .expect("renders");
    let path = folder.path().join("film.exr");
    let note = FilmNote::new(renderer.scene(), (0, 2), renderer.without());
    let metadata = Metadata::of(&renderer, renderer.scene().fingerprint());
    let exr = ExrPicture::new(renderer.picture(), renderer.planes(), metadata);
    write_film(
        &Target::picture(&path).expect("a name"),
        &exr,
        renderer.film(),
        &note,
    )
    .expect("a writable folder");
    let mut bytes = std::fs::read(path).expect("was written");
    // With its seal any damage would be seen at once.
    let seal = b"mixray.seal";
    let at = bytes.windows(seal.len()).position(|bytes| bytes == seal);
    bytes[at.expect("is sealed")] = b'M';
    vec![bytes]
}

pub fn y4ms() -> Vec<Vec<u8>> {
    let stream = |head: &str, frame_bytes: usize| {
        let mut bytes = format!("YUV4MPEG2 W6 H4 F25:1 Ip A1:1 {head}\n").into_bytes();
        for frame in 0..2 {
            bytes.extend(b"FRAME\n");
            bytes.extend((0..frame_bytes).map(|i| (i * 7 + frame * 31) as u8));
        }
        bytes
    };
    vec![
        stream("C420jpeg XCOLORRANGE=FULL", 36),
        stream("C422", 48),
        stream("C444", 72),
    ]
}

pub fn mjpegs() -> Vec<Vec<u8>> {
    vec![jpegs()[..2].concat()]
}

pub const SCENE: &str = r#"
[photo]
exposure_ev = 0.5
[camera]
width = 32
height = 24
fx = 30.5
fy = 31
cx = 16.0
distortion = [0.1, -0.02, 0.001, 0.0, 0.0]
position = [0.0, 1.0, 2.0]
look_at = [0, 0, 0]
[lens]
f_number = 2.8
focal_length_mm = 50
focus_distance_m = inf
aperture = 7
[environment]
radiance = [1.0, 0.5, 0.25]
[[light]]
kind = "quad"
corner = [0, 2, 0]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [10, 10, 10]
[[real]]
shape = "quad"
corner = [-1, 0, 1]
edge_u = [2, 0, 0]
edge_v = [0, 0, -2]
material = { base_color = [0.6, 0.6, 0.6], roughness = 1.0 }
[[virtual]]
shape = "sphere"
segments = 16
translation = [0.1, 0.0, -0.2]
rotation_deg = [0, 30, 0]
scale = 0.1
[render]
rays_per_pixel = 49
sampler = "cmj"
"#;

const MOVING_SCENE: &str = r#"
[camera]
width = 32
height = 24
vertical_fov_deg = 40
position = [0.0, 1.0, 2.0]
look_at = [0, 0, 0]
[shutter]
exposure_secs = 0.02
readout_secs = 0.01
time_secs = 0.05
[[virtual]]
shape = "sphere"
scale = 0.06
[[virtual.motion]]
time_secs = 0.0
translation = [0, 0, 0]
[[virtual.motion]]
time_secs = 0.1
translation = [0.05, 0, 0]
[antialias]
[motion_blur]
min_length_px = 0.5
"#;

pub fn scenes() -> Vec<Vec<u8>> {
    vec![SCENE.into(), MOVING_SCENE.into()]
}

pub fn toml_poses() -> Vec<Vec<u8>> {
    vec![b"frames_per_second = 25\n[camera]\nwidth = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 16\ncy = 12\n[[frame]]\nframe = 1\nworld_from_camera = [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]\n[[frame]]\nframe = 2\nworld_from_camera = [[1, 0, 0, 0.6], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]\n".to_vec()]
}

pub fn json_poses() -> Vec<Vec<u8>> {
    let matrix = "[[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]";
    vec![format!("{{\"w\": 32, \"h\": 24, \"fl_x\": 30.0, \"fl_y\": 30.0, \"cx\": 16, \"cy\": 12, \"k1\": 0.01, \"frames\": [{{\"file_path\": \"images/f_001.png\", \"transform_matrix\": {matrix}}}, {{\"file_path\": \"images/f_002.png\", \"transform_matrix\": {matrix}}}]}}\n").into_bytes()]
}

pub fn tum_poses() -> Vec<Vec<u8>> {
    vec![b"# timestamp tx ty tz qx qy qz qw\n1305031102.1758 1.3405 0.6266 1.6575 0.6574 0.6126 -0.2949 -0.3248\n1305031102.2110 1.3388 0.6286 1.6545 0.6579 0.6161 -0.2932 -0.3189\n".to_vec()]
}

pub fn colmap_cameras() -> Vec<Vec<u8>> {
    vec![
        b"# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 OPENCV 640 480 500 500 320 240 0.01 0.001 0 0\n".to_vec(),
        b"1 SIMPLE_RADIAL 640 480 500 320 240 0.01\n".to_vec(),
        b"1 PINHOLE 640 480 500 501 320 240\n".to_vec(),
    ]
}

pub fn colmap_images() -> Vec<Vec<u8>> {
    vec![b"# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n1 0.9 0.1 0.2 0.374 1 2 3 1 a/f_001.png\n10.5 20.5 1 30 40 -1\n2 1 0 0 0 1.5 2 3 1 f_002.png\n\n".to_vec()]
}

pub fn opencv_intrinsics() -> Vec<Vec<u8>> {
    vec![b"%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 5.0e+02, 0., 319.5, 0., 5.0e+02, 239.5, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0.1, -0.2, 0.001, 0., 0.05 ]\n".to_vec()]
}

pub fn profiles() -> Vec<Vec<u8>> {
    let fit = NoiseFit { a: 0.02, b: 0.5 };
    vec![NoiseProfile::from_fit(fit, 4).to_toml().into_bytes()]
}

/// Of the frames of [`json_poses`].
pub fn points() -> Vec<Vec<u8>> {
    let table = "frame,x_px,y_px,x_m,y_m,z_m\n# seen\nf_001.png,16.5,12.25,0.5,0.1,0.0\nf_002.png,10,8,0.2,-0.1,-1\nf_002.png,,,0.6,0,0.5\n";
    vec![table.into()]
}

/// Of `mixray bench`.
pub fn results() -> Vec<Vec<u8>> {
    vec![include_bytes!("../data/results.json").to_vec()]
}

/// A textured triangle with everything that a model may have in short.
pub fn models() -> Vec<Vec<u8>> {
    vec![model(&encoded(&picture(), ImageFormat::Png))]
}

/// A textured triangle.
pub fn model(texture: &[u8]) -> Vec<u8> {
    let floats: [f32; 24] = [
        0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, // positions
        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, // normals
        0.0, 0.0, 1.0, 0.0, 0.0, 1.0, // texture coordinates
    ];
    let mut binary: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    binary.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    let image_at = binary.len();
    binary.extend(texture);
    let view = |offset: usize, length: usize| json!({"buffer": 0, "byteOffset": offset, "byteLength": length});
    let is_webp = texture.starts_with(b"RIFF");
    let plain = json!({"source": 0, "sampler": 0});
    let webp = json!({"sampler": 0, "extensions": {"EXT_texture_webp": {"source": 0}}});
    let mime = match texture {
        _ if is_webp => "image/webp",
        [0xff, 0xd8, ..] => "image/jpeg",
        _ => "image/png",
    };
    let json = json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_texture_webp", "KHR_materials_ior"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "translation": [0.1, 0, 0]}, {"mesh": 0, "rotation": [0, 0, 0, 1], "scale": [1, 2, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "roughnessFactor": 0.5}, "extensions": {"KHR_materials_ior": {"ior": 1.4}}}],
        "textures": [if is_webp { webp } else { plain }],
        "samplers": [{"magFilter": 9729, "wrapS": 10497}],
        "images": [{"bufferView": 4, "mimeType": mime}],
        "animations": [{"channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}], "samplers": [{"input": 4, "output": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5123, "count": 3, "type": "SCALAR"},
            {"bufferView": 2, "byteOffset": 0, "componentType": 5126, "count": 1, "type": "SCALAR", "min": [0], "max": [0]}
        ],
        "bufferViews": [view(0, 36), view(36, 36), view(72, 24), view(96, 6), view(image_at, texture.len())],
        "buffers": [{"byteLength": binary.len()}]
    });
    binary.resize(binary.len().next_multiple_of(4), 0);
    let mut chunk = (binary.len() as u32).to_le_bytes().to_vec();
    chunk.extend(b"BIN\0");
    chunk.extend(binary);
    glb_of(&json, &chunk)
}

/// A GLB of a document and the chunks after it.
pub fn glb_of(json: &Value, rest: &[u8]) -> Vec<u8> {
    let mut text = serde_json::to_vec(json).expect("JSON");
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    [
        b"glTF".as_slice(),
        &word(2),
        &word(20 + text.len() + rest.len()),
        &word(text.len()),
        b"JSON",
        &text,
        rest,
    ]
    .concat()
}
