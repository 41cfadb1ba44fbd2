//! A scene as a Python script that builds it in Blender, for a look: the same camera, proxy and lights, catchers set.
//!
//! The script is `build.py` with the scene as JSON before it, in Blender's own terms (Z up, watts, millimetres); meshes, textures and the
//! photograph lie in a file of numbers beside it.

mod camera;
mod geometry;
mod light;
mod numbers;
#[cfg(test)]
mod tests;

use glam::{DMat4, DVec3, DVec4};
use serde_json::{Value, json};

use crate::scene::{Backdrop, Composite, EncodedPhoto, Exposure, Photo, Scene};
use numbers::Numbers;

const BUILD: &str = include_str!("build.py");

/// What [`script`] makes of a scene.
#[derive(Debug)]
pub struct BlenderScene {
    /// The script's text.
    pub script: String,
    /// Content of the file that the script reads, little-endian.
    pub numbers: Vec<u8>,
    /// What is not carried, or as something near it, a line each.
    pub notes: Vec<String>,
}

/// The script that builds `scene`, and reads `numbers_name` beside it.
pub fn script(scene: &Scene, numbers_name: &str) -> BlenderScene {
    let mut numbers = Numbers::default();
    let mut notes = notes(scene);
    // Radiance of the photograph: exposure scales all that shines.
    let exposure = match scene.settings.exposure {
        Exposure::Ev(ev) => ev.exp2(),
        Exposure::Auto => 1.0,
    };
    let description = json!({
        "name": scene.name,
        "numbers": numbers_name,
        "camera": camera::describe(scene),
        "photo": scene.photo.as_ref().map(|photo| describe_photo(photo, &mut numbers)),
        "environment": (scene.environment.as_ref())
            .map(|environment| light::describe_environment(environment, exposure, &mut numbers)),
        "lights": (scene.lights.iter().enumerate())
            .map(|(index, light)| light::describe(light, index, exposure, &mut notes))
            .collect::<Vec<Value>>(),
        "geometry": geometry::describe(scene, exposure, &mut numbers, &mut notes),
        "settings": {
            "samples": scene.settings.rays_per_pixel,
            "max_bounces": scene.settings.max_bounces - 1,
            "seed": scene.settings.seed,
            "clamp_indirect": finite_or_zero(scene.settings.clamp_indirect),
        },
    });
    let mut listed: Vec<String> = Vec::new();
    for note in notes {
        if !listed.contains(&note) {
            listed.push(note);
        }
    }
    BlenderScene {
        script: format!(
            "#!/usr/bin/env python3\n\"\"\"The scene {} in Blender: run it in the text editor, or `blender --python` it.\n\n{}\"\"\"\n\nSCENE = r'''\n{}\n'''\n\n{BUILD}",
            harmless(&scene.name),
            told(&listed),
            // Names may hold quotes, which would end the text.
            serde_json::to_string_pretty(&description)
                .unwrap_or_default()
                .replace('\'', "\\u0027"),
        ),
        numbers: numbers.bytes,
        notes: listed,
    }
}

/// For the script's reader.
fn told(notes: &[String]) -> String {
    if notes.is_empty() {
        return "All of it is carried.\n".to_owned();
    }
    let lines = notes.iter().map(|note| format!("- {}\n", harmless(note)));
    format!("Not carried as it is:\n{}", lines.collect::<String>())
}

/// Text of a user in a docstring.
fn harmless(text: &str) -> String {
    text.replace(['\\', '"'], "'")
}

/// Cycles' 0 is no clamp.
fn finite_or_zero(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

fn notes(scene: &Scene) -> Vec<String> {
    let settings = &scene.settings;
    let told = [
        (
            !scene.camera.distortion.is_none(),
            "the lens's distortion: Blender's picture is a pinhole's",
        ),
        (
            scene.objects.iter().any(|o| o.is_animated()),
            "motion: objects stand as at the picture's time",
        ),
        (
            scene.shutter.is_some() || scene.camera_path.pose(0.0).is_some(),
            "the shutter and the camera's motion",
        ),
        (
            settings.exposure == Exposure::Auto,
            "exposure_ev = \"auto\": lights are as the scene has them",
        ),
        (
            settings.composite == Composite::Quotient,
            "the quotient composite",
        ),
        (
            settings.backdrop != Backdrop::Photograph(None),
            "the backdrop",
        ),
        (
            scene.objects.iter().any(|o| o.albedo_from_photo),
            "colours from the photograph: those objects have no material",
        ),
        (
            scene.objects.iter().any(|o| o.self_shadow_bias_m > 0.0),
            "self_shadow_bias_m",
        ),
        (
            scene
                .photo
                .as_ref()
                .is_some_and(|p| p.tags.profile.is_some()),
            "the photograph's profile: its colours are converted to linear Rec.709",
        ),
        (
            scene.stages != crate::scene::Stages::default(),
            "the camera stages",
        ),
    ];
    let told = told.into_iter().filter(|(is, _)| *is);
    told.map(|(_, note)| note.to_owned()).collect()
}

/// Codes where they are sRGB of 8 bits, else linear floats; rows from the bottom, as Blender's.
fn describe_photo(photo: &Photo, numbers: &mut Numbers) -> Value {
    let rows = (0..photo.height as usize).rev();
    let width = photo.width as usize;
    let row = |y: usize| y * width..(y + 1) * width;
    let (kind, pixels) = match &photo.encoded {
        EncodedPhoto::Codes8(codes) if photo.tags.profile.is_none() => {
            let codes: Vec<[u8; 3]> = rows.flat_map(|y| codes[row(y)].to_vec()).collect();
            ("codes", numbers.add(codes.as_flattened()))
        }
        _ => {
            let linear: Vec<[f32; 3]> = rows.flat_map(|y| photo.linear[row(y)].to_vec()).collect();
            ("linear", numbers.add(linear.as_flattened()))
        }
    };
    json!({ "kind": kind, "width": photo.width, "height": photo.height, "pixels": pixels })
}

/// mixray's world in Blender's, whose Z is up.
fn blender_from_world() -> DMat4 {
    DMat4::from_cols(DVec4::X, DVec4::Z, DVec4::NEG_Y, DVec4::W)
}

/// Four rows of a matrix into mixray's world, as one into Blender's.
fn rows(world_from_local: DMat4) -> Value {
    let m = (blender_from_world() * world_from_local).transpose();
    json!(m.to_cols_array_2d())
}

/// World-from-lamp of a lamp that shines along its -Z, its X axis along `right` as far as that is across.
fn lamp_pose(position: DVec3, direction: DVec3, right: Option<DVec3>) -> DMat4 {
    let back = -direction.normalize();
    let right = right.unwrap_or_else(|| back.any_orthonormal_vector());
    let right = (right - back * right.dot(back)).normalize();
    DMat4::from_cols(
        right.extend(0.0),
        back.cross(right).extend(0.0),
        back.extend(0.0),
        position.extend(1.0),
    )
}
