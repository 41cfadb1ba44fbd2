//! `mixray pick`: what stands at a pixel.

use std::path::PathBuf;

use clap::Args;
use glam::DVec2;

use super::scene_flags::SceneFlags;
use super::{Failure, Outcome, print};
use crate::scene::ray::{RayHit, nearest, pixel_ray};
use crate::scene::{Choice, Scene, Side};

/// Prints the point, normal, material and object at a pixel of a scene's picture
///
/// Of the nearest thing, and of the proxy behind it if that is virtual. Points and normals are in world space, metres.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// Pixels from the left; the middle of the first pixel is 0.5
    #[arg(allow_negative_numbers = true)]
    x: f64,
    /// Pixels from the top
    #[arg(allow_negative_numbers = true)]
    y: f64,
    #[command(flatten)]
    flags: SceneFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let scene = arguments.flags.load(&arguments.scene)?;
    let pixel = DVec2::new(arguments.x, arguments.y);
    let size = DVec2::new(scene.camera.width.into(), scene.camera.height.into());
    if !(pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size).all()) {
        return Err(Failure(format!(
            "pixel {} {} is not in the picture; expected 0 0 to {} {}; choose another",
            pixel.x, pixel.y, size.x, size.y
        )));
    }
    let ray = pixel_ray(&scene.camera, pixel).ok_or_else(|| {
        Failure(format!(
            "the lens has no ray at pixel {} {}",
            pixel.x, pixel.y
        ))
    })?;
    let Some(first) = nearest(&scene.objects, &ray, |_| true) else {
        print("nothing: the environment is seen there\n")?;
        return Ok(Outcome::Done);
    };
    let mut text = describe(&scene, &first);
    if scene.objects[first.object].side == Side::Virtual {
        let behind = nearest(&scene.objects, &ray, |object| object.side == Side::Real);
        text += &behind.map_or("behind it nothing of the proxy\n".to_owned(), |hit| {
            format!("behind it\n{}", describe(&scene, &hit))
        });
    }
    print(&text)?;
    Ok(Outcome::Done)
}

fn describe(scene: &Scene, hit: &RayHit) -> String {
    let object = &scene.objects[hit.object];
    let instance = &object.instances[hit.instance];
    let camera_from_world = scene.camera.world_from_camera.inverse();
    let depth_m = -camera_from_world.transform_point3(hit.point).z;
    let rounded = |v: glam::DVec3| {
        let [x, y, z] = v.to_array().map(|x| (x * 1e5).round() / 1e5 + 0.0);
        format!("[{x}, {y}, {z}]")
    };
    let material = match (object.albedo_from_photo, instance.material.name.as_str()) {
        (true, _) => "colours from the photograph",
        (false, "") => "without a name",
        (false, name) => name,
    };
    format!(
        "object    {} ({}, {})\nmaterial  {material}\npoint     {}\nnormal    {}\ndepth     {depth_m:.4} m\n",
        object.name,
        object.side.name(),
        instance.primitive.name,
        rounded(hit.point),
        rounded(hit.normal),
    )
}
