//! Intrinsics, gathered field by field: what a frame says comes first, then what its file says of all frames, then a field of view.

use std::borrow::Cow;

use glam::DMat4;

use crate::distortion::{Distortion, LENS_FISHEYE};
use crate::refusal::Refusal;
use crate::scene::Camera;
use crate::scene::projection::check_distortion;

use super::numbers;

/// Pinhole intrinsics with OpenCV distortion, as [`Camera`] has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Width and height of the pictures, where the file says.
    pub size: Option<(u32, u32)>,
    pub focal: Focal,
    /// Pixels, corner origin; `None`: the middle of the picture.
    pub centre: Option<[f64; 2]>,
    pub distortion: Distortion,
}

/// How long the lens is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focal {
    /// fx and fy.
    Pixels([f64; 2]),
    /// Across the width, with square pixels; radians.
    FieldOfView(f64),
}

impl Intrinsics {
    /// The camera that takes pictures of this size.
    ///
    /// # Errors
    /// The intrinsics are of another size, or their distortion does not reach every pixel: the problem alone, without what was expected.
    pub fn camera(
        &self,
        (width, height): (u32, u32),
        world_from_camera: DMat4,
    ) -> Result<Camera, Refusal> {
        if let Some((own_width, own_height)) = self.size
            && (own_width, own_height) != (width, height)
        {
            return Err(format!(
                "the intrinsics are those of {own_width} x {own_height} pixels where the frames have {width} x {height}"
            ).into());
        }
        let camera = self.camera_of_any_size((width, height), world_from_camera);
        check_distortion(&camera).map_err(|problem| problem.to_string())?;
        Ok(camera)
    }

    /// [`Intrinsics::camera`] without a look at the size and the distortion.
    pub(crate) fn camera_of_any_size(
        &self,
        (width, height): (u32, u32),
        world_from_camera: DMat4,
    ) -> Camera {
        let half = [width, height].map(|side| 0.5 * f64::from(side));
        let [fx, fy] = match self.focal {
            Focal::Pixels(focal) => focal,
            Focal::FieldOfView(angle) => {
                [half[0] / half_view(0.5 * angle, self.distortion.model == LENS_FISHEYE); 2]
            }
        };
        let [cx, cy] = self.centre.unwrap_or(half);
        Camera {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            distortion: self.distortion,
            world_from_camera,
        }
    }
}

/// Of half a field of view, how far from the centre it ends where the focal length is 1.
pub(crate) fn half_view(angle: f64, is_fisheye: bool) -> f64 {
    match is_fisheye {
        true => angle,
        false => angle.tan(),
    }
}

/// Names of the distortion coefficients in OpenCV's order.
pub(super) const COEFFICIENTS: [&str; 12] = [
    "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4",
];

/// Where files name the model of their lens: what is not known there is refused.
const MODEL_KEYS: [&str; 4] = [
    "distortion_model",
    "camera_model",
    "lens_model",
    "camera_type",
];

/// In words about a projection that may stand under any key: those that are none of OpenCV's.
const OTHER_MODELS: [&str; 10] = [
    "equirect",
    "spherical",
    "panoram",
    "omni",
    "cylind",
    "stereograph",
    "equisolid",
    "orthogra",
    "double_sphere",
    "unified",
];

/// Keys of instant-ngp that each name a projection by being there, without `is_` before them.
const PROJECTION_KEYS: [&str; 3] = ["latlong", "equirectangular", "orthographic"];

/// The lens models of OpenCV under all of their names, from the least to the most special.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LensModel {
    /// k1 k2 p1 p2 k3.
    Radial,
    /// k4 k5 k6 and a thin prism beside.
    Rational,
    /// k1 to k4, equidistant.
    Fisheye,
}

impl LensModel {
    const NAMES: [(&str, Self); 25] = [
        ("OPENCV", Self::Radial),
        ("PINHOLE", Self::Radial),
        ("SIMPLE_PINHOLE", Self::Radial),
        ("RADIAL", Self::Radial),
        ("SIMPLE_RADIAL", Self::Radial),
        ("PERSPECTIVE", Self::Radial),
        ("PLUMB_BOB", Self::Radial),
        ("RADTAN", Self::Radial),
        ("RADIAL_TANGENTIAL", Self::Radial),
        ("BROWN", Self::Radial),
        ("BROWN_CONRADY", Self::Radial),
        ("RATIONAL", Self::Rational),
        ("NONE", Self::Radial),
        ("FULL_OPENCV", Self::Rational),
        ("RATIONAL_POLYNOMIAL", Self::Rational),
        ("THIN_PRISM", Self::Rational),
        ("OPENCV_FISHEYE", Self::Fisheye),
        ("FISHEYE", Self::Fisheye),
        ("EQUIDISTANT", Self::Fisheye),
        ("EQUI", Self::Fisheye),
        ("KANNALA_BRANDT", Self::Fisheye),
        ("KANNALA_BRANDT4", Self::Fisheye),
        ("KB4", Self::Fisheye),
        ("RADIAL_FISHEYE", Self::Fisheye),
        ("SIMPLE_RADIAL_FISHEYE", Self::Fisheye),
    ];

