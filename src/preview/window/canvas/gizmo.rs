//! The gizmo on the screen: which handle is under the pointer, how it looks, what dragging it does.

use eframe::egui::{Align2, Color32, FontId, Painter, Pos2, Shape, Stroke, Ui, Vec2};
use glam::DVec2;

use super::{Canvas, Gesture};
use crate::preview::composition::{Placement, moves_within};
use crate::preview::geometry::{camera_ray, seen_at};
use crate::preview::gizmo::{Gizmo, Handle, dragged, measure, within_half_turn};
use crate::preview::session::Session;

/// Length of an arrow across the view, points.
const ARROW_PT: f32 = 84.0;
/// Points on the screen within which a handle is caught.
const REACH_PT: f32 = 6.0;
/// Of the tip, points.
const TIP_PT: f32 = 9.0;
const COLOURS: [Color32; 3] = [
    Color32::from_rgb(236, 86, 86),
    Color32::from_rgb(96, 206, 96),
    Color32::from_rgb(96, 146, 255),
];
const CAUGHT: Color32 = Color32::from_rgb(255, 235, 90);

impl Canvas {
    /// Of the selected object; what is animated within its mesh stands where that says, and has none.
    fn gizmo(&self, session: &Session) -> Option<(usize, Gizmo)> {
        let object = self.selected.filter(|_| self.shows_gizmo)?;
        let (loaded, composition) = (session.loaded()?, session.composition()?);
        if moves_within(loaded.scene.objects.get(object)?) {
            return None;
        }
        let placement = composition.placement(object);
        let px_per_pt = self.size.x / self.place.width();
        let length_px = f64::from(ARROW_PT * px_per_pt);
        let gizmo = Gizmo::at(&loaded.scene.camera, composition, &placement, length_px)?;
        Some((object, gizmo))
    }

    /// On the screen, points; `None` if a part of it is not seen, or it is seen end on.
    fn handle_line(&self, session: &Session, gizmo: &Gizmo, handle: Handle) -> Option<Vec<Pos2>> {
        let camera = &session.loaded()?.scene.camera;
        let composition = session.composition()?;
        let eye = composition.camera.world_from_camera().w_axis.truncate();
        if !gizmo.is_usable(handle, eye) {
            return None;
        }
        let points = gizmo.points(handle).into_iter();
        points
            .map(|point| Some(self.on_screen(seen_at(camera, composition, point)?)))
            .collect()
    }

