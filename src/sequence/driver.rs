//! The frames one after the other.

use std::collections::HashSet;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;

use super::plan::{Files, in_part, in_range};
use super::report::{FrameCounts, SequenceSeconds, SequenceStats};
use super::whole::{Whole, open_source, output_of};
use super::{Event, SequenceError, SequenceOptions};
use crate::output::{ExrLayers, ExrPicture, Metadata};
use crate::pack::next_anchor;
use crate::renderer::{
    Budget, Delivered, ErrorGoal, FrameEdit, Mattes, NeighbourView, RayCounts, Renderer,
    RendererOptions, Watcher,
};
use crate::scene::trajectory::{FrameName, FrameView};
use crate::scene::{Camera, FocusPath, Lens, MotionBlurMethod, Scene};
use crate::stages::{Finished, GpuStages, finish, finish_in_layers};
use crate::video::{FrameSink, Header, Pixels, SinkPlan, Taken, VideoFrame};

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
    let output = output_of(options)?;
    let files = Files::read(options, hear)?;
    let mut source = open_source(options)?;
    let whole = Whole::new(options, output, &files, &source, hear)?;
    hear(&Event::Plan {
        frames: whole.names_of_part().map(|names| names.len()),
    });
    let mut sequence = Sequence {
        whole,
        hear,
        told: HashSet::new(),
        lost: Vec::new(),
        started: None,
        anchor: None,
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
        let wanted = |name: &FrameName| sequence.wants(name);
        let Some((name, taken)) = source.next(&wanted)? else {
            break true;
        };
        sequence.seconds.load += begin.elapsed().as_secs_f64();
        let is_past = |range: Option<(u32, u32)>| range.is_some_and(|(_, to)| name.number >= to);
        if is_past(options.range) || is_past(options.part) {
            break true;
        }
        if in_range(options, &name) {
            sequence.follow(&name)?;
        }
        let (label, number) = (name.label.as_str(), name.number);
        let header = source.header().cloned();
        match taken {
            Taken::Skipped => continue,
            Taken::Whole(frame) if !in_part(options, &name) => {
                sequence.take(&name, frame, header, watcher)?;
                continue;
            }
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
    let rendered = sequence.end(complete)?;
    if complete && options.range.is_some() {
        source.drain(&|| watcher.is_cancelled());
    }
    Ok(rendered)
}

struct Sequence<'a> {
    whole: Whole<'a>,
    hear: &'a dyn Fn(&Event<'_>),
    /// Warnings of frames.
    told: HashSet<String>,
    /// Frames before the first of which anything is there.
    lost: Vec<FrameName>,
    started: Option<Started>,
    /// The coordinates' origin: the same for every frame whichever run renders it.
    anchor: Option<DVec3>,
    frames: FrameCounts,
    seconds: SequenceSeconds,
    rays: RayCounts,
    non_finite_samples: u64,
}

/// What the first frame brings to life.
struct Started {
    sink: FrameSink,
    /// Without the photographs.
    scene_hash: String,
    size: (u32, u32),
    /// Frames are turned as their tags say.
    upright: bool,
    lens: Lens,
    focus_path: FocusPath,
    /// The scene file's own, where nobody else brings intrinsics.
    camera: Camera,
    /// Not before the first posed frame.
    renderer: Option<Renderer>,
    goal: Option<ErrorGoal>,
    scene: Option<Scene>,
    gpu: Option<GpuStages>,
    seed: u32,
    notes: usize,
}

