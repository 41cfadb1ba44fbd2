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
        if !table.contains_key(focal[0]) {
            refuse_matrices(table, focal[0])?;
        }
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

/// Lists of OpenCV's coefficients in order.
const LISTS: [&str; 5] = [
    "distortion",
    "distortion_coefficients",
    "distortion_coeffs",
    "dist_coeffs",
    "coeffs",
];
/// Lists too, where they are lists: short names may mean something else.
const SHORT_LISTS: [&str; 2] = ["dist", "D"];
/// A camera matrix, which no style of these has.
const MATRICES: [&str; 5] = [
    "K",
    "intrinsics",
    "intrinsic_matrix",
    "camera_matrix",
    "camera_intrinsics",
];
/// nerfstudio's list.
const PARAMS: &str = "distortion_params";
const ORDER_OF_PARAMS: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];
/// A list for a fisheye: four, and what it has none of.
const OF_FISHEYES: [&str; 12] = [
    "k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "s1", "s2", "s3", "s4",
];

/// In a table or list, or side by side.
fn coefficients(table: &Object, is_fisheye: bool) -> Problem<[Option<f64>; 12]> {
    refuse_unknown(table)?;
    if let Some(params) = table.get(PARAMS) {
        let values = params
            .as_array()
            .filter(|values| values.len() <= ORDER_OF_PARAMS.len());
        let values = values.ok_or_else(|| not_understood(PARAMS))?;
        return in_order(values, &ORDER_OF_PARAMS);
    }
    let short = SHORT_LISTS
        .iter()
        .filter(|key| table.get(**key).is_some_and(Value::is_array));
    let list = LISTS
        .iter()
        .chain(short)
        .find_map(|key| Some((*key, table.get(*key)?)))
        .filter(|(_, value)| !value.is_null());
    let named = match list {
        None => table,
        // Said in words.
        Some((_, Value::String(text))) if text.to_ascii_lowercase().starts_with("none") => {
            return Ok([None; 12]);
        }
        Some((_, Value::Object(named))) => named,
        Some((_, Value::Array(values))) if [0, 4, 5, 8, 12].contains(&values.len()) => {
            let order: &[&str] = match is_fisheye {
                true => &OF_FISHEYES,
                false => &COEFFICIENTS,
            };
            return in_order(values, order);
        }
        Some((key, _)) => return Err(not_understood(key)),
    };
    let mut found = [None; 12];
    for (k, key) in found.iter_mut().zip(COEFFICIENTS) {
        *k = named.get(key).map(|value| number(value, key)).transpose()?;
    }
    Ok(found)
}

/// Values of the coefficients of these names.
fn in_order(values: &[Value], names: &[&str]) -> Problem<[Option<f64>; 12]> {
    let mut found = [None; 12];
    for (value, name) in values.iter().zip(names) {
        let place = COEFFICIENTS.iter().position(|own| own == name);
        let place = place.ok_or_else(|| not_understood("distortion"))?;
        found[place] = Some(number(value, "a distortion coefficient")?);
    }
    Ok(found)
}

fn not_understood(key: &str) -> String {
    format!(
        "`{key}` is not understood; expected OpenCV's coefficients side by side (k1, k2, p1, ...), or `distortion` as a list of 4, 5, 8 or 12 of them; correct it"
    )
}

/// A camera matrix in place of focal lengths would be left out.
fn refuse_matrices(table: &Object, focal: &str) -> Problem<()> {
    let is_matrix =
        |key: &&&str| matches!(table.get(**key), Some(Value::Array(_) | Value::Object(_)));
    match MATRICES.iter().find(is_matrix) {
        None => Ok(()),
        Some(key) => Err(format!(
            "`{key}` is not understood; expected focal lengths and a principal point as `{focal}`, `{}`, `cx` and `cy`, pixels; write them out",
            focal.replace('x', "y")
        )),
    }
}

/// A distortion by a name that is not known would be left out.
fn refuse_unknown(table: &Object) -> Problem<()> {
    let says_something = |value: &Value| match value {
        Value::Number(number) => number.as_f64() != Some(0.0),
        Value::Array(values) => values.iter().any(|value| value.as_f64() != Some(0.0)),
        Value::Object(_) => true,
        _ => false,
    };
    let is_unknown = |key: &str| {
        let lower = key.to_ascii_lowercase();
        let is_own = LISTS.contains(&key) || key == PARAMS || key == "distortion_model";
        let means_it = ["distort", "radial", "tangential", "skew", "dist_co"];
        !is_own
            && (means_it.iter().any(|word| lower.contains(word))
                || COEFFICIENTS.contains(&lower.as_str()) && !COEFFICIENTS.contains(&key))
    };
    let unknown = table
        .iter()
        .find(|(key, value)| is_unknown(key) && says_something(value));
    unknown.map_or(Ok(()), |(key, _)| Err(not_understood(key)))
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
