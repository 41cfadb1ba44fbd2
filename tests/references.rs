//! Composites against converged references that an independent renderer, Mitsuba 3, made of the same scenes (docs/accuracy.md).

use std::sync::Arc;

use mixray::film::Picture;
use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{BackendChoice, EncodedPhoto, LightKind, Material, Photo, Scene};

use crate::support::{largest, root};

/// Runs of a comparison: their spread is the standard error.
const RUNS: u32 = 4;
/// Pixels along a block's side.
const BLOCK: usize = 8;
/// Largest mean error, relative to the mean.
const MEAN_TOLERANCE: f64 = 1e-3;
/// Structure: largest root mean square of the blocks' errors over their standard errors, and largest of all.
const LARGEST_Z_RMS: f64 = 1.25;
const LARGEST_Z: f64 = 5.5;

/// What `benches/peers/mitsuba_reference.py` wrote, row-major. Means of the channels.
struct Reference {
    width: usize,
    height: usize,
    rays_per_pixel: f64,
    /// Composite without its photograph.
    added: Vec<f64>,
    mask: Vec<f64>,
    /// Variance of the mean.
    variance: Vec<f64>,
    /// Made from the lights' side: it tells nothing of pixels with virtual objects.
    of_real_pixels: bool,
}

impl Reference {
    fn read(name: &str) -> Self {
        let path = root().join(format!("tests/references/{name}.exr"));
        let image = exr::prelude::read_all_flat_layers_from_file(path).expect("reference");
        let layer = &image.layer_data[0];
        let plane = |name: &str| -> Vec<f64> {
            let channels = &layer.channel_data.list;
            let channel = channels
                .iter()
                .find(|channel| channel.name.eq(name))
                .expect("channel");
            let samples = channel.sample_data.values_as_f32();
            samples.map(f64::from).collect()
        };
        let planes = |names: [&str; 3]| names.map(plane);
        let mean = |[r, g, b]: [Vec<f64>; 3]| -> Vec<f64> {
            (0..r.len()).map(|i| (r[i] + g[i] + b[i]) / 3.0).collect()
        };
        let errors = planes(["error.R", "error.G", "error.B"]);
        // One path lights all channels: their errors are as good as equal, and so add up.
        let variance = mean(errors).iter().map(|error| error * error).collect();
        let Some(exr::prelude::AttributeValue::I32(rays_per_pixel)) = layer
            .attributes
            .other
            .get(&exr::meta::attribute::Text::from("raysPerPixel"))
        else {
            panic!("{name} does not say its rays per pixel");
        };
        let integrator = layer
            .attributes
            .other
            .get(&exr::meta::attribute::Text::from("integrator"));
        Self {
            width: layer.size.x(),
            height: layer.size.y(),
            of_real_pixels: matches!(integrator, Some(exr::prelude::AttributeValue::Text(name)) if name.eq("ptracer")),
            rays_per_pixel: f64::from(*rays_per_pixel),
            added: mean(planes(["R", "G", "B"])),
            mask: plane("mask.Y"),
            variance,
        }
    }

    /// The whole composite over the scene's photograph.
    fn composite(&self, scene: &Scene) -> Vec<f64> {
        let photo = grey(&scene.photo.as_ref().expect("photograph").linear);
        (self.added.iter().zip(&self.mask).zip(&photo))
            .map(|((added, mask), ic)| added + (1.0 - mask) * ic)
            .collect()
    }
}

fn grey(linear: &[[f32; 3]]) -> Vec<f64> {
    (linear.iter())
        .map(|c| c.iter().map(|&x| f64::from(x)).sum::<f64>() / 3.0)
        .collect()
}

/// A scene of `scenes/` at the reference's size, its photograph averaged in linear light.
fn scene_for(name: &str, reference: &Reference) -> Scene {
    let path = root().join(format!("scenes/{name}/scene.toml"));
    let mut scene = mixray::scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
    let photo = scene.photo.take().expect("photograph");
    let shrink = photo.height as usize / reference.height;
    let (width, height) = (reference.width, reference.height);
    let linear = (0..width * height)
        .map(|pixel| {
            let (x, y) = (pixel % width * shrink, pixel / width * shrink);
            let mut sum = [0.0_f32; 3];
            for at in 0..shrink * shrink {
                let row = y + at / shrink;
                let texel = photo.linear[row * photo.width as usize + x + at % shrink];
                (0..3).for_each(|c| sum[c] += texel[c]);
            }
            sum.map(|x| x / (shrink * shrink) as f32)
        })
        .collect();
    scene.photo = Some(Photo {
        width: width as u32,
        height: height as u32,
        linear,
        encoded: EncodedPhoto::Linear,
        tags: Default::default(),
    });
    let camera = &mut scene.camera;
    (camera.width, camera.height) = (width as u32, height as u32);
    for length in [
        &mut camera.fx,
        &mut camera.fy,
        &mut camera.cx,
        &mut camera.cy,
    ] {
        *length /= shrink as f64;
    }
    scene
}

