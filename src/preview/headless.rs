//! Runs a script on the window's own code, without a display.

mod expectations;
mod measure;

use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use eframe::egui::{self, Event, Key, Modifiers, MouseWheelUnit, PointerButton, TouchPhase};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec2;

use super::composition::Track;
use super::render_threads::{Level, Shown};
use super::script::{Held, Line, Step};
use super::session::Session;
use super::still::{Still, StillState};
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
const NO_FRAMES: &str = "there are no frames; expected --frames and --trajectory; give them";
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
    run_on(
        session.map_err(|error| at(0)(error.to_string()))?,
        steps,
        tell,
    )
}

/// The same on a session that may follow the frames of a video.
///
/// # Errors
/// As [`run`].
pub fn run_on(
    mut session: Session,
    steps: &[Line],
    tell: &mut dyn FnMut(&str),
) -> Result<(), Failed> {
    let at = |line| move |problem| Failed { line, problem };
    // What a script leaves unsaved is nobody's work.
    session.keep_no_unsaved_work();
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
    pub fn new(mut app: App) -> Self {
        // Files come by the steps of a script.
        app.keep_to_folder();
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
            Step::Select(name) => {
                let object = self.object(name)?;
                self.harness.state_mut().select(Some(object));
                self.frame();
            }
            Step::Pull(handle, by) => {
                let grip = self.app().grip(*handle);
                let grip =
                    grip.ok_or("no object with a gizmo is selected; expected one; click it first")?;
                let to = grip + DVec2::from(*by);
                self.drag(grip.to_array(), to.to_array());
            }
            Step::Wheel(pixel, notches, held) => self.wheel(*pixel, *notches, *held),
            Step::Key(name, held) => self.key(name, *held)?,
            Step::Press(label) => self.press(label)?,
            Step::Set(quantity, value) => self.session_mut().edit("set", |composition| {
                quantity.set(composition, *value);
            }),
            Step::Material(name, number, value) => {
                let object = self.object(name)?;
                self.session_mut().edit("set", |composition| {
                    if let Some(form) = &mut composition.materials[object] {
                        number.set(form, *value as f32);
                    }
                });
            }
            Step::SetKey(name) => {
                let track = self.track(name)?;
                self.session_mut().set_key(track);
            }
            Step::DeleteKey(name) => {
                let track = self.track(name)?;
                if !self.session().has_key(track) {
                    return Err(format!(
                        "`{name}` has no key at the present time; expected one; go to its time first"
                    ));
                }
                self.session_mut().delete_key(track);
            }
            Step::MoveKey(from, to, name) => {
                let track = self.track(name)?;
                if from != to && self.session_mut().shift_key(track, *from, *to) == *from {
                    return Err(format!(
                        "`{name}` has no key at {from} s, or has one at {to} s; expected one that can go there; correct the times"
                    ));
                }
                self.session_mut().end_gesture();
            }
            Step::View(view) => self.session_mut().set_view(*view),
            Step::Place(name, number, value) => {
                let object = self.object(name)?;
                self.session_mut().edit("set", |composition| {
                    let mut placement = composition.placement(object);
                    number.set(&mut placement, *value);
                    composition.place(object, placement);
                });
            }
            Step::Drop(file, at) => {
                self.session_mut().take_file(file, at.map(DVec2::from));
                self.wait_for_scene()?;
            }
            Step::Frame(number) => {
                let frames = self.session().frames().ok_or(NO_FRAMES)?;
                let place = frames.posed().iter().position(|f| f.number == *number);
                let place = place.ok_or_else(|| {
                    format!("there is no frame {number} with a pose; expected one of the folder; correct it")
                })?;
                self.session_mut().go_to_frame(place);
                self.wait_for_scene()?;
            }
            Step::Range(from, to, output) => {
                self.session_mut()
                    .render_range((*from, *to), output.clone());
                self.wait_until("the range", |session| {
                    !matches!(
                        session.still().map(Still::state),
                        None | Some(StillState::Rendering(_))
                    )
                })?;
                if let Some(StillState::Failed(problem)) = self.session().still().map(Still::state)
                {
                    return Err(problem);
                }
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
        if matches!(
            step,
            Step::Set(..) | Step::Material(..) | Step::Place(..) | Step::Undo | Step::Redo
        ) {
            self.session_mut().end_gesture();
        }
        // Another time, and what has keys, are read anew.
        let may_read = matches!(
            step,
            Step::Set(..) | Step::Press(_) | Step::Pull(..) | Step::Undo | Step::Redo
        );
        if may_read && self.session().is_reading() {
            self.wait_for_scene()?;
        }
        self.frame();
        Ok(())
    }

    fn track(&self, name: &str) -> Result<Track, String> {
        self.session().track(name).ok_or_else(|| {
            format!("nothing that can have keys is called `{name}`; expected focus, or a virtual object; correct it")
        })
    }

    fn object(&self, name: &str) -> Result<usize, String> {
        self.session().object(name).ok_or_else(|| {
            format!("no virtual object is called `{name}`; expected a name or number; correct it")
        })
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
