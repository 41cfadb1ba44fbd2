//! Invariant 7 in numbers: 99.9% of the pixels within 1e-4 relative + 1e-5, the averages within 1e-5, every outlier a flipped decision.

use std::sync::Arc;

use mixray::cpu::render::render;
use mixray::film::{Film, composite};
use mixray::gpu::{GpuBackend, GpuDevice, harness::test_device};
use mixray::renderer::{RayCounts, Renderer, RendererOptions, Watcher, Without};
use mixray::scene::Scene;
use mixray::work::WorkList;

use super::assets::write_assets;
use super::scenes::{Case, RAYS};
use crate::support::largest;

const RELATIVE: f64 = 1e-4;
const ABSOLUTE: f64 = 1e-5;
const AVERAGE: f64 = 1e-5;
const OUTLIERS: f64 = 1e-3;

/// The scene of a file's text, beside the files that it may name.
pub fn load(text: &str) -> Scene {
    let folder = tempfile::tempdir().expect("folder");
    write_assets(folder.path());
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("writes");
    mixray::scene::load(&path).unwrap_or_else(|error| panic!("{error}"))
}

pub fn renderer(scene: Scene, all_planes: bool) -> Renderer {
    renderer_without(scene, all_planes, Without::default())
}

pub fn renderer_without(scene: Scene, all_planes: bool, without: Without) -> Renderer {
    let options = RendererOptions {
        guides: all_planes,
        real_everywhere: all_planes,
        without,
        ..RendererOptions::default()
    };
    Renderer::new(scene, options, &Watcher::none()).unwrap_or_else(|error| panic!("{error}"))
}

/// What a pixel shows, plane by plane: the composite, the means, the guides.
pub fn planes(renderer: &Renderer, film: &Film) -> Vec<Vec<f64>> {
    let scene = renderer.scene();
    let picture = composite(film, scene.photo.as_ref(), scene.settings.composite);
    let mut out: Vec<Vec<f64>> = Vec::new();
    for (pixel, sums) in film.pixels.iter().enumerate() {
        let n = f64::from(sums.n.max(1));
        let mut values: Vec<f64> = picture.linear[pixel].map(f64::from).to_vec();
        for sum in [sums.m_im, sums.diff, sums.m_ir, sums.r_ir] {
            values.extend((sum.value() / n).to_array());
        }
        values.extend(sums.sq.value().to_array().map(|square| (square / n).sqrt()));
        values.push(f64::from(sums.m) / n);
        if let Some(guides) = film.guides.get(pixel) {
            let hits = f64::from(guides.hits.max(1));
            values.push(guides.depth() / hits);
            values.extend((guides.normal.value() / hits).to_array());
            values.extend((guides.albedo.value() / hits).to_array());
        }
        out.push(values);
    }
    out
}

/// Two films side by side.
#[derive(Debug)]
pub struct Difference {
    /// Pixels with a value that is too far off.
    pub outliers: Vec<usize>,
    pub pixels: usize,
    /// The largest relative difference of a plane's average. Outliers are left out: of so few samples a flipped one moves it further.
    /// A plane that averages to nothing counts by its absolute difference.
    pub average: f64,
}

impl Difference {
    pub fn between(a: &[Vec<f64>], b: &[Vec<f64>]) -> Self {
        let far = |a: &f64, b: &f64| !((a - b).abs() <= RELATIVE * a.abs() + ABSOLUTE);
        let outliers: Vec<usize> = (0..a.len())
            .filter(|&pixel| a[pixel].iter().zip(&b[pixel]).any(|(a, b)| far(a, b)))
            .collect();
        let sum = |film: &[Vec<f64>], plane: usize| -> f64 {
            let inlier = |pixel: &usize| outliers.binary_search(pixel).is_err();
            (0..film.len())
                .filter(inlier)
                .map(|pixel| film[pixel][plane])
                .sum()
        };
        let average = largest((0..a[0].len()).map(|plane| {
            let (x, y) = (sum(a, plane), sum(b, plane));
            (x - y) / x.abs().max(ABSOLUTE * a.len() as f64)
        }));
        Self {
            outliers,
            pixels: a.len(),
            average,
        }
    }

    pub fn agrees(&self) -> bool {
        self.outliers.len() as f64 <= OUTLIERS * self.pixels as f64 && self.average <= AVERAGE
    }
}

/// What a complete render takes: every pixel's samples up to `end`, and its real rays everywhere.
pub fn render_all(
    renderer: &Renderer,
    film: &mut Film,
    end: u32,
    mut render: impl FnMut(&mut Film, &WorkList),
) {
    let infos = &renderer.packed().pixels;
    let main = WorkList::main(infos, film, |_| end);
    render(film, &main);
    let real = WorkList::real(infos, film, true, |_| end);
    render(film, &real);
}

pub fn empty_film(renderer: &Renderer, first: u32, all_planes: bool) -> Film {
    let scene = renderer.packed();
    let frame = &scene.frame;
    let mut film = Film::new(frame.width, frame.height, first, all_planes);
    film.set_sample_factors(scene.pixels.iter().map(|pixel| pixel.sample_factor));
    film
}

/// The film of the CPU, and its rays.
pub fn cpu_film(renderer: &Renderer, all_planes: bool) -> (Film, RayCounts) {
    let mut film = empty_film(renderer, 0, all_planes);
    let mut rays = RayCounts::default();
    render_all(renderer, &mut film, RAYS, |film, work| {
        rays += render(renderer.packed(), film, work, &Watcher::none());
    });
    (film, rays)
}

