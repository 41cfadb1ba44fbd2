//! The window: draws a [`Session`] and turns what is done in it into edits.

mod canvas;
mod file_list;
mod key_lane;
mod keys;
mod panel;
mod stream;
mod system_dialog;
mod timeline;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use eframe::egui::{self, Ui, ViewportCommand};
use glam::DVec2;

use super::composition::{Opening, Track};
use super::frames::Frames;
use super::gizmo::Handle;
use super::render_threads::Level;
use super::session::Session;
use super::still::StillState;
use canvas::Canvas;
use file_list::FileList;
use keys::Act;
pub use stream::{StreamApp, StreamFeed, show_stream};
use system_dialog::{Answer, SystemDialog, picked_file};
use timeline::Timeline;

/// A third of a stop, as a factor of the f-number.
const THIRD_STOP: f64 = 1.122_462_048_309_373;
const PANEL_WIDTH: f32 = 300.0;

/// The state of the window.
pub struct App {
    pub session: Session,
    canvas: Canvas,
    timeline: Timeline,
    shows_help: bool,
    file_list: FileList,
    system_dialog: Option<SystemDialog>,
    /// Until one was not there.
    has_system_dialogs: bool,
    /// The scene that is shown; another has other objects and times.
    scene_path: PathBuf,
    still_path: String,
    /// The window is asked to close while there is unsaved work.
    asks_to_close: bool,
    may_close: bool,
    /// The longest that a frame took so far.
    pub longest_frame: Duration,
}

impl App {
    pub fn new(session: Session) -> Self {
        let still = session.path().with_extension("png");
        Self {
            file_list: FileList::beside(session.path()),
            system_dialog: None,
            has_system_dialogs: false,
            scene_path: session.path().to_path_buf(),
            still_path: format!("still-{}", still.file_name().unwrap_or_default().display()),
            session,
            canvas: Canvas::default(),
            timeline: Timeline::default(),
            shows_help: false,
            asks_to_close: false,
            may_close: false,
            longest_frame: Duration::ZERO,
        }
    }

    /// Where the window shows a position of the photograph, pixels, in points.
    pub fn on_screen(&self, pixel: DVec2) -> egui::Pos2 {
        self.canvas.on_screen(pixel)
    }

    /// Where a handle of the selected object's gizmo can be caught, photograph pixels.
    pub fn grip(&self, handle: Handle) -> Option<DVec2> {
        self.canvas.grip(&self.session, handle)
    }

    /// Where the timeline has a time of the scene's keys, in points.
    pub fn time_on_screen(&self, time_secs: f64) -> Option<egui::Pos2> {
        self.timeline.on_screen(time_secs)
    }

    pub fn select(&mut self, object: Option<usize>) {
        self.canvas.selected = object;
    }

