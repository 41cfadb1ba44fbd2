//! Two renderers on threads of their own: a coarse one that answers every edit at once, and the one of the whole picture, which begins when
//! the edits pause. Both take the newest state that is wanted and drop what they were at; neither is ever waited for.

mod current;
mod pictures;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, Weak};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use super::composition::{Composition, Difference};
use super::view::View;
use crate::clock::thread_time;
use crate::film::Picture;
use crate::renderer::{Budget, Progress, RenderError, Watcher};
use crate::scene::Scene;
use current::{Current, take_up};
pub use pictures::photo_codes;
use pictures::{coarse_picture, fine_picture};

/// The whole picture is shown from here on: with fewer rays the coarse one, filtered, looks better.
const FIRST_FINE_RAYS: u32 = 4;
/// The whole picture begins once nothing was edited for so long.
const SETTLE: Duration = Duration::from_millis(150);
/// Scheduling below the window's own thread.
const COARSE_NICE: i32 = 3;
const FINE_NICE: i32 = 12;

/// A state to show.
pub struct Wanted {
    /// Counts edits.
    pub revision: u64,
    /// As it was read; another reading is another `Arc`.
    pub scene: Arc<Scene>,
    pub composition: Composition,
    pub view: View,
    /// When it was asked for.
    pub since: Instant,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Coarse,
    Fine,
}

/// A picture to show.
pub struct Shown {
    pub revision: u64,
    pub level: Level,
    pub view: View,
    scene: Weak<Scene>,
    composition: Composition,
    pub width: u32,
    pub height: u32,
    /// As they are shown, row-major from the top left.
    pub codes: Vec<[u8; 3]>,
    /// The picture's values; a coarse one's are fewer.
    pub picture: Picture,
    /// Rays per pixel.
    pub samples: u32,
    pub samples_total: u32,
    pub device: String,
    /// What the renderer and the camera's stages say.
    pub notes: Vec<String>,
}

impl Shown {
    pub fn is_complete(&self) -> bool {
        self.level == Level::Fine && self.samples >= self.samples_total
    }

    /// The whole picture's film is there, and at most what is made of it changes.
    fn has_film_of(&self, wanted: &Wanted) -> bool {
        self.level == Level::Fine
            && self.view == wanted.view
            && Weak::as_ptr(&self.scene) == Arc::as_ptr(&wanted.scene)
            && Difference::between(&self.composition, &wanted.composition).keeps_film()
    }
}

/// From an edit to the first picture that shows it.
#[derive(Clone, Copy, Debug)]
pub struct Latency {
    pub level: Level,
    pub change: &'static str,
    pub time: Duration,
    /// Of the processors, for the picture.
    pub processor_time: Duration,
}

/// What goes on, for the window's status line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activity {
    pub level: Level,
    pub progress: Progress,
}

#[derive(Default)]
struct State {
    wanted: Option<Arc<Wanted>>,
    shown: Option<Arc<Shown>>,
    error: Option<(u64, String)>,
    activity: Option<Activity>,
    latencies: Vec<Latency>,
    has_ended: bool,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Of `wanted`: asked by what renders.
    revision: AtomicU64,
    frame_time: Duration,
    wake: Box<dyn Fn() + Send + Sync>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// The two threads; they end with it.
pub struct RenderThreads {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl RenderThreads {
    /// `wake` is called whenever there is something new to show. Of the coarse picture's rays as many are taken as fit into `frame_time`.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn start(
        frame_time: Duration,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, ThreadPoolBuildError> {
        let shared = Arc::new(Shared {
            state: Mutex::new(State::default()),
            changed: Condvar::new(),
            revision: AtomicU64::new(0),
            frame_time,
            wake: Box::new(wake),
        });
        let mut threads = Vec::new();
        for (level, nice) in [(Level::Coarse, COARSE_NICE), (Level::Fine, FINE_NICE)] {
            let pool = polite_pool(nice)?;
            let shared = shared.clone();
            threads.push(thread::spawn(move || run(&shared, level, &pool)));
        }
        Ok(Self { shared, threads })
    }

