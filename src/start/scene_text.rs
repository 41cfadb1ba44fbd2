//! The scene file, with what was guessed as comments beside it.

use std::fmt::Write;

use glam::{DMat4, DVec3};

use super::Claim;
use super::camera::coefficients;
use super::place::Placement;
use super::sun::Sun;
use crate::distortion::LENS_FISHEYE;
use crate::scene::Camera;

/// All that stands in a starter scene.
pub struct Draft {
    /// The photograph as the scene file names it.
    pub photo: String,
    pub upright: bool,
    /// Where its focal length, its direction, and its place come from, a line each.
    pub camera: Claim<Camera>,
    pub lens: Option<Claim<ThinLens>>,
    pub environment: Claim<String>,
    pub sun: Option<Claim<Sun>>,
    pub proxy: Claim<Proxy>,
    pub models: Vec<(String, Placement)>,
}

/// As the camera notes it in the photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    pub f_number: f64,
    pub focal_length_mm: f64,
    pub focus_distance_m: f64,
}

/// What stands before the camera.
#[derive(Clone, Debug, PartialEq)]
pub enum Proxy {
    /// y = 0, as far as this, metres.
    Ground(f64),
    /// A file as the scene names it, and world-from-mesh.
    Mesh(String, DMat4),
}

/// Longest line of a comment, characters.
const COMMENT_WIDTH: usize = 110;

impl Draft {
    pub fn text(&self) -> String {
        let mut text = comment(
            "A scene to begin with, made from one photograph. What was guessed says so; correct it here. A scene has only as much light, shape and scale as it tells.",
        );
        let upright = match self.upright {
            true => "orientation = \"apply\"              # the camera was held sideways\n",
            false => "",
        };
        text += &format!("\n[photo]\nimage = {}\n{upright}\n", quoted(&self.photo));
        text += &self.camera_table();
        if let Some(lens) = &self.lens {
            text += &comment(&lens.basis);
            let value = lens.value;
            text += &format!(
                "[lens]\nf_number = {}\nfocal_length_mm = {}\nfocus_distance_m = {:.3}\n\n",
                value.f_number, value.focal_length_mm, value.focus_distance_m
            );
        }
        text += &comment(&self.environment.basis);
        text += &format!(
            "[environment]\nimage = {}\n\n",
            quoted(&self.environment.value)
        );
        if let Some(sun) = &self.sun {
            text += &comment(&format!("The sun: {}.", sun.basis));
            text += &format!(
                "[[light]]\nkind = \"directional\"\ndirection = {}\nirradiance = {}\n\n",
                vector(sun.value.direction),
                vector(DVec3::from(sun.value.irradiance))
            );
        }
        text += &comment(&self.proxy.basis);
        text += &proxy_table(&self.proxy.value);
        for (mesh, placement) in &self.models {
            text += &model_table(mesh, placement);
        }
        text +=
            "[render]\nrays_per_pixel = 16                # more: less noise\nmax_bounces = 6\n";
        text
    }

    fn camera_table(&self) -> String {
        let camera = &self.camera.value;
        let mut text = String::new();
        for line in self.camera.basis.lines() {
            text += &comment(line);
        }
        let pose = camera.world_from_camera;
        let (eye, forward) = (pose.w_axis.truncate(), -pose.z_axis.truncate());
        text += "[camera]\n";
        // Writing into a string cannot fail.
        let mut line = |key: &str, value: String| {
            let _ = writeln!(text, "{key} = {value}");
        };
        line("fx", format!("{:.4}", camera.fx));
        line("fy", format!("{:.4}", camera.fy));
        line("cx", format!("{:.4}", camera.cx));
        line("cy", format!("{:.4}", camera.cy));
        if !camera.distortion.is_none() {
            let numbers: Vec<String> = (coefficients(&camera.distortion).iter())
                .map(|k| format!("{k:?}"))
                .collect();
            line("distortion", format!("[{}]", numbers.join(", ")));
        }
        if camera.distortion.model == LENS_FISHEYE {
            line("lens_model", quoted("fisheye"));
        }
        line("position", vector(eye));
        line("look_at", vector(eye + forward));
        line("up", vector(pose.y_axis.truncate()));
        text + "\n"
    }
}

fn proxy_table(proxy: &Proxy) -> String {
    match proxy {
        Proxy::Ground(reach) => format!(
            "[[real]]\nname = \"ground\"\nshape = \"quad\"\ncorner = [{:.3}, 0, {reach:.3}]\nedge_u = [{:.3}, 0, 0]\nedge_v = [0, 0, {:.3}]\n\n",
            -reach,
            2.0 * reach,
            -2.0 * reach
        ),
        Proxy::Mesh(file, place) => {
            let mut text = format!("[[real]]\nmesh = {}\n", quoted(file));
            if *place != DMat4::IDENTITY {
                let (scale, rotation, translation) = place.to_scale_rotation_translation();
                let q = rotation.to_array().map(|x| format!("{x:.9}")).join(", ");
                text += &format!(
                    "translation = {}\nrotation = [{q}]\nscale = {:.9}\n",
                    vector(translation),
                    scale.element_product().abs().cbrt()
                );
            }
            text + "albedo = \"from-photo\"\n\n"
        }
    }
}

fn model_table(mesh: &str, placement: &Placement) -> String {
    let mut note = match placement.rests {
        true => "Put down on the real surface; move it as you like.",
        false => "Nothing real was found to put it on: it floats in the view. Move it as you like.",
    }
    .to_owned();
    if placement.scale != 1.0 {
        note += " Its size is guessed, to fit the picture: its own would be `scale = 1`.";
    }
    comment(&note)
        + &format!(
            "[[virtual]]\nmesh = {}\ntranslation = {}\nrotation_deg = [0, {:.3}, 0]\nscale = {}\n\n",
            quoted(mesh),
            vector(placement.translation),
            placement.yaw_deg,
            placement.scale
        )
}

fn vector(v: DVec3) -> String {
    // No -0.
    let [x, y, z] = v.to_array().map(|x| x + 0.0);
    format!("[{x:.9}, {y:.9}, {z:.9}]")
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// Lines of a comment. What it holds of file names has no line of its own.
fn comment(text: &str) -> String {
    let mut lines = vec![String::from("#")];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        if lines[last].len() + 1 + word.len() > COMMENT_WIDTH && lines[last].len() > 1 {
            lines.push(format!("# {word}"));
        } else {
            lines[last] += &format!(" {word}");
        }
    }
    lines.join("\n") + "\n"
}
