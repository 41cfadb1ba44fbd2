//! The picture, and what the pointer does on it.

mod gizmo;
mod paint;

use std::sync::Arc;

use eframe::egui::{
    self, ColorImage, Event, Key, Modifiers, PointerButton, Pos2, Rect, Response, Sense,
    TextureHandle, TextureOptions, Ui, Vec2, vec2,
};
use glam::{DVec2, DVec3};

use crate::preview::composition::{Placement, rounded};
use crate::preview::geometry::seen_at;
use crate::preview::gizmo::Handle;
use crate::preview::manipulate::{dollied, orbited, panned, scaled, turned};
use crate::preview::render_threads::{Shown, photo_codes};
use crate::preview::session::Session;
use crate::scene::Scene;

/// Points on the screen within which a corner is caught.
const CORNER_PT: f32 = 8.0;
/// Degrees that one notch of the wheel turns an object.
const TURN_DEG: f64 = 5.0;
/// Degrees that the camera orbits for a point of the screen.
const ORBIT_DEG_PER_PT: f64 = 0.4;
const MAX_ZOOM: f32 = 64.0;

/// What a drag does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Gesture {
    /// An object along the real surface; from the pointer to its foot, photograph pixels.
    Object {
        object: usize,
        foot_from_pointer: DVec2,
    },
    /// By a corner: its distance from the foot at the beginning, points.
    Scale {
        object: usize,
        foot: DVec3,
        foot_at: Pos2,
        radius: f32,
        from: Placement,
    },
    /// By a handle: where it was caught, and by how much it was dragged, metres or radians.
    Gizmo {
        object: usize,
        handle: Handle,
        from: Placement,
        start: f64,
        by: f64,
    },
    Orbit,
    PanCamera,
    /// The environment.
    Light,
    PanView,
    /// The border between picture and photograph.
    Wipe,
}

impl Gesture {
    /// What is dragged.
    fn object(&self) -> Option<usize> {
        match *self {
            Self::Object { object, .. }
            | Self::Scale { object, .. }
            | Self::Gizmo { object, .. } => Some(object),
            _ => None,
        }
    }
}

pub(super) struct Canvas {
    picture: Option<TextureHandle>,
    photo: Option<TextureHandle>,
    /// What the textures hold.
    uploaded: Option<Arc<Shown>>,
    uploaded_scene: Option<Arc<Scene>>,
    /// 1: the picture fits.
    zoom: f32,
    /// The picture's middle from the canvas's, points.
    offset: Vec2,
    gesture: Option<Gesture>,
    pub selected: Option<usize>,
    pub wireframe: bool,
    /// Arrows and rings on the selected object.
    pub shows_gizmo: bool,
    /// Share of the width that shows the picture; the rest shows the bare photograph.
    pub wipe: Option<f32>,
    /// Where the picture lies, points.
    place: Rect,
    size: Vec2,
}

impl Default for Canvas {
    fn default() -> Self {
        Self {
            picture: None,
            photo: None,
            uploaded: None,
            uploaded_scene: None,
            zoom: 1.0,
            offset: Vec2::ZERO,
            gesture: None,
            selected: None,
            wireframe: false,
            shows_gizmo: true,
            wipe: None,
            place: Rect::NOTHING,
            size: Vec2::ZERO,
        }
    }
}

impl Canvas {
    /// Where a position of the photograph, pixels, stands on the screen, points.
    pub fn on_screen(&self, pixel: DVec2) -> Pos2 {
        let share = vec2(pixel.x as f32 / self.size.x, pixel.y as f32 / self.size.y);
        self.place.min + share * self.place.size()
    }

    fn pixel(&self, at: Pos2) -> DVec2 {
        let share = (at - self.place.min) / self.place.size();
        DVec2::new(
            f64::from(share.x * self.size.x),
            f64::from(share.y * self.size.y),
        )
    }

    pub fn fit(&mut self) {
        (self.zoom, self.offset) = (1.0, Vec2::ZERO);
    }

    /// The position of the photograph under the pointer, pixels, if it is within the picture.
    pub fn pointed(&self, ui: &Ui) -> Option<DVec2> {
        let at = ui.input(|input| input.pointer.latest_pos())?;
        self.place.contains(at).then(|| self.pixel(at))
    }

    pub fn show(&mut self, ui: &mut Ui, session: &mut Session) {
        let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        let Some(loaded) = session.loaded() else {
            ui.painter().text(
                area.center(),
                egui::Align2::CENTER_CENTER,
                if session.is_reading() {
                    "reading the scene"
                } else {
                    "no scene"
                },
                egui::FontId::proportional(16.0),
                ui.visuals().text_color(),
            );
            return;
        };
        let camera = &loaded.scene.camera;
        self.size = vec2(camera.width as f32, camera.height as f32);
        self.forget_lost_objects(session);
        self.upload(ui, session);
        self.lay_out(area);
        if area.is_positive() {
            self.act(ui, &response, session);
            // The zoom may be another.
            self.lay_out(area);
            self.paint(ui, area, session);
        }
    }

