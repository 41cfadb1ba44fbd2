//! The progress bar: on stderr, and only where that is a terminal; and lines on stdout for an engine that asks for them.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use clap::ValueEnum;
use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use super::pool;
use super::terminal::{escaped, one_line, print};
use crate::renderer::{Phase, Progress};

/// What a render does, and the share of it that is done.
pub(super) struct Bar {
    bar: Option<ProgressBar>,
    unit: &'static str,
    /// Rays when they were last counted, and a second's worth of them in millions until then: they are counted pass by pass.
    rate: Mutex<(u64, f64)>,
    lines: Option<Lines>,
}

/// Who reads lines of progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Engine {
    /// Open Job Description.
    Openjd,
}

/// Lines that an engine reads: whole percents, and what is done, each once.
#[derive(Default)]
struct Lines(Mutex<(Option<u64>, String)>);

impl Lines {
    fn tell(&self, share_done: f64, doing: &str) {
        let Ok(mut told) = self.0.lock() else { return };
        let mut text = String::new();
        if !doing.is_empty() && told.1 != doing {
            doing.clone_into(&mut told.1);
            text += &format!("openjd_status: {}\n", one_line(doing));
        }
        let percent = (100.0 * share_done.clamp(0.0, 1.0)) as u64;
        if told.0.is_none_or(|before| before < percent) {
            told.0 = Some(percent);
            text += &format!("openjd_progress: {percent}\n");
        }
        if !text.is_empty() {
            // Whoever no longer listens needs no progress.
            let _ = print(&text);
        }
    }
}

/// Of the bar's length.
const PARTS: u64 = 1000;

impl Bar {
    /// `unit`: of what a render counts, "rays per pixel" or "scrambles".
    pub(super) fn new(doing: &'static str, unit: &'static str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(PARTS);
            set_template(&bar, "{prefix} {wide_bar} {percent:>3}%{msg}");
            bar.set_prefix(doing);
            tick(&bar, 200);
            bar
        });
        Self {
            bar,
            unit,
            rate: Mutex::default(),
            lines: None,
        }
    }

    /// Tells an engine as well.
    pub(super) fn told_to(mut self, engine: Option<Engine>) -> Self {
        self.lines = engine.map(|Engine::Openjd| Lines::default());
        self
    }

    pub(super) fn hear(&self, progress: &Progress) {
        if let Some(lines) = &self.lines {
            lines.tell(progress.share_done, progress.phase.name());
        }
        let Some(bar) = &self.bar else { return };
        bar.set_prefix(progress.phase.name());
        bar.set_position((progress.share_done * PARTS as f64) as u64);
        let seconds = progress.elapsed.as_secs_f64().max(1e-9);
        let left = seconds * (1.0 / progress.share_done.max(1e-9) - 1.0);
        let mut message = String::new();
        if progress.phase == Phase::Rendering {
            let (samples, total, unit) = (progress.samples, progress.samples_total, self.unit);
            message = format!(", {samples}/{total} {unit}");
            let rays = progress.rays.traced();
            if rays > 0
                && let Ok(mut counted) = self.rate.lock()
            {
                if rays != counted.0 {
                    *counted = (rays, rays as f64 / seconds / 1e6);
                }
                message += &format!(", {:.2} Mrays/s", counted.1);
            }
        }
        if progress.share_done > 0.0 && seconds > 1.0 {
            let left = HumanDuration(Duration::try_from_secs_f64(left).unwrap_or(Duration::MAX));
            message += &format!(", {left:#} left");
        }
        bar.set_message(message);
    }

    /// Says something while the bar steps aside.
    pub(super) fn aside(&self, speak: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(speak),
            None => speak(),
        }
    }
}

/// However the command ends, no bar stays behind.
impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Steps of a longer job, each with a line of what is going on.
pub(super) struct Steps {
    bar: Option<ProgressBar>,
    lines: Option<Lines>,
    /// Done, and to do.
    count: (AtomicU64, AtomicU64),
}

impl Steps {
    pub(super) fn new(count: u64) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(count);
            set_template(&bar, "{bar:24} {pos}/{len}, {elapsed}: {wide_msg}");
            tick(&bar, 500);
            bar
        });
        Self {
            bar,
            lines: None,
            count: (AtomicU64::new(0), AtomicU64::new(count)),
        }
    }

    /// Tells an engine as well.
    pub(super) fn told_to(mut self, engine: Option<Engine>) -> Self {
        self.lines = engine.map(|Engine::Openjd| Lines::default());
        self
    }

    fn tell(&self, doing: &str) {
        if let Some(lines) = &self.lines {
            let [done, count] = [&self.count.0, &self.count.1].map(|n| n.load(Ordering::Relaxed));
            lines.tell(done as f64 / count.max(1) as f64, doing);
        }
    }

    /// How many steps there are.
    pub(super) fn expect(&self, count: u64) {
        self.count.1.store(count, Ordering::Relaxed);
        if let Some(bar) = &self.bar {
            bar.set_length(count);
        }
    }

    /// Says something while the bar steps aside.
    pub(super) fn aside(&self, speak: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(speak),
            None => speak(),
        }
    }

    /// Something within a step.
    pub(super) fn say(&self, message: &str) {
        self.tell(message);
        if let Some(bar) = &self.bar {
            bar.set_message(escaped(message));
        }
    }

    /// A step ends.
    pub(super) fn step(&self) {
        self.count.0.fetch_add(1, Ordering::Relaxed);
        self.tell("");
        if let Some(bar) = &self.bar {
            bar.inc(1);
        }
    }

    pub(super) fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Moves on its own, where a thread can be made for that.
fn tick(bar: &ProgressBar, milliseconds: u64) {
    if pool::can_spawn() {
        bar.enable_steady_tick(Duration::from_millis(milliseconds));
    }
}

fn set_template(bar: &ProgressBar, template: &str) {
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
}

/// Things done of things to do.
pub(super) struct Count {
    bar: Option<ProgressBar>,
}

impl Count {
    pub(super) fn new(what: &'static str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(1);
            set_template(&bar, "{wide_bar} {pos}/{len} {msg}, {eta} left");
            bar.set_message(what);
            bar
        });
        Self { bar }
    }

    pub(super) fn show(&self, done: u64, total: u64) {
        if let Some(bar) = &self.bar {
            bar.set_length(total);
            bar.set_position(done);
        }
    }

    pub(super) fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