    /// Shows this from now on. Never waits for what renders.
    pub fn want(&self, wanted: Wanted) {
        let revision = wanted.revision;
        self.shared.lock().wanted = Some(Arc::new(wanted));
        self.shared.revision.store(revision, Ordering::Release);
        self.shared.changed.notify_all();
    }

    /// The newest picture.
    pub fn shown(&self) -> Option<Arc<Shown>> {
        self.shared.lock().shown.clone()
    }

    /// Why the state of that revision cannot be rendered.
    pub fn error(&self, revision: u64) -> Option<String> {
        let state = self.shared.lock();
        let error = state.error.as_ref();
        error
            .filter(|(of, _)| *of == revision)
            .map(|(_, message)| message.clone())
    }

    pub fn activity(&self) -> Option<Activity> {
        self.shared.lock().activity
    }

    /// Of every edit so far.
    pub fn latencies(&self) -> Vec<Latency> {
        self.shared.lock().latencies.clone()
    }
}

impl Drop for RenderThreads {
    fn drop(&mut self) {
        self.shared.lock().has_ended = true;
        // Nothing has this revision: what renders ends.
        self.shared.revision.store(u64::MAX, Ordering::Release);
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // A thread that threw has nothing left to hand over.
            let _ = thread.join();
        }
    }
}

/// Threads that let the window's own go first, where the system has such a thing for threads.
pub fn polite_pool(nice: i32) -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new()
        .start_handler(move |_| {
            // SAFETY: no memory is passed; on Linux 0 is the calling thread.
            #[cfg(target_os = "linux")]
            unsafe {
                libc::setpriority(libc::PRIO_PROCESS, 0, nice);
            }
            #[cfg(not(target_os = "linux"))]
            let _ = nice;
        })
        .build()
}

/// What a thread has shown last.
#[derive(Default)]
struct Stand {
    revision: u64,
    view: View,
    is_done: bool,
}

fn run(shared: &Shared, level: Level, pool: &ThreadPool) {
    let mut current = None;
    let mut stand = Stand::default();
    while let Some(wanted) = next(shared, level, &stand) {
        let begins = stand.revision != wanted.revision || stand.view != wanted.view;
        let step = pool.install(|| step(shared, level, &wanted, &mut current, begins));
        stand.revision = wanted.revision;
        stand.view = wanted.view;
        stand.is_done = match step {
            Ok(is_done) => is_done,
            Err(error) => {
                current = None;
                shared.lock().error = Some((wanted.revision, error.to_string()));
                shared.changed.notify_all();
                (shared.wake)();
                true
            }
        };
    }
}

/// Waits for something to do; `None`: the window has closed.
fn next(shared: &Shared, level: Level, stand: &Stand) -> Option<Arc<Wanted>> {
    let mut state = shared.lock();
    loop {
        if state.has_ended {
            return None;
        }
        let mut pause = None;
        if let Some(wanted) = &state.wanted {
            let is_new = stand.revision != wanted.revision || stand.view != wanted.view;
            let settles_in = SETTLE.saturating_sub(wanted.since.elapsed());
            let is_answered = (state.shown.as_ref())
                .is_some_and(|shown| shown.revision == wanted.revision)
                || (state.error.as_ref()).is_some_and(|(of, _)| *of == wanted.revision);
            let fine_is_shown = (state.shown.as_ref()).is_some_and(|shown| {
                shown.level == Level::Fine && shown.revision == wanted.revision
            });
            let has_film = (state.shown.as_ref()).is_some_and(|shown| shown.has_film_of(wanted));
            match level {
                Level::Fine if is_new && has_film => return Some(wanted.clone()),
                Level::Coarse if has_film => {}
                // The coarse answer has the processors for itself, and wakes this thread.
                Level::Fine if is_new && !is_answered => {}
                Level::Fine if is_new && !settles_in.is_zero() => pause = Some(settles_in),
                Level::Coarse if !is_new && fine_is_shown => {}
                _ if is_new || !stand.is_done => return Some(wanted.clone()),
                _ => {}
            }
        }
        state = match pause {
            Some(pause) => {
                let result = shared.changed.wait_timeout(state, pause);
                result.map_or_else(|poisoned| poisoned.into_inner().0, |(state, _)| state)
            }
            None => (shared.changed.wait(state)).unwrap_or_else(|poisoned| poisoned.into_inner()),
        };
    }
}