    /// Draws a frame, and takes up what was done since the last.
    pub fn show(&mut self, ui: &mut Ui) {
        let begin = Instant::now();
        self.session.tick(begin);
        if self.scene_path != self.session.path() {
            self.scene_path = self.session.path().to_path_buf();
            (self.canvas, self.timeline) = (Canvas::default(), Timeline::default());
        }
        self.take_files(ui);
        for act in keys::pressed(ui.ctx()) {
            self.act(act, ui.ctx());
        }
        egui::Panel::top("commands").show(ui, |ui| self.commands(ui));
        egui::Panel::bottom("status").show(ui, |ui| self.status(ui));
        if Timeline::is_needed(&self.session) {
            egui::Panel::bottom("timeline").show(ui, |ui| {
                let selected = self.canvas.selected;
                self.timeline.show(ui, &mut self.session, selected);
            });
        }
        egui::Panel::right("settings")
            .default_size(PANEL_WIDTH)
            .show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    ui.spacing_mut().slider_width = 120.0;
                    panel::show(ui, &mut self.session, &mut self.canvas);
                });
            });
        egui::CentralPanel::default().show(ui, |ui| self.canvas.show(ui, &mut self.session));
        self.dialogs(ui);
        if let Some(time) = self.session.tick_in(begin) {
            ui.ctx().request_repaint_after(time);
        }
        self.longest_frame = self.longest_frame.max(begin.elapsed());
    }

    fn act(&mut self, act: Act, context: &egui::Context) {
        let session = &mut self.session;
        let mut stop = |factor: f64| {
            session.edit("f-number", |composition| {
                if let Opening::FNumber { f_number, .. } = &mut composition.lens.opening {
                    let wanted = (*f_number * factor).clamp(0.5, 64.0);
                    *f_number = super::composition::rounded(wanted, 0.01);
                }
            });
        };
        match act {
            Act::Help => self.shows_help = !self.shows_help,
            Act::Open => self.open_file(context),
            Act::Save => session.save(),
            Act::Undo => session.undo(),
            Act::Redo => session.redo(),
            Act::Reload => session.reload(),
            Act::Fit => self.canvas.fit(),
            Act::Wireframe => self.canvas.wireframe ^= true,
            Act::Gizmo => self.canvas.shows_gizmo ^= true,
            Act::Wipe => self.canvas.wipe = self.canvas.wipe.is_none().then_some(0.5),
            Act::WiderAperture => stop(1.0 / THIRD_STOP),
            Act::NarrowerAperture => stop(THIRD_STOP),
            Act::SetKey => {
                if let Some(object) = self.canvas.selected {
                    session.set_key(Track::Object(object));
                }
            }
            Act::Remove => {
                if let Some(object) = self.canvas.selected.take() {
                    session.remove(object);
                }
            }
        }
    }

    fn take_files(&mut self, ui: &Ui) {
        let dropped = ui.input(|input| input.raw.dropped_files.clone());
        for file in dropped {
            let pixel = self.canvas.pointed(ui);
            self.session.take_file(file.path(), pixel);
        }
        self.take_picked_file();
        if let Some(file) = self.file_list.show(ui.ctx()) {
            self.session.take_file(&file, None);
        }
    }

    /// Files to open are asked for by the system's dialog, where it has one.
    fn with_system_dialogs(mut self) -> Self {
        self.has_system_dialogs = cfg!(target_os = "linux");
        self
    }

    fn open_file(&mut self, context: &egui::Context) {
        if self.system_dialog.is_some() {
            return;
        }
        if !self.has_system_dialogs {
            self.file_list.open();
            return;
        }
        let (context, folder) = (context.clone(), self.file_list.folder().to_path_buf());
        let wake = move || context.request_repaint();
        self.system_dialog = Some(SystemDialog::show(move || picked_file(&folder), wake));
    }

    fn take_picked_file(&mut self) {
        let Some(answer) = self.system_dialog.as_ref().map(SystemDialog::answer) else {
            return;
        };
        if answer != Answer::Open {
            self.system_dialog = None;
        }
        match answer {
            Answer::Open | Answer::Closed => {}
            Answer::Chosen(file) => self.session.take_file(&file, None),
            Answer::Missing => {
                self.has_system_dialogs = false;
                self.file_list.open();
            }
        }
    }

    /// The list of files shows the scene's folder and what lies in it, and nothing else.
    pub fn keep_to_folder(&mut self) {
        self.file_list.keep_to_folder();
    }

    fn commands(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            let open = ui.button("Open");
            if open
                .on_hover_text("scene, mesh, photograph or environment")
                .clicked()
            {
                self.open_file(ui.ctx());
            }
            let session = &mut self.session;
            let dirty = session.is_dirty();
            if ui.add_enabled(dirty, egui::Button::new("Save")).clicked() {
                session.save();
            }
            if ui.button("Reload").clicked() {
                session.reload();
            }
            if ui
                .add_enabled(session.can_undo(), egui::Button::new("Undo"))
                .clicked()
            {
                session.undo();
            }
            if ui
                .add_enabled(session.can_redo(), egui::Button::new("Redo"))
                .clicked()
            {
                session.redo();
            }
            ui.menu_button("Still", |ui| {
                ui.text_edit_singleline(&mut self.still_path);
                if ui.button("Render still").clicked() {
                    session.render_still(PathBuf::from(&self.still_path));
                    ui.close();
                }
            });
            if ui.button("Copy command").clicked() {
                ui.ctx().copy_text(session.command());
            }
            if ui.button("Keys").clicked() {
                self.shows_help = !self.shows_help;
            }
            if dirty {
                ui.label("unsaved");
            }
        });
    }

    fn status(&mut self, ui: &mut Ui) {
        if let Some(problem) = self.session.problem() {
            ui.colored_label(ui.visuals().error_fg_color, problem);
        }
        if self.session.has_conflict() {
            ui.horizontal(|ui| {
                ui.colored_label(
                    ui.visuals().warn_fg_color,
                    "the scene file was changed by another program: Save writes over it, Reload drops the edits (undo brings them back)",
                );
            });
        }
        if self.session.recovered() {
            ui.horizontal(|ui| {
                ui.label("An earlier run ended with unsaved work.");
                if ui.button("Restore").clicked() {
                    self.session.recover();
                }
                if ui.button("Discard").clicked() {
                    self.session.discard_autosave();
                }
            });
        }
        self.still_status(ui);
        ui.horizontal(|ui| {
            let words = match self.session.shown() {
                Some(shown) if shown.revision == self.session.revision() => {
                    let level = match shown.level {
                        Level::Coarse => "coarse, ",
                        Level::Fine => "",
                    };
                    let of = match shown.level {
                        Level::Coarse => String::new(),
                        Level::Fine => format!(" of {}", shown.samples_total),
                    };
                    format!(
                        "{level}{}{of} rays per pixel, {}",
                        shown.samples, shown.device
                    )
                }
                _ => (self.session.renderers().activity()).map_or_else(
                    || "waiting".to_owned(),
                    |activity| activity.progress.phase.name().to_owned(),
                ),
            };
            ui.label(words);
            if let Some(words) = self.canvas.under_pointer(ui, &self.session) {
                ui.separator();
                ui.label(words);
            }
        });
    }

    fn still_status(&mut self, ui: &mut Ui) {
        let Some(still) = self.session.still() else {
            return;
        };
        let name = still.path.display();
        ui.horizontal(|ui| match still.state() {
            StillState::Rendering(progress) => {
                let share = progress.map_or(0.0, |progress| match progress.samples_total {
                    0 => 0.0,
                    _ => progress.share_done as f32,
                });
                ui.add(
                    egui::ProgressBar::new(share)
                        .desired_width(160.0)
                        .show_percentage(),
                );
                ui.label(format!("{name}"));
                if ui.button("Stop").clicked() {
                    still.stop();
                }
            }
            StillState::Done => {
                ui.label(format!("{name} is written"));
            }
            StillState::Stopped => {
                ui.label(format!("{name}: stopped, nothing is written"));
            }
            StillState::Failed(problem) => {
                ui.colored_label(ui.visuals().error_fg_color, problem);
            }
        });
    }

    fn dialogs(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        let mut open = self.shows_help;
        egui::Window::new("Keys and pointer")
            .open(&mut open)
            .show(&context, keys::help);
        self.shows_help = open;
        let closes = context.input(|input| input.viewport().close_requested());
        if closes && self.session.is_dirty() && !self.may_close {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.asks_to_close = true;
        } else if closes {
            self.session.discard_autosave();
        }
        if self.asks_to_close {
            egui::Modal::new(egui::Id::unique("close")).show(&context, |ui| {
                ui.label("The scene has unsaved edits.");
                ui.horizontal(|ui| {
                    let save = ui.button("Save and close").clicked();
                    if save {
                        self.session.save();
                    }
                    let is_saved = save && !self.session.is_dirty();
                    if is_saved || ui.button("Close without saving").clicked() {
                        (self.may_close, self.asks_to_close) = (true, false);
                        self.session.discard_autosave();
                        context.send_viewport_cmd(ViewportCommand::Close);
                    }
                    if ui.button("Go on").clicked() {
                        self.asks_to_close = false;
                    }
                });
            });
        }
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show(ui);
    }
}

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    #[error(
        "the window cannot be opened: {0}; expected a display and a graphics driver (on Linux Vulkan, such as Mesa's); or do without it: `mixray preview --headless-script`, `mixray live -o`"
    )]
    Open(String),
    #[error("threads cannot be started: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Opens the window on a scene file and stays until it is closed.
///
/// # Errors
/// There is no display, no graphics driver, or no threads.
pub fn run(scene: &Path, frames: Option<Frames>, frame_time: Duration) -> Result<(), WindowError> {
    let scene = scene.to_path_buf();
    let title = format!("mixray preview {}", scene.display());
    open(
        &title,
        [1240.0, 760.0],
        Box::new(move |creation| {
            let context = creation.egui_ctx.clone();
            let mut session = Session::open(&scene, frame_time, move || context.request_repaint())?;
            if let Some(frames) = frames {
                session.follow(frames);
            }
            Ok(Box::new(App::new(session).with_system_dialogs()))
        }),
    )
}

/// A window of this size in points.
fn open(
    title: &str,
    size: [f32; 2],
    create: eframe::AppCreator<'static>,
) -> Result<(), WindowError> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_inner_size(size)
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        ..eframe::NativeOptions::default()
    };
    eframe::run_native(title, options, create).map_err(|error| WindowError::Open(error.to_string()))
}
