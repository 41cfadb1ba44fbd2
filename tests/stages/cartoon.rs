//! The cartoon against a plain f64 transcription of the paper's equations 1 to 5, pixel by pixel with nothing shared or reordered.

use mixray::math::hash_u32;
use mixray::scene::{CartoonSettings, CartoonStyle};
use mixray::stages::EncodedImage;
use mixray::stages::cartoon::cartoon;

use crate::support::largest;

type Rgb = [f64; 3];

struct Image {
    width: usize,
    height: usize,
    rgb: Vec<Rgb>,
}

impl Image {
    /// Borders repeat.
    fn at(&self, x: isize, y: isize) -> Rgb {
        let x = x.clamp(0, self.width as isize - 1) as usize;
        let y = y.clamp(0, self.height as isize - 1) as usize;
        self.rgb[y * self.width + x]
    }

    fn map(width: usize, height: usize, pixel: impl Fn(usize, usize) -> Rgb) -> Self {
        let rgb = (0..height)
            .flat_map(|y| (0..width).map(move |x| (x, y)))
            .map(|(x, y)| pixel(x, y))
            .collect();
        Self { width, height, rgb }
    }
}

/// BT.601 as its matrix stands in textbooks.
fn yuv([r, g, b]: Rgb) -> Rgb {
    [
        0.299 * r + 0.587 * g + 0.114 * b,
        -0.147_14 * r - 0.288_86 * g + 0.436 * b,
        0.615 * r - 0.514_99 * g - 0.100_01 * b,
    ]
}

fn area_average(image: &Image, width: usize, height: usize) -> Image {
    let (sx, sy) = (
        image.width as f64 / width as f64,
        image.height as f64 / height as f64,
    );
    Image::map(width, height, |x, y| {
        let mut sum = [0.0; 3];
        for row in 0..image.height {
            let h = ((y as f64 + 1.0) * sy).min(row as f64 + 1.0) - (y as f64 * sy).max(row as f64);
            for column in 0..image.width {
                let w = ((x as f64 + 1.0) * sx).min(column as f64 + 1.0)
                    - (x as f64 * sx).max(column as f64);
                if w > 0.0 && h > 0.0 {
                    let pixel = image.rgb[row * image.width + column];
                    for c in 0..3 {
                        sum[c] += pixel[c] * w * h / (sx * sy);
                    }
                }
            }
        }
        sum
    })
}

/// Equations 1 to 3.
fn photometric(f: &Image, sigma_p: f64) -> Image {
    Image::map(f.width, f.height, |x, y| {
        let center = yuv(f.at(x as isize, y as isize));
        let (mut sum, mut k) = ([0.0; 3], 0.0);
        for dy in -2..=2 {
            for dx in -2..=2 {
                let near = f.at(x as isize + dx, y as isize + dy);
                let color = yuv(near);
                let distance = (color[1] - center[1]).hypot(color[2] - center[2]);
                let s = (-0.5 * (distance / sigma_p).powi(2)).exp();
                k += s;
                for c in 0..3 {
                    sum[c] += near[c] * s;
                }
            }
        }
        sum.map(|channel| channel / k)
    })
}

/// Equation 4.
fn edge(image: &Image, x: usize, y: usize, alpha: f64) -> f64 {
    const SOBEL: [[f64; 3]; 3] = [[-1.0, 0.0, 1.0], [-2.0, 0.0, 2.0], [-1.0, 0.0, 1.0]];
    let (mut gx, mut gy) = ([0.0; 3], [0.0; 3]);
    for (j, row) in SOBEL.iter().enumerate() {
        for (i, weight) in row.iter().enumerate() {
            let across = yuv(image.at(x as isize + i as isize - 1, y as isize + j as isize - 1));
            let down = yuv(image.at(x as isize + j as isize - 1, y as isize + i as isize - 1));
            for c in 0..3 {
                gx[c] += weight * across[c] / 4.0;
                gy[c] += weight * down[c] / 4.0;
            }
        }
    }
    let [y, u, v] = [0, 1, 2].map(|c| gx[c].hypot(gy[c]));
    (1.0 - alpha) * y + alpha * (u + v) / 2.0
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    3.0 * t * t - 2.0 * t * t * t
}

