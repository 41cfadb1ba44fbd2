//! The timeline under the picture: frames of a video, or the time of the scene's own keys.

use std::path::PathBuf;

use eframe::egui::{DragValue, Pos2, Slider, Ui};

use super::key_lane::{Axis, KeyLane};
use crate::preview::session::Session;

/// Between two pictures where the scene has keys and no frames, seconds.
const STEP_SECS: f64 = 0.04;

pub(super) struct Timeline {
    plays: bool,
    /// Numbers of frames, the end not included; `None`: all.
    range: Option<(u32, u32)>,
    output: String,
    lane: KeyLane,
}

impl Default for Timeline {
    fn default() -> Self {
        Self {
            plays: false,
            range: None,
            output: "frames-out".to_owned(),
            lane: KeyLane::default(),
        }
    }
}

impl Timeline {
    /// The scene has something that time changes.
    pub fn is_needed(session: &Session) -> bool {
        session.frames().is_some() || session.moves()
    }

    /// Where a time of the scene's keys stands on the screen, points.
    pub fn on_screen(&self, time_secs: f64) -> Option<Pos2> {
        self.lane.on_screen(time_secs)
    }

    /// `selected`: the object whose keys stand out.
    pub fn show(&mut self, ui: &mut Ui, session: &mut Session, selected: Option<usize>) {
        self.play_on(session);
        if let Some(frames) = session.frames() {
            let times = frames.posed().iter().map(|frame| frame.time_secs());
            let times = times.collect::<Option<Vec<_>>>().unwrap_or_default();
            let has_keys = session.composition().is_some_and(|c| c.has_keys());
            if let Some(axis) = Axis::of_frames(times).filter(|_| has_keys) {
                self.lane.show(ui, session, selected, axis);
            }
        }
        ui.horizontal(|ui| {
            let label = if self.plays { "Pause" } else { "Play" };
            if ui.button(label).clicked() {
                self.plays ^= true;
            }
            ui.spacing_mut().slider_width = (ui.available_width() - 420.0).max(80.0);
            match session.frames().is_some() {
                true => self.frames(ui, session),
                false => self.times(ui, session, selected),
            }
        });
    }

    /// Goes on once the picture before is there: as fast as they come.
    fn play_on(&mut self, session: &mut Session) {
        let is_shown = (session.shown()).is_some_and(|shown| shown.revision == session.revision());
        if !self.plays || session.is_reading() || !is_shown {
            return;
        }
        let goes_on = match session.frames() {
            Some(frames) => {
                let next = session.frame() + 1;
                let is_there = next < frames.posed().len();
                session.go_to_frame(next);
                is_there
            }
            None => match (session.composition(), session.span_secs()) {
                (Some(composition), Some((_, last))) => {
                    let next = composition.time_secs() + STEP_SECS;
                    if next <= last {
                        session.set_time(next);
                    }
                    next <= last
                }
                _ => false,
            },
        };
        self.plays = goes_on;
    }

    fn frames(&mut self, ui: &mut Ui, session: &mut Session) {
        let Some(frames) = session.frames() else {
            return;
        };
        let posed = frames.posed();
        let (Some(first), Some(last)) = (posed.first(), posed.last()) else {
            return;
        };
        let all = (first.number, last.number + 1);
        let shown = &posed[session.frame().min(posed.len() - 1)];
        let mut words = shown.label.clone();
        if let Some(secs) = shown.time_secs() {
            words += &format!(", {secs:.3} s");
        }
        let mut place = session.frame();
        let slider = Slider::new(&mut place, 0..=posed.len() - 1).show_value(false);
        if ui.add(slider.text("frame")).changed() {
            self.plays = false;
            session.go_to_frame(place);
        }
        ui.label(words);
        let (mut from, mut to) = self.range.unwrap_or(all);
        ui.menu_button("Range", |ui| {
            ui.horizontal(|ui| {
                ui.add(DragValue::new(&mut from).range(all.0..=all.1 - 1));
                ui.label("to before");
                ui.add(DragValue::new(&mut to).range(from + 1..=all.1));
            });
            self.range = Some((from, to));
            ui.text_edit_singleline(&mut self.output);
            if ui.button("Render range").clicked() {
                session.render_range((from, to), PathBuf::from(&self.output));
                ui.close();
            }
            if ui.button("Copy range's command").clicked() {
                let command = session.range_command((from, to), &self.output);
                ui.ctx().copy_text(command);
                ui.close();
            }
        });
    }

    fn times(&mut self, ui: &mut Ui, session: &mut Session, selected: Option<usize>) {
        let Some((first, last)) = session.span_secs() else {
            return;
        };
        let before = session.composition().map_or(0.0, |c| c.time_secs());
        let mut time_secs = before;
        ui.label("time, s");
        let value = DragValue::new(&mut time_secs).speed(0.01).max_decimals(4);
        let response = ui.add(value);
        if response.changed() && time_secs != before {
            session.set_time(time_secs);
        }
        if response.drag_stopped() || response.lost_focus() {
            session.end_gesture();
        }
        self.lane
            .show(ui, session, selected, Axis::of_span(first, last));
    }
}
