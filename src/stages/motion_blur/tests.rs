use super::{Copies, MotionBlurSettings, draw_copies};
use crate::stages::test_support::{SIZE, mask, picture, stages};

#[test]
fn the_copies_are_the_same() {
    let Some(gpu) = stages() else { return };
    let settings = MotionBlurSettings::default();
    let copies = |blur| Copies::of(blur, &settings).expect("moves enough");
    let layer = |stream: u32| -> Vec<[f32; 4]> {
        let covered = mask();
        (picture(stream).linear.iter().zip(covered))
            .map(|([r, g, b], a)| [r * a, g * a, b * a, a])
            .collect()
    };
    let (far, near) = (layer(3), layer(4));
    let canvas: Vec<[f32; 4]> = (picture(5).linear.iter())
        .map(|[r, g, b]| [*r, *g, *b, 0.0])
        .collect();
    let layers = [
        (far.as_slice(), copies([17.3, -9.1])),
        (near.as_slice(), copies([-5.2, 0.4])),
        (near.as_slice(), Copies::ONE),
    ];
    let mut on_cpu = canvas.clone();
    for (layer, copies) in &layers {
        draw_copies(&mut on_cpu, SIZE, layer, copies);
    }
    let mut on_gpu = canvas.clone();
    gpu.draw_copies(&mut on_gpu, SIZE, &layers).expect("runs");
    let apart = |a: &[[f32; 4]], b: &[[f32; 4]]| {
        let pairs = a.as_flattened().iter().zip(b.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    let worst = apart(&on_cpu, &on_gpu);
    assert!(worst < 1e-5, "{worst}");
    let mut other = canvas.clone();
    gpu.draw_copies(&mut other, SIZE, &layers[..2])
        .expect("runs");
    assert!(apart(&on_cpu, &other) > 0.01, "control: a layer less");
}
