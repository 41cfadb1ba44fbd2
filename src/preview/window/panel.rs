//! The side panel: what can be set by numbers.

mod material;
mod stages;

use eframe::egui::{self, DragValue, Slider, Ui};
use glam::DVec3;

use super::canvas::Canvas;
use crate::preview::composition::{
    Composition, Opening, Rotation, Track, rounded, rounded_m, virtual_objects,
};
use crate::preview::session::Session;
use crate::preview::view::View;
use crate::scene::{Aperture, Choice, Exposure, Settings};

pub(super) fn show(ui: &mut Ui, session: &mut Session, canvas: &mut Canvas) {
    ui.add_enabled_ui(session.loaded().is_some(), |ui| {
        views(ui, session, canvas);
        let Some(composition) = session.composition().cloned() else {
            return;
        };
        ui.separator();
        lens(ui, session, &composition);
        ui.separator();
        light(ui, session, &composition);
        ui.separator();
        rays(ui, session, &composition);
        ui.separator();
        stages::show(ui, session, &composition);
        ui.separator();
        objects(ui, session, canvas);
    });
}

fn views(ui: &mut Ui, session: &mut Session, canvas: &mut Canvas) {
    ui.horizontal(|ui| {
        let mut view = session.view();
        egui::ComboBox::from_label("View")
            .selected_text(view.name())
            .show_ui(ui, |ui| {
                for (name, choice) in View::CHOICES {
                    ui.selectable_value(&mut view, *choice, *name);
                }
            });
        session.set_view(view);
    });
    ui.horizontal(|ui| {
        ui.checkbox(&mut canvas.wireframe, "Proxy wireframe");
        ui.checkbox(&mut canvas.shows_gizmo, "Gizmo");
        let mut wipes = canvas.wipe.is_some();
        if ui.checkbox(&mut wipes, "Wipe").changed() {
            canvas.wipe = wipes.then_some(0.5);
        }
    });
}

/// A slider over a value of the composition.
fn slide(
    ui: &mut Ui,
    session: &mut Session,
    label: &'static str,
    slider: impl FnOnce(&mut f64) -> Slider<'_>,
    value: f64,
    step: f64,
    set: impl FnOnce(&mut Composition, f64),
) {
    let mut shown = value;
    let response = ui.add(slider(&mut shown).text(label));
    // A slider rounds whatever it is given.
    let shown = rounded(shown, step);
    if response.changed() && shown != rounded(value, step) {
        session.edit(label, |composition| set(composition, shown));
    }
    if response.drag_stopped() {
        session.end_gesture();
    }
}

fn lens(ui: &mut Ui, session: &mut Session, composition: &Composition) {
    ui.strong("Lens");
    let (lens, focus_distance_m) = (&composition.lens, composition.focus_distance_m());
    match lens.opening {
        Opening::FNumber {
            f_number,
            focal_length_mm,
        } => slide(
            ui,
            session,
            "f-number",
            |value| {
                Slider::new(value, 0.7..=32.0)
                    .logarithmic(true)
                    .max_decimals(2)
            },
            f_number,
            0.01,
            |composition, f_number| {
                composition.lens.opening = Opening::FNumber {
                    f_number,
                    focal_length_mm,
                };
            },
        ),
        Opening::RadiusM(radius) => slide(
            ui,
            session,
            "aperture radius, mm",
            |value| {
                Slider::new(value, 0.0..=50.0)
                    .logarithmic(true)
                    .smallest_positive(0.01)
            },
            radius * 1000.0,
            1e-3,
            |composition, mm| {
                composition.lens.opening = Opening::RadiusM(rounded(mm / 1000.0, 1e-6))
            },
        ),
    }
    let least = lens.least_focus_m();
    slide(
        ui,
        session,
        "focus distance, m",
        |value| {
            Slider::new(value, least..=1000.0)
                .logarithmic(true)
                .max_decimals(4)
                .largest_finite(1000.0)
        },
        focus_distance_m,
        1e-4,
        |composition, focus| composition.focus(focus.max(least)),
    );
    if session.moves() {
        keys(
            ui,
            session,
            Track::Focus,
            ["Set focus key", "Delete focus key"],
        );
    }
    ui.horizontal(|ui| {
        let mut aperture = lens.aperture;
        let name = match aperture {
            Aperture::Disc => "disc".to_owned(),
            Aperture::Square => "square".to_owned(),
            Aperture::Blades(blades) => format!("{blades} blades"),
        };
        egui::ComboBox::from_label("aperture")
            .selected_text(name)
            .show_ui(ui, |ui| {
                ui.selectable_value(&mut aperture, Aperture::Disc, "disc");
                ui.selectable_value(&mut aperture, Aperture::Square, "square");
                for blades in 3..=12 {
                    let name = format!("{blades} blades");
                    ui.selectable_value(&mut aperture, Aperture::Blades(blades), name);
                }
            });
        session.edit("aperture", |composition| {
            composition.lens.aperture = aperture
        });
    });
    if matches!(lens.aperture, Aperture::Blades(_)) {
        slide(
            ui,
            session,
            "blade rotation, degrees",
            |value| Slider::new(value, 0.0..=120.0),
            lens.blade_rotation_deg,
            0.1,
            |composition, deg| composition.lens.blade_rotation_deg = deg,
        );
    }
}

