//! Runs a script on the window's own code, without a display.

use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use eframe::egui::{self, Event, Key, Modifiers, MouseWheelUnit, PointerButton, TouchPhase};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec2;

use super::composition::rounded;
use super::render_threads::{Level, Shown};
use super::script::{Expectation, Held, Line, Quantity, Step};
use super::session::Session;
use super::window::App;
use crate::film::Picture;
use crate::output::{PngBits, Target, write_png};
use crate::renderer::{Budget, Renderer, RendererOptions, Watcher};
use crate::scene::load;
use crate::stages::finish;

/// Nothing that is waited for takes longer.
const PATIENCE: Duration = Duration::from_secs(600);
/// Between two frames while something is waited for, as on a screen: drawing more often would take the processors from what renders.
const FRAME: Duration = Duration::from_millis(16);
const SIZE: [f32; 2] = [1240.0, 760.0];

/// A step that failed.
#[derive(Debug)]
pub struct Failed {
    /// From 1; 0: before the first.
    pub line: usize,
    pub problem: String,
}

/// Runs a script on a scene; `tell` hears results, a line or a table each.
///
/// # Errors
/// The first step that cannot be done, or expectation that does not hold.
pub fn run(
    scene: &Path,
    steps: &[Line],
    frame_time: Duration,
    tell: &mut dyn FnMut(&str),
) -> Result<(), Failed> {
    let at = |line| move |problem| Failed { line, problem };
    let session = Session::open(scene, frame_time, || ());
    let session = session.map_err(|error| at(0)(error.to_string()))?;
    let mut window = Window::new(App::new(session));
    window.wait_for_scene().map_err(at(0))?;
    for Line { number, step } in steps {
        window.step(step, tell).map_err(at(*number))?;
    }
    Ok(())
}

/// A window without a display.
pub struct Window {
    harness: Harness<'static, App>,
}

impl Window {
    pub fn new(app: App) -> Self {
        let harness = Harness::builder()
            .with_size(SIZE)
            .with_step_dt(1.0 / 60.0)
            .build_ui_state(|ui: &mut egui::Ui, app: &mut App| app.show(ui), app);
        Self { harness }
    }

    pub fn session(&self) -> &Session {
        &self.harness.state().session
    }

    pub fn session_mut(&mut self) -> &mut Session {
        &mut self.harness.state_mut().session
    }

    pub fn app(&self) -> &App {
        self.harness.state()
    }

