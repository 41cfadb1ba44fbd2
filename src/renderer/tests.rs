use std::sync::{Arc, Mutex};

use super::*;
use crate::pack::{test_mesh, test_scene};
use crate::scene::{
    BackendChoice, EncodedPhoto, Environment, EnvironmentMap, Exposure, Light, LightKind, Material,
    Photo, Side,
};

#[test]
fn no_device_is_opened_until_there_is_something_to_trace() {
    let mut scene = test_scene();
    scene.settings.backend = BackendChoice::Auto;
    let mut renderer =
        Renderer::new(scene, RendererOptions::default(), &Watcher::none()).expect("fits");
    assert!(matches!(renderer.core.backend, Backend::Undecided));
    (renderer.advance(Budget::Complete, &Watcher::none())).expect("nothing to do");
    assert_eq!(renderer.rays(), RayCounts::default());
    let lamp = Light {
        kind: LightKind::Quad {
            corner: [-1.0, -1.0, -2.0],
            edge_u: [2.0, 0.0, 0.0],
            edge_v: [0.0, 2.0, 0.0],
            radiance: [1.0; 3],
        },
        side: Side::Virtual,
    };
    renderer
        .set_lights(vec![lamp], &Watcher::none())
        .expect("fits");
    assert!(!matches!(renderer.core.backend, Backend::Undecided));
}

/// A floor and a smaller square above it, before a photograph.
fn scene_with_a_photo(albedo_from_photo: bool) -> Scene {
    let square = |side, half: f32, depth: f32| {
        let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
        let corners = corners.map(|[x, y]| [x, y, -depth]);
        let triangles = [[0, 1, 2], [0, 2, 3]];
        test_mesh(side, &corners, &triangles, Material::default())
    };
    let mut scene = test_scene();
    let mut floor = square(Side::Real, 2.0, 2.0);
    floor.albedo_from_photo = albedo_from_photo;
    scene.objects = vec![floor, square(Side::Virtual, 0.2, 1.0)];
    scene.environment = Some(Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    });
    scene.photo = Some(Photo {
        width: 4,
        height: 3,
        linear: vec![[0.5; 3]; 12],
        encoded: EncodedPhoto::Linear,
        tags: Default::default(),
    });
    scene
}

fn heard_of(scene: Scene, goal: Option<&ErrorGoal>) -> Vec<Progress> {
    let heard = Mutex::new(Vec::new());
    let hear = |progress: &Progress| heard.lock().expect("whole").push(*progress);
    let watcher = Watcher::none().heard_by(&hear);
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &watcher).expect("fits");
    match goal {
        Some(goal) => renderer.render_to_error(goal, &watcher).expect("renders"),
        None => (renderer.advance(Budget::Complete, &watcher)).expect("renders"),
    }
    heard.into_inner().expect("whole")
}

#[test]
fn a_watcher_hears_every_phase_from_its_beginning_to_its_end() {
    let goal = ErrorGoal {
        standard_error: Some(0.01),
        noise: None,
        max_rays_per_pixel: 64,
    };
    let phases = |heard: &[Progress]| {
        let mut phases: Vec<Phase> = heard.iter().map(|progress| progress.phase).collect();
        phases.dedup();
        phases
    };
    let with_albedo = [
        Phase::Trees,
        Phase::Albedo,
        Phase::LookingAhead,
        Phase::Rendering,
    ];
    for goal in [None, Some(&goal)] {
        let heard = heard_of(scene_with_a_photo(true), goal);
        assert_eq!(phases(&heard), with_albedo);
        for of_phase in heard.chunk_by(|a, b| a.phase == b.phase) {
            let shares: Vec<f64> = of_phase.iter().map(|p| p.share_done).collect();
            assert_eq!((shares[0], shares.last()), (0.0, Some(&1.0)), "{shares:?}");
            // Tiles above the goal make what is expected grow.
            assert!(goal.is_some() || shares.is_sorted(), "{shares:?}");
        }
        let last = heard.last().expect("something was heard");
        assert_eq!(last.samples, last.samples_total);
        assert!(last.rays.primary > 0);
        assert!(goal.is_some() || last.samples == 4);
    }
    let without = heard_of(scene_with_a_photo(false), None);
    assert_ne!(
        phases(&without),
        with_albedo,
        "control: no albedo is estimated"
    );
}

