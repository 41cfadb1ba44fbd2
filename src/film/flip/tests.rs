use super::*;
use crate::scene::srgb::decode;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;

fn image(f: impl Fn(usize, usize) -> [f64; 3]) -> Vec<[f32; 3]> {
    (0..WIDTH * HEIGHT)
        .map(|i| f(i % WIDTH, i / WIDTH).map(|c| decode(c) as f32))
        .collect()
}

fn flip_of(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    flip(WIDTH, HEIGHT, a, b)
}

/// Encoded sRGB values that a few lines of any language reproduce.
fn texture(x: usize, y: usize) -> [f64; 3] {
    let (x, y) = (x as f64, y as f64);
    [
        0.5 + 0.4 * (0.30 * x).sin() * (0.20 * y).cos(),
        0.5 + 0.3 * (0.11 * x + 0.23 * y).sin(),
        0.5 + 0.45 * (0.05 * x).cos() * (0.40 * y).sin(),
    ]
}

#[test]
fn known_properties() {
    let a = image(texture);
    let black = image(|_, _| [0.0; 3]);
    let white = image(|_, _| [1.0; 3]);
    let green = image(|_, _| [0.0, 1.0, 0.0]);
    let blue = image(|_, _| [0.0, 0.0, 1.0]);
    assert_eq!(flip_of(&a, &a), 0.0);
    assert!(
        (flip_of(&green, &blue) - 1.0).abs() < 1e-9,
        "the largest difference of the gamut"
    );
    let ab = flip_of(&a, &black);
    assert!((ab - flip_of(&black, &a)).abs() < 1e-12, "symmetric");
    assert!(ab > 0.1 && ab < flip_of(&black, &white));
    let bright = image(|_, _| [1.0; 3])
        .iter()
        .map(|v| v.map(|c| c * 7.0))
        .collect::<Vec<_>>();
    assert_eq!(
        flip_of(&white, &bright),
        0.0,
        "low dynamic range: values are clamped"
    );
}

/// A constant pair has no features, so its error is the colour difference alone: L* 100 against 0 in closed form.
#[test]
fn black_against_white_in_closed_form() {
    let largest = Colour::new().largest;
    let difference = 100.0f64.powf(Q_C);
    let expected = if difference < P_C * largest {
        difference * P_T / (P_C * largest)
    } else {
        P_T + (difference - P_C * largest) / ((1.0 - P_C) * largest) * (1.0 - P_T)
    };
    let got = flip_of(&image(|_, _| [0.0; 3]), &image(|_, _| [1.0; 3]));
    assert!((got - expected).abs() < 1e-9, "{got} {expected}");
}

/// NVIDIA's own implementation on the same images: `pip install flip-evaluator==1.7`, then with numpy
/// `y, x = mgrid[0:64, 0:96]` and `a` the texture above,
/// `flip_evaluator.evaluate(a.astype(float32), clip(b, 0, 1).astype(float32), "LDR", applyMagma=False)[1]`.
#[test]
fn agrees_with_the_published_implementation() {
    let a = image(texture);
    let brightened =
        |x: usize, y: usize, add: f64| texture(x, y).map(|c| (c + add).clamp(0.0, 1.0));
    let cases: [(&str, f64, Vec<[f32; 3]>); 6] = [
        // b = a + 0.1 * sin(1.7 x + 2.3 y)
        (
            "stripes",
            0.048_513_9,
            image(|x, y| brightened(x, y, 0.1 * (1.7 * x as f64 + 2.3 * y as f64).sin())),
        ),
        // b = a moved right by one pixel, the first column repeated
        (
            "shift",
            0.202_755_3,
            image(|x, y| texture(x.saturating_sub(1), y)),
        ),
        (
            "darker",
            0.322_831_9,
            image(|x, y| texture(x, y).map(|c| 0.9 * c)),
        ),
        // b = a with row 30 white
        (
            "line",
            0.052_737_1,
            image(|x, y| if y == 30 { [1.0; 3] } else { texture(x, y) }),
        ),
        // b = a with 0.1 more red
        (
            "red",
            0.271_914_9,
            image(|x, y| {
                let [r, g, b] = texture(x, y);
                [(r + 0.1).min(1.0), g, b]
            }),
        ),
        ("black", 0.959_272_8, image(|_, _| [0.0; 3])),
    ];
    for (name, expected, b) in &cases {
        let got = flip_of(&a, b);
        assert!((got - expected).abs() < 2e-5, "{name}: {got} {expected}");
    }
    let got = flip_of(
        &a,
        &cases[2]
            .2
            .iter()
            .map(|v| v.map(|c| c * 1.01))
            .collect::<Vec<_>>(),
    );
    assert!(
        (got - cases[2].1).abs() > 1e-3,
        "control: one percent shows"
    );
}
