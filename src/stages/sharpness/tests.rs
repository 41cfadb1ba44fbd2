use super::{PointSpread, VirtualLight, sharpen};
use crate::film::Picture;
use crate::stages::test_support::{SIZE, codes_apart, mask, picture, random, stages};

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

/// A photograph of slanted squares, drawn by area coverage eight times finer, gone through `spread` alone.
fn squares(spread: &PointSpread) -> Picture {
    let mut picture = sharp_squares();
    let mask = vec![1.0; picture.linear.len()];
    let light = VirtualLight {
        photo: None,
        mask: &mask,
        ratio: None,
    };
    sharpen(&mut picture, &light, spread);
    picture
}

fn sharp_squares() -> Picture {
    const FINE: i32 = 8;
    let (width, height) = (320, 240);
    let linear = (0..width * height)
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let mut inside = 0;
            for sub in 0..FINE * FINE {
                let at = |pixel: i32, sub: i32| f64::from(pixel) + (f64::from(sub) + 0.5) / 8.0;
                let (u, v) = (at(x, sub % FINE), at(y, sub / FINE));
                // Turned by about five degrees.
                let (a, b) = (u + 0.09 * v, v - 0.09 * u);
                let cell = |t: f64| (t + 400.0) % 80.0 < 40.0;
                inside += i32::from(cell(a) != cell(b));
            }
            [0.1 + 0.5 * inside as f32 / (FINE * FINE) as f32; 3]
        })
        .collect();
    Picture {
        width: width as u32,
        height: height as u32,
        linear,
    }
}

fn measured(picture: &Picture) -> super::Measured {
    super::measure(&picture.linear, (picture.width, picture.height)).unwrap()
}

/// What one picture's edges show, given to ideal edges, shows again.
#[test]
fn the_measured_sharpness_is_that_of_the_picture() {
    for (sigma, sharpening) in [(0.8, 0.0), (1.2, 0.0), (1.0, 1.2)] {
        let known = PointSpread {
            sharpening,
            sharpening_radius_px: 1.5,
            ..PointSpread::gaussian(sigma)
        };
        let photo = measured(&squares(&known));
        let again = measured(&squares(&photo.spread));
        let ratio = again.edge_spread_px / photo.edge_spread_px;
        assert!((ratio - 1.0).abs() < 0.05, "{photo:?} {again:?}");
        assert!(
            (again.overshoot - photo.overshoot).abs() < 0.02,
            "{photo:?} {again:?}"
        );
        assert!(photo.spread.lateral_px == [0.0; 2], "{photo:?}");
        let ideal = measured(&squares(&PointSpread::gaussian(0.0)));
        assert!(ideal.edge_spread_px < 0.8 * photo.edge_spread_px, "control");
    }
}

/// A third of the picture is in focus, the rest far out of it, and all of it is noisy: what is in focus counts.
#[test]
fn an_object_in_focus_is_as_sharp_as_what_is_in_focus() {
    let (sharp, soft) = (PointSpread::gaussian(0.8), PointSpread::gaussian(2.2));
    let (mut photo, blurred) = (squares(&sharp), squares(&soft));
    let width = photo.width as usize;
    for (i, (value, blurred)) in photo.linear.iter_mut().zip(&blurred.linear).enumerate() {
        if i % width > width / 3 {
            *value = *blurred;
        }
        for (c, value) in value.iter_mut().enumerate() {
            let normal = (0..12).map(|k| random(3 * i + c, 40 + k)).sum::<f32>() - 6.0;
            *value += 0.008 * normal;
        }
    }
    let found = measured(&photo).edge_spread_px;
    let known = measured(&squares(&sharp)).edge_spread_px;
    assert!((found / known - 1.0).abs() < 0.1, "{found}, not {known}");
    let all = measured(&blurred).edge_spread_px;
    assert!(all > 2.0 * known, "control: {all}");
}

/// Noise makes no overshoot, and a bright rim on one side alone is no sharpening.
#[test]
fn overshoot_is_on_both_sides_near_the_edge() {
    let mut photo = squares(&PointSpread::gaussian(0.9));
    for (i, value) in photo.linear.iter_mut().enumerate() {
        for (c, value) in value.iter_mut().enumerate() {
            let normal = (0..12).map(|k| random(3 * i + c, 90 + k)).sum::<f32>() - 6.0;
            *value += 0.01 * normal;
        }
    }
    let plain = measured(&photo);
    assert!(plain.overshoot < 0.01, "{plain:?}");
    let sharpened = PointSpread {
        sharpening: 1.2,
        sharpening_radius_px: 1.5,
        ..PointSpread::gaussian(0.9)
    };
    let sharpened = measured(&squares(&sharpened));
    assert!(sharpened.overshoot > 0.04, "control: {sharpened:?}");
}

#[test]
fn lateral_colour_is_found() {
    let known = PointSpread {
        lateral_px: [0.8, -0.5],
        ..PointSpread::gaussian(0.9)
    };
    let found = measured(&squares(&known)).spread.lateral_px;
    for (found, known) in found.into_iter().zip(known.lateral_px) {
        assert!((found - known).abs() < 0.1, "{found} {known}");
    }
}

#[test]
fn a_picture_without_edges_is_refused() {
    let flat = vec![[0.3; 3]; 200 * 200];
    let problem = super::measure(&flat, (200, 200)).unwrap_err().to_string();
    assert!(problem.contains("give numbers"), "{problem}");
}

/// The point spread of each of five photographs gives ideal edges the spread of that photograph's own.
#[test]
fn virtual_edges_are_as_soft_as_five_photographs() {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    for name in [
        "tum_desk_rgbd/photo.png",
        "polyu_noise_pairs/Canon5D2_5_160_6400_circuit_11_mean.jpg",
        "polyu_noise_pairs/Canon5D2_5_200_3200_fruit_11_mean.jpg",
        "polyu_noise_pairs/NikonD800_4-5_160_1800_classroom_15_mean.jpg",
        "polyu_noise_pairs/NikonD800_8_100_6400_bulletin_3_mean.jpg",
    ] {
        let path = data.join(name);
        if !path.is_file() {
            eprintln!("{name} is absent: nothing is tested on it");
            continue;
        }
        let (photo, _) = crate::scene::Photo::read(&path).unwrap();
        let real = super::measure(&photo.linear, (photo.width, photo.height)).unwrap();
        let virtually = measured(&squares(&real.spread));
        eprintln!(
            "{name}: {:.2} px, {:.3}; virtual {:.2} px, {:.3}; {real:?}",
            real.edge_spread_px, real.overshoot, virtually.edge_spread_px, virtually.overshoot
        );
        let ratio = virtually.edge_spread_px / real.edge_spread_px;
        assert!((ratio - 1.0).abs() < 0.1, "{name}: {ratio}");
        let off = virtually.overshoot - real.overshoot;
        assert!(off.abs() < 0.02, "{name}: {off}");
    }
}
