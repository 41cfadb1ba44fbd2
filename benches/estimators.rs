//! `direct` against `paper` on the CPU at equal error: the same scene, materials and backend, `paper` with its jittered sampler.
//!
//! Both render at a list of rays per pixel; the error is the RMSE of the composite against a reference rendered once (kept under `target/`), the time
//! is that of one thread's processor, so that what else the machine does hardly matters. The two take turns. The figure is the time that
//! `direct` needs for the error that `paper` has, read off the straight line through its points in log error over log time.
//!
//!     cargo bench --bench estimators [-- SCENE.toml ...]
//!
//! writes its table to `docs/estimators.md` if it is given no scenes.

#[path = "support/cpu_time.rs"]
mod cpu_time;
#[path = "support/half_size.rs"]
mod half_size;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use cpu_time::thread_cpu_secs;
use mixray::film::{Picture, PixelKind};
use mixray::renderer::{Budget, RayTotals, Renderer, RendererOptions};
use mixray::scene::{BackendChoice, Estimator, SamplerKind, Scene};

const SCENES: [&str; 3] = [
    "scenes/far/scene.toml",
    "scenes/room/scene.toml",
    "scenes/sunny/scene.toml",
];
/// Rays per pixel at which each estimator is timed.
const DIRECT_RAYS: [u32; 4] = [4, 9, 16, 49];
const PAPER_RAYS: [u32; 4] = [4, 9, 16, 49];
/// Each is rendered this often, with another seed; squared errors are averaged, and the fastest time counts.
const REPEATS: u32 = 2;
const REFERENCE_RAYS: u32 = 1024;
const REFERENCE_SEED: u32 = 1_000_003;

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let given: Vec<PathBuf> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .map(PathBuf::from)
        .collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scenes = if given.is_empty() {
        SCENES.iter().map(|s| root.join(s)).collect()
    } else {
        given.clone()
    };
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut rows = String::new();
    for path in scenes {
        let scene = half_size::of(mixray::scene::load(&path)?);
        let reference = reference(&scene, &root.join("target/estimators"))?;
        let result = one_thread.install(|| compare(&scene, &reference))?;
        println!("{}", result.details);
        rows += &result.row;
    }
    let table = format!("{HEADER}{rows}");
    println!("{table}");
    if given.is_empty() {
        let page = include_str!("support/estimators_page.md");
        std::fs::write(
            root.join("docs/estimators.md"),
            page.replace("TABLE\n", &table),
        )?;
    }
    Ok(())
}

const HEADER: &str = "| scene | virtual pixels | RMSE of paper at 49 rays | CPU s paper | CPU s direct, equal RMSE | time paper / direct | Mrays/s paper | Mrays/s direct |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n";

/// One estimator at one number of rays per pixel.
struct Point {
    cpu_secs: f64,
    /// Mean squared error of a channel of a pixel.
    mse: f64,
    /// Shares of the squared error by kind of pixel: background, edge, virtual.
    shares: [f64; 3],
    rays: RayTotals,
}

struct Comparison {
    details: String,
    row: String,
}

fn compare(scene: &Scene, reference: &Picture) -> Result<Comparison, Failure> {
    let mut kinds = Vec::new();
    let mut direct = Vec::new();
    let mut paper = Vec::new();
    for (d, p) in DIRECT_RAYS.into_iter().zip(PAPER_RAYS) {
        direct.push(measure(scene, Estimator::Direct, d, reference, &mut kinds)?);
        paper.push(measure(scene, Estimator::Paper, p, reference, &mut kinds)?);
    }
    let mut details = format!("{}\n", scene.name);
    for (name, rays, points) in [
        ("direct", DIRECT_RAYS, &direct),
        ("paper", PAPER_RAYS, &paper),
    ] {
        for (n, p) in rays.into_iter().zip(points) {
            let [b, e, v] = p.shares.map(|s| 100.0 * s);
            let r = &p.rays;
            writeln!(
                details,
                "  {name:6} {n:3} rays: {:7.3} CPU s, RMSE {:.5}, 1/(MSE s) {:9.1}, {:5.2} Mrays/s; error from background {b:.0}%, edge {e:.0}%, virtual {v:.0}%; \
                 rays k: mixed {} real {} mixed shadow {} real shadow {}",
                p.cpu_secs,
                p.mse.sqrt(),
                1.0 / (p.mse * p.cpu_secs),
                mrays_per_sec(p),
                r.mixed / 1000,
                r.real / 1000,
                r.mixed_shadow / 1000,
                r.real_shadow / 1000,
            )?;
        }
    }
    let last = &paper[paper.len() - 1];
    let direct_secs = secs_at(&direct, last.mse);
    let virtual_share = kinds
        .iter()
        .filter(|&&k| k != PixelKind::Background && k != PixelKind::Skipped)
        .count() as f64
        / kinds.len() as f64;
    let row = format!(
        "| {} | {:.1}% | {:.5} | {:.2} | {:.3} | {:.1} | {:.2} | {:.2} |\n",
        scene.name,
        100.0 * virtual_share,
        last.mse.sqrt(),
        last.cpu_secs,
        direct_secs,
        last.cpu_secs / direct_secs,
        mrays_per_sec(last),
        mrays_per_sec(&direct[direct.len() - 1]),
    );
    Ok(Comparison { details, row })
}

