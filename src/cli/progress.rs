//! The progress bar: on stderr, and only where that is a terminal.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use super::terminal::escaped;
use crate::renderer::Progress;

/// What a render counts: "rays per pixel" or "scrambles".
pub(super) struct Bar {
    bar: Option<ProgressBar>,
    unit: &'static str,
}

impl Bar {
    pub(super) fn new(total: u32, unit: &'static str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(u64::from(total));
            set_template(&bar, &format!("{{wide_bar}} {{pos}}/{{len}} {unit}"));
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        Self { bar, unit }
    }

    pub(super) fn show(&self, progress: &Progress) {
        if let Some(bar) = &self.bar {
            let unit = self.unit;
            set_template(
                bar,
                &format!("{{wide_bar}} {{pos}}/{{len}} {unit}, {{msg}} Mrays/s, {{eta}} left"),
            );
            bar.set_length(u64::from(progress.samples_total));
            bar.set_position(u64::from(progress.samples));
            let seconds = progress.elapsed.as_secs_f64().max(1e-9);
            let rate = progress.rays.traced() as f64 / seconds / 1e6;
            bar.set_message(format!("{rate:.2}"));
        }
    }

    pub(super) fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Steps of a longer job, each with a line of what is going on.
pub(super) struct Steps(Option<ProgressBar>);

impl Steps {
    pub(super) fn new(count: u64) -> Self {
        if !std::io::stderr().is_terminal() {
            return Self(None);
        }
        let bar = ProgressBar::new(count);
        set_template(&bar, "{bar:24} {pos}/{len}, {elapsed}: {wide_msg}");
        bar.enable_steady_tick(Duration::from_millis(500));
        Self(Some(bar))
    }

    /// Something within a step.
    pub(super) fn say(&self, message: &str) {
        if let Some(bar) = &self.0 {
            bar.set_message(escaped(message));
        }
    }

    /// A step ends.
    pub(super) fn step(&self) {
        if let Some(bar) = &self.0 {
            bar.inc(1);
        }
    }

    pub(super) fn clear(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
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
