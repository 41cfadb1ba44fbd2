use super::{PointSpread, VirtualLight, sharpen};
use crate::film::Picture;
use crate::stages::test_support::{SIZE, codes_apart, mask, picture, stages};

fn lens() -> PointSpread {
    PointSpread {
        sigma_px: [0.9, 0.7, 1.1],
        corner_sigma_px: [1.4, 1.2, 1.6],
        sharpening: 0.8,
        sharpening_radius_px: 1.5,
        lateral_px: [0.6, -0.4],
    }
}

/// A disc of another picture in a photograph, and the photograph.
fn inserted() -> (Picture, Picture, Vec<f32>) {
    let (photo, layer, mask) = (picture(4), picture(5), mask());
    let mut both = photo.clone();
    for ((value, layer), m) in both.linear.iter_mut().zip(&layer.linear).zip(&mask) {
        if *m > 0.0 {
            *value = *layer;
        }
    }
    (both, photo, mask)
}

#[test]
fn both_sides_agree() {
    let Some(gpu) = stages() else { return };
    let (source, photo, mask) = inserted();
    let light = VirtualLight {
        photo: Some(&photo.linear),
        mask: &mask,
        ratio: None,
    };
    let (mut on_cpu, mut on_gpu) = (source.clone(), source.clone());
    sharpen(&mut on_cpu, &light, &lens());
    gpu.sharpen(&mut on_gpu, &light, &lens()).expect("runs");
    assert!(codes_apart(&on_cpu.linear, &on_gpu.linear).1 <= 1);
    assert!(codes_apart(&on_cpu.linear, &source.linear).1 > 1, "control");
    let far = on_gpu.linear[0].map(f32::to_bits);
    assert_eq!(far, photo.linear[0].map(f32::to_bits));
}

/// The photograph's bits stay beyond the filter's reach and change within it.
#[test]
fn what_nothing_virtual_reaches_keeps_its_bits() {
    let (source, photo, mask) = inserted();
    let light = VirtualLight {
        photo: Some(&photo.linear),
        mask: &mask,
        ratio: None,
    };
    let mut sharpened = source.clone();
    sharpen(&mut sharpened, &light, &lens());
    let reach = super::reach(&lens()) as f32;
    let (mut kept, mut changed) = (0, 0);
    for (i, (after, before)) in sharpened.linear.iter().zip(&photo.linear).enumerate() {
        let (x, y) = ((i as u32 % SIZE.0) as f32, (i as u32 / SIZE.0) as f32);
        let distance = (x - 50.0).hypot(y - 33.0) - 25.0;
        let same = after.map(f32::to_bits) == before.map(f32::to_bits);
        if distance > std::f32::consts::SQRT_2 * (reach + 1.0) {
            assert!(same, "{x} {y}");
            kept += 1;
        } else if distance > 0.0 && distance < 2.0 {
            changed += u32::from(!same);
        }
    }
    assert!(kept > 100 && changed > 100, "{kept} {changed}");
}

/// Light in the open is spread, not made: its sum and its cover's stay.
#[test]
fn energy_is_kept() {
    let (width, height) = (61, 61);
    let mut linear = vec![[0.0f32; 3]; width * height];
    let mut mask = vec![0.0; width * height];
    for (i, (value, m)) in linear.iter_mut().zip(&mut mask).enumerate() {
        let (x, y) = (i % width, i / width);
        if (25..35).contains(&x) && (28..33).contains(&y) {
            (*value, *m) = ([2.0, 0.5, 1.0], 1.0);
        }
    }
    let mut picture = Picture {
        width: width as u32,
        height: height as u32,
        linear,
    };
    let sum = |picture: &Picture| -> [f64; 3] {
        [0, 1, 2].map(|c| picture.linear.iter().map(|v| f64::from(v[c])).sum())
    };
    let before = sum(&picture);
    let light = VirtualLight {
        photo: None,
        mask: &mask,
        ratio: None,
    };
    // The same everywhere: where the spread varies each pixel still averages, but the sum is another.
    let spread = PointSpread {
        corner_sigma_px: lens().sigma_px,
        lateral_px: [0.0; 2],
        ..lens()
    };
    sharpen(&mut picture, &light, &spread);
    for (after, before) in sum(&picture).into_iter().zip(before) {
        assert!((after / before - 1.0).abs() < 1e-5, "{after} {before}");
    }
    let most = picture.linear.iter().map(|v| v[0]).fold(0.0, f32::max);
    assert!(most > 2.05, "control: it is sharpened, {most}");
}