    /// Objects may be gone since the last frame, by an undo or with another file.
    fn forget_lost_objects(&mut self, session: &Session) {
        let count = (session.composition()).map_or(0, |composition| composition.objects.len());
        self.selected = self.selected.filter(|object| *object < count);
        self.gesture =
            (self.gesture).filter(|gesture| gesture.object().is_none_or(|object| object < count));
    }

    fn lay_out(&mut self, area: Rect) {
        let fit = (area.width() / self.size.x)
            .min(area.height() / self.size.y)
            .max(1e-6);
        let size = self.size * fit * self.zoom;
        self.place = Rect::from_center_size(area.center() + self.offset, size);
    }

    fn upload(&mut self, ui: &Ui, session: &Session) {
        let context = ui.ctx();
        let holds = |held: &Option<Arc<Shown>>, shown| {
            held.as_ref().is_some_and(|held| Arc::ptr_eq(held, shown))
        };
        if let Some(shown) = session.shown()
            && !holds(&self.uploaded, &shown)
        {
            let size = [shown.width as usize, shown.height as usize];
            set(&mut self.picture, context, "picture", size, &shown.codes);
            self.uploaded = Some(shown);
        }
        let scene = session.loaded().map(|loaded| &loaded.scene);
        let is_held = |held: &Arc<Scene>| scene.is_some_and(|scene| Arc::ptr_eq(held, scene));
        if let Some(scene) = scene
            && !self.uploaded_scene.as_ref().is_some_and(is_held)
        {
            let size = [scene.camera.width, scene.camera.height];
            let codes = photo_codes(scene.photo.as_ref(), size);
            let size = size.map(|side| side as usize);
            set(&mut self.photo, context, "photograph", size, &codes);
            self.uploaded_scene = Some(scene.clone());
        }
    }

    fn act(&mut self, ui: &Ui, response: &Response, session: &mut Session) {
        let modifiers = ui.input(|input| input.modifiers);
        if response.drag_started()
            && let Some(at) = ui.input(|input| input.pointer.press_origin())
        {
            session.begin_gesture();
            self.gesture = Some(self.begin(ui, response, session, at, modifiers));
        }
        if response.dragged()
            && let Some(at) = response.interact_pointer_pos()
        {
            self.drag(session, at, response.drag_delta());
        }
        if response.drag_stopped() {
            self.gesture = None;
            session.end_gesture();
        }
        if response.clicked_by(PointerButton::Primary)
            && let Some(at) = response.interact_pointer_pos()
        {
            let pixel = self.pixel(at);
            self.selected = session.pick(pixel).and_then(|pick| pick.object);
            session.focus_at(pixel);
        }
        if response.hovered() {
            self.wheel(ui, session);
        }
    }

    fn begin(
        &mut self,
        ui: &Ui,
        response: &Response,
        session: &Session,
        at: Pos2,
        modifiers: Modifiers,
    ) -> Gesture {
        let has_photo = (session.loaded()).is_some_and(|loaded| loaded.scene.photo.is_some());
        if response.dragged_by(PointerButton::Middle) {
            return Gesture::PanView;
        }
        if response.dragged_by(PointerButton::Secondary) {
            return match modifiers.shift {
                true => Gesture::PanCamera,
                false => Gesture::Orbit,
            };
        }
        if ui.input(|input| input.key_down(Key::L)) {
            return Gesture::Light;
        }
        if modifiers.alt {
            return Gesture::Orbit;
        }
        let border = self
            .wipe
            .map(|share| self.place.left() + share * self.place.width());
        if border.is_some_and(|border| (border - at.x).abs() < CORNER_PT) {
            return Gesture::Wipe;
        }
        if let Some(gizmo) = self.begin_gizmo(session, at) {
            return gizmo;
        }
        if let Some(scale) = self.begin_scale(session, at) {
            return scale;
        }
        let pixel = self.pixel(at);
        if let Some(object) = session.pick(pixel).and_then(|pick| pick.object) {
            self.selected = Some(object);
            let foot = foot(session, object).and_then(|foot| seen(session, foot));
            return Gesture::Object {
                object,
                foot_from_pointer: foot.map_or(DVec2::ZERO, |foot| foot - pixel),
            };
        }
        match has_photo {
            true => Gesture::PanView,
            false => Gesture::Orbit,
        }
    }

    fn begin_scale(&self, session: &Session, at: Pos2) -> Option<Gesture> {
        let object = self.selected?;
        let frame = self.frame(session, object)?;
        let corners = [
            frame.left_top(),
            frame.right_top(),
            frame.left_bottom(),
            frame.right_bottom(),
        ];
        corners
            .iter()
            .find(|corner| corner.distance(at) < CORNER_PT)?;
        let foot = foot(session, object)?;
        let foot_at = self.on_screen(seen(session, foot)?);
        Some(Gesture::Scale {
            object,
            foot,
            foot_at,
            radius: foot_at.distance(at).max(1.0),
            from: session.composition()?.placement(object),
        })
    }

