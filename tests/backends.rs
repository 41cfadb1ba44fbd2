//! The two backends draw the same random numbers and do the same arithmetic: same samples, same film, up to rounding.

use std::sync::Arc;

use mixray::film::Film;
use mixray::gpu::{GpuBackend, GpuDevice, harness::test_device};
use mixray::renderer::{Budget, Cancel, Pass, RayTotals, Renderer, RendererOptions};

const CAMERA: &str = r#"
[camera]
width = 64
height = 48
vertical_fov_deg = 40
position = [0, 0.5, 2.2]
look_at = [0, 0.25, 0]
up = [0, 1, 0]
"#;

const WORLD: &str = r#"
[[real]]
shape = "quad"
corner = [-3, 0, -3]
edge_u = [0, 0, 6]
edge_v = [6, 0, 0]
material = { base_color = [0.6, 0.5, 0.4], roughness = 1.0, specular = 0.0 }

[[real]]
shape = "box"
size = [0.3, 0.5, 0.3]
translation = [-0.6, 0.25, -0.4]
material = { base_color = [0.3, 0.5, 0.7], roughness = 0.4 }

[[virtual]]
shape = "sphere"
segments = 24
scale = 0.3
translation = [0.1, 0.3, 0]
material = { base_color = [0.9, 0.7, 0.4], metallic = 1.0, roughness = 0.3 }
"#;

const GLASS: &str = r#"
[[virtual]]
shape = "sphere"
segments = 24
scale = 0.2
translation = [0.6, 0.2, 0.3]
material = { base_color = [1, 1, 1], transmission = 1.0, roughness = 0.0, ior = 1.5 }
"#;

const LIGHTS: &str = r#"
[[light]]
kind = "quad"
corner = [-1, 2.5, -1]
edge_u = [1, 0, 0]
edge_v = [0, 0, 1]
radiance = [6, 6, 6]
side = "real"

[[light]]
kind = "point"
position = [1.5, 1.5, 1]
intensity = [2, 2, 2.5]
side = "real"
"#;

fn renderer(settings: &str, parts: &[&str]) -> Renderer {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("scene.toml");
    let text = format!(
        "{CAMERA}{}\n[render]\nrays_per_pixel = 8\nbackend = \"cpu\"\n{settings}\n",
        parts.concat()
    );
    std::fs::write(&path, text).expect("writes");
    let scene = mixray::scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
    let options = RendererOptions { all_planes: true };
    Renderer::new(scene, options).unwrap_or_else(|error| panic!("{error}"))
}

/// Every mean of every pixel.
fn means(film: &Film) -> Vec<f64> {
    let mut out = Vec::new();
    for (sums, guides) in film.pixels.iter().zip(&film.guides) {
        let n = f64::from(sums.n.max(1));
        for sum in [
            sums.m_im,
            sums.diff,
            sums.m_ir,
            sums.r_ir,
            guides.normal,
            guides.albedo,
        ] {
            out.extend((sum.value() / n).to_array());
        }
        out.push(f64::from(sums.m) / n);
    }
    out
}

/// The film of the GPU, and its rays.
fn gpu_film(gpu: &Arc<GpuDevice>, renderer: &Renderer) -> (Film, RayTotals) {
    let scene = renderer.packed();
    let mut backend =
        GpuBackend::new(Arc::clone(gpu), scene).unwrap_or_else(|error| panic!("{error}"));
    let mut film = Film::new(scene.frame.width, scene.frame.height, 0, true);
    let mut rays = RayTotals::default();
    let cancel = Cancel::new(&|| false, None);
    for pass in [Pass::Main { end: 8 }, Pass::Real { everywhere: true }] {
        backend
            .render_pass(scene, &mut film, pass, &cancel, &mut rays)
            .unwrap_or_else(|error| panic!("{error}"));
    }
    (film, rays)
}

/// Share of the values that differ, and by how much the averages do.
fn difference(a: &[f64], b: &[f64]) -> (f64, f64) {
    let far = a
        .iter()
        .zip(b)
        .filter(|(a, b)| (*a - *b).abs() > 1e-4 * a.abs() + 1e-5);
    let sum = |values: &[f64]| values.iter().sum::<f64>();
    (
        far.count() as f64 / a.len() as f64,
        (sum(b) / sum(a) - 1.0).abs(),
    )
}

fn backends_agree(settings: &str, parts: &[&str]) {
    let Some(gpu) = test_device() else { return };
    let mut cpu = renderer(settings, parts);
    cpu.advance(Budget::Complete, &|| false, &mut |_| ())
        .expect("renders");
    let expected = means(cpu.film());

    let (film, rays) = gpu_film(gpu, &renderer(settings, parts));
    let found = means(&film);
    assert!(found.iter().all(|x| x.is_finite()));
    let (far, average) = difference(&expected, &found);
    eprintln!("{far} of the values differ, the averages by {average:.1e}");
    assert!(far <= 1e-3 && average <= 1e-5, "{far}, {average}");
    let (traced, expected_rays) = (rays.traced() as f64, cpu.rays().traced() as f64);
    assert!(
        (traced / expected_rays - 1.0).abs() < 1e-3,
        "{rays:?}, {:?}",
        cpu.rays()
    );

    // Negative control: other random numbers are told apart.
    let (other, _) = gpu_film(gpu, &renderer(&format!("{settings}\nseed = 1"), parts));
    let (far, _) = difference(&expected, &means(&other));
    assert!(far > 0.05, "{far}");
}

#[test]
fn direct_light() {
    backends_agree(
        "max_bounces = 1",
        &[WORLD, LIGHTS, "[environment]\nradiance = [0.5, 0.6, 0.8]\n"],
    );
}

#[test]
fn a_lens_and_glass() {
    let lens = "[lens]\naperture_radius_m = 0.03\nfocus_distance_m = 2.0\n[environment]\nradiance = [0.5, 0.6, 0.8]\n";
    backends_agree("max_bounces = 4", &[WORLD, GLASS, LIGHTS, lens]);
}

#[test]
fn the_paper_estimator() {
    backends_agree(
        "max_bounces = 3\nestimator = \"paper\"",
        &[WORLD, GLASS, LIGHTS],
    );
}