/// One composite a seed.
fn render(scene: &Scene, backend: BackendChoice, rays_per_pixel: u32) -> Vec<Picture> {
    (0..RUNS)
        .map(|seed| {
            let mut scene = scene.clone();
            scene.settings.rays_per_pixel = rays_per_pixel;
            scene.settings.seed = seed;
            scene.settings.backend = backend;
            let mut renderer = Renderer::new(scene, RendererOptions::default(), &Watcher::none())
                .expect("scene fits");
            (renderer.advance(Budget::Complete, &Watcher::none())).expect("renders");
            renderer.picture()
        })
        .collect()
}

/// A difference from the reference in numbers.
#[derive(Debug)]
struct Comparison {
    /// Mean error over the mean of the reference.
    mean_error: f64,
    /// Its standard error by the runs' spread, and by the reference's own.
    standard_error_mixray: f64,
    standard_error_reference: f64,
    /// The same with blocks weighted by the reciprocal of the reference's variance: where caustics make both renderers noisy there is little
    /// to learn, and elsewhere much.
    weighted_error: f64,
    weighted_standard_error: f64,
    /// Errors of blocks over their standard errors.
    z_rms: f64,
    z_largest: f64,
}

fn compare(
    pictures: &[Picture],
    rays_per_pixel: u32,
    reference: &Reference,
    scene: &Scene,
) -> Comparison {
    let truth = reference.composite(scene);
    let runs: Vec<Vec<f64>> = pictures.iter().map(|p| grey(&p.linear)).collect();
    let count = runs.len() as f64;
    let pixels = truth.len();
    let columns = reference.width / BLOCK;
    let rows = reference.height / BLOCK;
    let mut blocks = vec![Block::default(); columns * rows];
    let mut whole = Block::default();
    let at_equal_rays = reference.rays_per_pixel / (f64::from(rays_per_pixel) * count);
    for i in (0..pixels).filter(|&i| !reference.of_real_pixels || reference.mask[i] == 0.0) {
        let values = runs.iter().map(|run| run[i]);
        let mean = values.clone().sum::<f64>() / count;
        let spread = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / (count - 1.0);
        let one = Block {
            truth: truth[i],
            error: mean - truth[i],
            variance: spread / count,
            reference_variance: reference.variance[i],
        };
        whole.add(&one);
        let (x, y) = (i % reference.width / BLOCK, i / reference.width / BLOCK);
        if x < columns && y < rows {
            blocks[y * columns + x].add(&one);
        }
    }
    blocks.retain(|block| block.truth > 0.0);
    let mut sorted: Vec<f64> = blocks.iter().map(|b| b.reference_variance).collect();
    sorted.sort_by(f64::total_cmp);
    let floor = sorted[sorted.len() / 2];
    let mut weighted = Block::default();
    for b in &blocks {
        let weight = 1.0 / b.reference_variance.max(floor);
        weighted.truth += weight * b.truth;
        weighted.error += weight * b.error;
        weighted.variance += weight * weight * (b.variance + b.reference_variance);
    }
    let zs: Vec<f64> = blocks.iter().map(|b| b.z(at_equal_rays)).collect();
    Comparison {
        mean_error: whole.error / whole.truth,
        standard_error_mixray: whole.variance.sqrt() / whole.truth,
        standard_error_reference: whole.reference_variance.sqrt() / whole.truth,
        weighted_error: weighted.error / weighted.truth,
        weighted_standard_error: weighted.variance.sqrt() / weighted.truth,
        z_rms: (zs.iter().map(|z| z * z).sum::<f64>() / zs.len() as f64).sqrt(),
        z_largest: largest(zs.iter().copied()),
    }
}

