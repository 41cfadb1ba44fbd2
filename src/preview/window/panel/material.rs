//! What the scene file says an object is made of.

use eframe::egui::{self, Slider, Ui};

use super::slide;
use crate::preview::material_form::{MaterialForm, MaterialNumber};
use crate::preview::quantity::decimal;
use crate::preview::session::Session;

const NUMBERS: &[(&str, MaterialNumber)] = &[
    ("metallic", MaterialNumber::Metallic),
    ("roughness", MaterialNumber::Roughness),
    ("specular", MaterialNumber::Specular),
    ("transmission", MaterialNumber::Transmission),
    ("clearcoat", MaterialNumber::Clearcoat),
    ("clearcoat roughness", MaterialNumber::ClearcoatRoughness),
];
/// Of glass to diamond.
const LARGEST_IOR: f64 = 3.0;

pub(super) fn show(ui: &mut Ui, session: &mut Session, object: usize) {
    let form = session
        .composition()
        .and_then(|c| *c.materials.get(object)?);
    let Some(form) = form else {
        replace(ui, session, object);
        return;
    };
    ui.label("Material");
    ui.horizontal(|ui| {
        let [r, g, b, opacity] = form.base_color;
        let mut colour = [r, g, b];
        // Linear, as the scene file has it.
        if egui::color_picker::color_edit_button_rgb(ui, &mut colour).changed() {
            let [r, g, b] = colour.map(|channel| (channel * 1e3).round() / 1e3);
            edit(session, "base colour", object, |form| {
                form.base_color = [r, g, b, opacity];
            });
        }
        ui.label("base colour");
    });
    for (label, number) in NUMBERS {
        number_slider(ui, session, label, object, *number, |value| {
            Slider::new(value, 0.0..=1.0)
        });
    }
    if form.transmission > 0.0 {
        number_slider(
            ui,
            session,
            "index of refraction",
            object,
            MaterialNumber::Ior,
            |value| Slider::new(value, 1.0..=LARGEST_IOR),
        );
        let mut is_thin = form.thin_walled;
        if ui.checkbox(&mut is_thin, "thin walled").changed() {
            edit(session, "thin walled", object, |form| {
                form.thin_walled = is_thin
            });
        }
    }
}

/// Starts from what the mesh brought, but for its textures.
fn replace(ui: &mut Ui, session: &mut Session, object: usize) {
    let own = session.loaded().and_then(|loaded| {
        let parts = &loaded.scene.objects.get(object)?.instances;
        Some(MaterialForm::of(&parts.first()?.material))
    });
    let Some(own) = own else {
        return;
    };
    let button = ui.button("Replace material");
    if button
        .on_hover_text(
            "numbers in the scene file in place of the mesh's own materials and textures",
        )
        .clicked()
    {
        session.end_gesture();
        session.edit("material", |composition| {
            composition.materials[object] = Some(own)
        });
        session.end_gesture();
    }
}

fn number_slider(
    ui: &mut Ui,
    session: &mut Session,
    label: &'static str,
    object: usize,
    number: MaterialNumber,
    slider: impl FnOnce(&mut f64) -> Slider<'_>,
) {
    let form = session
        .composition()
        .and_then(|c| *c.materials.get(object)?);
    let Some(form) = form else {
        return;
    };
    let value = decimal(number.of(&form));
    slide(
        ui,
        session,
        label,
        slider,
        value,
        1e-3,
        |composition, value| {
            if let Some(form) = &mut composition.materials[object] {
                number.set(form, value as f32);
            }
        },
    );
}

fn edit(session: &mut Session, what: &str, object: usize, change: impl FnOnce(&mut MaterialForm)) {
    session.edit(what, |composition| {
        if let Some(form) = &mut composition.materials[object] {
            change(form);
        }
    });
}