impl Sequence<'_> {
    /// The frame has to be decoded: it is of the part, or of those before it that all frames depend on, the first and the first posed.
    fn wants(&self, name: &FrameName) -> bool {
        let view = || self.whole.views.of(name);
        let is_posed = || view().is_ok_and(|view| view.world_from_camera.is_some());
        let all_depend = || match &self.started {
            None => true,
            Some(started) => started.renderer.is_none() && is_posed(),
        };
        let options = self.whole.options;
        in_range(options, name) && (in_part(options, name) || all_depend())
    }

    /// The origin goes with the camera, whether or not the frame is rendered.
    fn follow(&mut self, name: &FrameName) -> Result<(), SequenceError> {
        if let Some(pose) = self.whole.views.of(name)?.world_from_camera {
            self.anchor = Some(next_anchor(self.anchor, pose.w_axis.truncate()));
        }
        Ok(())
    }

    /// Renders, keeps or passes a frame on; false if it was interrupted. What is not of the part is not touched.
    fn take(
        &mut self,
        name: &FrameName,
        mut frame: VideoFrame,
        header: Option<Header>,
        watcher: &Watcher<'_>,
    ) -> Result<bool, SequenceError> {
        let view = self.whole.views.of(name)?;
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
        let is_ours = in_part(self.whole.options, name);
        let there = !is_ours || started.sink.has(name, &frame)?;
        let Some(world_from_camera) = view.world_from_camera else {
            if there {
                self.frames.kept += u32::from(is_ours);
                return Ok(true);
            }
            let begin = Instant::now();
            started.sink.pass(name, &frame)?;
            self.seconds.write += begin.elapsed().as_secs_f64();
            self.frames.passed_through += 1;
            return Ok(true);
        };
        let camera = match self.whole.files.intrinsics_of(&view) {
            Some(intrinsics) => (intrinsics.camera(size, world_from_camera)).map_err(|problem| {
                SequenceError::Unfit(format!("{}: {problem}; expected intrinsics of the frames' size; calibrate at that size, or scale the frames", name.label))
            })?,
            None => Camera {
                world_from_camera,
                ..started.camera.clone()
            },
        };
        let time_secs = view.time_secs.unwrap_or(0.0);
        let near = self.whole.views.path_near(time_secs);
        let neighbour = |(time_secs, world_from_camera)| NeighbourView {
            world_from_camera,
            time_secs,
        };
        let previous = near.key_before(time_secs).map(neighbour);
        let next = near.key_after(time_secs).map(neighbour);
        let lens = Lens {
            focus_distance_m: pulled_focus(
                self.whole.options.focus_pull_m,
                self.whole.span,
                name.number,
            )
            .or(view.focus_distance_m)
            .or(started.focus_path.distance_m(time_secs))
            .unwrap_or(started.lens.focus_distance_m),
            ..started.lens
        };
        if let Some(mut scene) = started.scene.take() {
            let begin = Instant::now();
            // Fitted once, to the first posed frame of the range, whether or not that one is finished.
            scene.photo = Some(frame.photo.clone());
            scene.camera = camera.clone();
            let layers = started.sink.layers();
            let with = RendererOptions {
                guides: layers.is_some_and(ExrLayers::need_guides),
                real_everywhere: layers.is_some_and(ExrLayers::need_real_everywhere),
                without: self.whole.options.without,
                filter: self.whole.options.filter,
                ..RendererOptions::default()
            };
            let goal = self
                .whole
                .options
                .goal
                .map(|goal| goal.of(&scene))
                .transpose()?;
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
            self.frames.kept += u32::from(is_ours);
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
                anchor: self.anchor,
                coarseness: 1,
            },
            &Watcher::none(),
        )?;
        self.seconds.edit += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        match &started.goal {
            Some(goal) => renderer.render_to_error(goal, watcher)?,
            None => renderer.advance(Budget::Complete, watcher)?,
        }
        let layers = started.sink.layers().cloned();
        let wants = |layer: fn(&ExrLayers) -> bool| layers.as_ref().is_some_and(layer);
        let mattes = (wants(ExrLayers::need_mattes).then(|| renderer.mattes())).transpose()?;
        let vectors = wants(ExrLayers::need_motion)
            .then(|| renderer.motion_vectors(previous.as_ref(), next.as_ref()));
        let vectors = vectors.transpose()?;
        self.seconds.render += begin.elapsed().as_secs_f64();
        if watcher.is_cancelled() {
            return Ok(false);
        }
        let begin = Instant::now();
        let Delivered { picture, film, .. } = renderer.delivered();
        self.seconds.composite += begin.elapsed().as_secs_f64();
        let copies = (renderer.scene().stages.motion_blur)
            .is_some_and(|settings| settings.method == MotionBlurMethod::Copies);
        let motion = previous
            .filter(|_| copies)
            .map(|previous| renderer.picture_motion(&previous));
        let finish = match layers.as_ref().is_some_and(ExrLayers::need_stages) {
            true => finish_in_layers,
            false => finish,
        };
        let finished = finish(
            picture,
            renderer.film(),
            renderer.scene(),
            name.number,
            motion.as_ref(),
            started.gpu.as_ref(),
        );
        let exr = layers.map(|layers| {
            let metadata = Metadata::of(renderer, started.scene_hash.clone());
            ExrPicture {
                motion: vectors,
                mattes,
                ..ExrPicture::of(renderer, metadata, &film, finished.clone(), &layers)
            }
        });
        drop(film);
        let Finished {
            picture,
            notes,
            seconds,
            ..
        } = finished;
        self.seconds.stages.add(&seconds);
        self.frames.rendered += 1;
        self.frames.moving += u32::from(renderer.is_moving());
        self.non_finite_samples += renderer.film().non_finite_samples();
        for note in renderer.notes().iter().skip(started.notes) {
            // Frames that differ in its figures alone do not say it again.
            let figures = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-');
            if self.told.insert(note.replace(figures, "")) {
                (self.hear)(&Event::Note(note.to_string()));
            }
        }
        started.notes = renderer.notes().len();
        if self.frames.rendered == 1 {
            for note in &notes {
                (self.hear)(&Event::Note(note.to_string()));
            }
        }
        let begin = Instant::now();
        match &exr {
            Some(exr) => started.sink.write_exr(name, exr)?,
            None => started.sink.write(name, &picture, &frame)?,
        }
        self.seconds.write += begin.elapsed().as_secs_f64();
        self.rays = renderer.rays();
        Ok(true)
    }

    /// A frame of which a part is lost goes on as far as it is there; where nothing is, the one before keeps its place.
    fn pass_damaged(
        &mut self,
        name: &FrameName,
        problem: &str,
        rest: Option<VideoFrame>,
        header: Option<Header>,
    ) -> Result<(), SequenceError> {
        if !in_part(self.whole.options, name) {
            return Ok(());
        }
        let reason = problem.split("; ").next().unwrap_or(problem);
        let tell = |what: &str| (self.hear)(&Event::Warning(format!("{reason}; {what}")));
        let Some(frame) = rest else {
            match &mut self.started {
                Some(started) => {
                    tell("the frame before stands for it");
                    started.sink.stand_in(name)?;
                }
                None => {
                    tell("grey stands for it");
                    self.lost.push(name.clone());
                }
            }
            self.frames.passed_through += 1;
            return Ok(());
        };
        tell("the frame passes through");
        let view = self.whole.views.of(name)?;
        let started = match self.started.take() {
            Some(started) => started,
            None => self.start(&view, &frame, header)?,
        };
        let started = self.started.insert(started);
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
        let (scene, size) = self.whole.scene(view, &frame.photo, self.hear)?;
        let options = self.whole.options;
        let mut header = header.unwrap_or_else(|| Header::new(size.0, size.1, self.whole.rate));
        header.matrix = options.matrix.unwrap_or(header.matrix);
        let layers = ExrLayers::new(&options.layers, scene.settings.composite);
        let mut sink = FrameSink::open(SinkPlan {
            path: &options.output,
            output: self.whole.output.clone(),
            layers,
            composite: scene.settings.composite,
            objects: Mattes::names_of(&scene),
            fingerprint: self.whole.fingerprint(&scene),
            header,
            png_bits: options.png_bits,
            overwrite: options.overwrite,
            names: self.whole.names_of_part().unwrap_or_default(),
        })?;
        for name in &self.lost {
            sink.stand_in(name)?;
        }
        Ok(Started {
            sink,
            scene_hash: scene.fingerprint(),
            size,
            lens: scene.lens,
            focus_path: scene.focus_path.clone(),
            upright: scene.settings.upright_photo,
            camera: scene.camera.clone(),
            seed: scene.settings.seed,
            renderer: None,
            goal: None,
            scene: Some(scene),
            gpu: None,
            notes: 0,
        })
    }

    fn end(self, complete: bool) -> Result<RenderedSequence, SequenceError> {
        let Some(started) = self.started else {
            let frames = self
                .whole
                .options
                .frames
                .as_deref()
                .unwrap_or(Path::new("-"));
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

/// At a constant rate in 1/m: what a lens barrel turns through.
fn pulled_focus(ends: Option<(f64, f64)>, span: Option<(u32, u32)>, number: u32) -> Option<f64> {
    let (from, to) = ends?;
    let (first, last) = span?;
    let share = f64::from(number - first) / f64::from((last - first).max(1));
    Some(1.0 / ((1.0 - share) / from + share / to))
}