/// Linear between pixel centres; x and y in pixels of `width` x `height`, corner origin.
fn bilinear<const N: usize>(
    at: impl Fn(isize, isize) -> [f64; N],
    size: (usize, usize),
    x: f64,
    y: f64,
) -> [f64; N] {
    let x = (x - 0.5).clamp(0.0, size.0 as f64 - 1.0);
    let y = (y - 0.5).clamp(0.0, size.1 as f64 - 1.0);
    let (column, row) = (x.floor(), y.floor());
    let (fx, fy) = (x - column, y - row);
    let mut sum = [0.0; N];
    for (dx, dy, weight) in [
        (0, 0, (1.0 - fx) * (1.0 - fy)),
        (1, 0, fx * (1.0 - fy)),
        (0, 1, (1.0 - fx) * fy),
        (1, 1, fx * fy),
    ] {
        let value = at(column as isize + dx, row as isize + dy);
        for c in 0..N {
            sum[c] += weight * value[c];
        }
    }
    sum
}

/// Equation 5 and the final picture.
fn transcription(image: &Image, s: &CartoonSettings) -> Image {
    let mut simplified = area_average(image, s.shrunk_width as usize, s.shrunk_height as usize);
    for _ in 0..s.iterations {
        simplified = photometric(&simplified, f64::from(s.sigma_p));
    }
    let (alpha, beta) = (f64::from(s.alpha), f64::from(s.beta));
    let size = (simplified.width, simplified.height);
    let responses: Vec<f64> = (0..size.0 * size.1)
        .map(|i| edge(&simplified, i % size.0, i / size.0, alpha))
        .collect();
    let response = |x: isize, y: isize| {
        let x = x.clamp(0, size.0 as isize - 1) as usize;
        let y = y.clamp(0, size.1 as isize - 1) as usize;
        [responses[y * size.0 + x]]
    };
    Image::map(image.width, image.height, |x, y| {
        let xs = (x as f64 + 0.5) * size.0 as f64 / image.width as f64;
        let ys = (y as f64 + 0.5) * size.1 as f64 / image.height as f64;
        let [edge_s] = bilinear(response, size, xs, ys);
        let edge_a = edge(image, x, y, alpha);
        let silhouette = (1.0 - beta) * smoothstep(s.s0.into(), s.s1.into(), edge_s)
            + beta * smoothstep(s.a0.into(), s.a1.into(), edge_a);
        bilinear(|x, y| simplified.at(x, y), size, xs, ys).map(|c| c * (1.0 - silhouette))
    })
}

/// Coloured discs and stripes on a gradient, with noise: edges of every strength.
fn picture(width: u32, height: u32) -> EncodedImage {
    let rgb = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            let mut rgb = [
                0.2 + 0.5 * x / width as f32,
                0.3 + 0.3 * y / height as f32,
                0.4,
            ];
            for disc in 0..9 {
                let [a, b, c] = [1, 2, 3].map(|k| hash_u32(disc * 7 + k) as f32 / u32::MAX as f32);
                let distance = (x - a * width as f32).hypot(y - b * height as f32);
                if distance < 4.0 + 0.12 * c * width as f32 {
                    let strength = 0.02 + 0.3 * c;
                    rgb[disc as usize % 3] += strength * if disc % 2 == 0 { 1.0 } else { -1.0 };
                }
            }
            std::array::from_fn(|c| {
                let noise = hash_u32(i * 3 + c as u32) as f32 / u32::MAX as f32 - 0.5;
                (rgb[c] + 0.03 * noise).clamp(0.0, 1.0)
            })
        })
        .collect();
    EncodedImage { width, height, rgb }
}

fn in_f64(image: &EncodedImage) -> Image {
    Image {
        width: image.width as usize,
        height: image.height as usize,
        rgb: image.rgb.iter().map(|p| p.map(f64::from)).collect(),
    }
}

/// Largest difference in 8-bit codes.
fn worst_codes(a: &EncodedImage, b: &Image) -> f64 {
    let code = |x: f64| (x.clamp(0.0, 1.0) * 255.0 + 0.5).floor();
    let pairs = a.rgb.iter().zip(&b.rgb);
    largest(pairs.flat_map(|(a, b)| (0..3).map(move |c| code(f64::from(a[c])) - code(b[c]))))
}

