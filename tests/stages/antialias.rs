//! Equations 9 and 10 of the paper, written out.

use mixray::film::Picture;
use mixray::scene::AntialiasSettings;
use mixray::stages::antialias::antialias;

use crate::support::{Random, largest};

const WIDTH: i32 = 23;
const HEIGHT: i32 = 17;

fn inputs() -> (Picture, Vec<f32>) {
    let mut rng = Random(2);
    let linear = (0..WIDTH * HEIGHT)
        .map(|_| [(); 3].map(|()| rng.uniform() as f32))
        .collect();
    let mask = (0..WIDTH * HEIGHT)
        .map(|i| {
            f32::from(u8::from(
                ((i % WIDTH - 11) as f32).hypot((i / WIDTH - 8) as f32) < 6.5 || i % 97 == 0,
            ))
        })
        .collect();
    (
        Picture {
            width: WIDTH as u32,
            height: HEIGHT as u32,
            linear,
        },
        mask,
    )
}

/// b = (v + sum (1 - D) c) / n, mixed with v by beta.
fn transcription(picture: &Picture, mask: &[f32], beta: f64) -> Vec<[f64; 3]> {
    let at = |x: i32, y: i32| (y * WIDTH + x) as usize;
    let mut out = Vec::new();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let v = picture.linear[at(x, y)].map(f64::from);
            if mask[at(x, y)] == 0.0 {
                out.push(v);
                continue;
            }
            let (mut sum, mut n) = (v, 1.0);
            for j in -1..=1 {
                for i in -1..=1 {
                    let inside = (0..WIDTH).contains(&(x + i)) && (0..HEIGHT).contains(&(y + j));
                    if inside && mask[at(x + i, y + j)] == 0.0 {
                        for (sum, near) in sum.iter_mut().zip(picture.linear[at(x + i, y + j)]) {
                            *sum += f64::from(near);
                        }
                        n += 1.0;
                    }
                }
            }
            out.push([0, 1, 2].map(|c| beta * sum[c] / n + (1.0 - beta) * v[c]));
        }
    }
    out
}

fn worst(picture: &Picture, truth: &[[f64; 3]]) -> f64 {
    let pairs = picture.linear.iter().flatten().zip(truth.iter().flatten());
    largest(pairs.map(|(a, b)| f64::from(*a) - b))
}

#[test]
fn it_is_equation_10() {
    let (source, mask) = inputs();
    for beta in [0.0, 0.3, 0.8, 1.0] {
        let mut picture = source.clone();
        assert!(antialias(
            &mut picture,
            &mask,
            &AntialiasSettings { beta: beta as f32 }
        ));
        assert!(worst(&picture, &transcription(&source, &mask, beta)) < 1e-6);
        let other = transcription(&source, &mask, beta - 0.1);
        assert!(worst(&picture, &other) > 0.01, "control");
        for (i, m) in mask.iter().enumerate() {
            assert!(
                *m == 1.0 || picture.linear[i] == source.linear[i],
                "real pixels stay"
            );
        }
    }
}

#[test]
fn it_is_off_where_the_mask_is_soft() {
    let (source, mut mask) = inputs();
    mask[40] = 0.5;
    let mut picture = source.clone();
    assert!(!antialias(
        &mut picture,
        &mask,
        &AntialiasSettings { beta: 0.8 }
    ));
    assert_eq!(picture, source);
}
