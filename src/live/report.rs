//! What a stream came to, and its last seconds.

use std::collections::BTreeMap;

use serde::Serialize;

use super::ages::{AgeSpread, Ages};
use super::slot::Counts;
use crate::stages::StageSeconds;

/// Frames by what became of them. Those that arrived are the sum of the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LiveCounts {
    pub arrived: u64,
    /// A newer one came before they were taken up.
    pub dropped: u64,
    /// With their own pose.
    pub rendered: u64,
    /// With the last pose that was found.
    pub held: u64,
    /// Without a pose: written as they came.
    pub passed_through: u64,
}

impl LiveCounts {
    fn since(self, before: Self) -> Self {
        Self {
            arrived: self.arrived - before.arrived,
            dropped: self.dropped - before.dropped,
            rendered: self.rendered - before.rendered,
            held: self.held - before.held,
            passed_through: self.passed_through - before.passed_through,
        }
    }

    pub fn written(self) -> u64 {
        self.rendered + self.held + self.passed_through
    }
}

/// Seconds over all frames, by what they were spent on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveSeconds {
    /// Y'CbCr to light.
    pub decode: f64,
    pub track: f64,
    /// Pilot, camera, and what moved.
    pub edit: f64,
    pub render: f64,
    pub composite: f64,
    #[serde(flatten)]
    pub stages: StageSeconds,
    pub write: f64,
}

impl LiveSeconds {
    pub(super) fn add(&mut self, other: &Self) {
        self.decode += other.decode;
        self.track += other.track;
        self.edit += other.edit;
        self.render += other.render;
        self.composite += other.composite;
        self.stages.add(&other.stages);
        self.write += other.write;
    }

    pub(super) fn total(&self) -> f64 {
        self.decode
            + self.track
            + self.edit
            + self.render
            + self.composite
            + self.stages.total()
            + self.write
    }
}

/// Some seconds of a stream.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveWindow {
    pub seconds: f64,
    pub frames: LiveCounts,
    /// From a frame's arrival to its output.
    pub age: AgeSpread,
    /// The part of it in which the frame was not worked on.
    pub wait: AgeSpread,
    /// Of rendered frames, mean, for each pixel of the stream.
    pub rays_per_pixel: f64,
    /// What the sides of rendered pictures were divided by, mean.
    pub coarseness: f64,
    /// Of processing, without waiting: mean of a frame, ...
    pub work_ms: f64,
    /// ... and how frames differ in it.
    pub work: AgeSpread,
    /// Why frames had no pose of their own.
    pub without_pose: BTreeMap<String, u64>,
}

impl LiveWindow {
    /// One line.
    pub fn text(&self) -> String {
        let LiveCounts {
            arrived,
            dropped,
            held,
            passed_through,
            ..
        } = self.frames;
        let mut text = format!(
            "{:.1} of {:.1} frames/s, age {:.0} ms, p95 {:.0}, work {:.0}; {:.2} rays per pixel, sides divided by {:.1}; {dropped} dropped, {held} with the pose before, {passed_through} without one",
            self.frames.written() as f64 / self.seconds,
            arrived as f64 / self.seconds,
            self.age.median_ms,
            self.age.p95_ms,
            self.work_ms,
            self.rays_per_pixel,
            self.coarseness,
        );
        let most = self.without_pose.iter().max_by_key(|(_, count)| **count);
        if let Some((why, _)) = most {
            text += &format!(" ({why})");
        }
        text
    }
}

/// What a stream came to.
#[derive(Clone, Debug, Serialize)]
pub struct LiveStats {
    pub total: LiveWindow,
    pub windows: Vec<LiveWindow>,
    /// Of all frames.
    pub seconds: LiveSeconds,
    pub backend: String,
    pub device: String,
}