fn cases() -> Vec<CartoonSettings> {
    let default = CartoonSettings::default();
    vec![
        CartoonSettings {
            shrunk_width: 60,
            shrunk_height: 45,
            ..default
        },
        // A ratio that is not whole, other weights, and edges of the original that show.
        CartoonSettings {
            shrunk_width: 67,
            shrunk_height: 41,
            iterations: 3,
            sigma_p: 0.05,
            alpha: 0.7,
            beta: 0.6,
            s0: 0.01,
            s1: 0.1,
            a0: 0.02,
            a1: 0.2,
            ..default
        },
    ]
}

#[test]
fn it_is_the_papers_equations_within_one_code() {
    let image = picture(160, 120);
    for settings in cases() {
        let truth = transcription(&in_f64(&image), &settings);
        let result = cartoon(&image, &settings, false);
        let worst = worst_codes(&result.image, &truth);
        assert!(worst <= 1.0, "{worst} codes");
        let lines = truth.rgb.iter().filter(|p| p[1] < 0.1).count();
        assert!(lines > 50, "the picture has silhouettes: {lines}");
    }
}

/// Negative control: each parameter and each equation counts.
#[test]
fn another_parameter_is_another_picture() {
    let image = picture(160, 120);
    let settings = cases()[1];
    let truth = transcription(&in_f64(&image), &settings);
    let others = [
        CartoonSettings {
            iterations: 4,
            ..settings
        },
        CartoonSettings {
            sigma_p: 0.06,
            ..settings
        },
        CartoonSettings {
            alpha: 0.6,
            ..settings
        },
        CartoonSettings {
            beta: 0.5,
            ..settings
        },
        CartoonSettings {
            s1: 0.09,
            ..settings
        },
        CartoonSettings {
            a0: 0.03,
            ..settings
        },
        CartoonSettings {
            shrunk_width: 66,
            ..settings
        },
    ];
    for other in others {
        let result = cartoon(&image, &other, false);
        assert!(worst_codes(&result.image, &truth) > 1.0, "{other:?}");
    }
}

#[test]
fn small_pictures_keep_their_size_and_nothing_is_added_to_grey() {
    for (width, height) in [(1, 1), (3, 200), (17, 2)] {
        let image = EncodedImage {
            width,
            height,
            rgb: vec![[0.5; 3]; (width * height) as usize],
        };
        for style in [CartoonStyle::Photometric, CartoonStyle::Flow] {
            let settings = CartoonSettings {
                style,
                ..CartoonSettings::default()
            };
            let result = cartoon(&image, &settings, true);
            assert!(worst_codes(&result.image, &in_f64(&image)) <= 1.0);
            let edges = result.edges.expect("asked for");
            assert!(edges.silhouette.iter().all(|s| *s == 0.0));
        }
    }
}

/// The flow style draws a line on the dark side of a step, along the whole of it, and none where there is no step; noise that would
/// break Sobel's edges leaves it whole.
#[test]
fn the_flow_style_draws_whole_lines_along_contours() {
    let (width, height) = (96u32, 96u32);
    let disc = |x: f32, y: f32| (x - 48.0).hypot(y - 48.0);
    let image = EncodedImage {
        width,
        height,
        rgb: (0..width * height)
            .map(|i| {
                let radius = disc((i % width) as f32, (i / width) as f32);
                let noise = hash_u32(i) as f32 / u32::MAX as f32 - 0.5;
                [if radius < 30.0 { 0.3 } else { 0.6 } + 0.04 * noise; 3]
            })
            .collect(),
    };
    let settings = CartoonSettings {
        style: CartoonStyle::Flow,
        ..CartoonSettings::default()
    };
    let edges = cartoon(&image, &settings, true).edges.expect("asked for");
    let line = |degrees: usize, radius: f32| {
        let (sin, cos) = (degrees as f32).to_radians().sin_cos();
        let (x, y) = (48.0 + radius * cos, 48.0 + radius * sin);
        edges.silhouette[y.round() as usize * width as usize + x.round() as usize]
    };
    let strongest = |degrees| {
        (26..32)
            .map(|r| line(degrees, r as f32))
            .fold(0.0, f32::max)
    };
    let drawn = (0..360).filter(|d| strongest(*d) > 0.5).count();
    assert!(drawn >= 350, "{drawn} of 360 degrees");
    let stray = (0..360)
        .filter(|d| line(*d, 15.0) > 0.5 || line(*d, 42.0) > 0.5)
        .count();
    assert!(
        stray <= 2,
        "{stray} of 360 degrees where there is no contour"
    );
}