    fn drag(&mut self, session: &mut Session, at: Pos2, delta: Vec2) {
        let points = DVec2::new(f64::from(delta.x), f64::from(delta.y));
        match self.gesture {
            Some(Gesture::Object {
                object,
                foot_from_pointer,
            }) => session.rest_at(object, self.pixel(at) + foot_from_pointer),
            Some(Gesture::Scale {
                object,
                foot,
                foot_at,
                radius,
                from,
            }) => {
                let factor = f64::from(foot_at.distance(at) / radius).max(0.01);
                session.edit("scale", |composition| {
                    composition.place(object, scaled(&from, factor, foot));
                });
            }
            Some(Gesture::Gizmo { .. }) => self.drag_gizmo(session, at),
            Some(Gesture::Orbit) => {
                let distance = focus_or_metre(session);
                session.edit("orbit", |composition| {
                    let degrees = points * ORBIT_DEG_PER_PT;
                    composition.camera = orbited(&composition.camera, degrees, distance);
                });
            }
            Some(Gesture::PanCamera) => {
                let distance = focus_or_metre(session);
                let Some(loaded) = session.loaded() else {
                    return;
                };
                // What lies at the point looked at follows the pointer.
                let per_point =
                    f64::from(self.size.x / self.place.width()) / loaded.scene.camera.fx;
                let shift = DVec2::new(-points.x, points.y) * per_point;
                session.edit("pan", |composition| {
                    composition.camera = panned(&composition.camera, shift, distance);
                });
            }
            Some(Gesture::Light) => {
                session.edit("environment rotation", |composition| {
                    if let Some(environment) = &mut composition.environment {
                        let turned = environment.rotation_deg + 0.5 * points.x;
                        environment.rotation_deg = rounded(turned.rem_euclid(360.0), 0.01);
                    }
                });
            }
            Some(Gesture::PanView) => self.offset += delta,
            Some(Gesture::Wipe) => {
                let share = (at.x - self.place.left()) / self.place.width();
                self.wipe = Some(share.clamp(0.0, 1.0));
            }
            None => {}
        }
    }

    fn wheel(&mut self, ui: &Ui, session: &mut Session) {
        let notches = ui.input(|input| {
            let mut sum = (0.0, input.modifiers);
            for event in &input.events {
                if let Event::MouseWheel {
                    unit,
                    delta,
                    modifiers,
                    ..
                } = event
                {
                    let along = if delta.y == 0.0 { delta.x } else { delta.y };
                    let per_notch = match unit {
                        egui::MouseWheelUnit::Point => 50.0,
                        egui::MouseWheelUnit::Line | egui::MouseWheelUnit::Page => 1.0,
                    };
                    sum = (sum.0 + along / per_notch, *modifiers);
                }
            }
            sum
        });
        let (notches, modifiers) = notches;
        let Some(at) = ui
            .input(|input| input.pointer.latest_pos())
            .filter(|_| notches != 0.0)
        else {
            return;
        };
        let notches_f64 = f64::from(notches);
        if modifiers.shift {
            let under = session.pick(self.pixel(at)).and_then(|pick| pick.object);
            if let Some(object) = under.or(self.selected) {
                session.edit("turn", |composition| {
                    let placement = composition.placement(object);
                    composition.place(object, turned(&placement, TURN_DEG * notches_f64));
                });
            }
        } else if modifiers.command {
            let distance = focus_or_metre(session);
            session.edit("dolly", |composition| {
                let factor = 0.9_f64.powf(notches_f64);
                composition.camera = dollied(&composition.camera, factor, distance);
            });
        } else {
            let zoom = (self.zoom * 1.2_f32.powf(notches)).clamp(1.0, MAX_ZOOM);
            let from_middle = at - self.place.center();
            // What is under the pointer stays there.
            self.offset += from_middle * (1.0 - zoom / self.zoom);
            self.zoom = zoom;
            if zoom == 1.0 {
                self.offset = Vec2::ZERO;
            }
        }
    }
}

fn set(
    texture: &mut Option<TextureHandle>,
    context: &egui::Context,
    name: &str,
    size: [usize; 2],
    codes: &[[u8; 3]],
) {
    let image = ColorImage::from_rgb(size, codes.as_flattened());
    let options = TextureOptions {
        magnification: egui::TextureFilter::Nearest,
        ..TextureOptions::LINEAR
    };
    match texture {
        Some(texture) => texture.set(image, options),
        None => *texture = Some(context.load_texture(name, image, options)),
    }
}

/// The point that an object stands on.
fn foot(session: &Session, object: usize) -> Option<DVec3> {
    let placement = session.composition()?.placement(object);
    (session.loaded()?.geometry).lowest_point(object, &placement)
}

fn seen(session: &Session, point: DVec3) -> Option<DVec2> {
    seen_at(
        &session.loaded()?.scene.camera,
        session.composition()?,
        point,
    )
}

/// Where a camera that looks at nothing in particular turns about.
fn focus_or_metre(session: &Session) -> f64 {
    let focus = session.composition().map(|c| c.focus_distance_m());
    focus.filter(|focus| focus.is_finite()).unwrap_or(1.0)
}
