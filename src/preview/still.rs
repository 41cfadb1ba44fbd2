//! A still, or frames of a video, rendered at full quality beside the preview.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use super::render_threads::{Stop, polite_pool};
use crate::output::{
    ExrLayers, ExrPicture, Format, Metadata, PngBits, Target, write_exr, write_png,
};
use crate::renderer::{Budget, Delivered, Progress, Renderer, RendererOptions, Watcher};
use crate::scene::Scene;
use crate::sequence::{SequenceOptions, render_sequence};
use crate::stages::finish_in_layers;

/// Below both renderers of the window.
const STILL_NICE: i32 = 15;

/// How far it is.
#[derive(Clone, Debug, PartialEq)]
pub enum StillState {
    Rendering(Option<Progress>),
    Done,
    Stopped,
    Failed(String),
}

/// On its way to a file, or a folder.
pub struct Still {
    pub path: PathBuf,
    state: Arc<Mutex<StillState>>,
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl Still {
    /// Renders as `mixray render` does.
    ///
    /// # Errors
    /// The name ends in something else than `.png` or `.exr`, or is a file that the scene is made of.
    pub fn start(
        scene: Scene,
        path: PathBuf,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, String> {
        let same = |input: &PathBuf| input.canonicalize().ok() == path.canonicalize().ok();
        if path.exists() && scene.inputs.iter().any(same) {
            let name = path.display();
            return Err(format!(
                "{name}: the scene is made of it; expected another name; choose one"
            ));
        }
        let target = Target::picture(&path).map_err(|error| error.to_string())?;
        Ok(Self::spawn(path, wake, move |stop, tell| {
            render(scene, &target, stop, tell)
        }))
    }

    /// Renders frames as `mixray sequence` does.
    pub fn of_range(options: SequenceOptions, wake: impl Fn() + Send + Sync + 'static) -> Self {
        Self::spawn(options.output.clone(), wake, move |stop, _| {
            let cancelled = || stop.is_asked();
            let watcher = Watcher::none().cancelled_by(&cancelled);
            let rendered = render_sequence(&options, &watcher, &|_| ());
            rendered.map(|_| ()).map_err(|error| error.to_string())
        })
    }

    fn spawn(
        path: PathBuf,
        wake: impl Fn() + Send + Sync + 'static,
        work: impl FnOnce(&Stop, &(dyn Fn(StillState) + Sync)) -> Result<(), String> + Send + 'static,
    ) -> Self {
        let state = Arc::new(Mutex::new(StillState::Rendering(None)));
        let stop = Stop::default();
        let (told, asked) = (state.clone(), stop.clone());
        let thread = thread::spawn(move || {
            let tell = |state: StillState| {
                *told.lock().unwrap_or_else(|poisoned| poisoned.into_inner()) = state;
                wake();
            };
            let end = match polite_pool(STILL_NICE) {
                Ok(pool) => pool.install(|| work(&asked, &tell)),
                Err(error) => Err(error.to_string()),
            };
            tell(match end {
                Ok(()) if asked.is_asked() => StillState::Stopped,
                Ok(()) => StillState::Done,
                Err(problem) => StillState::Failed(problem),
            });
        });
        Self {
            path,
            state,
            stop,
            thread: Some(thread),
        }
    }

    pub fn state(&self) -> StillState {
        (self
            .state
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner()))
        .clone()
    }

    /// Ends it without a picture.
    pub fn stop(&self) {
        self.stop.stop();
    }
}

impl Drop for Still {
    fn drop(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            // A thread that threw has nothing left to hand over.
            let _ = thread.join();
        }
    }
}

fn render(
    scene: Scene,
    target: &Target,
    stop: &Stop,
    tell: &(dyn Fn(StillState) + Sync),
) -> Result<(), String> {
    let hear = |progress: &Progress| tell(StillState::Rendering(Some(*progress)));
    let cancelled = || stop.is_asked();
    let watcher = Watcher::none().heard_by(&hear).cancelled_by(&cancelled);
    let is_exr = target.format() == Format::Exr;
    let options = RendererOptions {
        guides: is_exr,
        ..RendererOptions::default()
    };
    let mut renderer = Renderer::new(scene, options, &watcher).map_err(|e| e.to_string())?;
    renderer
        .advance(Budget::Complete, &watcher)
        .map_err(|error| error.to_string())?;
    if stop.is_asked() {
        return Ok(());
    }
    let scene = renderer.scene();
    let Delivered { picture, film, .. } = renderer.delivered();
    let finished = finish_in_layers(picture, renderer.film(), scene, 0, None, None);
    let photo = scene.photo.as_ref();
    let written = match is_exr {
        true => {
            let metadata = Metadata::of(&renderer, scene.fingerprint());
            let layers = ExrLayers::new(&[], scene.settings.composite);
            let exr = ExrPicture::of(&renderer, metadata, &film, finished, &layers);
            write_exr(target, &exr)
        }
        false => write_png(target, &finished.picture, photo, PngBits::for_photo(photo)),
    };
    written.map_err(|error| error.to_string())
}
