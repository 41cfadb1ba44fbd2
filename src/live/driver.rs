//! The newest frame, over and over.

use std::path::Path;
use std::time::{Duration, Instant};

use glam::{DMat4, DVec3};

use super::clock::Clock;
use super::held_pose::{HeldPose, Placed};
use super::intake::{Arrived, Intake};
use super::ray_budget::RayBudget;
use super::report::{Became, LiveSeconds, LiveStats, Tally};
use super::rest::Rest;
use super::running::{Rendered, Running, View};
use super::slot::Fetched;
use super::{LiveError, LiveEvent, LiveFrame, LiveOptions};
use crate::film::Picture;
use crate::output::{ExrLayers, picture_codes8};
use crate::pack::next_anchor;
use crate::renderer::{FrameEdit, NeighbourView, Renderer, Watcher};
use crate::scene::Composite;
use crate::scene::trajectory::{CameraPath, FrameName, Intrinsics, read_intrinsics};
use crate::scene::{
    Camera, Content, ContentHash, EncodedPhoto, FocusPath, Given, Photo, Scene, load_with,
};
use crate::tracking::{Follower, KnownBoard, Lens, Luma, read_known_board};
use crate::video::{FrameOutput, FrameSink, Pixels, SinkPlan, VideoFrame, decode_yuv};

/// How long a wait for a frame goes on before it is asked whether to end.
const ASK_EVERY: Duration = Duration::from_millis(100);
/// Poses that are further apart tell no motion.
const LONGEST_MOTION_SECS: f64 = 0.25;

/// Augments a stream until it ends, or until `watcher` ends it after a frame that is whole.
///
/// # Errors
/// Something cannot be read or written, or the stream breaks off. What is written stays.
pub fn run_live(
    options: &LiveOptions,
    watcher: &Watcher<'_>,
    hear: &dyn Fn(&LiveEvent<'_>),
) -> Result<LiveStats, LiveError> {
    let known = read_known_board(&options.board)?;
    let intrinsics = options.intrinsics.as_deref().map(read_intrinsics);
    let intrinsics = intrinsics.transpose()?;
    let intake = Intake::open(&options.input, options.matrix)?;
    let begin = Instant::now();
    let mut live = Live {
        options,
        film: film_of(options)?,
        known,
        intrinsics,
        begin,
        rate: intake.header.frames_per_second(),
        held: HeldPose::new(options.hold),
        budget: RayBudget::new(options.frame_secs, 1, 1),
        tally: Tally::default(),
        started: None,
        sink: None,
        intake,
        hear,
    };
    // Who reads standard output need not wait for the first frame.
    if matches!(live.film, Some((_, FrameOutput::Stdout))) {
        live.sink()?;
    }
    let mut window_began = begin;
    let end = loop {
        if watcher.is_cancelled() {
            break Ok(());
        }
        match live.intake.take(ASK_EVERY) {
            Fetched::Newest(arrived) => live.take(arrived)?,
            Fetched::Nothing => {}
            Fetched::End(how) => break how,
        }
        if window_began.elapsed() >= options.summary_every {
            live.close_window(&mut window_began);
        }
    };
    live.close_window(&mut window_began);
    let stats = live.end()?;
    end?;
    Ok(stats)
}

/// Where frames are written; `None`: they are not.
fn film_of(options: &LiveOptions) -> Result<Option<(&Path, FrameOutput)>, LiveError> {
    let Some(path) = options.output.as_deref() else {
        return Ok(None);
    };
    let is_film = path.extension().is_some_and(|e| e == "y4m");
    if !is_film && path.as_os_str() != "-" {
        return Err(LiveError::Unfit(format!(
            "{}: a stream goes to a film; expected a .y4m file, or -; name one",
            path.display()
        )));
    }
    Ok(Some((path, FrameOutput::of(path, None)?)))
}

fn open_sink(
    options: &LiveOptions,
    (path, output): (&Path, FrameOutput),
    intake: &Intake,
) -> Result<FrameSink, LiveError> {
    // No other run's frames are these.
    let mut hash = ContentHash::default();
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    format!("{now:?}").add_to(&mut hash);
    Ok(FrameSink::open(SinkPlan {
        path,
        output,
        layers: ExrLayers::new(&[], Composite::Additive),
        objects: Vec::new(),
        composite: Composite::Additive,
        fingerprint: hash.finish(),
        header: intake.header.clone(),
        png_bits: None,
        overwrite: options.overwrite,
        names: Vec::new(),
    })?)
}

struct Live<'a> {
    options: &'a LiveOptions,
    film: Option<(&'a Path, FrameOutput)>,
    known: KnownBoard,
    intrinsics: Option<Intrinsics>,
    begin: Instant,
    /// Frames a second of the stream.
    rate: Option<f64>,
    intake: Intake,
    /// A film waits for the scene, which tells what is an input.
    sink: Option<FrameSink>,
    held: HeldPose,
    budget: RayBudget,
    tally: Tally,
    started: Option<Started>,
    hear: &'a dyn Fn(&LiveEvent<'_>),
}