impl LiveStats {
    /// A few lines for the user.
    pub fn text(&self) -> String {
        let frames = self.total.frames.written().max(1) as f64;
        let each = |seconds: f64| 1e3 * seconds / frames;
        let s = &self.seconds;
        let mut text = format!(
            "{}\nms a frame on {}: decode {:.1}, track {:.1}, edit {:.1}, render {:.1}, composite {:.1}",
            self.total.text(),
            self.device,
            each(s.decode),
            each(s.track),
            each(s.edit),
            each(s.render),
            each(s.composite)
        );
        for (name, seconds) in s.stages.by_name().filter(|(_, seconds)| *seconds > 0.0) {
            text += &format!(", {} {:.1}", name.replace('_', " "), each(seconds));
        }
        text + &format!(", write {:.1}\n", each(s.write))
    }
}

/// Adds frames up, for the window of the moment and for all.
#[derive(Debug, Default)]
pub(super) struct Tally {
    counts: LiveCounts,
    before: LiveCounts,
    window: Sums,
    all: Sums,
    pub windows: Vec<LiveWindow>,
    pub seconds: LiveSeconds,
}

#[derive(Debug, Default)]
struct Sums {
    ages: Ages,
    waits: Ages,
    works: Ages,
    rays_per_pixel: f64,
    coarseness: f64,
    work_secs: f64,
    without_pose: BTreeMap<String, u64>,
}

impl Sums {
    fn window(&self, frames: LiveCounts, seconds: f64) -> LiveWindow {
        let rendered = (frames.rendered + frames.held).max(1) as f64;
        LiveWindow {
            seconds,
            frames,
            age: self.ages.spread(),
            wait: self.waits.spread(),
            rays_per_pixel: self.rays_per_pixel / rendered,
            coarseness: self.coarseness / rendered,
            work_ms: 1e3 * self.work_secs / self.ages.len().max(1) as f64,
            work: self.works.spread(),
            without_pose: self.without_pose.clone(),
        }
    }

    fn extend(&mut self, other: &Self) {
        self.ages.extend(&other.ages);
        self.waits.extend(&other.waits);
        self.works.extend(&other.works);
        self.rays_per_pixel += other.rays_per_pixel;
        self.coarseness += other.coarseness;
        self.work_secs += other.work_secs;
        for (why, count) in &other.without_pose {
            *self.without_pose.entry(why.clone()).or_default() += count;
        }
    }
}

/// How finely a frame was rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fineness {
    /// For each pixel of the stream.
    pub rays_per_pixel: f64,
    /// What the sides of its picture were divided by.
    pub coarseness: u32,
}

/// How a frame came to its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Became {
    Rendered(Fineness),
    Held(Fineness),
    PassedThrough,
}

impl Tally {
    pub fn lacks_pose(&mut self, why: String) {
        *self.window.without_pose.entry(why).or_default() += 1;
    }

    pub fn add(&mut self, became: Became, age_secs: f64, seconds: &LiveSeconds) {
        match became {
            Became::Rendered(_) => self.counts.rendered += 1,
            Became::Held(_) => self.counts.held += 1,
            Became::PassedThrough => self.counts.passed_through += 1,
        }
        if let Became::Rendered(fineness) | Became::Held(fineness) = became {
            self.window.rays_per_pixel += fineness.rays_per_pixel;
            self.window.coarseness += f64::from(fineness.coarseness);
        }
        self.window.ages.add(age_secs);
        self.window.waits.add(age_secs - seconds.total());
        self.window.works.add(seconds.total());
        self.window.work_secs += seconds.total();
        self.seconds.add(seconds);
    }

    pub fn written(&self) -> u64 {
        self.counts.written()
    }

    /// Ends the window of the moment.
    pub fn close_window(&mut self, intake: Counts, seconds: f64) -> &LiveWindow {
        self.counts.arrived = intake.arrived;
        self.counts.dropped = intake.dropped;
        let window = std::mem::take(&mut self.window);
        self.all.extend(&window);
        let frames = self.counts.since(self.before);
        self.before = self.counts;
        self.windows.push(window.window(frames, seconds));
        &self.windows[self.windows.len() - 1]
    }

    /// Of all windows that were closed.
    pub fn total(&self, seconds: f64) -> LiveWindow {
        self.all.window(self.counts, seconds)
    }
}
