//! A scene that is being composed: its file, its edits, and the picture of them. Everything that the window does but drawing.
//!
//! Nothing here waits: files are read on a thread of their own, pictures come from [`RenderThreads`].

mod keyframes;
mod reading;
mod rewriting;
mod timeline;
mod unsaved;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use glam::DVec2;

use super::composition::{Composition, rounded, virtual_objects};
use super::document::Document;
use super::frames::Frames;
use super::geometry::{Geometry, Pick};
use super::history::History;
use super::render_threads::{RenderThreads, Shown, Wanted};
use super::still::Still;
use super::view::View;
use super::watch::Watch;
use crate::output::write_text;
use crate::scene::{Scene, Stages};
use reading::Reading;
pub use rewriting::TAKEN_ENDINGS;
use unsaved::AUTOSAVE_EVERY;

/// A text that was read, and what was edited since.
#[derive(Clone, Debug, PartialEq)]
struct Edited {
    text: Arc<str>,
    composition: Composition,
}

/// A scene as its text says.
pub struct Loaded {
    pub scene: Arc<Scene>,
    pub geometry: Geometry,
    document: Document,
    /// As the text has it.
    base: Composition,
    text: Arc<str>,
}

pub struct Session {
    path: PathBuf,
    wake: Arc<dyn Fn() + Send + Sync>,
    renderers: RenderThreads,
    loaded: Option<Box<Loaded>>,
    present: Option<Edited>,
    saved: Option<Edited>,
    /// What the scene file held when it was last read or written.
    disk: Arc<str>,
    history: History<Edited>,
    reading: Option<Reading>,
    /// `None`: the scene is of one picture.
    frames: Option<Arc<Frames>>,
    frame: usize,
    revision: u64,
    view: View,
    watch: Option<Watch>,
    /// Of reading, saving or rendering; shown until the next success.
    problem: Option<String>,
    /// The scene file was changed by another program while there are unsaved edits.
    has_conflict: bool,
    /// Unsaved work of a run that ended without a word.
    recovered: Option<String>,
    keeps_unsaved_work: bool,
    autosaved: Option<(Edited, Instant)>,
    /// Writes it.
    autosaving: Option<thread::JoinHandle<()>>,
    still: Option<Still>,
}

impl Session {
    /// Opens a scene file; it is read in the background.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn open(
        path: &Path,
        frame_time: Duration,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, rayon::ThreadPoolBuildError> {
        let wake: Arc<dyn Fn() + Send + Sync> = Arc::new(wake);
        let woken = wake.clone();
        let mut session = Self {
            path: path.to_path_buf(),
            wake,
            renderers: RenderThreads::start(frame_time, move || woken())?,
            loaded: None,
            present: None,
            saved: None,
            disk: Arc::from(""),
            history: History::default(),
            reading: None,
            frames: None,
            frame: 0,
            revision: 0,
            view: View::Picture,
            watch: None,
            problem: None,
            has_conflict: false,
            recovered: None,
            keeps_unsaved_work: true,
            autosaved: None,
            autosaving: None,
            still: None,
        };
        session.recovered = std::fs::read_to_string(session.autosave_path()).ok();
        session.read_disk();
        Ok(session)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn loaded(&self) -> Option<&Loaded> {
        self.loaded.as_deref()
    }

    /// The state that is shown or on its way to be.
    pub fn composition(&self) -> Option<&Composition> {
        self.present.as_ref().map(|present| &present.composition)
    }

    pub fn shown(&self) -> Option<Arc<Shown>> {
        self.renderers.shown()
    }

    pub fn renderers(&self) -> &RenderThreads {
        &self.renderers
    }

    /// Counts the states that were shown.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    pub fn is_reading(&self) -> bool {
        self.reading.is_some()
    }

    /// What is wrong, in one line.
    pub fn problem(&self) -> Option<String> {
        self.problem
            .clone()
            .or_else(|| self.renderers.error(self.revision))
    }

    pub fn has_conflict(&self) -> bool {
        self.has_conflict
    }

    pub fn recovered(&self) -> bool {
        self.recovered.is_some()
    }

    pub fn is_dirty(&self) -> bool {
        self.present != self.saved
    }

    pub fn still(&self) -> Option<&Still> {
        self.still.as_ref()
    }

    pub fn view(&self) -> View {
        self.view
    }

    pub fn set_view(&mut self, view: View) {
        if self.view != view {
            self.view = view;
            self.want();
        }
    }

    /// Takes up what has happened meanwhile: files read, files changed. Called before every frame.
    pub fn tick(&mut self, now: Instant) {
        let result = self
            .reading
            .as_ref()
            .and_then(|reading| reading.result.try_recv().ok());
        if let Some(result) = result {
            self.take_up(result, now);
        }
        let changed = self.watch.as_mut().map(|watch| watch.changed(now));
        if let Some(changed) = changed.filter(|changed| !changed.is_empty()) {
            self.files_changed(&changed);
        }
        self.autosave(now);
    }

    /// When [`Session::tick`] has something to do by itself.
    pub fn tick_in(&self, now: Instant) -> Option<Duration> {
        let watch = self.watch.as_ref().and_then(|watch| watch.look_in(now));
        let autosave = self.is_dirty().then_some(AUTOSAVE_EVERY);
        watch.into_iter().chain(autosave).min()
    }

    /// The stages that the file asks for.
    pub fn stages_of_file(&self) -> Option<&Stages> {
        self.loaded.as_ref().map(|loaded| &loaded.base.stages)
    }

