use super::*;
use crate::gpu::kernel::reflect_bindings;
use crate::gpu::{AdapterChoice, Composer, Features};

/// A kernel that reads all of `names`.
fn bound(names: &[&str]) -> Result<Vec<String>, GpuError> {
    let reads: String = names.iter().map(|name| format!("_ = &{name};")).collect();
    let root = format!(
        "import package::gpu::buffers::{{{}}};
        @compute @workgroup_size(1) fn main() {{ {reads} }}",
        names.join(", ")
    );
    let wgsl =
        Composer::default()
            .with_module("root", root)
            .compose("root", "main", &Features::ALL)?;
    let bindings = reflect_bindings(&wgsl).expect("valid");
    Ok(bindings.into_iter().map(|binding| binding.name).collect())
}

#[test]
fn every_buffer_has_the_name_and_place_of_its_declaration() {
    let parts = SceneParts::default();
    let arrays = arrays(&parts).map(|array| array.name);
    let names: Vec<&str> = std::iter::once("frame").chain(arrays).collect();
    assert_eq!(bound(&names).expect("all are declared"), names);
    let (_, text) = crate::gpu::compose::MODULES
        .iter()
        .find(|(module, _)| *module == "gpu::buffers")
        .expect("is embedded");
    assert_eq!(text.matches("@binding").count(), names.len());
    // Negative control: a name that no shader declares.
    assert!(bound(&["frame", "vertexes"]).is_err());
}

#[test]
fn an_edit_sends_what_it_changes_and_no_more() {
    if crate::gpu::harness::test_device().is_none() {
        return;
    }
    let gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
    let pixels = [PixelInfo::uniform(0); 10];
    let parts = SceneParts {
        pixels: &pixels,
        photo_albedo: &[[0.5; 4]; 3],
        backdrop: &[0.5; 30],
        ..SceneParts::default()
    };
    let mut scene = SceneBuffers::from_parts(&gpu, &parts).expect("fits");
    let frame = size_of::<Frame>() as u64;
    for (changed, bytes) in [
        (Changed::Plan, 120),
        (Changed::View, 120 + 48),
        (Changed::Photo, 120 + 48 + 120),
        (Changed::Virtual, 120 + 48 + 120),
    ] {
        let before = gpu.traffic();
        assert!(!scene.update(&gpu, &parts, changed).expect("fits"));
        assert_eq!(
            (gpu.traffic() - before).bytes_up,
            frame + bytes,
            "{changed:?}"
        );
    }
    let more = [PixelInfo::uniform(0); 1000];
    let parts = SceneParts {
        pixels: &more,
        ..parts
    };
    let before = gpu.traffic();
    assert!(scene.update(&gpu, &parts, Changed::View).expect("fits"));
    let bytes = (gpu.traffic() - before).bytes_up;
    assert_eq!(bytes, frame + 12_000 + 48, "a new buffer for one array");
    assert!(!scene.update(&gpu, &parts, Changed::Plan).expect("fits"));
}

#[test]
fn a_moved_object_sends_its_own_records() {
    if crate::gpu::harness::test_device().is_none() {
        return;
    }
    let gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
    let vertices = [Vertex::zeroed(); 10];
    let nodes = [[[0; 4]; 5]; 40];
    let moved = Moved {
        object: 0,
        triangles: 0..0,
        vertices: 3..5,
    };
    let refitted = Refitted {
        nodes: vec![1..2, 30..33],
        leaves: Vec::new(),
    };
    let parts = SceneParts {
        vertices: &vertices,
        resting: Resting {
            triangles: 0,
            vertices: 10,
        },
        bvh_nodes: [[&[]; 3], [&nodes[..3], &nodes[3..], &[]]],
        moved: Some((&moved, &refitted)),
        ..SceneParts::default()
    };
    let mut scene = SceneBuffers::from_parts(&gpu, &parts).expect("fits");
    let mut sent = |parts: &SceneParts<'_>| {
        let before = gpu.traffic();
        let others = scene.update(&gpu, parts, Changed::Object).expect("fits");
        assert!(!others);
        (gpu.traffic() - before).bytes_up - size_of::<Frame>() as u64
    };
    assert_eq!(sent(&parts), 2 * 80 + (3 + 1 + 3) * 80);
    let unknown = SceneParts {
        moved: None,
        ..parts
    };
    assert_eq!(sent(&unknown), 10 * 80 + 40 * 80, "control");
}

#[test]
fn a_scene_beyond_the_limits_is_refused_with_what_to_do() {
    if crate::gpu::harness::test_device().is_none() {
        return;
    }
    let mut gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
    let vertices = vec![Vertex::zeroed(); 20_000];
    let parts = SceneParts {
        vertices: &vertices,
        ..SceneParts::default()
    };
    assert!(SceneBuffers::from_parts(&gpu, &parts).is_ok());
    gpu.limits.max_storage_buffer_binding_size = 1 << 20;
    let error = SceneBuffers::from_parts(&gpu, &parts)
        .err()
        .expect("does not fit")
        .to_string();
    for part in ["vertices", "1.5 MiB", "1.0 MiB", "--backend cpu"] {
        assert!(error.contains(part), "{error}");
    }
}
