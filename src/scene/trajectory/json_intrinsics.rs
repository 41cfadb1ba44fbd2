//! Intrinsics as the JSON of several programs has them.

use std::borrow::Cow;

use serde_json::{Map, Value};

use super::Intrinsics;
use super::intrinsics::{COEFFICIENTS, Fields, LensModel, Names};
use super::json_values::{Problem, number};

type Object = Map<String, Value>;

/// How a file writes its intrinsics: one style for all of its tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// This program's: a table `camera`.
    Own,
    /// nerfstudio and instant-ngp, whose principal point counts from the corner as COLMAP's does.
    Nerfstudio,
    /// Tracked videos count pixel centres from 0, as OpenCV does.
    Tracked,
}

/// The style of a file that is made of these tables.
pub(super) fn style_of<'a>(tables: impl Iterator<Item = &'a Object> + Clone) -> Problem<Style> {
    let has = |keys: &[&str]| {
        (tables.clone()).any(|table| keys.iter().any(|key| table.contains_key(*key)))
    };
    Ok(match () {
        () if has(&["camera"]) => Style::Own,
        () if has(&["fx", "fy"]) && !has(&["fl_x", "fl_y"]) => Style::Tracked,
        () => Style::Nerfstudio,
    })
}

impl Style {
    /// Of all frames that bring none of their own.
    pub(super) fn of_all(self, root: &Object) -> Problem<Option<Intrinsics>> {
        self.resolve(self.fields(root)?)
    }

    /// A frame's own, field by field before those at the top; `None`: it has none.
    pub(super) fn of_frame(self, frame: &Object, root: &Object) -> Problem<Option<Intrinsics>> {
        let own = self.fields(frame)?;
        match own.say_anything() {
            true => self.resolve(own.or(self.fields(root)?)),
            false => Ok(None),
        }
    }

    fn resolve(self, fields: Fields) -> Problem<Option<Intrinsics>> {
        if !fields.say_anything() {
            return Ok(None);
        }
        let names = match self {
            Self::Nerfstudio => Names {
                fx: "fl_x",
                fov_x: "camera_angle_x",
            },
            Self::Own | Self::Tracked => Names {
                fx: "fx",
                fov_x: "camera_angle_x",
            },
        };
        (fields.intrinsics(&names).map(Some)).map_err(|why| why.to_string())
    }

    fn fields(self, table: &Object) -> Problem<Fields> {
        let table = match self {
            Self::Own => match table.get("camera").and_then(Value::as_object) {
                Some(camera) => camera,
                None => return Ok(Fields::default()),
            },
            Self::Nerfstudio | Self::Tracked => table,
        };
        let (focal, size) = match self {
            Self::Nerfstudio => (["fl_x", "fl_y"], ["w", "h"]),
            Self::Own | Self::Tracked => (["fx", "fy"], ["width", "height"]),
        };
        let centre_offset = if self == Self::Tracked { 0.5 } else { 0.0 };
        let optional = |key: &str| table.get(key).map(|value| number(value, key)).transpose();
        let side = |key: &str| u32::try_from(table.get(key)?.as_f64()? as u64).ok();
        let centre = |key: &str| Ok::<_, String>(optional(key)?.map(|x| x + centre_offset));
        let model = model_of(table)?;
        Ok(Fields {
            model,
            width: side(size[0]),
            height: side(size[1]),
            fx: optional(focal[0])?,
            fy: optional(focal[1])?,
            cx: centre("cx")?,
            cy: centre("cy")?,
            fov_x: optional("camera_angle_x")?,
            fov_y: optional("camera_angle_y")?,
            coefficients: coefficients(table, model == Some(LensModel::Fisheye))?,
        })
    }
}

/// In a table or list `distortion`, or side by side.
fn coefficients(table: &Object, is_fisheye: bool) -> Problem<[Option<f64>; 12]> {
    let mut found = [None; 12];
    let named = match table.get("distortion") {
        None => table,
        // Said in words.
        Some(Value::String(text)) if text.to_ascii_lowercase().starts_with("none") => {
            return Ok(found);
        }
        Some(Value::Object(named)) => named,
        Some(Value::Array(values)) if [4, 5, 8, 12].contains(&values.len()) => {
            // A fisheye's four are k1 to k4.
            let fisheye = [0, 1, 4, 5];
            for (place, value) in values.iter().enumerate() {
                let place = match is_fisheye {
                    true => *fisheye.get(place).unwrap_or(&place),
                    false => place,
                };
                found[place] = Some(number(value, "a distortion coefficient")?);
            }
            return Ok(found);
        }
        Some(_) => {
            return Err("`distortion` is not understood; expected OpenCV's coefficients as a list of 4, 5, 8 or 12; correct it".to_owned());
        }
    };
    for (k, key) in found.iter_mut().zip(COEFFICIENTS) {
        *k = named.get(key).map(|value| number(value, key)).transpose()?;
    }
    Ok(found)
}

/// Wherever the table says it: by a name, or that it is a fisheye.
fn model_of(table: &Object) -> Problem<Option<LensModel>> {
    let nested = table.get("distortion").and_then(Value::as_object);
    let nested = nested.and_then(|distortion| distortion.get("model"));
    let nested = nested.map(|model| ("distortion_model", model));
    let all = table
        .iter()
        .map(|(key, value)| (key.as_str(), value))
        .chain(nested);
    LensModel::of(all.filter_map(|(key, value)| match value {
        Value::String(text) => Some((key, Cow::from(text))),
        Value::Bool(_) | Value::Number(_) => Some((key, Cow::from(value.to_string()))),
        _ => None,
    }))
}
