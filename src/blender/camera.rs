//! A camera and its lens in Blender's terms.

use serde_json::{Value, json};

use super::rows;
use crate::scene::{Aperture, Lens, Scene};

/// Width of the sensor that Blender's camera gets: that of 35 mm film.
const SENSOR_MM: f64 = 36.0;
/// Blender's focus distance is finite.
const FARTHEST_FOCUS_M: f64 = 1e6;

pub(super) fn describe(scene: &Scene) -> Value {
    let camera = &scene.camera;
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    // Height of a pixel over its width.
    let pixel_aspect = camera.fx / camera.fy;
    let lens_mm = camera.fx * SENSOR_MM / width;
    json!({
        "width": camera.width,
        "height": camera.height,
        "sensor_width_mm": SENSOR_MM,
        "lens_mm": lens_mm,
        "pixel_aspect": pixel_aspect,
        "shift": [(0.5 * width - camera.cx) / width, (camera.cy - 0.5 * height) * pixel_aspect / width],
        "matrix": rows(camera.world_from_camera),
        "depth_of_field": (scene.lens.aperture_radius_m > 0.0).then(|| describe_lens(&scene.lens, lens_mm)),
    })
}

/// Cycles has the middle of a side where mixray has a corner of the aperture.
fn describe_lens(lens: &Lens, lens_mm: f64) -> Value {
    let (blades, radius_m, rotation_deg) = match lens.aperture {
        Aperture::Disc => (0, lens.aperture_radius_m, 0.0),
        // The half-width is given; corners lie on the diagonals.
        Aperture::Square => (
            4,
            lens.aperture_radius_m * std::f64::consts::SQRT_2,
            lens.blade_rotation_deg,
        ),
        Aperture::Blades(blades) => (
            blades,
            lens.aperture_radius_m,
            lens.blade_rotation_deg - 180.0 / f64::from(blades),
        ),
    };
    json!({
        "f_number": lens_mm / (2000.0 * radius_m),
        "focus_distance_m": lens.focus_distance_m.min(FARTHEST_FOCUS_M),
        "blades": blades,
        "rotation_deg": rotation_deg,
    })
}