    /// Of a name as a file has it.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        let upper = name.to_ascii_uppercase().replace([' ', '-'], "_");
        let short = upper.strip_prefix("OPENCV_").unwrap_or(&upper);
        let found = Self::NAMES
            .iter()
            .find(|(own, _)| *own == upper || *own == short);
        found.map(|(_, model)| *model).ok_or_else(|| {
            format!(
                "the camera model {name} is not known; expected OpenCV's pinhole (OPENCV, FULL_OPENCV) or fisheye (OPENCV_FISHEYE); undistort the frames"
            )
        })
    }

    /// Of all that a file says, keys with their values: a fisheye by any word, and a pinhole's distortion, which says more than its camera.
    pub(super) fn of<'a>(
        said: impl Iterator<Item = (&'a str, Cow<'a, str>)>,
    ) -> Result<Option<Self>, String> {
        let mut found = None;
        for (key, value) in said {
            let key = key.to_ascii_lowercase();
            let is_true = || ["1", "1.0", "true", "yes"].contains(&&*value.to_ascii_lowercase());
            let model = if MODEL_KEYS.contains(&key.as_str()) {
                Some(Self::named(&value)?)
            } else if key.contains("fisheye") && is_true() {
                Some(Self::Fisheye)
            } else if key.starts_with("ftheta")
                || PROJECTION_KEYS.contains(&key.trim_start_matches("is_")) && is_true()
            {
                return Self::named(&key).map(Some);
            } else if ["model", "type", "projection", "lens"]
                .iter()
                .any(|word| key.contains(word))
            {
                let lower = value.to_ascii_lowercase();
                if OTHER_MODELS.iter().any(|word| lower.contains(word)) {
                    return Self::named(&value).map(Some);
                }
                Self::named(&value)
                    .ok()
                    .filter(|model| *model == Self::Fisheye)
            } else {
                None
            };
            found = found.max(model);
        }
        Ok(found)
    }

    /// The lens of these coefficients, absent ones 0.
    pub(super) fn lens(self, given: &[Option<f64>; 12]) -> Result<Distortion, Unusable> {
        let k = given.map(Option::unwrap_or_default);
        let left_out: &[usize] = match self {
            Self::Radial => &[5, 6, 7, 8, 9, 10, 11],
            Self::Rational => &[],
            Self::Fisheye => &[2, 3, 6, 7, 8, 9, 10, 11],
        };
        if let Some(index) = left_out.iter().find(|index| k[**index] != 0.0) {
            return Err(Unusable {
                problem: format!(
                    "{} is {} in a lens that has none",
                    COEFFICIENTS[*index], k[*index]
                ),
                expected: "the coefficients of its model: k1 k2 p1 p2 k3, or with FULL_OPENCV k4 k5 k6 too, or k1 k2 k3 k4 of a fisheye",
                mend: "name the model, or undistort the frames",
            });
        }
        Ok(match self {
            Self::Fisheye => Distortion::fisheye([k[0], k[1], k[4], k[5]]),
            Self::Radial | Self::Rational => Distortion::opencv(&k).unwrap_or(Distortion::NONE),
        })
    }
}

/// What one table says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Fields {
    pub width: Option<u32>,
    pub height: Option<u32>,
    /// Pixels.
    pub fx: Option<f64>,
    pub fy: Option<f64>,
    /// Pixels, corner origin.
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    /// Radians.
    pub fov_x: Option<f64>,
    pub fov_y: Option<f64>,
    /// In the order of [`COEFFICIENTS`].
    pub coefficients: [Option<f64>; 12],
    pub model: Option<LensModel>,
}

/// What a format calls the fields that may be missed.
pub(super) struct Names {
    pub fx: &'static str,
    pub fov_x: &'static str,
}

/// Why the fields make no intrinsics.
pub(super) struct Unusable {
    pub problem: String,
    pub expected: &'static str,
    pub mend: &'static str,
}

impl std::fmt::Display for Unusable {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}; expected {}; {}",
            self.problem, self.expected, self.mend
        )
    }
}