    /// Changes what is shown; `what` names the gesture or slider, whose changes are undone together. Nothing happens before the scene is read.
    pub fn edit(&mut self, what: &str, change: impl FnOnce(&mut Composition)) {
        let is_led = self.camera_is_led();
        let Some(before) = self.present.clone() else {
            return;
        };
        let mut after = before.clone();
        change(&mut after.composition);
        if is_led {
            after.composition.camera = before.composition.camera;
        }
        self.keep_frame(&mut after.composition, &before.composition);
        if after == before {
            return;
        }
        self.present = Some(after);
        self.history.changed(before.clone(), what, Instant::now());
        self.show_from(&before.composition);
    }

    /// Edits of one thing are undone together until [`Session::end_gesture`].
    pub fn begin_gesture(&mut self) {
        self.history.begin_gesture();
    }

    /// The next edit is undone by itself.
    pub fn end_gesture(&mut self) {
        self.history.end_gesture();
    }

    fn show_from(&mut self, before: &Composition) {
        let (Some(loaded), Some(present)) = (&self.loaded, &self.present) else {
            return;
        };
        if present.composition.needs_reading(before, &loaded.scene) {
            let text = self.text().unwrap_or_default();
            self.read(Arc::from(text), None, None, false);
        } else {
            self.want();
        }
    }

    fn want(&mut self) {
        let (Some(loaded), Some(present)) = (&self.loaded, &self.present) else {
            return;
        };
        self.revision += 1;
        self.renderers.want(Wanted {
            revision: self.revision,
            scene: loaded.scene.clone(),
            composition: present.composition.clone(),
            view: self.view,
            since: Instant::now(),
        });
    }

    pub fn can_undo(&self) -> bool {
        self.history.can_undo()
    }

    pub fn can_redo(&self) -> bool {
        self.history.can_redo()
    }

    pub fn undo(&mut self) {
        if let Some(present) = self.present.clone()
            && let Some(before) = self.history.undo(present)
        {
            self.go_to(before);
        }
    }

    pub fn redo(&mut self) {
        if let Some(present) = self.present.clone()
            && let Some(after) = self.history.redo(present)
        {
            self.go_to(after);
        }
    }

    fn go_to(&mut self, mut state: Edited) {
        if let Some(present) = &self.present {
            self.keep_frame(&mut state.composition, &present.composition);
        }
        let same_text = (self.loaded.as_ref()).is_some_and(|loaded| loaded.text == state.text);
        if !same_text {
            self.read(state.text, Some(state.composition), None, false);
        } else if let Some(before) = self.present.replace(state) {
            self.show_from(&before.composition);
        }
    }

    /// The scene file's text with all edits; `None` before the scene is read.
    pub fn text(&self) -> Option<String> {
        let (loaded, present) = (self.loaded.as_ref()?, self.present.as_ref()?);
        let mut document = loaded.document.clone();
        document.write(&loaded.base, &present.composition, &loaded.scene);
        Some(document.text())
    }

    /// Writes the edits into the scene file.
    pub fn save(&mut self) {
        let Some(text) = self.text() else {
            return;
        };
        match write_text(&self.path, &text) {
            Ok(()) => {
                self.disk = Arc::from(text);
                self.saved = self.present.clone();
                self.has_conflict = false;
                self.problem = None;
                self.discard_autosave();
            }
            Err(error) => self.problem = Some(error.to_string()),
        }
    }

    /// What stands under a position of the photograph, pixels.
    pub fn pick(&self, pixel: DVec2) -> Option<Pick> {
        let (loaded, composition) = (self.loaded.as_ref()?, self.composition()?);
        (loaded.geometry).pick(&loaded.scene.camera, composition, pixel)
    }

    /// Focuses on what stands there.
    pub fn focus_at(&mut self, pixel: DVec2) {
        if let Some(pick) = self.pick(pixel) {
            self.end_gesture();
            self.edit("focus", |composition| {
                let least = composition.lens.least_focus_m();
                composition.focus(rounded(pick.depth_m, 1e-4).max(least));
            });
            self.end_gesture();
        }
    }

    /// Sets an object down on the real surface there.
    pub fn rest_at(&mut self, object: usize, pixel: DVec2) {
        let (Some(loaded), Some(composition)) = (&self.loaded, self.composition()) else {
            return;
        };
        let camera = &loaded.scene.camera;
        let rested = (loaded.geometry).rest_at(camera, composition, object, pixel);
        if let Some(placement) = rested {
            self.edit("drag", |composition| composition.place(object, placement));
        }
    }

    /// The object of that name, or that number among the virtual ones, from 0.
    pub fn object(&self, name: &str) -> Option<usize> {
        let scene = &self.loaded.as_ref()?.scene;
        let number = name.parse::<usize>().ok();
        let by_name = virtual_objects(scene).find(|index| scene.objects[*index].name == name);
        by_name.or_else(|| virtual_objects(scene).nth(number?))
    }

    /// The scene with its edits.
    pub fn edited_scene(&self) -> Option<Scene> {
        let mut scene = Scene::clone(&self.loaded.as_ref()?.scene);
        self.composition()?.apply(&mut scene);
        Some(scene)
    }

    /// Renders the present state at full quality, beside the preview.
    pub fn render_still(&mut self, path: PathBuf) {
        let Some(scene) = self.edited_scene() else {
            return;
        };
        let wake = self.wake.clone();
        match Still::start(scene, path, move || wake()) {
            Ok(still) => self.still = Some(still),
            Err(problem) => self.problem = Some(problem),
        }
    }

    /// The command line that renders the saved scene.
    pub fn command(&self) -> String {
        format!("mixray render {}", quoted(&self.path.to_string_lossy()))
    }
}

/// As a shell takes it for one word.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+".contains(c);
    match word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}