    pub fn harness(&mut self) -> &mut Harness<'static, App> {
        &mut self.harness
    }

    /// A frame.
    pub fn frame(&mut self) {
        self.harness.step();
    }

    fn wait_until(&mut self, what: &str, done: impl Fn(&Session) -> bool) -> Result<(), String> {
        let end = Instant::now() + PATIENCE;
        loop {
            self.frame();
            if done(self.session()) {
                return Ok(());
            }
            if let Some(problem) = self.session().problem() {
                return Err(problem);
            }
            if Instant::now() > end {
                return Err(format!("{what} took longer than {} s", PATIENCE.as_secs()));
            }
            sleep(FRAME);
        }
    }

    /// Until no file is being read.
    pub fn wait_for_scene(&mut self) -> Result<(), String> {
        self.wait_until("reading the scene", |session| {
            !session.is_reading() && session.loaded().is_some()
        })?;
        // Panels have their sizes once they were drawn, and the picture has its own from the frame after.
        self.frame();
        self.frame();
        Ok(())
    }

    /// Until the present state is shown; with `rays`, at full size with so many.
    pub fn wait_for_picture(&mut self, rays: Option<u32>) -> Result<(), String> {
        self.wait_until("the picture", |session| {
            let is_present = |shown: &Shown| {
                shown.revision == session.revision() && shown.view == session.view()
            };
            let wanted = |shown: &Shown| match rays {
                Some(rays) => {
                    shown.level == Level::Fine && shown.samples >= rays.min(shown.samples_total)
                }
                None => shown.is_complete(),
            };
            !session.is_reading()
                && session
                    .shown()
                    .is_some_and(|s| is_present(&s) && wanted(&s))
        })
    }

    fn wait_for_coarse(&mut self) -> Result<(), String> {
        self.wait_until("the coarse picture", |session| {
            session
                .shown()
                .is_some_and(|shown| shown.revision == session.revision())
        })
    }

    fn place(&self, [x, y]: [f64; 2]) -> egui::Pos2 {
        self.app().on_screen(DVec2::new(x, y))
    }

    fn button(&mut self, at: egui::Pos2, pressed: bool) {
        self.harness.event(Event::PointerButton {
            pos: at,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::NONE,
        });
        self.frame();
    }

    pub fn click(&mut self, pixel: [f64; 2]) {
        let at = self.place(pixel);
        self.harness.hover_at(at);
        self.frame();
        self.button(at, true);
        self.button(at, false);
        self.frame();
    }

    /// In several moves, a frame each.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        const MOVES: u32 = 8;
        let [from, to] = [from, to].map(|pixel| self.place(pixel));
        self.harness.hover_at(from);
        self.frame();
        self.button(from, true);
        for n in 1..=MOVES {
            let at = from + (to - from) * (n as f32 / MOVES as f32);
            self.harness.hover_at(at);
            self.frame();
        }
        self.button(to, false);
        self.frame();
    }

    pub fn wheel(&mut self, pixel: [f64; 2], notches: f32, held: Held) {
        let at = self.place(pixel);
        self.harness.hover_at(at);
        self.frame();
        let modifiers = modifiers(held);
        let event = Event::MouseWheel {
            unit: MouseWheelUnit::Line,
            delta: egui::vec2(0.0, notches),
            phase: TouchPhase::Move,
            source: egui::MouseWheelSource::Unknown,
            modifiers,
        };
        self.harness.event_modifiers(event, modifiers);
        self.frame();
        self.frame();
    }

    pub fn key(&mut self, name: &str, held: Held) -> Result<(), String> {
        let key = Key::from_name(name)
            .ok_or_else(|| format!("`{name}` is no key; expected a name such as W; correct it"))?;
        match held {
            Held::Nothing => self.harness.key_press(key),
            held => self.harness.key_press_modifiers(modifiers(held), key),
        }
        self.frame();
        self.frame();
        Ok(())
    }

    pub fn press(&mut self, label: &str) -> Result<(), String> {
        match self.harness.query_by_label(label) {
            Some(node) => node.click(),
            None => {
                return Err(format!(
                    "nothing in the window is called `{label}`; expected a button; correct it"
                ));
            }
        }
        self.frame();
        self.frame();
        Ok(())
    }

    pub fn step(&mut self, step: &Step, tell: &mut dyn FnMut(&str)) -> Result<(), String> {
        match step {
            Step::Size(size) => {
                self.harness.set_size((*size).into());
            }
            Step::Scale(scale) => {
                self.harness.set_pixels_per_point(*scale);
            }
            Step::Light => self.harness.ctx.set_theme(egui::Theme::Light),
            Step::Wait(rays) => self.wait_for_picture(*rays)?,
            Step::Click(pixel) => self.click(*pixel),
            Step::Hover(pixel) => self.harness.hover_at(self.place(*pixel)),
            Step::Drag(from, to) => self.drag(*from, *to),
            Step::Wheel(pixel, notches, held) => self.wheel(*pixel, *notches, *held),
            Step::Key(name, held) => self.key(name, *held)?,
            Step::Press(label) => self.press(label)?,
            Step::Set(quantity, value) => self.session_mut().edit("set", |composition| {
                quantity.set(composition, *value);
            }),
            Step::View(view) => self.session_mut().set_view(*view),
            Step::Drop(file) => {
                self.session_mut().take_file(file, None);
                self.wait_for_scene()?;
            }
            Step::Undo => self.session_mut().undo(),
            Step::Redo => self.session_mut().redo(),
            Step::Save => self.session_mut().save(),
            Step::Reload => {
                self.session_mut().reload();
                self.wait_for_scene()?;
            }
            Step::Expect(expectation) => self.expect(expectation)?,
            Step::Screenshot(path) => self.screenshot(path)?,
            Step::Picture(path) => self.picture(path)?,
            Step::Measure(edits) => tell(&self.measure(*edits)?),
        }
        if matches!(step, Step::Set(..) | Step::Undo | Step::Redo) {
            self.session_mut().end_gesture();
        }
        self.frame();
        Ok(())
    }

    fn expect(&mut self, expectation: &Expectation) -> Result<(), String> {
        let session = self.session();
        let composition = session.composition().ok_or("no scene is read")?;
        let holds = match expectation {
            Expectation::Value(quantity, value, share) => {
                let is = quantity.of(composition);
                let close = |is: f64| (is - value).abs() <= share * value.abs();
                if !is.is_some_and(close) {
                    let is = is.map_or("nothing".to_owned(), |is| is.to_string());
                    return Err(format!(
                        "it is {is}; expected {value}; see the steps before"
                    ));
                }
                true
            }
            Expectation::Rests(name, within) => {
                let object = session.object(name).ok_or_else(|| {
                    format!("no virtual object is called `{name}`; expected a name or number; correct it")
                })?;
                let gap = session
                    .loaded()
                    .and_then(|l| l.geometry.gap_m(composition, object));
                let gap = gap.ok_or("there is no real surface under it")?;
                if !(gap.abs() <= *within) {
                    return Err(format!(
                        "`{name}` is {gap} m above the surface; expected at most {within}; see the steps before"
                    ));
                }
                true
            }
            Expectation::Saved => !session.is_dirty(),
            Expectation::Unsaved => session.is_dirty(),
            Expectation::Problem => session.problem().is_some(),
            Expectation::NoProblem => session.problem().is_none(),
            Expectation::FileEqualsWindow => self.file_equals_window()?,
            Expectation::FileDiffersFromWindow => !self.file_equals_window()?,
        };
        match holds {
            true => Ok(()),
            false => Err(format!(
                "{expectation:?} does not hold; see the steps before"
            )),
        }
    }

    /// Renders the file anew and compares every bit.
    pub fn file_equals_window(&mut self) -> Result<bool, String> {
        self.wait_for_picture(None)?;
        let shown = self.session().shown().ok_or("nothing is shown")?;
        let picture = rendered(self.session().path())?;
        let bits = |picture: &Picture| -> Vec<u32> {
            let values = picture.linear.as_flattened().iter();
            values.map(|value| value.to_bits()).collect()
        };
        Ok(bits(&picture) == bits(&shown.picture))
    }

    /// The window as it looks; a graphics driver draws it, a software one too.
    pub fn screenshot(&mut self, path: &Path) -> Result<(), String> {
        self.frame();
        let image = self.harness.render()?;
        let codes: Vec<[u8; 3]> = image.pixels().map(|p| [p[0], p[1], p[2]]).collect();
        let photo = crate::scene::Photo::from_srgb8(image.width(), image.height(), codes);
        let picture = Picture {
            width: photo.width,
            height: photo.height,
            linear: photo.linear,
        };
        let target = Target::picture(path).map_err(|error| error.to_string())?;
        write_png(&target, &picture, None, PngBits::Eight).map_err(|error| error.to_string())
    }

    fn picture(&mut self, path: &Path) -> Result<(), String> {
        self.wait_for_coarse()?;
        let shown = self.session().shown().ok_or("nothing is shown")?;
        let target = Target::picture(path).map_err(|error| error.to_string())?;
        let photo = crate::scene::Photo::from_srgb8(shown.width, shown.height, shown.codes.clone());
        let picture = Picture {
            width: photo.width,
            height: photo.height,
            linear: photo.linear,
        };
        write_png(&target, &picture, None, PngBits::Eight).map_err(|error| error.to_string())
    }

    /// From edits to the pictures that show them first, as a Markdown table.
    fn measure(&mut self, edits: u32) -> Result<String, String> {
        let objects = self
            .session()
            .loaded()
            .map(|loaded| super::composition::virtual_objects(&loaded.scene).next());
        let object = objects.flatten();
        self.wait_for_picture(Some(1))?;
        for kind in 0..4 {
            for n in 0..edits {
                let step = f64::from(n % 7) * 0.01 + 0.01;
                self.session_mut()
                    .edit("measure", |composition| match kind {
                        0 => composition.lens.focus_distance_m = rounded(0.7 + step, 1e-4),
                        1 => {
                            if let Some(form) = &mut composition.environment {
                                form.rotation_deg = rounded(100.0 * step, 0.01);
                            }
                        }
                        2 => {
                            if let Some(object) = object {
                                composition.objects[object].translation.x = rounded(step, 1e-5);
                            }
                        }
                        _ => Quantity::Exposure.set(composition, step),
                    });
                self.wait_for_coarse()?;
            }
        }
        let added = self.measure_files(&["glb", "gltf"], true)?;
        let swapped = self.measure_files(&["png", "jpg", "jpeg", "webp"], false)?;
        let longest_ms = 1e3 * self.app().longest_frame.as_secs_f64();
        let latencies = self.session().renderers().latencies();
        let mut table = String::from(
            "| edit | edits | median, ms | p95, ms | of the processors, median, ms |\n| --- | --- | --- | --- | --- |\n",
        );
        let mut row = |name: &str, times: Option<Spread>, processors: Option<Spread>| {
            if let Some(times) = times {
                let processors =
                    processors.map_or("".to_owned(), |p| format!("{:.0}", p.median_ms));
                table += &format!(
                    "| {name} | {} | {:.0} | {:.0} | {processors} |\n",
                    times.count, times.median_ms, times.p95_ms
                );
            }
        };
        for change in ["lens", "light", "object", "exposure or bounces"] {
            let of_change = || {
                let all = latencies.iter();
                all.filter(|latency| latency.change == change && latency.level == Level::Coarse)
            };
            let times = Spread::of(of_change().map(|latency| latency.time));
            let processors = Spread::of(of_change().map(|latency| latency.processor_time));
            row(change, times, processors);
        }
        row("object added", Spread::of(added.into_iter()), None);
        row("photograph swapped", Spread::of(swapped.into_iter()), None);
        let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
        let load = load.split(' ').next().unwrap_or_default();
        Ok(table
            + &format!(
                "\nlongest frame of the window: {longest_ms:.0} ms; load of the machine: {load}\n"
            ))
    }

    /// From files that are dropped, one of the scene's own with such an ending, to the pictures that show them first; `undone`: each is taken out
    /// again.
    fn measure_files(&mut self, endings: &[&str], undone: bool) -> Result<Vec<Duration>, String> {
        const FILES: usize = 5;
        let loaded = self.session().loaded().ok_or("no scene is read")?;
        let has_ending = |file: &&PathBuf| {
            let ending = file.extension().map(|e| e.to_string_lossy().to_lowercase());
            ending.is_some_and(|ending| endings.contains(&&*ending))
        };
        let Some(file) = loaded.scene.inputs.iter().find(has_ending).cloned() else {
            return Ok(Vec::new());
        };
        let mut times = Vec::new();
        for _ in 0..FILES {
            let begin = Instant::now();
            self.session_mut().take_file(&file, None);
            self.wait_for_scene()?;
            self.wait_for_coarse()?;
            times.push(begin.elapsed());
            if undone {
                self.session_mut().undo();
                self.wait_for_scene()?;
                self.wait_for_coarse()?;
            }
        }
        Ok(times)
    }
}