    /// The handle under a position of the screen.
    fn handle_at(&self, session: &Session, at: Pos2) -> Option<Handle> {
        let (_, gizmo) = self.gizmo(session)?;
        let reached = Handle::all().filter_map(|handle| {
            let line = self.handle_line(session, &gizmo, handle)?;
            Some((handle, distance_pt(&line, at)))
        });
        reached
            .filter(|(_, distance)| *distance < REACH_PT)
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(handle, _)| handle)
    }

    /// Where a handle can be caught, photograph pixels: the point of it that lies farthest from the others.
    pub fn grip(&self, session: &Session, handle: Handle) -> Option<DVec2> {
        let (_, gizmo) = self.gizmo(session)?;
        let line = self.handle_line(session, &gizmo, handle)?;
        let others: Vec<Vec<Pos2>> = Handle::all()
            .filter(|other| *other != handle)
            .filter_map(|other| self.handle_line(session, &gizmo, other))
            .collect();
        let room = |at: Pos2| {
            let distances = others.iter().map(|line| distance_pt(line, at));
            distances.fold(f32::INFINITY, f32::min)
        };
        let best = (line.into_iter()).max_by(|a, b| room(*a).total_cmp(&room(*b)))?;
        Some(self.pixel(best))
    }

    pub(super) fn begin_gizmo(&self, session: &Session, at: Pos2) -> Option<Gesture> {
        let handle = self.handle_at(session, at)?;
        let (object, _) = self.gizmo(session)?;
        let from = session.composition()?.placement(object);
        Some(Gesture::Gizmo {
            object,
            handle,
            from,
            start: self.measured(session, handle, &from, at)?,
            by: 0.0,
        })
    }

    fn measured(
        &self,
        session: &Session,
        handle: Handle,
        from: &Placement,
        at: Pos2,
    ) -> Option<f64> {
        let camera = &session.loaded()?.scene.camera;
        let ray = camera_ray(camera, session.composition()?, self.pixel(at))?;
        measure(handle, from.translation, &ray)
    }

    pub(super) fn drag_gizmo(&mut self, session: &mut Session, at: Pos2) {
        let Some(Gesture::Gizmo {
            object,
            handle,
            from,
            start,
            ..
        }) = self.gesture
        else {
            return;
        };
        let Some(now) = self.measured(session, handle, &from, at) else {
            return;
        };
        let dragged_by = match handle.turns() {
            true => within_half_turn(now - start),
            false => now - start,
        };
        if let Some(Gesture::Gizmo { by, .. }) = &mut self.gesture {
            *by = dragged_by;
        }
        session.edit("gizmo", |composition| {
            composition.place(object, dragged(handle, &from, dragged_by));
        });
    }

    pub(super) fn paint_gizmo(&self, ui: &Ui, painter: &Painter, session: &Session) {
        let Some((_, gizmo)) = self.gizmo(session) else {
            return;
        };
        let pointer = ui.input(|input| input.pointer.latest_pos());
        let caught = match self.gesture {
            Some(Gesture::Gizmo { handle, .. }) => Some(handle),
            Some(_) => None,
            None => pointer.and_then(|at| self.handle_at(session, at)),
        };
        for handle in Handle::all() {
            let Some(line) = self.handle_line(session, &gizmo, handle) else {
                continue;
            };
            let (colour, width) = match caught == Some(handle) {
                true => (CAUGHT, 3.0),
                false => (COLOURS[handle.axis()], 2.0),
            };
            // A dark seam keeps it visible over any photograph.
            let seam = Stroke::new(width + 2.0, Color32::from_black_alpha(110));
            painter.add(Shape::line(line.clone(), seam));
            if let ([begin, end], false) = (&*line, handle.turns()) {
                painter.add(tip(*begin, *end, colour));
            }
            painter.add(Shape::line(line, Stroke::new(width, colour)));
        }
        if let (Some(Gesture::Gizmo { handle, by, .. }), Some(at)) = (self.gesture, pointer) {
            let words = match handle.turns() {
                true => format!("{:+.1}\u{b0}", by.to_degrees()),
                false => format!("{} {by:+.4} m", ["x", "y", "z"][handle.axis()]),
            };
            let at = at + Vec2::new(16.0, -16.0);
            let font = FontId::monospace(13.0);
            let text = painter.layout_no_wrap(words, font, CAUGHT);
            let place = Align2::LEFT_BOTTOM.anchor_size(at, text.size());
            painter.rect_filled(place.expand(3.0), 3.0, Color32::from_black_alpha(190));
            painter.galley(place.min, text, CAUGHT);
        }
    }
}

fn tip(begin: Pos2, end: Pos2, colour: Color32) -> Shape {
    let along = (end - begin).normalized();
    let foot = end - along * TIP_PT;
    let aside = along.rot90() * (0.45 * TIP_PT);
    Shape::convex_polygon(vec![end, foot + aside, foot - aside], colour, Stroke::NONE)
}

/// From a point to the nearest of a line's parts.
fn distance_pt(line: &[Pos2], at: Pos2) -> f32 {
    let parts = line.windows(2).map(|ends| {
        let (from, along) = (ends[0], ends[1] - ends[0]);
        let share = match along.length_sq() > 0.0 {
            true => ((at - from).dot(along) / along.length_sq()).clamp(0.0, 1.0),
            false => 0.0,
        };
        (from + along * share).distance(at)
    });
    parts.fold(f32::INFINITY, f32::min)
}
