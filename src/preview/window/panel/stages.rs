//! The camera stages: what happens to the picture after its rays.

use eframe::egui::{self, Slider, Ui};

use super::slide;
use crate::preview::composition::Composition;
use crate::preview::quantity::{Quantity, decimal};
use crate::preview::session::Session;
use crate::scene::{
    AntialiasSettings, CartoonSettings, CartoonStyle, Choice, PointSpread, SharpnessSettings,
    Shutter, Stages,
};

/// What a shutter is switched on with, seconds.
const USUAL_EXPOSURE_SECS: f64 = 0.02;
/// A point's deviation that sharpness by numbers begins with, pixels.
const USUAL_SIGMA_PX: f32 = 0.5;

pub(super) fn show(ui: &mut Ui, session: &mut Session, composition: &Composition) {
    ui.strong("Camera");
    motion_blur(ui, session, composition);
    let stages = &composition.stages;
    if stages.cartoon.is_none() {
        noise(ui, session, stages);
        sharpness(ui, session, stages);
        antialias(ui, session, stages);
    }
    cartoon(ui, session, stages);
}

/// A stage that is there or not.
fn switch(
    ui: &mut Ui,
    session: &mut Session,
    label: &'static str,
    is_on: bool,
    set: impl FnOnce(&mut Composition, bool),
) {
    let mut on = is_on;
    if ui.checkbox(&mut on, label).changed() {
        session.end_gesture();
        session.edit(label, |composition| set(composition, on));
        session.end_gesture();
    }
}

/// A slider over a number that scripts know too.
fn number(
    ui: &mut Ui,
    session: &mut Session,
    label: &'static str,
    quantity: Quantity,
    slider: impl FnOnce(&mut f64) -> Slider<'_>,
    step: f64,
) {
    let value = (session.composition()).and_then(|composition| quantity.of(composition));
    if let Some(value) = value {
        slide(
            ui,
            session,
            label,
            slider,
            value,
            step,
            |composition, value| {
                quantity.set(composition, value);
            },
        );
    }
}

fn motion_blur(ui: &mut Ui, session: &mut Session, composition: &Composition) {
    if !session.moves() {
        return;
    }
    let is_on = (composition.shutter).is_some_and(|shutter| shutter.exposure_secs > 0.0);
    switch(ui, session, "Motion blur", is_on, |composition, on| {
        let exposure_secs = if on { USUAL_EXPOSURE_SECS } else { 0.0 };
        composition.shutter = Some(match composition.shutter {
            Some(shutter) => Shutter {
                exposure_secs,
                ..shutter
            },
            None => Shutter {
                exposure_secs,
                readout_secs: 0.0,
                samples: None,
                time_secs: 0.0,
            },
        });
    });
    if is_on {
        let label = "shutter open, s";
        number(
            ui,
            session,
            label,
            Quantity::ExposureTime,
            |value| {
                Slider::new(value, 0.0001..=1.0)
                    .logarithmic(true)
                    .max_decimals(4)
            },
            1e-4,
        );
    }
}

fn noise(ui: &mut Ui, session: &mut Session, stages: &Stages) {
    let of_file = session.stages_of_file().and_then(|file| file.noise.clone());
    let can_be_on = of_file.is_some() || stages.noise.is_some();
    let box_ = ui.add_enabled_ui(can_be_on, |ui| {
        switch(
            ui,
            session,
            "Noise",
            stages.noise.is_some(),
            |composition, on| {
                composition.stages.noise = of_file.filter(|_| on);
            },
        );
    });
    box_.response
        .on_disabled_hover_text("[noise] profile names what `mixray noise calibrate` measured");
    let label = "noise scale";
    number(
        ui,
        session,
        label,
        Quantity::NoiseScale,
        |value| Slider::new(value, 0.0..=4.0),
        1e-3,
    );
}

