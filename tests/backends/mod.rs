//! The two backends draw the same random numbers and do the same arithmetic: same samples, same film, up to rounding (invariant 7).

mod agreement;
mod assets;
mod device;
mod guide;
mod photons;
mod scenes;

use std::sync::Arc;

use mixray::gpu::{Composer, Features, GpuBackend, SceneBuffers, SceneParts, harness::test_device};
use mixray::renderer::{ErrorGoal, Renderer, Skip, Watcher, Without};
use mixray::scene::BackendChoice;

use agreement::{
    Difference, assert_agreement, assert_scene_agrees, backend_for, gpu_film, load, planes,
    renderer,
};
use scenes::{CASES, Case, case};

use crate::support::shared_data;

macro_rules! each_case {
    ($($name:ident,)*) => {
        $(#[test]
        fn $name() {
            assert_agreement(case(stringify!($name)));
        })*

        const TESTED: &[&str] = &[$(stringify!($name),)*];
    };
}

each_case! {
    matt_under_a_flat_sky,
    matt_with_an_occluder_under_a_quad,
    textures_and_normal_maps_in_the_sun,
    alpha_under_lights_without_size,
    smooth_glass_in_the_sun,
    rough_and_thin_glass,
    windows_and_fog,
    clearcoat,
    virtual_lights,
    glowing_real_wall,
    albedo_from_a_distorted_photograph,
    mirrors_and_gloss,
    paper_plain,
    paper_with_everything,
    camera_in_motion,
    fisheye,
    a_rational_lens_wide_open,
    direct_with_everything,
}

/// What the kernels of a case hold.
fn features_of(case: &Case) -> Features {
    Features::for_scene(renderer(load(&case.text()), false).packed())
}

/// What the scenes between them use, and can do without.
#[test]
fn the_table_is_complete() {
    let names: Vec<&str> = CASES.iter().map(|case| case.name).collect();
    assert_eq!(names, TESTED);
    let features: Vec<Features> = CASES.iter().map(features_of).collect();
    for (at, (flag, _)) in Features::default().flags().into_iter().enumerate() {
        for wanted in [true, false] {
            let found = features.iter().any(|f| f.flags()[at].1 == wanted);
            // What photons found is known once a render has begun: backends/guide.rs.
            let found = found || (flag == "guide" && wanted);
            // Deep trees: accel/tests.
            let found = found || (flag == "shallow_trees" && !wanted);
            assert!(found, "no scene has {flag} = {wanted}");
        }
    }
    let text: String = CASES.iter().map(Case::text).collect();
    for part in [
        "jittered",
        "cmj",
        "\"square\"",
        "aperture = 5",
        "\"quotient\"",
        "\"paper\"",
        "from-photo",
        "distortion",
        "rotation_deg = 35",
        "thin_walled",
        "unlit",
        "attenuation_color",
        "max_bounces = 1",
        "max_bounces = 2",
        "max_bounces = 6",
        "metallic = 1.0, roughness = 0.0",
        "self_shadow_bias_m",
        "exposure_ev",
        "f_number",
        "\"spot\"",
        "\"directional\"",
        "side = \"virtual\"",
    ] {
        assert!(text.contains(part), "no scene has {part}");
    }
}

/// The savings of the estimator switched off, on matt and on glossy ground.
#[test]
fn without_its_savings() {
    let Some(gpu) = test_device() else { return };
    let all = [Skip::VirtualFirst, Skip::Cones, Skip::LastVertex];
    for (name, without) in [
        ("matt_with_an_occluder_under_a_quad", &all[..]),
        ("mirrors_and_gloss", &all[..2]),
    ] {
        let case = case(name);
        let scene = load(&case.text());
        let off: Without = without.iter().copied().collect();
        let rays = assert_scene_agrees(gpu, name, &scene, case.all_planes, off);
        // Negative control: the savings did something.
        let (_, usual) = agreement::cpu_film(&renderer(scene, case.all_planes), case.all_planes);
        assert_ne!(rays, usual, "{name} {without:?}");
    }
}