/// A draft that was edited renders what a draft of the edited scene renders, bit for bit. Control: the scene before.
#[test]
fn an_edited_draft_is_a_draft_of_the_edited_scene() {
    let draft = RendererOptions {
        filter: Some(Filter::Preview),
        draft: true,
        ..RendererOptions::default()
    };
    let nobody = Watcher::none();
    let mut scene = scene_with_a_photo(false);
    let shown = |renderer: &mut Renderer| {
        (renderer.advance(Budget::Rays(12), &nobody)).expect("renders");
        renderer.picture()
    };
    let mut edited = Renderer::new(scene.clone(), draft, &nobody).expect("fits");
    let before = shown(&mut edited);
    let to = glam::DMat4::from_translation(glam::DVec3::new(0.1, -0.05, 0.2));
    let lens = crate::scene::Lens {
        aperture_radius_m: 0.05,
        ..scene.lens
    };
    (edited.set_object_transform(1, to, &nobody)).expect("fits");
    edited.set_lens(lens, &nobody).expect("fits");
    (edited.set_environment(30.0, 0.8, &nobody)).expect("fits");
    scene.objects[1].world_from_object = to;
    scene.lens = lens;
    let environment = scene.environment.as_mut().expect("has one");
    (environment.rotation_deg, environment.scale) = (30.0, 0.8);
    let mut new = Renderer::new(scene, draft, &nobody).expect("fits");
    let after = shown(&mut edited);
    assert_eq!(after, shown(&mut new));
    assert_ne!(after, before, "control");
}

/// Of a draft, one exposure after another renders what the last one does alone, bit for bit. Control: another exposure.
#[test]
fn a_draft_that_is_exposed_again_and_again_is_exposed_once() {
    let draft = RendererOptions {
        draft: true,
        ..RendererOptions::default()
    };
    let nobody = Watcher::none();
    let exposed = |exposures: &[f64]| {
        let mut renderer = Renderer::new(scene_with_a_photo(true), draft, &nobody).expect("fits");
        for ev in exposures {
            let bounces = renderer.scene().settings.max_bounces;
            (renderer.set_transport(Exposure::Ev(*ev), bounces, &nobody)).expect("fits");
        }
        (renderer.advance(Budget::Rays(12), &nobody)).expect("renders");
        bits(&renderer)
    };
    assert_eq!(exposed(&[0.5, -0.25, 0.2]), exposed(&[0.2]));
    assert_ne!(exposed(&[0.5]), exposed(&[0.2]), "control");
}

/// Each bit of the film's sums.
fn bits(renderer: &Renderer) -> Vec<u32> {
    let picture = renderer.picture();
    let values = picture.linear.as_flattened().iter();
    values.map(|value| value.to_bits()).collect()
}

/// What photons taught before is what they would teach again, or is forgotten. Control: a moved object, beside which they land elsewhere.
#[test]
fn photons_teach_once_what_an_edit_does_not_change() {
    let nobody = Watcher::none();
    let mut scene = scene_with_a_photo(false);
    let glass = Material {
        transmission: 1.0,
        roughness: 0.0,
        ..Material::default()
    };
    scene.objects[1].instances[0].material = Arc::new(glass);
    scene.lights = vec![Light {
        kind: LightKind::Quad {
            corner: [-0.15, 1.0, -0.3],
            edge_u: [0.3, 0.0, 0.0],
            edge_v: [0.0, 0.0, 0.3],
            radiance: [5.0; 3],
        },
        side: Side::Real,
    }];
    scene.settings.rays_per_pixel = 16;
    let to = |x| glam::DMat4::from_translation(glam::DVec3::new(x, 0.01, 0.0));
    let lens = crate::scene::Lens {
        aperture_radius_m: 0.01,
        ..scene.lens
    };
    let edits = |renderer: &mut Renderer, edit: usize| match edit {
        0 => renderer.set_camera_pose(to(0.02), &nobody),
        1 => renderer.set_lens(lens, &nobody),
        2 => renderer.set_object_transform(1, to(0.05), &nobody),
        _ => renderer.set_samples(1_000_000, 1, &nobody),
    };
    let new = || Renderer::new(scene.clone(), RendererOptions::default(), &nobody).expect("fits");
    let [mut kept, mut forgetful] = [new(), new()];
    for edit in 0..4 {
        let before = kept.core.packed.guide.clone();
        assert!(!before.is_empty());
        edits(&mut kept, edit).expect("fits");
        forgetful.core.packed.taught = None;
        edits(&mut forgetful, edit).expect("fits");
        let [kept, anew] = [&kept, &forgetful].map(|renderer| &renderer.core.packed);
        assert_eq!(kept.guide, anew.guide, "{edit}");
        assert_eq!(kept.pixels, anew.pixels, "{edit}");
        assert_eq!(kept.photons_per_ray, anew.photons_per_ray, "{edit}");
        assert_eq!(kept.guide == before, edit < 2, "{edit}");
    }
}

