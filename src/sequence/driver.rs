//! The frames one after the other.

use std::collections::HashSet;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;

use super::plan::{Files, check_frames, check_rate, in_range, known_rate, views};
use super::report::{FrameCounts, SequenceSeconds, SequenceStats};
use super::{Event, SequenceError, SequenceOptions};
use crate::output::PngBits;
use crate::pack::next_anchor;
use crate::renderer::{
    Budget, ErrorGoal, FrameEdit, PreviousView, RayCounts, Renderer, RendererOptions, Watcher,
};
use crate::scene::trajectory::{CameraPath, FrameName, FrameView, Views};
use crate::scene::{
    BackendChoice, Camera, Content, ContentHash, Exposure, Lens, MotionBlurMethod, Scene,
};
use crate::stages::{Finished, GpuStages, finish};
use crate::video::{FrameSink, FrameSource, Header, Matrix, Pixels, SinkPlan, Taken, VideoFrame};

/// Neighbouring poses tell the motion at a frame if they are at most this many frames away.
const REACH_FRAMES: f64 = 1.5;

/// What became of a sequence.
#[derive(Debug)]
pub struct RenderedSequence {
    pub stats: SequenceStats,
    /// All frames are there; else it was cancelled, and the same options go on with it.
    pub complete: bool,
}

/// Renders the frames one after the other. Those that an earlier call with the same options finished are kept; once `watcher` cancels, it ends
/// with the frames that are finished. `hear` is told what happens; `watcher` hears of each frame's rays.
///
/// # Errors
/// Something cannot be read, does not fit together, or cannot be written. Frames that are finished stay.
pub fn render_sequence(
    options: &SequenceOptions,
    watcher: &Watcher<'_>,
    hear: &dyn Fn(&Event<'_>),
) -> Result<RenderedSequence, SequenceError> {
    let files = Files::read(options, hear)?;
    let frames = options.frames.as_deref().ok_or_else(|| {
        SequenceError::Unfit(
            "--frames is absent; expected a folder of pictures, a .y4m file, or -; add it"
                .to_owned(),
        )
    })?;
    let mut source = FrameSource::open(frames)?;
    if let Some(matrix) = options.matrix {
        source.set_matrix(matrix);
    }
    let rate = known_rate(options, &files.trajectory, Some(&source));
    let views = views(options, &files.trajectory, rate, source.is_stream())?;
    check_frames(options, &source, &views, hear)?;
    let names: Option<Vec<FrameName>> = source.names().map(|names| {
        names
            .into_iter()
            .filter(|name| in_range(options, name))
            .collect()
    });
    if let (Some((from, to)), None) = (options.focus_pull_m, &names)
        && options.range.is_none()
    {
        return Err(SequenceError::Unfit(format!(
            "--focus-pull {from}..{to} of a stream whose length is not known; expected a range; give --range"
        )));
    }
    hear(&Event::Plan {
        frames: names.as_ref().map(Vec::len),
    });
    let mut sequence = Sequence {
        options,
        files: &files,
        views: &views,
        rate,
        span: span(options, &source),
        names: names.unwrap_or_default(),
        hear,
        told: HashSet::new(),
        started: None,
        frames: FrameCounts::default(),
        seconds: SequenceSeconds::default(),
        rays: RayCounts::default(),
        non_finite_samples: 0,
    };
    let complete = loop {
        if watcher.is_cancelled() {
            break false;
        }
        let begin = Instant::now();
        let wanted = |name: &FrameName| in_range(options, name);
        let Some((name, taken)) = source.next(&wanted)? else {
            break true;
        };
        sequence.seconds.load += begin.elapsed().as_secs_f64();
        if options.range.is_some_and(|(_, to)| name.number >= to) {
            break true;
        }
        let (label, number) = (name.label.as_str(), name.number);
        let header = source.header().cloned();
        match taken {
            Taken::Skipped => continue,
            Taken::Whole(frame) => {
                hear(&Event::Begins { label, number });
                if !sequence.take(&name, frame, header, watcher)? {
                    break false;
                }
            }
            Taken::Damaged { problem, rest } => {
                if !options.pass_damaged_frames {
                    return Err(problem.into());
                }
                hear(&Event::Begins { label, number });
                sequence.pass_damaged(&name, &problem.to_string(), rest, header)?;
            }
        }
        hear(&Event::Ends { label, number });
    };
    sequence.end(complete)
}

/// The first and the last frame's number, where they are known: the focus is pulled between them.
fn span(options: &SequenceOptions, source: &FrameSource) -> Option<(u32, u32)> {
    if let Some((from, to)) = options.range {
        return Some((from, to - 1));
    }
    let names = source.names()?;
    Some((names.first()?.number, names.last()?.number))
}

struct Sequence<'a> {
    options: &'a SequenceOptions,
    files: &'a Files,
    views: &'a Views<'a>,
    /// Frames a second, where known.
    rate: Option<f64>,
    span: Option<(u32, u32)>,
    /// The frames to come, where they are known.
    names: Vec<FrameName>,
    hear: &'a dyn Fn(&Event<'_>),
    /// Warnings of frames.
    told: HashSet<String>,
    started: Option<Started>,
    frames: FrameCounts,
    seconds: SequenceSeconds,
    rays: RayCounts,
    non_finite_samples: u64,
}