fn light(ui: &mut Ui, session: &mut Session, composition: &Composition) {
    ui.strong("Light");
    if let Some(environment) = composition.environment {
        slide(
            ui,
            session,
            "environment scale",
            |value| {
                Slider::new(value, 0.0..=16.0)
                    .logarithmic(true)
                    .smallest_positive(0.01)
            },
            environment.scale,
            1e-3,
            |composition, scale| {
                if let Some(environment) = &mut composition.environment {
                    environment.scale = scale;
                }
            },
        );
        slide(
            ui,
            session,
            "environment rotation",
            |value| Slider::new(value, 0.0..=360.0),
            environment.rotation_deg,
            0.01,
            |composition, deg| {
                if let Some(environment) = &mut composition.environment {
                    environment.rotation_deg = deg;
                }
            },
        );
    }
    match composition.exposure {
        Exposure::Ev(ev) => slide(
            ui,
            session,
            "exposure, EV",
            |value| Slider::new(value, -8.0..=8.0),
            ev,
            0.01,
            |composition, ev| composition.exposure = Exposure::Ev(ev),
        ),
        Exposure::Auto => {
            ui.label("exposure: fitted to the photograph");
        }
    }
}

fn rays(ui: &mut Ui, session: &mut Session, composition: &Composition) {
    ui.strong("Rays");
    let mut rays = composition.rays_per_pixel;
    let slider = Slider::new(&mut rays, 1..=4096).logarithmic(true);
    if ui.add(slider.text("rays per pixel")).changed() {
        session.edit("rays per pixel", |c| c.rays_per_pixel = rays);
    }
    let mut bounces = composition.max_bounces;
    let most = 32.max(bounces).min(Settings::MAX_BOUNCES);
    if ui
        .add(Slider::new(&mut bounces, 1..=most).text("bounces"))
        .changed()
    {
        session.edit("bounces", |composition| composition.max_bounces = bounces);
    }
    ui.horizontal(|ui| {
        let mut seed = composition.seed;
        if ui.add(DragValue::new(&mut seed)).changed() {
            session.edit("seed", |composition| composition.seed = seed);
        }
        ui.label("seed");
    });
}

fn objects(ui: &mut Ui, session: &mut Session, canvas: &mut Canvas) {
    ui.strong("Objects");
    let Some(loaded) = session.loaded() else {
        return;
    };
    let scene = loaded.scene.clone();
    for object in virtual_objects(&scene) {
        let is_selected = canvas.selected == Some(object);
        ui.push_id(object, |ui| {
            if ui
                .selectable_label(is_selected, &scene.objects[object].name)
                .clicked()
            {
                canvas.selected = (!is_selected).then_some(object);
            }
        });
    }
    let placement = (canvas.selected)
        .and_then(|object| Some((object, session.composition()?)))
        .filter(|(object, composition)| *object < composition.objects.len())
        .map(|(object, composition)| (object, composition.placement(object)));
    let Some((object, mut placement)) = placement else {
        canvas.selected = None;
        return;
    };
    let before = placement;
    numbers(ui, "position, m", &mut placement.translation, 0.002, 5);
    placement.translation = match placement.translation == before.translation {
        true => before.translation,
        false => rounded_m(placement.translation),
    };
    let mut deg = match placement.rotation {
        Rotation::EulerDeg(deg) => deg,
        Rotation::Quaternion(quaternion) => match Rotation::of(quaternion) {
            Rotation::EulerDeg(deg) => deg,
            Rotation::Quaternion(_) => DVec3::ZERO,
        },
    };
    let shown = deg;
    numbers(ui, "rotation, degrees", &mut deg, 0.5, 3);
    if deg != shown {
        placement.rotation = Rotation::EulerDeg(deg.map(|angle| rounded(angle, 1e-3)));
    }
    numbers(ui, "scale", &mut placement.scale, 0.002, 5);
    if placement.scale.abs().min_element() < 1e-5 {
        placement.scale = before.scale;
    }
    if placement != before {
        session.edit("object", |composition| composition.place(object, placement));
    }
    keys(
        ui,
        session,
        Track::Object(object),
        ["Set key", "Delete key"],
    );
    material::show(ui, session, object);
    if ui.button("Remove object").clicked() {
        session.remove(object);
        canvas.selected = None;
    }
}

/// Buttons of these names: a key at the picture's time.
fn keys(ui: &mut Ui, session: &mut Session, track: Track, [set, delete]: [&str; 2]) {
    ui.horizontal(|ui| {
        if ui.button(set).clicked() {
            session.set_key(track);
        }
        let button = egui::Button::new(delete);
        if ui.add_enabled(session.has_key(track), button).clicked() {
            session.delete_key(track);
        }
    });
}

fn numbers(ui: &mut Ui, label: &str, values: &mut DVec3, speed: f64, decimals: usize) {
    ui.horizontal(|ui| {
        for value in values.as_mut() {
            ui.add(DragValue::new(value).speed(speed).max_decimals(decimals));
        }
        ui.label(label);
    });
}