impl Fields {
    /// More than a size is said.
    pub(super) fn say_anything(&self) -> bool {
        let sizeless = Self {
            width: None,
            height: None,
            ..*self
        };
        sizeless != Self::default()
    }

    /// These, and those of `top` where there is none.
    pub(super) fn or(self, top: Self) -> Self {
        let mut coefficients = self.coefficients;
        for (own, top) in coefficients.iter_mut().zip(top.coefficients) {
            *own = own.or(top);
        }
        Self {
            width: self.width.or(top.width),
            height: self.height.or(top.height),
            fx: self.fx.or(top.fx),
            fy: self.fy.or(top.fy),
            cx: self.cx.or(top.cx),
            cy: self.cy.or(top.cy),
            fov_x: self.fov_x.or(top.fov_x),
            fov_y: self.fov_y.or(top.fov_y),
            coefficients,
            model: self.model.or(top.model),
        }
    }

    /// What the fields come to.
    pub(super) fn intrinsics(&self, names: &Names) -> Result<Intrinsics, Unusable> {
        let angles = [self.fov_x, self.fov_y];
        if !angles
            .iter()
            .flatten()
            .all(|angle| *angle > 1e-6 && *angle < 0.9999 * std::f64::consts::PI)
        {
            return Err(Unusable {
                problem: "a field of view is not between 0 and 180 degrees".to_owned(),
                expected: "an angle across the picture",
                mend: "correct it",
            });
        }
        let model = self.model.unwrap_or(LensModel::Radial);
        let across = |side: Option<u32>, angle: Option<f64>| {
            let half = half_view(0.5 * angle?, model == LensModel::Fisheye);
            Some(0.5 * f64::from(side?) / half)
        };
        let fx = self.fx.or_else(|| across(self.width, self.fov_x));
        let fy = (self.fy).or_else(|| across(self.height, self.fov_y)).or(fx);
        let focal = match (fx.or(fy), fy, self.fov_x) {
            (Some(fx), Some(fy), _) => Focal::Pixels([fx, fy]),
            (_, _, Some(angle)) => Focal::FieldOfView(angle),
            _ => return Err(lacks(&format!("`{}` or `{}`", names.fx, names.fov_x))),
        };
        if matches!(focal, Focal::Pixels(sides) if !sides.iter().all(|f| *f > 0.0)) {
            return Err(Unusable {
                problem: "a focal length is not above 0".to_owned(),
                expected: "pixels",
                mend: "correct it",
            });
        }
        let centre = match (self.cx, self.cy) {
            (Some(cx), Some(cy)) => Some([cx, cy]),
            // A field of view is symmetric.
            (None, None) if self.fx.is_none() => None,
            (None, _) => return Err(lacks("`cx`")),
            (_, None) => return Err(lacks("`cy`")),
        };
        Ok(Intrinsics {
            size: self.width.zip(self.height),
            focal,
            centre,
            distortion: model.lens(&self.coefficients)?,
        })
    }
}

/// Of fx, fy, cx, cy that count from the first pixel's centre, and OpenCV's coefficients in order: twelve at most, a fisheye's k1 to k4.
pub(super) fn intrinsics_of_pixel_centres(
    [fx, fy, cx, cy]: [f64; 4],
    size: Option<(u32, u32)>,
    model: Option<LensModel>,
    words: &[&str],
) -> Result<Intrinsics, String> {
    let mut coefficients = [None; 12];
    for (index, word) in words.iter().enumerate() {
        let [k] = numbers::<1>(&[word], "distortion coefficients")?;
        let place = match (model, index) {
            (Some(LensModel::Fisheye), 2 | 3) => index + 2,
            _ => index,
        };
        match coefficients.get_mut(place) {
            Some(coefficient) => *coefficient = Some(k),
            None if k == 0.0 => {}
            None => {
                return Err(format!(
                    "coefficient {} is {k}; expected OpenCV's twelve up to the thin prism; calibrate without a tilted sensor",
                    index + 1
                ));
            }
        }
    }
    let model = model.unwrap_or(LensModel::Rational);
    Ok(Intrinsics {
        size,
        focal: Focal::Pixels([fx, fy]),
        centre: Some([cx + 0.5, cy + 0.5]),
        distortion: model.lens(&coefficients).map_err(|why| why.to_string())?,
    })
}

fn lacks(names: &str) -> Unusable {
    Unusable {
        problem: format!("the intrinsics lack {names}"),
        expected: "it with the frame or for all frames",
        mend: "add it",
    }
}