fn mrays_per_sec(p: &Point) -> f64 {
    p.rays.traced() as f64 / p.cpu_secs * 1e-6
}

/// Time at which the least-squares line through the points, in log MSE over log time, reaches `mse`.
fn secs_at(points: &[Point], mse: f64) -> f64 {
    let n = points.len() as f64;
    let x: Vec<f64> = points.iter().map(|p| p.mse.ln()).collect();
    let y: Vec<f64> = points.iter().map(|p| p.cpu_secs.ln()).collect();
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let sxy: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    let sxx: f64 = x.iter().map(|x| (x - mx) * (x - mx)).sum();
    (my + sxy / sxx * (mse.ln() - mx)).exp()
}

fn measure(
    scene: &Scene,
    estimator: Estimator,
    rays_per_pixel: u32,
    reference: &Picture,
    kinds: &mut Vec<PixelKind>,
) -> Result<Point, Failure> {
    let mut point = Point {
        cpu_secs: f64::INFINITY,
        mse: 0.0,
        shares: [0.0; 3],
        rays: RayTotals::default(),
    };
    for seed in 0..REPEATS {
        let mut scene = scene.clone();
        scene.settings.estimator = estimator;
        scene.settings.sampler = match estimator {
            Estimator::Paper => SamplerKind::Jittered,
            Estimator::Direct => SamplerKind::Sobol,
        };
        scene.settings.rays_per_pixel = rays_per_pixel;
        scene.settings.seed = seed;
        let lens = scene.lens;
        let mut renderer = Renderer::new(scene, RendererOptions::default())?;
        let start = thread_cpu_secs();
        if estimator == Estimator::Direct {
            // The look at the picture is part of what direct costs.
            renderer.set_lens(lens)?;
        }
        renderer.advance(Budget::Complete, &|| false, &mut |_| ())?;
        point.cpu_secs = point.cpu_secs.min(thread_cpu_secs() - start);
        point.rays = renderer.rays();
        let film = renderer.film();
        if kinds.is_empty() && rays_per_pixel >= 16 {
            *kinds = (0..film.pixels.len()).map(|i| film.kind(i)).collect();
        }
        let picture = renderer.picture();
        let mut by_kind = [0.0; 3];
        for (i, (a, b)) in picture.linear.iter().zip(&reference.linear).enumerate() {
            let squared: f64 = (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum();
            by_kind[match film.kind(i) {
                PixelKind::Background | PixelKind::Skipped => 0,
                PixelKind::Edge => 1,
                PixelKind::Virtual => 2,
            }] += squared;
        }
        let sum: f64 = by_kind.iter().sum();
        let repeats = f64::from(REPEATS);
        point.mse += sum / (3 * picture.linear.len()) as f64 / repeats;
        for (share, part) in point.shares.iter_mut().zip(by_kind) {
            *share += part / sum / repeats;
        }
    }
    Ok(point)
}

/// The converged picture, from the file of an earlier run if there is one.
fn reference(scene: &Scene, folder: &Path) -> Result<Picture, Failure> {
    std::fs::create_dir_all(folder)?;
    let file = folder.join(format!("{}-{REFERENCE_RAYS}.bin", scene.name));
    let mut scene = scene.clone();
    scene.settings.estimator = Estimator::Direct;
    scene.settings.backend = BackendChoice::Cpu;
    scene.settings.rays_per_pixel = REFERENCE_RAYS;
    scene.settings.seed = REFERENCE_SEED;
    let (width, height) = (scene.camera.width, scene.camera.height);
    if let Ok(bytes) = std::fs::read(&file) {
        let linear: Vec<[f32; 3]> = bytemuck::pod_collect_to_vec(&bytes);
        if linear.len() == width as usize * height as usize {
            return Ok(Picture {
                width,
                height,
                linear,
            });
        }
    }
    eprintln!(
        "rendering the reference of {} at {REFERENCE_RAYS} rays per pixel",
        scene.name
    );
    let mut renderer = Renderer::new(scene, RendererOptions::default())?;
    renderer.advance(Budget::Complete, &|| false, &mut |_| ())?;
    let picture = renderer.picture();
    std::fs::write(&file, bytemuck::cast_slice::<_, u8>(&picture.linear))?;
    Ok(picture)
}