/// Sums over pixels.
#[derive(Clone, Default)]
struct Block {
    truth: f64,
    error: f64,
    variance: f64,
    reference_variance: f64,
}

impl Block {
    fn add(&mut self, other: &Block) {
        self.truth += other.truth;
        self.error += other.error;
        self.variance += other.variance;
        self.reference_variance += other.reference_variance;
    }

    /// A few runs often miss the rare bright paths of a caustic, and their spread then is far too small: at least the reference's variance
    /// at as many rays counts, for mixray's is no smaller there.
    fn z(&self, at_equal_rays: f64) -> f64 {
        let variance = self.variance.max(self.reference_variance * at_equal_rays);
        self.error / (variance + self.reference_variance).sqrt()
    }
}

impl Comparison {
    /// Precise enough to tell a mean error at the tolerance.
    fn is_precise(&self) -> bool {
        self.weighted_standard_error < MEAN_TOLERANCE / 2.0
    }

    fn agrees(&self) -> bool {
        let standard_error = (self.standard_error_mixray).hypot(self.standard_error_reference);
        self.mean_error.abs() < MEAN_TOLERANCE.max(3.0 * standard_error)
            && self.weighted_error.abs() < MEAN_TOLERANCE
            && self.z_rms < LARGEST_Z_RMS
            && self.z_largest < LARGEST_Z
    }
}

/// The scene agrees with its reference, and the same scene with something changed does not.
fn check(name: &str, backend: BackendChoice, rays_per_pixel: u32, change: fn(&mut Scene)) {
    let reference = Reference::read(name);
    let mut scene = scene_for(name, &reference);
    let measure = |scene: &Scene, rays_per_pixel: u32| {
        let pictures = render(scene, backend, rays_per_pixel);
        compare(&pictures, rays_per_pixel, &reference, scene)
    };
    let comparison = measure(&scene, rays_per_pixel);
    eprintln!("{name}: {comparison:?}");
    assert!(comparison.is_precise(), "{name}: {comparison:#?}");
    assert!(comparison.agrees(), "{name}: {comparison:#?}");
    change(&mut scene);
    let comparison = measure(&scene, rays_per_pixel / 2);
    eprintln!("{name}, changed: {comparison:?}");
    assert!(comparison.is_precise(), "{name}, changed: {comparison:#?}");
    assert!(!comparison.agrees(), "{name}, changed: {comparison:#?}");
}

fn change_material(scene: &mut Scene, object: &str, change: impl Fn(&mut Material)) {
    let object = (scene.objects.iter_mut().find(|o| o.name == object)).expect("object");
    for instance in &mut object.instances {
        change(Arc::make_mut(&mut instance.material));
    }
}

/// Diffuse things under an area light, wide open. Changed: the light is 10 cm to the right.
#[test]
fn room_agrees_with_mitsuba() {
    check("room", BackendChoice::Cpu, 16, |scene| {
        for light in &mut scene.lights {
            if let LightKind::Quad { corner, .. } = &mut light.kind {
                corner[0] += 0.1;
            }
        }
    });
}

/// Mirror, glass and rough metal under a sunny sky. Changed: the glass has the index 1.45 instead of 1.5.
#[test]
fn sunny_agrees_with_mitsuba() {
    check("sunny", BackendChoice::Cpu, 64, |scene| {
        change_material(scene, "glass", |m| m.ior = 1.45);
    });
}

/// What a glass ball and a chrome ring gather on a table under a small lamp, against Mitsuba's light tracer. Changed: the index 1.45.
#[test]
fn caustics_agree_with_mitsuba() {
    check("caustics", BackendChoice::Cpu, 36, |scene| {
        change_material(scene, "glass ball", |m| m.ior = 1.45);
    });
}

/// Small things far away. Changed: the diffuse sphere is a shade darker.
fn far_agrees(backend: BackendChoice) {
    check("far", backend, 24, |scene| {
        change_material(scene, "diffuse sphere", |m| {
            m.base_color = [0.70, 0.70, 0.65, 1.0]
        });
    });
}

#[test]
fn far_agrees_with_mitsuba() {
    far_agrees(BackendChoice::Cpu);
}

/// The other scenes agree there too; on a software device they take minutes.
#[test]
fn far_agrees_with_mitsuba_on_the_gpu() {
    if mixray::gpu::harness::test_device().is_some() {
        far_agrees(BackendChoice::Gpu);
    }
}