/// The film of the GPU, and its rays.
pub fn gpu_film(
    backend: &mut GpuBackend,
    renderer: &Renderer,
    all_planes: bool,
) -> (Film, RayCounts) {
    let mut film = empty_film(renderer, 0, all_planes);
    let mut rays = RayCounts::default();
    render_all(renderer, &mut film, RAYS, |film, work| {
        render_on(backend, film, work, &mut rays);
    });
    (film, rays)
}

pub fn render_on(backend: &mut GpuBackend, film: &mut Film, work: &WorkList, rays: &mut RayCounts) {
    backend
        .render(film, work, rays, &Watcher::none())
        .unwrap_or_else(|error| panic!("{error}"));
}

pub fn backend_for(gpu: &Arc<GpuDevice>, renderer: &Renderer) -> GpuBackend {
    GpuBackend::new(Arc::clone(gpu), renderer.packed(), true)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Renders the case on both backends, and two perturbed ones that must be told apart.
pub fn assert_agreement(case: &Case) {
    let Some(gpu) = test_device() else { return };
    let scene = load(&case.text());
    assert_scene_agrees(gpu, case.name, &scene, case.all_planes, Without::default());
}

/// The rays of the CPU.
pub fn assert_scene_agrees(
    gpu: &Arc<GpuDevice>,
    name: &str,
    scene: &Scene,
    all_planes: bool,
    without: Without,
) -> RayCounts {
    let built = renderer_without(scene.clone(), all_planes, without);
    let (film, cpu_rays) = cpu_film(&built, all_planes);
    let expected = planes(&built, &film);
    let mut backend = backend_for(gpu, &built);
    let (film, gpu_rays) = gpu_film(&mut backend, &built, all_planes);
    let found = planes(&built, &film);
    assert!(found.iter().flatten().all(|x| !x.is_nan()), "{name}");
    assert_eq!(film.non_finite_samples(), 0, "{name}");
    let lit = |film: &[Vec<f64>]| film.iter().flatten().any(|&x| x != 0.0);
    assert!(lit(&expected), "{name} is black");

    let difference = Difference::between(&expected, &found);
    eprintln!(
        "{name}: {} of {} pixels differ, the averages by {:.1e}; rays {cpu_rays:?}, {gpu_rays:?}",
        difference.outliers.len(),
        difference.pixels,
        difference.average
    );
    for &pixel in &difference.outliers {
        assert_flipped(name, &mut backend, &built, pixel);
    }
    assert!(difference.agrees(), "{name}: {difference:?}");
    let (cpu_total, gpu_total) = (cpu_rays.traced() as f64, gpu_rays.traced() as f64);
    assert!((gpu_total / cpu_total - 1.0).abs() < 1e-3, "{name}");
    assert_eq!(cpu_rays.primary, gpu_rays.primary, "{name}");

    // Negative controls: other random numbers, and materials 1% brighter.
    let mut seeded = scene.clone();
    seeded.settings.seed += 1;
    let mut brighter = scene.clone();
    brighten(&mut brighter);
    for (what, scene) in [("seed", seeded), ("material", brighter)] {
        let other = renderer_without(scene, all_planes, without);
        backend
            .set_scene(other.packed())
            .unwrap_or_else(|error| panic!("{error}"));
        let (film, _) = gpu_film(&mut backend, &other, all_planes);
        let difference = Difference::between(&expected, &planes(&other, &film));
        let share = difference.outliers.len() as f64 / difference.pixels as f64;
        assert!(
            share > 0.02 && !difference.agrees(),
            "{name}, {what}: {share}"
        );
    }
    cpu_rays
}

/// Every colour 1% brighter (or darker, where it is white).
fn brighten(scene: &mut Scene) {
    for object in &mut scene.objects {
        for instance in &mut object.instances {
            let material = Arc::make_mut(&mut instance.material);
            for c in &mut material.base_color[..3] {
                *c *= if *c > 0.99 { 0.99 } else { 1.01 };
            }
            material.emissive = material.emissive.map(|c| c * 1.01);
        }
    }
}

/// A sample that took another path is one of its pixel's few: a systematic difference would be in most of them.
fn assert_flipped(name: &str, backend: &mut GpuBackend, renderer: &Renderer, pixel: usize) {
    let scene = renderer.packed();
    let mut flipped = Vec::new();
    for index in 0..RAYS {
        let empty = empty_film(renderer, index, false);
        let [mut on_cpu, mut on_gpu] = [empty.clone(), empty];
        render_all(renderer, &mut on_cpu, index + 1, |film, work| {
            render(scene, film, work, &Watcher::none());
        });
        render_all(renderer, &mut on_gpu, index + 1, |film, work| {
            render_on(backend, film, work, &mut RayCounts::default());
        });
        let (a, b) = (planes(renderer, &on_cpu), planes(renderer, &on_gpu));
        if Difference::between(&a[pixel..=pixel], &b[pixel..=pixel])
            .outliers
            .len()
            == 1
        {
            let pairs = a[pixel].iter().zip(&b[pixel]).enumerate();
            let worst: Vec<String> = pairs
                .filter(|(_, (a, b))| (*a - *b).abs() > RELATIVE * a.abs() + ABSOLUTE)
                .map(|(plane, (a, b))| format!("[{plane}] {a} {b}"))
                .collect();
            eprintln!(
                "{name}: pixel {pixel}, sample {index}: {}",
                worst.join(", ")
            );
            flipped.push(index);
        }
    }
    assert!(
        flipped.len() as u32 <= RAYS / 2,
        "{name}: pixel {pixel} differs in samples {flipped:?}"
    );
}
