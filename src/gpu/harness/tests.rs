use super::*;
use crate::gpu::SceneParts;
use crate::gpu::tests::{MIX, mix};
use crate::packed::{Frame, Triangle};
use bytemuck::Zeroable;

fn probe(prelude: &str, body: &str) -> Option<Vec<u32>> {
    let inputs: Vec<u32> = (0..1000).collect();
    let probe = Probe {
        features: Features::default(),
        prelude,
        body,
        input_words: 1,
        output_words: 1,
        scene: None,
    };
    Some(probe.run(test_device()?, &inputs).expect("runs"))
}

#[test]
fn a_hash_gives_the_same_bits_on_both_sides() {
    let Some(outputs) = probe(MIX, "output(0u, mix_bits(input(0u)));") else {
        return;
    };
    let expected: Vec<u32> = (0..1000).map(mix).collect();
    assert_eq!(outputs, expected);
    // Negative control: another function of the same input is told apart.
    let other = probe(MIX, "output(0u, mix_bits(input(0u) ^ 1u));");
    assert_ne!(other.as_deref(), Some(&expected[..]));
}

#[test]
fn the_scene_can_be_read_and_must_be_given() {
    let Some(gpu) = test_device() else { return };
    let triangles: Vec<Triangle> = (0..5)
        .map(|i| Triangle {
            material: 10 + i,
            ..Triangle::zeroed()
        })
        .collect();
    let parts = SceneParts {
        frame: Frame {
            width: 640,
            ..Frame::zeroed()
        },
        triangles: &triangles,
        ..SceneParts::default()
    };
    let scene = SceneBuffers::from_parts(gpu, &parts).expect("uploads");
    let mut probe = Probe {
        features: Features::default(),
        prelude: "import package::gpu::buffers::{frame, triangles};",
        body: "output(0u, triangles[input(0u)].material); output(1u, frame.width);",
        input_words: 1,
        output_words: 2,
        scene: Some(&scene),
    };
    assert_eq!(probe.run(gpu, &[4, 1]).expect("runs"), [14, 640, 11, 640]);
    probe.scene = None;
    let error = probe.run(gpu, &[0]).expect_err("no scene");
    assert!(matches!(error, GpuError::Unbound { .. }), "{error}");
}
