//! Keys over time: clicked and dragged.

use eframe::egui::{
    Color32, CursorIcon, Pos2, Rect, Response, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2,
};

use crate::preview::composition::Track;
use crate::preview::session::Session;

const HEIGHT_PT: f32 = 20.0;
/// Points on the screen within which a key is caught.
const REACH_PT: f32 = 6.0;
/// Of a key's mark, from its middle, points.
const MARK_PT: f32 = 5.0;
/// Left and right of the first and last time, points.
const MARGIN_PT: f32 = 8.0;
const SELECTED: Color32 = Color32::from_rgb(255, 200, 60);
const FOCUS: Color32 = Color32::from_rgb(80, 200, 235);

/// Times at equal distances, and all between them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// Rising, two at least.
    times_secs: Vec<f64>,
    /// Nothing stands between them.
    snaps: bool,
}

impl Axis {
    pub fn of_span(first_secs: f64, last_secs: f64) -> Self {
        Self {
            times_secs: vec![first_secs, last_secs],
            snaps: false,
        }
    }

    /// `None`: they are no axis.
    pub fn of_frames(times_secs: Vec<f64>) -> Option<Self> {
        let rises = times_secs.windows(2).all(|pair| pair[0] < pair[1]);
        (rises && times_secs.len() > 1).then_some(Self {
            times_secs,
            snaps: true,
        })
    }

    /// From 0 at the first time to 1 at the last.
    fn share(&self, time_secs: f64) -> f64 {
        let times = &self.times_secs;
        let after = times.partition_point(|t| *t <= time_secs);
        let from = after.clamp(1, times.len() - 1) - 1;
        let within = (time_secs - times[from]) / (times[from + 1] - times[from]);
        ((from as f64 + within) / (times.len() - 1) as f64).clamp(0.0, 1.0)
    }

    fn time_secs(&self, share: f64) -> f64 {
        let last = self.times_secs.len() - 1;
        let at = share.clamp(0.0, 1.0) * last as f64;
        if self.snaps {
            return self.times_secs[at.round() as usize];
        }
        let from = (at as usize).min(last - 1);
        let [a, b] = [from, from + 1].map(|index| self.times_secs[index]);
        a + (b - a) * (at - from as f64)
    }

    /// The frame at a time, by its number among them.
    fn frame(&self, time_secs: f64) -> usize {
        let at = self.share(time_secs) * (self.times_secs.len() - 1) as f64;
        at.round() as usize
    }
}

/// A lane with the keys of objects and of the focus, and what is dragged on it.
#[derive(Default)]
pub(super) struct KeyLane {
    held: Option<(Track, f64)>,
    /// As it was drawn last.
    drawn: Option<(Rect, Axis)>,
}

impl KeyLane {
    pub fn on_screen(&self, time_secs: f64) -> Option<Pos2> {
        let (rect, axis) = self.drawn.as_ref()?;
        Some(place(rect, axis, time_secs))
    }

    pub fn show(
        &mut self,
        ui: &mut Ui,
        session: &mut Session,
        selected: Option<usize>,
        axis: Axis,
    ) {
        let size = vec2(ui.available_width().max(80.0), HEIGHT_PT);
        let (area, response) = ui.allocate_exact_size(size, Sense::click_and_drag());
        let rect = area.shrink2(vec2(MARGIN_PT, 0.0));
        let present_secs = session.composition().map_or(0.0, |c| c.time_secs());
        response.widget_info(|| WidgetInfo::slider(true, present_secs, "time and keys"));
        let keys = keys(session, selected);
        let under = |at: Pos2| {
            let near = keys.iter().map(|(track, time_secs)| {
                let distance = (place(&rect, &axis, *time_secs).x - at.x).abs();
                (*track, *time_secs, distance)
            });
            near.filter(|(.., distance)| *distance < REACH_PT)
                .min_by(|a, b| a.2.total_cmp(&b.2))
                .map(|(track, time_secs, _)| (track, time_secs))
        };
        self.act(ui, session, &response, &rect, &axis, under);
        let pointed = response.hover_pos().and_then(under);
        if let Some((track, time_secs)) = pointed.filter(|_| self.held.is_none()) {
            let name = name(session, track);
            let response = response.on_hover_cursor(CursorIcon::Grab);
            response.on_hover_text(format!("key of {name} at {time_secs} s"));
        }
        paint(ui, area, &rect, &axis, session, selected);
        self.drawn = Some((rect, axis));
    }