/// What the first frame brings to life.
struct Started {
    follower: Follower,
    /// The scene's, at the pose of the moment.
    camera: Camera,
    lens: crate::scene::Lens,
    focus_path: FocusPath,
    seed: u32,
    anchor: Option<DVec3>,
    /// When the frame before was, and from where, unless it passed through.
    before: Option<(f64, DMat4)>,
    /// The last frame taken up.
    number: Option<u32>,
    rest: Rest,
    /// Until the first pose, ...
    scene: Option<Scene>,
    /// ... and from then on.
    running: Option<Running>,
}

/// Where the camera of a frame is.
struct Standing {
    camera: Camera,
    /// It has been there for a while.
    rests: bool,
}

impl Live<'_> {
    /// `None`: nothing is written.
    fn sink(&mut self) -> Result<Option<&mut FrameSink>, LiveError> {
        let Some(film) = &self.film else {
            return Ok(None);
        };
        let sink = match self.sink.take() {
            Some(sink) => sink,
            None => open_sink(self.options, film.clone(), &self.intake)?,
        };
        Ok(Some(self.sink.insert(sink)))
    }

    /// The photograph goes out as it came.
    fn pass(&mut self, name: &FrameName, frame: &VideoFrame) -> Result<(), LiveError> {
        if let Some(sink) = self.sink()? {
            sink.pass(name, frame)?;
        }
        if let (true, EncodedPhoto::Codes8(codes)) = (self.options.shows, &frame.photo.encoded) {
            self.show(&frame.photo, codes.clone());
        }
        Ok(())
    }

    fn write(
        &mut self,
        name: &FrameName,
        picture: &Picture,
        frame: &VideoFrame,
    ) -> Result<(), LiveError> {
        if let Some(sink) = self.sink()? {
            sink.write(name, picture, frame)?;
        }
        if self.options.shows {
            self.show(&frame.photo, picture_codes8(picture, Some(&frame.photo)));
        }
        Ok(())
    }

    fn show(&self, photo: &Photo, codes: Vec<[u8; 3]>) {
        (self.hear)(&LiveEvent::Frame(&LiveFrame {
            width: photo.width,
            height: photo.height,
            codes,
        }));
    }

    fn take(&mut self, arrived: Arrived) -> Result<(), LiveError> {
        let Arrived { number, planes, at } = arrived;
        let name = FrameName::of_stream(number, "the stream");
        let mut seconds = LiveSeconds::default();
        let mut clock = Clock::start();
        let header = &self.intake.header;
        let luma = Luma::of_planes(header, &planes);
        let codes = decode_yuv(header, &planes);
        let photo = Photo::from_srgb8(header.width, header.height, codes);
        seconds.decode = clock.lap();
        let mut started = match self.started.take() {
            Some(started) => started,
            None => self.start(&photo)?,
        };
        clock.lap();
        let found = started.follower.follow(&luma, number);
        let pose = found.map_err(|why| self.tally.lacks_pose(why)).ok();
        let pose = pose.map(|pose| pose.world_from_camera());
        let placed = self.held.place(pose, at.duration_since(self.begin));
        seconds.track = clock.lap();
        if self.options.keep_time {
            let last = started.number.map_or(number, |last| last + 1);
            if let Some(sink) = self.sink()? {
                (last..number).try_for_each(|_| sink.stand_in(&name))?;
            }
        }
        started.number = Some(number);
        let frame = VideoFrame {
            photo,
            pixels: Pixels::Planes(planes),
            warnings: Vec::new(),
        };
        let became = match placed.world_from_camera() {
            None => {
                started.before = None;
                self.pass(&name, &frame)?;
                Became::PassedThrough
            }
            Some(world_from_camera) => {
                let is_first = started.running.is_none();
                let camera = Camera {
                    world_from_camera,
                    ..started.camera.clone()
                };
                let rests = match placed {
                    Placed::Seen(_) => {
                        let since = at.duration_since(self.begin);
                        started.rest.seen(&camera, since.as_secs_f64())
                    }
                    _ => {
                        started.rest.lost();
                        false
                    }
                };
                let standing = Standing { camera, rests };
                let Rendered {
                    picture,
                    fineness,
                    grows,
                    ..
                } = self.render(&mut started, standing, &frame.photo, number, &mut seconds)?;
                clock.lap();
                self.write(&name, &picture, &frame)?;
                seconds.write = clock.lap();
                // The first frame also waited for the scene's trees.
                if !is_first && !grows {
                    self.budget.took(&seconds);
                }
                match placed {
                    Placed::Held(_) => Became::Held(fineness),
                    _ => Became::Rendered(fineness),
                }
            }
        };
        self.started = Some(started);
        self.tally.add(became, at.elapsed().as_secs_f64(), &seconds);
        Ok(())
    }

    fn start(&mut self, photo: &Photo) -> Result<Started, LiveError> {
        let options = self.options;
        let given = Given {
            photo: Some(photo.clone()),
            intrinsics: self.intrinsics,
            sandbox: options.sandbox,
        };
        let mut scene = load_with(&options.scene, given)?;
        self.sink()?;
        scene.settings.apply(&options.overrides);
        for warning in &scene.warnings {
            (self.hear)(&LiveEvent::Warning(warning));
        }
        let most = scene.settings.rays_per_pixel;
        self.budget = RayBudget::new(options.frame_secs, most, options.coarsest);
        let camera = scene.camera.clone();
        let lens = Lens {
            focal: [camera.fx, camera.fy].into(),
            centre: [camera.cx, camera.cy].into(),
            distortion: camera.distortion,
        };
        let known = self.known.clone();
        let follower = Follower::new(known, options.code.clone(), lens, options.tone);
        Ok(Started {
            follower: match options.readout_secs {
                Some(secs) => follower.with_readout(secs, self.rate)?,
                None => follower,
            },
            lens: scene.lens,
            focus_path: scene.focus_path.clone(),
            camera,
            seed: scene.settings.seed,
            anchor: None,
            before: None,
            number: None,
            rest: Rest::default(),
            scene: Some(scene),
            running: None,
        })
    }

    /// The finished picture of a frame, and how finely it was rendered.
    fn render(
        &mut self,
        started: &mut Started,
        Standing { camera, rests }: Standing,
        photo: &Photo,
        number: u32,
        seconds: &mut LiveSeconds,
    ) -> Result<Rendered, LiveError> {
        let world_from_camera = camera.world_from_camera;
        let time_secs = match self.rate {
            Some(rate) => f64::from(number) / rate,
            None => self.begin.elapsed().as_secs_f64(),
        };
        let focus_m = started.focus_path.distance_m(time_secs);
        let near = |at: &f64| (time_secs - at).abs() <= LONGEST_MOTION_SECS;
        let before = started.before.replace((time_secs, world_from_camera));
        let keys = before.filter(|(at, _)| near(at)).into_iter();
        let camera_path = CameraPath::new(keys.chain([(time_secs, world_from_camera)]).collect());
        let position = world_from_camera.w_axis.truncate();
        started.anchor = Some(next_anchor(started.anchor, position));
        let running = match (started.running.take(), started.scene.take()) {
            (Some(running), _) => running,
            (None, Some(scene)) => Running::begin(scene, &camera, self.options)?,
            (None, None) => unreachable!("there is a scene until it runs"),
        };
        let edit = FrameEdit {
            photo: None,
            camera,
            lens: crate::scene::Lens {
                focus_distance_m: focus_m.unwrap_or(started.lens.focus_distance_m),
                ..started.lens
            },
            camera_path,
            time_secs,
            seed: started.seed.wrapping_add(number),
            anchor: started.anchor,
            coarseness: 1,
        };
        let before = before.map(|(time_secs, world_from_camera)| NeighbourView {
            world_from_camera,
            time_secs,
        });
        let view = View {
            photo,
            edit,
            number,
            rests,
            before,
        };
        let running = started.running.insert(running);
        let rendered = running.render(view, &mut self.budget, seconds)?;
        let [of_renderer, of_stages] = &rendered.notes;
        // Those of the stages come with each frame.
        let first = self.tally.written() == 0;
        let told = of_stages.iter().filter(|_| first);
        for note in of_renderer.iter().chain(told) {
            (self.hear)(&LiveEvent::Note(note));
        }
        Ok(rendered)
    }

    fn close_window(&mut self, began: &mut Instant) {
        let seconds = began.elapsed().as_secs_f64();
        *began = Instant::now();
        let window = self.tally.close_window(self.intake.counts(), seconds);
        (self.hear)(&LiveEvent::Summary(window));
    }

    fn end(self) -> Result<LiveStats, LiveError> {
        if let Some(sink) = self.sink {
            sink.finish()?;
        }
        let running = self.started.and_then(|started| started.running);
        let renderer = running.as_ref().map(Running::renderer);
        Ok(LiveStats {
            total: self.tally.total(self.begin.elapsed().as_secs_f64()),
            windows: self.tally.windows,
            seconds: self.tally.seconds,
            backend: renderer.map_or("none", Renderer::backend_name).to_owned(),
            device: renderer.map_or_else(|| "nothing".to_owned(), Renderer::device_name),
        })
    }
}
