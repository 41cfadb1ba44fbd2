//! A renderer at what is wanted: built anew where it must be, else edited.

use std::sync::Arc;

use super::{Level, Wanted};
use crate::preview::composition::{Composition, Difference};
use crate::renderer::{
    Filter, FrameEdit, RenderError, Renderer, RendererOptions, Skip, Watcher, Without,
};
use crate::scene::{BackendChoice, Exposure, Object, Scene};

/// The coarse picture's sides are the whole one's divided by this.
const COARSE_DIVISOR: u32 = 4;
/// Where the coarse picture ends: with more the pilot would measure first, which takes longer than the first picture.
const COARSE_RAYS: u32 = 7;

/// Columns of the environment that lights the coarse picture: a table that stays in a core's cache.
const COARSE_DIRECTIONS: u32 = 128;
/// The coarse picture's indirect light is no brighter: one ray would show it as dots.
const COARSE_CLAMP: f32 = 1.0;

/// A renderer and what it stands at.
pub(super) struct Current {
    pub renderer: Renderer,
    scene: Arc<Scene>,
    composition: Composition,
    has_real: bool,
}

/// Brings the renderer to what is wanted; what it was that changed, if the picture began anew.
pub(super) fn take_up(
    level: Level,
    wanted: &Wanted,
    current: &mut Option<Current>,
    watcher: &Watcher<'_>,
) -> Result<Option<&'static str>, RenderError> {
    let has_real = wanted.view.needs_real();
    let fits = |current: &Current| {
        Arc::ptr_eq(&current.scene, &wanted.scene)
            && current.has_real == has_real
            && is_edit(level, &current.composition, wanted)
    };
    if let Some(current) = current.as_mut().filter(|current| fits(current)) {
        let difference = Difference::between(&current.composition, &wanted.composition);
        let guides = level == Level::Fine || wanted.view.needs_planes();
        let begins = current.renderer.set_guides(guides, watcher)?;
        if difference.is_none() {
            return Ok(begins.then_some("view"));
        }
        edit(&mut current.renderer, level, &difference, wanted, watcher)?;
        current.composition = wanted.composition.clone();
        return Ok(Some(difference.name()));
    }
    let mut scene = Scene::clone(&wanted.scene);
    wanted.composition.apply(&mut scene);
    if level == Level::Coarse {
        shrink(&mut scene);
    }
    let options = RendererOptions {
        guides: true,
        real_everywhere: has_real,
        filter: (level == Level::Coarse).then_some(Filter::Preview),
        draft: level == Level::Coarse,
        beside_window: true,
        without: match level {
            // Caustics come with the whole picture.
            Level::Coarse => [Skip::Photons, Skip::Guide].into_iter().collect(),
            Level::Fine => Without::default(),
        },
        ..RendererOptions::default()
    };
    // The memory of the scene before is free first.
    *current = None;
    let mut renderer = Renderer::new(scene, options, watcher)?;
    if level == Level::Coarse {
        // The film has room for them, and another view asks for them.
        renderer.set_guides(wanted.view.needs_planes(), watcher)?;
    }
    *current = Some(Current {
        renderer,
        scene: wanted.scene.clone(),
        composition: wanted.composition.clone(),
        has_real,
    });
    Ok(Some("scene"))
}

/// The renderer takes the difference up without being built anew.
fn is_edit(level: Level, from: &Composition, wanted: &Wanted) -> bool {
    let to = &wanted.composition;
    let difference = Difference::between(from, to);
    // Such an object rests once it was edited, which is told from one that moves by an open shutter, and by the last bits.
    let is_moving = |object: &usize| wanted.scene.objects[*object].is_animated();
    let moves = difference.motion || difference.objects.iter().any(is_moving);
    let rests = level == Level::Coarse && !to.shutter.is_some_and(|shutter| shutter.is_open());
    // With the mesh's own materials, and without them, the scene is another.
    let is_own =
        |object: &usize| from.materials[*object].is_none() || to.materials[*object].is_none();
    let remade = difference.materials.iter().any(is_own);
    !difference.built && !remade && (rests || !moves)
}

fn edit(
    renderer: &mut Renderer,
    level: Level,
    difference: &Difference,
    wanted: &Wanted,
    watcher: &Watcher<'_>,
) -> Result<(), RenderError> {
    let to = &wanted.composition;
    for object in &difference.objects {
        let placement = to.world_from_object(*object);
        renderer.set_object_transform(*object, placement, watcher)?;
    }
    for object in &difference.materials {
        if let Some(form) = to.materials[*object] {
            let name = renderer.scene().objects[*object].name.clone();
            renderer.set_material(*object, form.material(name), watcher)?;
        }
    }
    if difference.environment
        && let Some(form) = to.environment
    {
        renderer.set_environment(form.rotation_deg, form.scale, watcher)?;
    }
    if difference.transport {
        renderer.set_transport(to.exposure, to.max_bounces, watcher)?;
    }
    if difference.samples && level == Level::Fine {
        renderer.set_samples(to.rays_per_pixel, to.seed, watcher)?;
    }
    if difference.stages {
        renderer.set_stages(to.stages.clone(), watcher)?;
    }
    if difference.camera {
        set_camera(renderer, level, to, watcher)?;
    }
    if difference.lens {
        renderer.set_lens(to.lens(), watcher)?;
    }
    Ok(())
}

/// The whole picture's coordinates begin at its camera, as those of the file's own render do: their last bits depend on it.
fn set_camera(
    renderer: &mut Renderer,
    level: Level,
    to: &Composition,
    watcher: &Watcher<'_>,
) -> Result<(), RenderError> {
    let pose = to.camera.world_from_camera();
    let scene = renderer.scene();
    if level == Level::Coarse || scene.settings.exposure == Exposure::Auto {
        return renderer.set_camera_pose(pose, watcher);
    }
    let mut camera = scene.camera.clone();
    camera.world_from_camera = pose;
    let edit = FrameEdit {
        photo: None,
        camera,
        lens: to.lens(),
        camera_path: scene.camera_path.clone(),
        time_secs: scene.shutter.map_or(0.0, |shutter| shutter.time_secs),
        seed: to.seed,
        anchor: Some(pose.w_axis.truncate()),
        coarseness: 1,
    };
    renderer.set_frame(edit, watcher)
}

/// A quarter of the width and height, photograph and environment averaged.
fn shrink(scene: &mut Scene) {
    scene.camera = scene.camera.coarser(COARSE_DIVISOR);
    let (width, height) = (scene.camera.width, scene.camera.height);
    let photo = scene.photo.as_ref();
    scene.photo = photo.map(|photo| photo.averaged(width, height));
    if let Some(environment) = &mut scene.environment {
        environment.map = environment.map.averaged(COARSE_DIRECTIONS);
    }
    if !scene.shutter.is_some_and(|shutter| shutter.is_open()) {
        rest(&mut scene.objects);
    }
    scene.settings.rays_per_pixel = COARSE_RAYS;
    scene.settings.clamp_indirect = scene.settings.clamp_indirect.min(COARSE_CLAMP);
    // It is small, and a second device would have to be opened for it.
    scene.settings.backend = BackendChoice::Cpu;
}

/// What moves stays where it is, and is edited like all else.
fn rest(objects: &mut [Object]) {
    for object in objects {
        object.motion = None;
        for part in &mut object.instances {
            (part.animation, part.deformation) = (None, None);
        }
    }
}