fn sharpness(ui: &mut Ui, session: &mut Session, stages: &Stages) {
    let has_photo = (session.loaded()).is_some_and(|loaded| loaded.scene.photo.is_some());
    let by_numbers = SharpnessSettings {
        given: Some(PointSpread::gaussian(USUAL_SIGMA_PX)),
    };
    let first = match has_photo {
        true => SharpnessSettings { given: None },
        false => by_numbers,
    };
    switch(
        ui,
        session,
        "Sharpness",
        stages.sharpness.is_some(),
        |composition, on| {
            composition.stages.sharpness = on.then_some(first);
        },
    );
    let Some(settings) = stages.sharpness else {
        return;
    };
    if has_photo {
        switch(
            ui,
            session,
            "as the photograph's edges",
            settings.given.is_none(),
            |composition, on| {
                composition.stages.sharpness = Some(match on {
                    true => SharpnessSettings { given: None },
                    false => by_numbers,
                });
            },
        );
    }
    let label = "blur sigma, px";
    number(
        ui,
        session,
        label,
        Quantity::SharpnessSigma,
        |value| Slider::new(value, 0.0..=f64::from(PointSpread::MAX_PX)),
        1e-3,
    );
    number(
        ui,
        session,
        "sharpening",
        Quantity::Sharpening,
        |value| Slider::new(value, 0.0..=10.0),
        0.01,
    );
}

fn antialias(ui: &mut Ui, session: &mut Session, stages: &Stages) {
    switch(
        ui,
        session,
        "Antialiasing",
        stages.antialias.is_some(),
        |composition, on| {
            composition.stages.antialias = on.then(AntialiasSettings::default);
        },
    );
    let label = "share blended";
    number(
        ui,
        session,
        label,
        Quantity::AntialiasBeta,
        |value| Slider::new(value, 0.0..=1.0),
        0.01,
    );
}

fn cartoon(ui: &mut Ui, session: &mut Session, stages: &Stages) {
    let of_file = session.stages_of_file().cloned().unwrap_or_default();
    switch(
        ui,
        session,
        "Cartoon",
        stages.cartoon.is_some(),
        |composition, on| {
            // It is never beside the others, which come back with the file's numbers.
            composition.stages = match on {
                true => Stages {
                    cartoon: Some(CartoonSettings::default()),
                    ..Stages::default()
                },
                false => Stages {
                    cartoon: None,
                    ..of_file
                },
            };
        },
    );
    let Some(settings) = stages.cartoon else {
        return;
    };
    let mut style = settings.style;
    egui::ComboBox::from_label("lines")
        .selected_text(style.name())
        .show_ui(ui, |ui| {
            for (name, choice) in CartoonStyle::CHOICES {
                ui.selectable_value(&mut style, *choice, *name);
            }
        });
    edit_cartoon(session, "cartoon style", |cartoon| cartoon.style = style);
    let label = "passes";
    number(
        ui,
        session,
        label,
        Quantity::CartoonIterations,
        |value| Slider::new(value, 0.0..=30.0).integer(),
        1.0,
    );
    let label = "colours mixed, sigma";
    number(
        ui,
        session,
        label,
        Quantity::CartoonSigmaP,
        |value| Slider::new(value, 0.001..=1.0).logarithmic(true),
        1e-4,
    );
    if style == CartoonStyle::Flow {
        let width = decimal(settings.flow.edge_sigma_px);
        slide(
            ui,
            session,
            "line width, px",
            |value| Slider::new(value, 0.1..=16.0).logarithmic(true),
            width,
            0.01,
            |composition, width| {
                if let Some(cartoon) = &mut composition.stages.cartoon {
                    cartoon.flow.edge_sigma_px = width as f32;
                }
            },
        );
    }
}

fn edit_cartoon(session: &mut Session, what: &str, change: impl FnOnce(&mut CartoonSettings)) {
    session.edit(what, |composition| {
        if let Some(cartoon) = &mut composition.stages.cartoon {
            change(cartoon);
        }
    });
}