/// To an error both backends take the same samples and state the same error.
#[test]
fn adaptive_renders() {
    if test_device().is_none() {
        return;
    }
    let case = case("matt_with_an_occluder_under_a_quad");
    let to_error = |backend: BackendChoice, standard_error: f64| {
        let mut scene = load(&case.text());
        scene.settings.backend = backend;
        let mut renderer = renderer(scene, false);
        let goal = ErrorGoal {
            standard_error: Some(standard_error),
            noise: None,
            max_rays_per_pixel: 1024,
        };
        (renderer.render_to_error(&goal, &Watcher::none())).expect("it renders");
        renderer
    };
    let goal = 0.002;
    let (cpu, gpu) = (
        to_error(BackendChoice::Cpu, goal),
        to_error(BackendChoice::Gpu, goal),
    );
    assert_eq!((cpu.backend_name(), gpu.backend_name()), ("cpu", "gpu"));
    let samples = |r: &Renderer| r.film().pixels.iter().map(|p| p.n).collect::<Vec<_>>();
    assert!(samples(&cpu) == samples(&gpu));
    let (least, most) = (
        samples(&cpu).into_iter().min(),
        samples(&cpu).into_iter().max(),
    );
    assert!(most > least, "some tiles take more than others: {least:?}");
    let expected = planes(&cpu, cpu.film());
    let difference = Difference::between(&expected, &planes(&gpu, gpu.film()));
    let stated = |r: &Renderer| r.stated().expect("it has a goal").rms();
    eprintln!("{difference:?}; stated {} {}", stated(&cpu), stated(&gpu));
    assert!(difference.agrees(), "{difference:?}");
    assert!((stated(&gpu) / stated(&cpu) - 1.0).abs() < 1e-3);
    let control = to_error(BackendChoice::Cpu, 0.5 * goal);
    assert!(samples(&cpu) != samples(&control), "control: another goal");
    assert!((stated(&control) / stated(&cpu) - 1.0).abs() > 0.1);
}

/// Kernels that hold more than the scene needs give the same film up to rounding.
#[test]
fn specialisation_changes_no_more_than_rounding() {
    let Some(gpu) = test_device() else { return };
    let case = case("matt_with_an_occluder_under_a_quad");
    let built = renderer(load(&case.text()), case.all_planes);
    let film = |backend: &mut GpuBackend| gpu_film(backend, &built, case.all_planes);
    let (special, special_rays) = film(&mut backend_for(gpu, &built));
    let more = features_of(scenes::case("windows_and_fog"));
    let needed = Features::for_scene(built.packed());
    let pairs = || needed.flags().into_iter().zip(more.flags());
    assert!(pairs().all(|((_, needed), (_, held))| held || !needed));
    assert!(pairs().filter(|(needed, held)| needed != held).count() > 5);
    let buffers = SceneBuffers::from_parts(gpu, &SceneParts::from(built.packed()))
        .unwrap_or_else(|error| panic!("{error}"));
    let mut general =
        GpuBackend::with_modules(Arc::clone(gpu), &Composer::default(), &more, buffers)
            .unwrap_or_else(|error| panic!("{error}"));
    let (general, general_rays) = film(&mut general);
    let expected = planes(&built, &special);
    let difference = Difference::between(&expected, &planes(&built, &general));
    eprintln!("{difference:?}; rays {special_rays:?}, {general_rays:?}");
    assert!(difference.agrees(), "{difference:?}");
    let mut other = load(&case.text());
    other.settings.seed += 1;
    let other = renderer(other, case.all_planes);
    let (film, _) = gpu_film(&mut backend_for(gpu, &other), &other, case.all_planes);
    let control = Difference::between(&expected, &planes(&other, &film));
    assert!(!control.agrees(), "control: another seed shows");
}

/// Models as they are found in the wild, under a studio map.
#[test]
fn models_of_others() {
    let Some(gpu) = test_device() else { return };
    let (Some(models), Some(maps)) = (shared_data("gltf_models"), shared_data("hdr_environments"))
    else {
        return;
    };
    let mirrors = case("mirrors_and_gloss").text().replace(
        "sky.hdr",
        &maps.join("brown_photostudio_02_1k.hdr").to_string_lossy(),
    );
    // Their textures together are more than a software device binds.
    let helmet = [
        (
            "DamagedHelmet.glb",
            "scale = 0.3\ntranslation = [-0.3, 0.35, 0.4]",
        ),
        (
            "ClearcoatTest.glb",
            "scale = 0.04\ntranslation = [-0.5, 0.3, -0.3]",
        ),
    ];
    let dish = [
        (
            "IridescentDishWithOlives.glb",
            "scale = 2.0\ntranslation = [0.35, 0.1, 0.6]",
        ),
        (
            "TextureTransformTest/TextureTransformTest.gltf",
            "scale = 0.15\ntranslation = [0, 0.8, 0]",
        ),
    ];
    for pair in [helmet, dish] {
        let objects = pair.map(|(model, place)| {
            let path = models.join(model);
            format!(
                "\n[[virtual]]\nmesh = {:?}\n{place}\n",
                path.to_string_lossy()
            )
        });
        let text = mirrors.clone() + &objects.concat();
        assert_scene_agrees(gpu, pair[0].0, &load(&text), true, Without::default());
    }
}
