//! The scenes that come with the program are what they say: they load, cover what the README states, and their photographs show
//! their proxies.

use std::path::{Path, PathBuf};

use mixray::renderer::{Budget, Renderer, RendererOptions, Watcher};
use mixray::scene::{
    self, AntialiasSettings, BackendChoice, CartoonSettings, Exposure, NoiseFit, NoiseProfile,
    NoiseSettings, Overrides, Scene, Side,
};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenes")
        .join(name)
        .join("scene.toml")
}

fn load(name: &str) -> Scene {
    let mut scene = scene::load(&file(name)).unwrap();
    scene.settings.apply(&Overrides {
        rays_per_pixel: Some(1),
        backend: Some(BackendChoice::Cpu),
        ..Overrides::default()
    });
    scene
}

fn render(scene: Scene) -> Renderer {
    let mut renderer = Renderer::new(
        scene,
        RendererOptions {
            guides: true,
            real_everywhere: true,
            ..RendererOptions::default()
        },
        &Watcher::none(),
    )
    .unwrap();
    renderer
        .advance(Budget::Complete, &Watcher::none())
        .unwrap();
    renderer
}

#[test]
fn every_scene_loads_without_warnings() {
    for name in ["demo", "room", "far", "sunny"] {
        let scene = load(name);
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        assert_eq!(scene.name, name);
    }
}

#[test]
fn the_readmes_scene_file_loads() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let (_, after) = readme.split_once("```toml\n").unwrap();
    let (text, after) = after.split_once("```").unwrap();
    let (_, after) = after.split_once("```toml\n").unwrap();
    let (cartoon, _) = after.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let demo = root.join("scenes/demo");
    for (from, to) in [
        ("photo.png", "photo.png"),
        ("env.exr", "env.exr"),
        ("room.glb", "desk.glb"),
    ] {
        std::fs::copy(demo.join(from), folder.path().join(to)).unwrap();
    }
    let noise = NoiseProfile::from_fit(NoiseFit { a: 0.02, b: 0.5 }, 4);
    let noise_path = folder.path().join("noise.toml");
    std::fs::write(&noise_path, noise.to_toml()).unwrap();
    let noise = NoiseProfile::read(&noise_path).unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    let scene = scene::load(&path).unwrap();
    assert_eq!((scene.objects.len(), scene.lights.len()), (2, 1));
    // What the README shows of the stages are their defaults.
    assert_eq!(scene.stages.noise, Some(NoiseSettings::new(noise)));
    assert_eq!(scene.stages.antialias, Some(AntialiasSettings::default()));
    let camera = "[camera]\nwidth = 4\nheight = 3\nvertical_fov_deg = 45\n";
    std::fs::write(&path, format!("{camera}{cartoon}")).unwrap();
    let stages = scene::load(&path).unwrap().stages;
    assert_eq!(stages.cartoon, Some(CartoonSettings::default()));
}

#[test]
fn the_demos_proxy_takes_its_colours_from_the_photograph() {
    let scene = load("demo");
    let mut real = scene.objects.iter().filter(|o| o.side == Side::Real);
    assert!(real.all(|object| object.albedo_from_photo));
}

/// The fraction of the primary rays that meet something virtual.
#[test]
fn scenes_cover_what_the_readme_says() {
    for (name, least, most) in [("room", 0.12, 0.15), ("far", 0.005, 0.02)] {
        let renderer = render(load(name));
        let mask = renderer.planes().mask;
        let coverage = mask.iter().sum::<f32>() / mask.len() as f32;
        assert!((least..most).contains(&coverage), "{name}: {coverage}");
    }
}

/// Mean radiance of the proxy over that of the photograph, minus 1, where nothing virtual is in front and the photograph is
/// not clipped (as it is where it shows a lamp).
fn proxy_error(name: &str, exposure_ev: f64) -> f64 {
    let mut scene = load(name);
    scene.settings.exposure = Exposure::Ev(exposure_ev);
    let renderer = render(scene);
    let planes = renderer.planes();
    let photo = renderer.scene().photo.as_ref().unwrap();
    let seen: Vec<usize> = (0..planes.mask.len())
        .filter(|pixel| planes.mask[*pixel] == 0.0)
        .filter(|pixel| photo.linear[*pixel].iter().all(|channel| *channel < 1.0))
        .collect();
    let sum = |image: &[[f32; 3]]| {
        let channels = seen.iter().flat_map(|pixel| image[*pixel]);
        channels.map(f64::from).sum::<f64>()
    };
    sum(&planes.real) / sum(&photo.linear) - 1.0
}

#[test]
fn photographs_show_their_proxies() {
    for name in ["room", "far", "sunny"] {
        let error = proxy_error(name, 0.0);
        assert!(error.abs() < 0.02, "{name}: {error}");
    }
}

/// Negative control: light that is 5% too strong is noticed.
#[test]
fn a_proxy_in_wrong_light_is_noticed() {
    let error = proxy_error("far", 1.05_f64.log2());
    assert!(error.abs() > 0.03, "{error}");
}