/// What the first frame brings to life.
struct Started {
    sink: FrameSink,
    size: (u32, u32),
    /// Frames are turned as their tags say.
    upright: bool,
    lens: Lens,
    /// The scene file's own, where nobody else brings intrinsics.
    camera: Camera,
    /// Not before the first posed frame.
    renderer: Option<Renderer>,
    goal: Option<ErrorGoal>,
    scene: Option<Scene>,
    gpu: Option<GpuStages>,
    anchor: Option<DVec3>,
    seed: u32,
    notes: usize,
}

impl Sequence<'_> {
    /// Renders, keeps or passes a frame on; false if it was interrupted.
    fn take(
        &mut self,
        name: &FrameName,
        mut frame: VideoFrame,
        header: Option<Header>,
        watcher: &Watcher<'_>,
    ) -> Result<bool, SequenceError> {
        let view = self.views.of(name)?;
        // What all frames have alike is told once.
        for warning in &frame.warnings {
            if self.told.insert(warning.clone()) {
                (self.hear)(&Event::Warning(format!("{}: {warning}", name.label)));
            }
        }
        let started = match self.started.take() {
            Some(started) => started,
            None => self.start(&view, &frame, header)?,
        };
        let started = self.started.insert(started);
        if started.upright && frame.photo.is_turned() {
            frame.photo = frame.photo.upright();
            frame.pixels = Pixels::Decoded;
        }
        let size = (frame.photo.width, frame.photo.height);
        if size != started.size {
            return Err(SequenceError::Unfit(format!(
                "{}: it has {} x {} pixels where the frames before have {} x {}; expected frames of one size; scale it, then go on with the same command",
                name.label, size.0, size.1, started.size.0, started.size.1
            )));
        }
        let position = view.world_from_camera.map(|pose| pose.w_axis.truncate());
        if let Some(position) = position {
            // The same for every frame whichever run renders it.
            started.anchor = Some(next_anchor(started.anchor, position));
        }
        let there = started.sink.has(name, &frame)?;
        let Some(world_from_camera) = view.world_from_camera else {
            if there {
                self.frames.kept += 1;
                return Ok(true);
            }
            let begin = Instant::now();
            started.sink.pass(name, &frame)?;
            self.seconds.write += begin.elapsed().as_secs_f64();
            self.frames.passed_through += 1;
            return Ok(true);
        };
        let camera = match self.files.intrinsics_of(&view) {
            Some(intrinsics) => (intrinsics.camera(size, world_from_camera)).map_err(|problem| {
                SequenceError::Unfit(format!("{}: {problem}; expected intrinsics of the frames' size; calibrate at that size, or scale the frames", name.label))
            })?,
            None => Camera {
                world_from_camera,
                ..started.camera.clone()
            },
        };
        let time_secs = view.time_secs.unwrap_or(0.0);
        let near = near(self.views, time_secs);
        let previous = near
            .key_before(time_secs)
            .map(|(time_secs, pose)| PreviousView {
                world_from_camera: pose,
                time_secs,
            });
        let lens = Lens {
            focus_distance_m: pulled_focus(self.options.focus_pull_m, self.span, name.number)
                .or(view.focus_distance_m)
                .unwrap_or(started.lens.focus_distance_m),
            ..started.lens
        };
        if let Some(mut scene) = started.scene.take() {
            let begin = Instant::now();
            // Fitted once, to the first posed frame of the range, whether or not that one is finished.
            scene.photo = Some(frame.photo.clone());
            scene.camera = camera.clone();
            let with = RendererOptions {
                without: self.options.without,
                filter: self.options.filter,
                ..RendererOptions::default()
            };
            let goal = self.options.goal.map(|goal| goal.of(&scene)).transpose()?;
            let renderer = Renderer::new(scene, with, &watcher.to_the_end())?;
            let estimator = renderer.scene().settings.estimator;
            let on_gpu = renderer.gpu_device().is_some();
            for (saving, reason) in renderer.without().idle(estimator, on_gpu, goal.as_ref()) {
                (self.hear)(&Event::Idle { saving, reason });
            }
            let seconds = renderer.seconds();
            self.seconds.compile += seconds.compile;
            self.seconds.first_build += begin.elapsed().as_secs_f64() - seconds.compile;
            started.gpu = renderer.gpu_device().cloned().map(GpuStages::new);
            started.goal = goal.map(|goal| goal.without(renderer.without()));
            started.renderer = Some(renderer);
        }
        if there {
            self.frames.kept += 1;
            return Ok(true);
        }
        let Some(renderer) = &mut started.renderer else {
            return Ok(true);
        };
        let begin = Instant::now();
        renderer.set_frame(
            FrameEdit {
                photo: Some(frame.photo.clone()),
                camera,
                lens,
                camera_path: near,
                time_secs,
                seed: started.seed.wrapping_add(name.number),
                anchor: started.anchor,
            },
            &Watcher::none(),
        )?;
        self.seconds.edit += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        match &started.goal {
            Some(goal) => renderer.render_to_error(goal, watcher)?,
            None => renderer.advance(Budget::Complete, watcher)?,
        }
        self.seconds.render += begin.elapsed().as_secs_f64();
        if watcher.is_cancelled() {
            return Ok(false);
        }
        let begin = Instant::now();
        let picture = renderer.delivered().picture;
        self.seconds.composite += begin.elapsed().as_secs_f64();
        let copies = (renderer.scene().stages.motion_blur)
            .is_some_and(|settings| settings.method == MotionBlurMethod::Copies);
        let motion = previous
            .filter(|_| copies)
            .map(|previous| renderer.picture_motion(&previous));
        let Finished {
            picture,
            notes,
            seconds,
        } = finish(
            picture,
            renderer.film(),
            renderer.scene(),
            name.number,
            motion.as_ref(),
            started.gpu.as_ref(),
        );
        self.seconds.stages.add(&seconds);
        self.frames.rendered += 1;
        self.frames.moving += u32::from(renderer.is_moving());
        self.non_finite_samples += renderer.film().non_finite_samples();
        for note in renderer.notes().iter().skip(started.notes) {
            (self.hear)(&Event::Note(note.to_string()));
        }
        started.notes = renderer.notes().len();
        if self.frames.rendered == 1 {
            for note in &notes {
                (self.hear)(&Event::Note(note.to_string()));
            }
        }
        let begin = Instant::now();
        started.sink.write(name, &picture, &frame)?;
        self.seconds.write += begin.elapsed().as_secs_f64();
        self.rays = renderer.rays();
        Ok(true)
    }

    /// A frame of which a part is lost goes on as it is, or is left out where there is nothing of it: so the others keep their names, and in
    /// a film their places.
    fn pass_damaged(
        &mut self,
        name: &FrameName,
        problem: &str,
        rest: Option<VideoFrame>,
        header: Option<Header>,
    ) -> Result<(), SequenceError> {
        let reason = problem.split("; ").next().unwrap_or(problem);
        let tell = |what: &str| (self.hear)(&Event::Warning(format!("{reason}; {what}")));
        let Some(frame) = rest else {
            if let Some(started) = &mut self.started
                && started.sink.repeat()?
            {
                tell("the frame before stands for it");
                self.frames.passed_through += 1;
            } else {
                tell("the frame is left out");
            }
            return Ok(());
        };
        tell("the frame passes through");
        let view = self.views.of(name)?;
        let started = match self.started.take() {
            Some(started) => started,
            None => self.start(&view, &frame, header)?,
        };
        let started = self.started.insert(started);
        if let Some(position) = view.world_from_camera.map(|pose| pose.w_axis.truncate()) {
            started.anchor = Some(next_anchor(started.anchor, position));
        }
        if started.sink.has(name, &frame)? {
            self.frames.kept += 1;
            return Ok(());
        }
        started.sink.pass(name, &frame)?;
        self.frames.passed_through += 1;
        Ok(())
    }

    fn start(
        &self,
        view: &FrameView,
        frame: &VideoFrame,
        header: Option<Header>,
    ) -> Result<Started, SequenceError> {
        let mut scene =
            self.files
                .scene(self.options, view, Some(frame.photo.clone()), self.hear)?;
        check_rate(&scene, self.rate, self.views.have_own_times())?;
        let size = (frame.photo.width, frame.photo.height);
        // The photograph of the moment is no part of what the frames are made with.
        let size = scene
            .photo
            .take()
            .map_or(size, |photo| (photo.width, photo.height));
        let options = self.options;
        let mut header = header.unwrap_or_else(|| Header::new(size.0, size.1, self.rate));
        header.matrix = options.matrix.unwrap_or(header.matrix);
        let sink = FrameSink::open(SinkPlan {
            path: &options.output,
            fingerprint: self.fingerprint(&scene),
            header,
            png_bits: options.png_bits,
            overwrite: options.overwrite,
            names: self.names.clone(),
        })?;
        Ok(Started {
            sink,
            size,
            lens: scene.lens,
            upright: scene.settings.upright_photo,
            camera: scene.camera.clone(),
            seed: scene.settings.seed,
            renderer: None,
            goal: None,
            scene: Some(scene),
            gpu: None,
            anchor: None,
            notes: 0,
        })
    }

    /// Of all that the frames are made with but the photographs.
    fn fingerprint(&self, scene: &Scene) -> String {
        let options = self.options;
        let poses = &self.files.trajectory;
        let settings = &scene.settings;
        let may_be_gpu = settings.backend != BackendChoice::Cpu;
        let without = options.without.of_pictures(may_be_gpu);
        let png_bits = (options.png_bits).map(|bits| bits == PngBits::Sixteen);
        // What is fitted or pulled over the frames depends on which there are; a file tells by their order which it holds.
        let fits = settings.exposure == Exposure::Auto;
        let is_file = options.output.extension().is_some_and(|e| e == "y4m");
        let scope = (fits || options.focus_pull_m.is_some() || is_file)
            .then_some((options.range, self.span));
        let mut hash = ContentHash::default();
        (env!("CARGO_PKG_VERSION"), scene.fingerprint()).add_to(&mut hash);
        (settings, &scene.stages).add_to(&mut hash);
        (without.names(), png_bits).add_to(&mut hash);
        format!("{:?} {:?}", options.filter, options.goal).add_to(&mut hash);
        (&poses.entries, (poses.intrinsics, self.files.intrinsics)).add_to(&mut hash);
        (self.rate, (options.focus_pull_m, scope)).add_to(&mut hash);
        options.matrix.map(Matrix::name).add_to(&mut hash);
        self.views.folder_of(&self.names).add_to(&mut hash);
        hash.finish()
    }

    fn end(self, complete: bool) -> Result<RenderedSequence, SequenceError> {
        let Some(started) = self.started else {
            let frames = self.options.frames.as_deref().unwrap_or(Path::new("-"));
            return Err(SequenceError::Unfit(format!(
                "{}: no frame of the range was found; expected at least one; correct --range",
                frames.display()
            )));
        };
        let film_colours = started.sink.film_colours();
        if complete {
            started.sink.finish()?;
        }
        let stats = SequenceStats::new(
            self.frames,
            self.seconds,
            self.rays,
            self.non_finite_samples,
            started.renderer.as_ref(),
            film_colours,
        );
        Ok(RenderedSequence { stats, complete })
    }
}

/// The camera's way around a frame.
fn near(views: &Views<'_>, time_secs: f64) -> CameraPath {
    let spacing = views.frame_secs().unwrap_or(0.0);
    views.path().around(time_secs, REACH_FRAMES * spacing)
}

/// At a constant rate in 1/m: what a lens barrel turns through.
fn pulled_focus(ends: Option<(f64, f64)>, span: Option<(u32, u32)>, number: u32) -> Option<f64> {
    let (from, to) = ends?;
    let (first, last) = span?;
    let share = f64::from(number - first) / f64::from((last - first).max(1));
    Some(1.0 / ((1.0 - share) / from + share / to))
}