    fn act(
        &mut self,
        ui: &Ui,
        session: &mut Session,
        response: &Response,
        rect: &Rect,
        axis: &Axis,
        under: impl Fn(Pos2) -> Option<(Track, f64)>,
    ) {
        let time_at = |at: Pos2| {
            let share = (at.x - rect.left()) / rect.width().max(1.0);
            axis.time_secs(f64::from(share))
        };
        if response.drag_started() {
            session.begin_gesture();
            let from = ui.input(|input| input.pointer.press_origin());
            self.held = from.and_then(&under);
        }
        if response.dragged()
            && let Some(at) = response.interact_pointer_pos()
        {
            match &mut self.held {
                Some((track, time_secs)) => {
                    *time_secs = session.shift_key(*track, *time_secs, time_at(at));
                }
                None => go_to(session, axis, time_at(at)),
            }
        }
        if response.drag_stopped() {
            self.held = None;
            session.end_gesture();
        }
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            let of_key = under(at).map(|(_, time_secs)| time_secs);
            go_to(session, axis, of_key.unwrap_or(time_at(at)));
            session.end_gesture();
        }
    }
}

fn go_to(session: &mut Session, axis: &Axis, time_secs: f64) {
    match axis.snaps {
        true => session.go_to_frame(axis.frame(time_secs)),
        false => session.set_time(time_secs),
    }
}

fn place(rect: &Rect, axis: &Axis, time_secs: f64) -> Pos2 {
    let share = axis.share(time_secs) as f32;
    pos2(rect.left() + share * rect.width(), rect.center().y)
}

fn name(session: &Session, track: Track) -> String {
    match track {
        Track::Focus => "the focus".to_owned(),
        Track::Object(object) => {
            let scene = session.loaded().map(|loaded| &loaded.scene);
            let object = scene.and_then(|scene| scene.objects.get(object));
            object.map_or(String::new(), |object| object.name.clone())
        }
    }
}

/// Those of the selected object last, as they are drawn over the others.
fn keys(session: &Session, selected: Option<usize>) -> Vec<(Track, f64)> {
    let Some(composition) = session.composition() else {
        return Vec::new();
    };
    let others = (0..composition.motions.len()).filter(|object| Some(*object) != selected);
    let tracks = (others.map(Track::Object))
        .chain([Track::Focus])
        .chain(selected.map(Track::Object));
    let of_track = |track| {
        let times = composition.key_times_secs(track).into_iter();
        times.map(move |time_secs| (track, time_secs))
    };
    tracks.flat_map(of_track).collect()
}

fn paint(
    ui: &Ui,
    area: Rect,
    rect: &Rect,
    axis: &Axis,
    session: &Session,
    selected: Option<usize>,
) {
    let visuals = ui.visuals();
    let painter = ui.painter_at(area);
    painter.rect_filled(area, 3.0, visuals.extreme_bg_color);
    let along = Stroke::new(1.0, visuals.weak_text_color());
    painter.hline(rect.x_range(), rect.center().y, along);
    let present_secs = session.composition().map_or(0.0, |c| c.time_secs());
    let here = place(rect, axis, present_secs).x;
    painter.vline(
        here,
        area.y_range(),
        Stroke::new(2.0, visuals.strong_text_color()),
    );
    for (track, time_secs) in keys(session, selected) {
        let middle = place(rect, axis, time_secs);
        let seam = Stroke::new(1.0, visuals.extreme_bg_color);
        let shape = match track {
            Track::Focus => Shape::circle_filled(middle, MARK_PT, FOCUS),
            Track::Object(object) => {
                let colour = match selected == Some(object) {
                    true => SELECTED,
                    false => visuals.weak_text_color(),
                };
                let corners = [
                    vec2(0.0, -1.0),
                    vec2(1.0, 0.0),
                    vec2(0.0, 1.0),
                    vec2(-1.0, 0.0),
                ];
                let corners = corners.map(|corner| middle + corner * MARK_PT);
                Shape::convex_polygon(corners.to_vec(), colour, seam)
            }
        };
        painter.add(shape);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_stand_at_equal_distances_and_nothing_between_them() {
        let axis = Axis::of_frames(vec![0.0, 1.0, 4.0]).unwrap();
        assert_eq!(
            [0.0, 1.0, 2.5, 4.0].map(|t| axis.share(t)),
            [0.0, 0.5, 0.75, 1.0]
        );
        assert_eq!([0.2, 0.3].map(|share| axis.time_secs(share)), [0.0, 1.0]);
        assert_eq!(axis.frame(3.9), 2);
        let span = Axis::of_span(1.0, 3.0);
        assert_eq!([0.25, 2.0].map(|share| span.time_secs(share)), [1.5, 3.0]);
        assert_eq!([-1.0, 1.5].map(|t| span.share(t)), [0.0, 0.25]);
        assert_eq!(Axis::of_frames(vec![0.0, 0.0]), None, "control");
    }
}
