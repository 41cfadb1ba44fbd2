//! What is drawn over the canvas, and told of what is under the pointer.

use eframe::egui::{self, Color32, Pos2, Rect, Shape, Stroke, Ui, Vec2};
use glam::DVec3;

use super::Canvas;
use crate::preview::geometry::{camera_ray, seen_at};
use crate::preview::render_threads::Level;
use crate::preview::session::Session;
use crate::preview::view::confusion_px;

impl Canvas {
    /// The picture and what lies over it.
    pub(super) fn paint(&self, ui: &Ui, area: Rect, session: &Session) {
        let painter = ui.painter().with_clip_rect(area);
        let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        let border = self.place.left() + self.wipe.unwrap_or(1.0) * self.place.width();
        if let Some(texture) = &self.picture {
            let left = Rect::from_min_max(area.min, Pos2::new(border, area.max.y));
            let clipped = if self.wipe.is_some() {
                painter.with_clip_rect(left)
            } else {
                painter.clone()
            };
            clipped.image(texture.id(), self.place, whole, Color32::WHITE);
        }
        if let (Some(_), Some(texture)) = (self.wipe, &self.photo) {
            let right = Rect::from_min_max(Pos2::new(border, area.min.y), area.max);
            painter
                .with_clip_rect(right)
                .image(texture.id(), self.place, whole, Color32::WHITE);
            let line = [
                Pos2::new(border, self.place.top()),
                Pos2::new(border, self.place.bottom()),
            ];
            painter.line_segment(line, Stroke::new(1.5, Color32::WHITE));
        }
        if self.wireframe {
            self.paint_wireframe(&painter, session);
        }
        if let Some(frame) = self.selected.and_then(|object| self.frame(session, object)) {
            let stroke = Stroke::new(1.0, Color32::from_rgb(255, 190, 60));
            painter.rect_stroke(frame, 0.0, stroke, egui::StrokeKind::Outside);
            for corner in [
                frame.left_top(),
                frame.right_top(),
                frame.left_bottom(),
                frame.right_bottom(),
            ] {
                let handle = Rect::from_center_size(corner, Vec2::splat(7.0));
                painter.rect_filled(handle, 1.0, Color32::from_rgb(255, 190, 60));
            }
        }
        self.paint_gizmo(ui, &painter, session);
    }

    fn paint_wireframe(&self, painter: &egui::Painter, session: &Session) {
        let (Some(loaded), Some(composition)) = (session.loaded(), session.composition()) else {
            return;
        };
        let camera = &loaded.scene.camera;
        let stroke = Stroke::new(1.0, Color32::from_rgb(80, 220, 255));
        let lines = loaded.geometry.proxy_edges.iter().filter_map(|ends| {
            let ends = ends.map(|end| seen_at(camera, composition, end));
            let [Some(a), Some(b)] = ends else {
                return None;
            };
            let points = [self.on_screen(a), self.on_screen(b)];
            Some(Shape::line_segment(points, stroke))
        });
        painter.with_clip_rect(self.place).extend(lines);
    }

    /// The rectangle around an object as the camera sees it, points.
    pub(super) fn frame(&self, session: &Session, object: usize) -> Option<Rect> {
        let (loaded, composition) = (session.loaded()?, session.composition()?);
        let (lo, hi) = loaded.geometry.bounds(object)?;
        let world_from_object = composition.world_from_object(object);
        let mut frame = Rect::NOTHING;
        for corner in 0..8_u32 {
            let pick = |bit: u32, axis: usize| {
                if corner >> bit & 1 == 0 {
                    lo[axis]
                } else {
                    hi[axis]
                }
            };
            let point = DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2));
            let point = world_from_object.transform_point3(point);
            frame.extend_with(self.on_screen(seen_at(&loaded.scene.camera, composition, point)?));
        }
        Some(frame)
    }

    /// What stands under the pointer, in words.
    pub fn under_pointer(&self, ui: &Ui, session: &Session) -> Option<String> {
        let pixel = self.pointed(ui)?;
        let (loaded, composition) = (session.loaded()?, session.composition()?);
        let camera = &loaded.scene.camera;
        camera_ray(camera, composition, pixel)?;
        let mut words = format!("({:.0}, {:.0})", pixel.x.floor(), pixel.y.floor());
        if let Some(shown) = session.shown() {
            // The coarse picture is smaller.
            let (width, height) = (shown.picture.width, shown.picture.height);
            let x = pixel.x * f64::from(width) / f64::from(camera.width);
            let y = pixel.y * f64::from(height) / f64::from(camera.height);
            let index = y as usize * width as usize + x as usize;
            if let Some([r, g, b]) = shown.picture.linear.get(index) {
                words += &format!("  linear {r:.4} {g:.4} {b:.4}");
            }
            if shown.level == Level::Coarse {
                words += " (coarse)";
            }
        }
        if let Some(pick) = session.pick(pixel) {
            let circle = confusion_px(&composition.lens(), camera, pick.depth_m);
            let what = pick
                .object
                .map_or("real", |object| &loaded.scene.objects[object].name);
            words += &format!("  {what}, {:.3} m, circle {circle:.1} px", pick.depth_m);
        }
        Some(words)
    }
}