/// Of some times.
struct Spread {
    count: usize,
    median_ms: f64,
    p95_ms: f64,
}

impl Spread {
    /// `None` of none.
    fn of(times: impl Iterator<Item = Duration>) -> Option<Self> {
        let mut ms: Vec<f64> = times.map(|time| 1e3 * time.as_secs_f64()).collect();
        ms.sort_by(f64::total_cmp);
        let last = ms.len().checked_sub(1)?;
        let at = |share: f64| ms[(last as f64 * share).round() as usize];
        Some(Self {
            count: ms.len(),
            median_ms: at(0.5),
            p95_ms: at(0.95),
        })
    }
}

fn modifiers(held: Held) -> Modifiers {
    match held {
        Held::Nothing => Modifiers::NONE,
        Held::Shift => Modifiers::SHIFT,
        Held::Control => Modifiers::COMMAND | Modifiers::CTRL,
    }
}

/// As `mixray render` renders it.
fn rendered(path: &Path) -> Result<Picture, String> {
    let scene = load(path).map_err(|error| error.to_string())?;
    let nobody = Watcher::none();
    let mut renderer = Renderer::new(scene, RendererOptions::default(), &nobody)
        .map_err(|error| error.to_string())?;
    renderer
        .advance(Budget::Complete, &nobody)
        .map_err(|error| error.to_string())?;
    let picture = renderer.delivered().picture;
    Ok(finish(picture, renderer.film(), renderer.scene(), 0, None, None).picture)
}