/// Takes up what is wanted, renders on, and shows it; true if nothing is left to render.
fn step(
    shared: &Shared,
    level: Level,
    wanted: &Wanted,
    current: &mut Option<Current>,
    begins: bool,
) -> Result<bool, RenderError> {
    let cancelled = || shared.revision.load(Ordering::Acquire) != wanted.revision;
    let hear = |progress: &Progress| {
        shared.lock().activity = Some(Activity {
            level,
            progress: *progress,
        });
    };
    let watcher = Watcher::none().heard_by(&hear);
    // Every edit has its first coarse picture, so that a long drag is seen.
    let watcher = match level == Level::Coarse && begins {
        true => watcher,
        false => watcher.cancelled_by(&cancelled),
    };
    let spent_before = processor_time();
    let change = take_up(level, wanted, current, &watcher)?;
    let Some(Current { renderer, .. }) = current else {
        return Ok(true);
    };
    let total = renderer.scene().settings.rays_per_pixel;
    let film = renderer.film();
    let pixels = u64::from(film.width) * u64::from(film.height);
    let before = renderer.samples();
    if before < total {
        let more = match (level, before) {
            (Level::Fine, 0) => FIRST_FINE_RAYS,
            _ => before.clamp(1, 8),
        };
        renderer.advance(Budget::Rays(pixels * u64::from(more)), &watcher)?;
        if level == Level::Coarse && before == 0 {
            // More rays if the frame's time allows.
            let left = shared.frame_time.saturating_sub(wanted.since.elapsed());
            if left > shared.frame_time / 2 {
                renderer.advance(Budget::Time(left / 2), &watcher)?;
            }
        }
    }
    if cancelled() && !(level == Level::Coarse && begins) {
        return Ok(false);
    }
    let samples = renderer.samples();
    if level == Level::Fine && samples < FIRST_FINE_RAYS.min(total) {
        return Ok(false);
    }
    let shown = match level {
        Level::Coarse => coarse_picture(renderer, wanted),
        Level::Fine => fine_picture(renderer, wanted),
    };
    let latency = change.map(|change| Latency {
        level,
        change,
        time: wanted.since.elapsed(),
        processor_time: processor_time().saturating_sub(spent_before),
    });
    publish(shared, wanted, shown, latency);
    Ok(samples >= total)
}

/// Of the threads of the current pool.
fn processor_time() -> Duration {
    rayon::broadcast(|_| thread_time()).into_iter().sum()
}

fn publish(shared: &Shared, wanted: &Wanted, shown: Shown, latency: Option<Latency>) {
    let mut state = shared.lock();
    // Where both threads show the same edit, the whole picture is the better.
    let is_older = (state.shown.as_ref()).is_some_and(|other| {
        let fine_of = |shown: &Shown| {
            (
                shown.revision,
                shown.view == wanted.view,
                shown.level == Level::Fine,
            )
        };
        fine_of(other) > fine_of(&shown)
    });
    if !is_older {
        state.shown = Some(Arc::new(shown));
    }
    state.latencies.extend(latency);
    drop(state);
    shared.changed.notify_all();
    (shared.wake)();
}

/// Ends what runs elsewhere.
#[derive(Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
