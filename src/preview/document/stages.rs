//! The tables of the camera stages, and `[shutter]`.

use toml_edit::{Array, TableLike, Value};

use super::{Document, set};
use crate::preview::quantity::decimal;
use crate::scene::{
    AntialiasSettings, CartoonSettings, Choice, NoiseSettings, PointSpread, SharpnessSettings,
    Shutter, Stages,
};

impl Document {
    /// Writes what differs; a stage that is off has no table.
    pub(super) fn write_stages(&mut self, was: &Stages, is: &Stages) {
        if was.antialias != is.antialias {
            self.write_table("antialias", is.antialias.is_some(), |table| {
                write_antialias(table, was.antialias, is.antialias.unwrap_or_default());
            });
        }
        if was.sharpness != is.sharpness {
            self.write_table("sharpness", is.sharpness.is_some(), |table| {
                write_sharpness(table, was.sharpness, is.sharpness);
            });
        }
        if is.motion_blur.is_none() {
            self.0.remove("motion_blur");
        }
        if was.noise != is.noise {
            self.write_table("noise", is.noise.is_some(), |table| {
                write_noise(table, was.noise.as_ref(), is.noise.as_ref());
            });
        }
        if was.cartoon != is.cartoon {
            self.write_table("cartoon", is.cartoon.is_some(), |table| {
                write_cartoon(
                    table,
                    was.cartoon.unwrap_or_default(),
                    is.cartoon.unwrap_or_default(),
                );
            });
        }
    }

    pub(super) fn write_shutter(&mut self, was: Option<Shutter>, is: Option<Shutter>) {
        if was == is {
            return;
        }
        self.write_table("shutter", is.is_some(), |table| {
            let Some(is) = is else {
                return;
            };
            let times = |shutter: Option<Shutter>| {
                shutter.map_or([None, Some(0.0), Some(0.0)], |shutter| {
                    [
                        shutter.exposure_secs,
                        shutter.readout_secs,
                        shutter.time_secs,
                    ]
                    .map(Some)
                })
            };
            let keys = ["exposure_secs", "readout_secs", "time_secs"];
            for (key, (was, is)) in keys.iter().zip(times(was).into_iter().zip(times(Some(is)))) {
                if let Some(secs) = is.filter(|_| was != is) {
                    set(table, key, secs);
                }
            }
            if let Some(samples) = is
                .samples
                .filter(|_| was.and_then(|w| w.samples) != is.samples)
            {
                set(table, "samples", i64::from(samples));
            }
        });
    }

    fn write_table(&mut self, key: &str, is_there: bool, write: impl FnOnce(&mut dyn TableLike)) {
        match is_there {
            true => write(self.table_mut(key)),
            false => {
                self.0.remove(key);
            }
        }
    }
}

fn write_antialias(
    table: &mut dyn TableLike,
    was: Option<AntialiasSettings>,
    is: AntialiasSettings,
) {
    // The number is told even where it is the usual one: an empty table says little.
    if was != Some(is) {
        set(table, "beta", decimal(is.beta));
    }
}

fn write_noise(table: &mut dyn TableLike, was: Option<&NoiseSettings>, is: Option<&NoiseSettings>) {
    let scale = |settings: Option<&NoiseSettings>| settings.map(|settings| settings.scale);
    if let Some(value) = scale(is).filter(|value| scale(was) != Some(*value)) {
        set(table, "scale", decimal(value));
    }
}

fn write_sharpness(
    table: &mut dyn TableLike,
    was: Option<SharpnessSettings>,
    is: Option<SharpnessSettings>,
) {
    let Some(is) = is.and_then(|settings| settings.given) else {
        for key in [
            "sigma_px",
            "corner_sigma_px",
            "sharpening",
            "sharpening_radius_px",
            "lateral_px",
        ] {
            table.remove(key);
        }
        set(table, "from", "photo");
        return;
    };
    table.remove("from");
    let was = was.and_then(|settings| settings.given);
    let plain = PointSpread::gaussian(0.0);
    if was.map(|was| was.sigma_px) != Some(is.sigma_px) {
        set(table, "sigma_px", channels(is.sigma_px));
    }
    // Without the key the corners are as sharp as the middle.
    if is.corner_sigma_px == is.sigma_px {
        table.remove("corner_sigma_px");
    } else if was.map(|was| was.corner_sigma_px) != Some(is.corner_sigma_px) {
        set(table, "corner_sigma_px", channels(is.corner_sigma_px));
    }
    let was = was.unwrap_or(plain);
    if was.sharpening != is.sharpening {
        set(table, "sharpening", decimal(is.sharpening));
    }
    if was.sharpening_radius_px != is.sharpening_radius_px {
        set(
            table,
            "sharpening_radius_px",
            decimal(is.sharpening_radius_px),
        );
    }
    if was.lateral_px != is.lateral_px {
        set(
            table,
            "lateral_px",
            Array::from_iter(is.lateral_px.map(decimal)),
        );
    }
}

/// One number where all are the same.
fn channels(sigma_px: [f32; 3]) -> Value {
    match sigma_px == [sigma_px[0]; 3] {
        true => decimal(sigma_px[0]).into(),
        false => Array::from_iter(sigma_px.map(decimal)).into(),
    }
}

fn write_cartoon(table: &mut dyn TableLike, was: CartoonSettings, is: CartoonSettings) {
    if was.style != is.style {
        set(table, "style", is.style.name());
    }
    for (key, was, is) in [
        ("shrunk_width", was.shrunk_width, is.shrunk_width),
        ("shrunk_height", was.shrunk_height, is.shrunk_height),
        ("iterations", was.iterations, is.iterations),
    ] {
        if was != is {
            set(table, key, i64::from(is));
        }
    }
    for (key, was, is) in [
        ("sigma_p", was.sigma_p, is.sigma_p),
        ("alpha", was.alpha, is.alpha),
        ("beta", was.beta, is.beta),
        ("s0", was.s0, is.s0),
        ("s1", was.s1, is.s1),
        ("a0", was.a0, is.a0),
        ("a1", was.a1, is.a1),
        (
            "tensor_sigma_px",
            was.flow.tensor_sigma_px,
            is.flow.tensor_sigma_px,
        ),
        (
            "edge_sigma_px",
            was.flow.edge_sigma_px,
            is.flow.edge_sigma_px,
        ),
        (
            "line_sigma_px",
            was.flow.line_sigma_px,
            is.flow.line_sigma_px,
        ),
        ("tau", was.flow.tau, is.flow.tau),
        ("t0", was.flow.t0, is.flow.t0),
        ("t1", was.flow.t1, is.flow.t1),
    ] {
        if was != is {
            set(table, key, decimal(is));
        }
    }
}
