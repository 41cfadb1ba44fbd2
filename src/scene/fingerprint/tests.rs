use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::scene::trajectory::CameraPath;
use crate::scene::{
    FocusPath, Material, NoiseFit, NoiseProfile, NoiseSettings, Texture, TextureRef, Wrap,
};

fn far() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/far/scene.toml");
    crate::scene::load(&path).unwrap()
}

/// Stable between versions, machines and runs, or films and frames of before would be taken for others.
#[test]
fn fingerprints_are_known_hashes_of_known_bytes() {
    let blake3 = |bytes: &[u8]| blake3::hash(bytes).to_hex()[..32].to_owned();
    assert_eq!(ContentHash::of(&7u32), blake3(&[7, 0, 0, 0]));
    assert_eq!(
        ContentHash::of(&vec![[1.0f32, -0.0]]),
        blake3(&[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x80, 0x3f, 0, 0, 0, 0x80])
    );
    assert_eq!(
        ContentHash::of(&(Some(true), "ü")),
        blake3(&[1, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0xc3, 0xbc])
    );
    // Of its authors' test vectors.
    assert_eq!(blake3(&[]), "af1349b9f5f9a1a6a0404dea36dcc949");
}

#[test]
fn lengths_and_choices_keep_values_apart() {
    let texts = |texts: [&str; 2]| ContentHash::of(&texts);
    assert_ne!(texts(["ab", "c"]), texts(["a", "bc"]));
    assert_eq!(texts(["ab", "c"]), texts(["ab", "c"]), "control");
    assert_ne!(
        ContentHash::of(&(Some(1u32), None::<u32>)),
        ContentHash::of(&(None::<u32>, Some(1u32)))
    );
    assert_ne!(
        ContentHash::of(&crate::scene::Exposure::Ev(0.0)),
        ContentHash::of(&crate::scene::Exposure::Auto)
    );
}

/// Whether parts of a scene share what is equal, or have copies of it, is no difference.
#[test]
fn shared_content_counts_as_its_copies_do() {
    let texture = |shade: u8| {
        Arc::new(Texture {
            name: String::new(),
            width: 1,
            height: 1,
            rgba8: vec![[shade; 4]],
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Clamp,
            nearest: false,
        })
    };
    let material = |colour: &Arc<Texture>, normal: &Arc<Texture>| {
        let on = |texture: &Arc<Texture>| {
            Some(TextureRef {
                texture: Arc::clone(texture),
                uv_set: 0,
                transform: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            })
        };
        ContentHash::of(&Material {
            base_color_texture: on(colour),
            normal_texture: on(normal),
            ..Material::default()
        })
    };
    let grey = texture(9);
    assert_eq!(material(&grey, &grey), material(&grey, &texture(9)));
    assert_ne!(
        material(&grey, &grey),
        material(&grey, &texture(8)),
        "control"
    );
}

#[test]
fn what_changes_the_picture_changes_the_fingerprint() {
    let scene = far();
    let before = scene.fingerprint();
    assert_eq!(far().fingerprint(), before, "read again");
    let mut sampled_otherwise = scene.clone();
    sampled_otherwise.settings.seed += 1;
    sampled_otherwise.settings.rays_per_pixel += 1;
    sampled_otherwise.name.push('x');
    sampled_otherwise.path.push("x");
    sampled_otherwise.objects[0].name.push('x');
    sampled_otherwise.warnings.push("x".into());
    assert_eq!(sampled_otherwise.fingerprint(), before);

    let changes: [fn(&mut Scene); 8] = [
        |s| s.settings.max_bounces += 1,
        |s| s.lens.focus_distance_m += 1e-12,
        |s| s.photo.as_mut().unwrap().linear[77][1] += 1e-6,
        |s| s.lights.truncate(0),
        |s| s.focus_path = FocusPath::new(vec![(0.0, s.lens.focus_distance_m)]),
        |s| s.camera_path = CameraPath::new(vec![(0.0, s.camera.world_from_camera)]),
        |s| {
            let primitive = &mut s.objects.last_mut().unwrap().instances[0].primitive;
            let mut moved = (**primitive).clone();
            moved.positions[3][0] = moved.positions[3][0].next_up();
            *primitive = Arc::new(moved);
        },
        |s| {
            let material = &mut s.objects.last_mut().unwrap().instances[0].material;
            let mut rougher = (**material).clone();
            rougher.roughness *= 0.5;
            *material = Arc::new(rougher);
        },
    ];
    for (number, change) in changes.into_iter().enumerate() {
        let mut changed = scene.clone();
        change(&mut changed);
        assert_ne!(changed.fingerprint(), before, "change {number}");
    }
}

/// Of camera stages, what they were measured on is no content.
#[test]
fn stages_are_content_of_their_own() {
    let profile = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 0.5 }, 4);
    let mut stages = far().stages;
    stages.noise = Some(NoiseSettings::new(profile));
    let before = ContentHash::of(&stages);
    let noise = stages.noise.as_mut().unwrap();
    noise.profile.sources.push("a camera".into());
    assert_eq!(ContentHash::of(&stages), before);
    stages.noise.as_mut().unwrap().profile.bins[2].sigma[1] *= 1.01;
    assert_ne!(ContentHash::of(&stages), before, "control");
}
