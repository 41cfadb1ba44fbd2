//! KHR_lights_punctual.

use glam::DMat4;
use gltf::json::extensions::scene::khr_lights_punctual::Type as LightType;
use gltf::json::validation::Checked;

use super::Problem;
use super::container::malformed;
use super::document::Document;

/// A light of KHR_lights_punctual. It sits at the origin of its space and shines along -Z; scale has no effect on its strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedLight {
    pub object_from_light: DMat4,
    pub kind: PunctualLight,
}

/// The file's candela and lux are taken as W/sr and W/m^2, number for number: glTF names no luminous efficacy, and the
/// photograph's exposure sets the scale anyway. `range` is not applied: it is a hint for rasterisers, and light has no end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualLight {
    /// W/sr.
    Point { intensity: [f32; 3] },
    /// W/sr; half-angles from the axis in degrees, `0 <= inner < outer <= 90`.
    Spot {
        intensity: [f32; 3],
        inner_deg: f64,
        outer_deg: f64,
    },
    /// W/m^2 on a plane across the light.
    Directional { irradiance: [f32; 3] },
}

pub(super) fn place_light(
    document: &Document,
    index: usize,
    object_from_light: DMat4,
) -> Result<PlacedLight, Problem> {
    let at = format!("KHR_lights_punctual lights[{index}]");
    let light = document.lights.get(index).ok_or_else(|| {
        malformed(
            &at,
            format!("does not exist; there are {}", document.lights.len()),
        )
    })?;
    let strength = light.color.map(|channel| channel * light.intensity);
    if !strength.iter().all(|s| s.is_finite() && *s >= 0.0) {
        return Err(malformed(
            &at,
            "its color times intensity is negative or not finite",
        ));
    }
    let kind = match (light.type_, &light.spot) {
        (Checked::Valid(LightType::Point), _) => PunctualLight::Point {
            intensity: strength,
        },
        (Checked::Valid(LightType::Directional), _) => PunctualLight::Directional {
            irradiance: strength,
        },
        (Checked::Valid(LightType::Spot), Some(spot)) => {
            let inner_deg = f64::from(spot.inner_cone_angle).to_degrees();
            // The f32 nearest to pi/2 lies above it.
            let outer_deg = f64::from(spot.outer_cone_angle).to_degrees().min(90.0);
            let too_wide = spot.outer_cone_angle > std::f32::consts::FRAC_PI_2;
            if !(inner_deg >= 0.0 && inner_deg < outer_deg) || too_wide {
                return Err(malformed(
                    &at,
                    "its cone angles are not 0 <= inner < outer <= pi/2",
                ));
            }
            PunctualLight::Spot {
                intensity: strength,
                inner_deg,
                outer_deg,
            }
        }
        (Checked::Valid(LightType::Spot), None) => {
            return Err(malformed(&at, "a spot without its `spot` object"));
        }
        (Checked::Invalid, _) => {
            return Err(malformed(&at, "its type is not point, spot or directional"));
        }
    };
    Ok(PlacedLight {
        object_from_light,
        kind,
    })
}
