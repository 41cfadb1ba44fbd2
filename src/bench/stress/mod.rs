//! The stress test of numerical stability: scenes and rays that break renderers, each with the figure that it must hold.
//!
//! [`cases`] is the table. [`Case::measure`] renders or traces on one [`Backend`] and compares with a closed form or with brute force in f64
//! (`oracle`, `brute_force`), never with another run of the same code. Every case has a control: the same comparison with one thing wrong,
//! which must not hold the bound.

pub(crate) mod backend;
pub(crate) mod brute_force;
mod cases;
mod light;
pub mod meshes;
mod oracle;
mod pictures;
mod report;
pub(crate) mod scenes;
mod shortcuts;
mod traversal;

use std::time::Instant;

use crate::film::Film;

pub use backend::{Backend, Gpu, StressError};
pub use cases::cases;
pub use meshes::fan_of_slivers;
pub use report::{Control, Figure, Report, csv, markdown, text};
pub use scenes::placed;

/// How much is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Small pictures, the extreme settings only: seconds.
    Quick,
    /// Every setting, 1e8 rays at edges: minutes.
    Full,
}

/// One row of the table.
pub struct Case {
    pub name: &'static str,
    /// What is rendered or traced.
    pub what: &'static str,
    /// What it is compared with.
    pub oracle: &'static str,
    /// What the figure is.
    pub quantity: &'static str,
    /// The largest figure that passes.
    pub bound: f64,
    /// What the settings count, for people.
    unit: &'static str,
    settings: &'static [f64],
    quick_settings: &'static [f64],
    /// Where they differ on a graphics device that is a program.
    slow_settings: Option<[&'static [f64]; 2]>,
    /// The setting at which the control is taken.
    control_at: f64,
    /// Samples that are not finite are what the case is about.
    counts_non_finite: bool,
    run: fn(&mut Backend, At) -> Result<Measured, StressError>,
}

/// What a case is asked.
#[derive(Clone, Copy)]
struct At {
    value: f64,
    effort: Effort,
    control: bool,
}

/// What a case answers.
struct Measured {
    figure: f64,
    non_finite: u64,
    /// Pixel and sample.
    first_non_finite: Option<(usize, u32)>,
}

impl Measured {
    fn figure(figure: f64) -> Self {
        Self {
            figure,
            non_finite: 0,
            first_non_finite: None,
        }
    }

    /// What a film says of its samples, without a figure yet.
    fn of_film(film: &Film) -> Self {
        Self {
            figure: f64::NAN,
            non_finite: film.non_finite_samples(),
            first_non_finite: film.first_non_finite(),
        }
    }
}

impl Case {
    /// The settings that this backend takes.
    pub fn settings(&self, backend: &Backend, effort: Effort) -> &'static [f64] {
        let slow = matches!(backend, Backend::Gpu(_)) && !backend.is_hardware_gpu();
        match (effort, self.slow_settings) {
            (Effort::Quick, Some([quick, _])) if slow => quick,
            (Effort::Full, Some([_, full])) if slow => full,
            (Effort::Quick, _) => self.quick_settings,
            (Effort::Full, _) => self.settings,
        }
    }

    /// # Errors
    /// The scene does not fit the backend, or the device was lost.
    pub fn measure(
        &self,
        backend: &mut Backend,
        effort: Effort,
        value: f64,
    ) -> Result<Figure, StressError> {
        let start = Instant::now();
        let at = At {
            value,
            effort,
            control: false,
        };
        let measured = (self.run)(backend, at)?;
        let finite = measured.non_finite == 0 || self.counts_non_finite;
        Ok(Figure {
            case: self.name.to_owned(),
            setting: self.label(value),
            backend: backend.name().to_owned(),
            quantity: self.quantity.to_owned(),
            measured: measured.figure,
            bound: self.bound,
            // A figure that is not a number fails.
            passed: measured.figure <= self.bound && finite,
            non_finite_samples: measured.non_finite,
            first_non_finite: measured
                .first_non_finite
                .map(|(pixel, sample)| format!("seed 1, pixel {pixel}, sample {sample}")),
            seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// The same comparison with one thing wrong.
    ///
    /// # Errors
    /// As [`Case::measure`].
    pub fn control(&self, backend: &mut Backend) -> Result<Control, StressError> {
        let at = At {
            value: self.control_at,
            effort: Effort::Quick,
            control: true,
        };
        let measured = (self.run)(backend, at)?.figure;
        Ok(Control {
            case: self.name.to_owned(),
            setting: self.label(self.control_at),
            measured,
            bound: self.bound,
            noticed: !(measured <= self.bound),
        })
    }

    fn label(&self, value: f64) -> String {
        let plain = (1e-3..1e4).contains(&value) || value == 0.0 || value.is_infinite();
        let number = if plain {
            format!("{value}")
        } else {
            format!("{value:e}")
        };
        format!("{number} {}", self.unit).trim_end().to_owned()
    }
}