/// On a device too, to which no more than its own records are sent. Control: before it was moved.
#[test]
fn a_moved_object_is_rendered_as_if_it_had_stood_there() {
    let nobody = Watcher::none();
    let mut backends = vec![BackendChoice::Cpu];
    backends.extend(crate::gpu::harness::test_device().map(|_| BackendChoice::Gpu));
    for backend in backends {
        let mut scene = scene_with_a_photo(false);
        scene.settings.backend = backend;
        let mut beside = scene.objects[1].clone();
        beside.world_from_object = glam::DMat4::from_translation(glam::DVec3::new(-0.4, 0.2, 0.1));
        scene.objects.push(beside);
        let new = |scene: &crate::scene::Scene| {
            Renderer::new(scene.clone(), RendererOptions::default(), &nobody).expect("fits")
        };
        let rendered = |renderer: &mut Renderer| {
            (renderer.advance(Budget::Complete, &nobody)).expect("renders");
            bits(renderer)
        };
        let mut edited = new(&scene);
        let mut before = rendered(&mut edited);
        for right_m in [0.05, 0.08] {
            let to = glam::DMat4::from_translation(glam::DVec3::new(right_m, -0.05, 0.02));
            (edited.set_object_transform(1, to, &nobody)).expect("fits");
            scene.objects[1].world_from_object = to;
            let after = rendered(&mut edited);
            assert_eq!(after, rendered(&mut new(&scene)), "{backend:?}");
            assert_ne!(after, before, "control");
            before = after;
        }
    }
}

#[test]
fn a_material_is_replaced_as_if_it_had_always_been_there() {
    let nobody = Watcher::none();
    let green = |green: f32| Material {
        base_color: [0.1, green, 0.1, 1.0],
        ..Material::default()
    };
    let with = |green_of_square: f32| {
        let mut scene = scene_with_a_photo(false);
        let material = Arc::new(green(green_of_square));
        for part in &mut scene.objects[1].instances {
            part.material = material.clone();
        }
        Renderer::new(scene, RendererOptions::default(), &nobody).expect("fits")
    };
    let mut edited = with(0.2);
    let count = edited.packed().materials.len();
    for green_now in [0.5, 0.9] {
        edited
            .set_material(1, green(green_now), &nobody)
            .expect("fits");
    }
    assert_eq!(
        edited.packed().materials.len(),
        count,
        "in the place of the one before"
    );
    let mut anew = with(0.9);
    for renderer in [&mut edited, &mut anew] {
        renderer
            .advance(Budget::Complete, &nobody)
            .expect("renders");
    }
    assert_eq!(bits(&edited), bits(&anew));
    let mut other = with(0.5);
    other.advance(Budget::Complete, &nobody).expect("renders");
    assert_ne!(bits(&other), bits(&anew), "control");
    let missing = edited.set_material(7, green(0.5), &nobody);
    assert!(matches!(missing, Err(RenderError::NoSuchObject(7))));
}

#[test]
fn a_pilot_that_was_ended_is_run_again_before_the_first_sample() {
    let scene = || {
        let mut scene = scene_with_a_photo(false);
        scene.settings.rays_per_pixel = 16;
        scene
    };
    let nobody = Watcher::none();
    let ended = || true;
    let mut cut = Renderer::new(
        scene(),
        RendererOptions::default(),
        &Watcher::none().cancelled_by(&ended),
    )
    .expect("fits");
    assert!(!cut.core.is_planned);
    cut.advance(Budget::Complete, &nobody).expect("renders");
    let mut whole = Renderer::new(scene(), RendererOptions::default(), &nobody).expect("fits");
    assert!(whole.core.is_planned, "control");
    whole.advance(Budget::Complete, &nobody).expect("renders");
    assert_eq!(whole.samples(), 16);
    assert_eq!(bits(&cut), bits(&whole));
}

#[test]
fn guides_are_traced_where_they_are_asked_for() {
    let nobody = Watcher::none();
    let options = RendererOptions {
        guides: true,
        draft: true,
        ..RendererOptions::default()
    };
    let mut renderer = Renderer::new(scene_with_a_photo(false), options, &nobody).expect("fits");
    let mut nearest = |guides: bool| {
        let before = renderer.rays().traced();
        renderer.set_guides(guides, &nobody).expect("fits");
        (renderer.advance(Budget::Complete, &nobody)).expect("renders");
        let depth = renderer
            .planes()
            .depth
            .into_iter()
            .filter(|depth| depth.is_finite());
        (
            depth.fold(f32::INFINITY, f32::min),
            renderer.rays().traced() - before,
        )
    };
    let [with, without, again] = [true, false, true].map(&mut nearest);
    assert_eq!(with, again);
    // Pixels show the square and the floor behind it.
    assert!((0.999..1.999).contains(&with.0), "the square: {with:?}");
    assert!(
        without.0 != with.0 && without.1 <= with.1,
        "control: {without:?}"
    );
}
