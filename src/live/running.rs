//! What renders the frames once there is a pose.

use std::time::{Duration, Instant};

use super::clock::Clock;
use super::ray_budget::RayBudget;
use super::report::{Fineness, LiveSeconds};
use super::resting::{Resting, Step};
use super::{LiveError, LiveOptions};
use crate::film::{Film, Picture, composite};
use crate::renderer::{
    Budget, Filter, FrameEdit, NeighbourView, Renderer, RendererOptions, Watcher,
};
use crate::scene::trajectory::CameraPath;
use crate::scene::{Camera, MotionBlurMethod, Object, Photo, Scene};
use crate::stages::{Finished, GpuStages, PictureMotion, finish};

/// A frame to render.
pub struct View<'a> {
    pub photo: &'a Photo,
    /// Without its photograph; its coarseness is found here.
    pub edit: FrameEdit,
    pub number: u32,
    /// The camera has been there for a while.
    pub rests: bool,
    /// Where the frame before was seen from.
    pub before: Option<NeighbourView>,
}

pub struct Running {
    renderer: Renderer,
    gpu: Option<GpuStages>,
    /// Notes of the renderer that were told.
    notes: usize,
    seed: u32,
    /// What frames are composited from, of the stream's size, and how fine it is.
    shown: Film,
    fineness: Fineness,
    /// While the camera rests.
    resting: Option<Resting>,
}

/// A frame that is done.
pub struct Rendered {
    pub picture: Picture,
    pub fineness: Fineness,
    /// It took part in a picture that grows over frames, and tells nothing of what one alone takes.
    pub grows: bool,
    /// Of the renderer, then of the stages.
    pub notes: [Vec<String>; 2],
}

impl Running {
    /// Builds what the first pose needs.
    pub fn begin(
        mut scene: Scene,
        camera: &Camera,
        options: &LiveOptions,
    ) -> Result<Self, LiveError> {
        scene.camera = camera.clone();
        let with = RendererOptions {
            filter: options.filter.then_some(Filter::Preview),
            draft: true,
            ..RendererOptions::default()
        };
        let seed = scene.settings.seed;
        let renderer = Renderer::new(scene, with, &Watcher::none())?;
        Ok(Self {
            gpu: renderer.gpu_device().cloned().map(GpuStages::new),
            renderer,
            notes: 0,
            seed,
            shown: Film::new(camera.width, camera.height, 0, false),
            fineness: Fineness {
                rays_per_pixel: 0.0,
                coarseness: 1,
            },
            resting: None,
        })
    }

    pub fn renderer(&self) -> &Renderer {
        &self.renderer
    }

    /// The finished picture of a frame.
    pub fn render(
        &mut self,
        view: View<'_>,
        budget: &mut RayBudget,
        seconds: &mut LiveSeconds,
    ) -> Result<Rendered, LiveError> {
        let View {
            photo,
            edit,
            number,
            rests,
            before,
        } = view;
        let stands = !self.scene().objects.iter().any(Object::is_animated);
        let mut motion = None;
        let (kept, rests) = (self.resting.take(), rests && stands);
        let grows = kept.is_some() && rests;
        match kept.filter(|_| rests) {
            Some(resting) => self.refine(resting, photo, edit, budget, seconds)?,
            None => {
                self.follow(photo, edit, budget, seconds)?;
                self.resting = rests.then(Resting::default);
                motion = before.and_then(|before| self.motion(&before));
            }
        }
        let mut clock = Clock::start();
        let picture = composite(&self.shown, Some(photo), self.scene().settings.composite);
        let secs = clock.lap();
        budget.composited(secs);
        seconds.composite += secs;
        let Finished {
            picture,
            notes,
            added: _,
            seconds: of_stages,
        } = finish(
            picture,
            &self.shown,
            self.scene(),
            number,
            motion.as_ref(),
            self.gpu.as_ref(),
        );
        seconds.stages = of_stages;
        let all = self.renderer.notes();
        let new = all.get(self.notes..).unwrap_or_default().to_vec();
        self.notes = all.len();
        Ok(Rendered {
            picture,
            fineness: self.fineness,
            grows,
            notes: [new, notes],
        })
    }

    fn scene(&self) -> &Scene {
        self.renderer.scene()
    }

    /// How what is seen has moved since the frame before, for stages that ask.
    fn motion(&self, before: &NeighbourView) -> Option<PictureMotion> {
        let settings = self.scene().stages.motion_blur?;
        let wants = settings.method == MotionBlurMethod::Copies;
        wants.then(|| self.renderer.picture_motion(before))
    }

    /// A frame of a camera that moves: as fine as fits into its time.
    fn follow(
        &mut self,
        photo: &Photo,
        edit: FrameEdit,
        budget: &mut RayBudget,
        seconds: &mut LiveSeconds,
    ) -> Result<(), LiveError> {
        let mut clock = Clock::start();
        let coarseness = budget.coarseness();
        let edit = FrameEdit {
            photo: Some(photo.clone()),
            coarseness,
            ..edit
        };
        self.renderer.set_frame(edit, &Watcher::none())?;
        seconds.edit = clock.lap();
        let rays = budget.rays(self.renderer.samples_of_a_ray(), seconds.total());
        self.take_rays(rays, &Watcher::none())?;
        seconds.render = clock.lap();
        self.renderer.deliver_into(&mut self.shown);
        seconds.composite = clock.lap();
        self.fineness = Fineness {
            rays_per_pixel: f64::from(rays) / f64::from(coarseness.pow(2)),
            coarseness,
        };
        Ok(())
    }

    /// A frame of a camera that rests: what there is is shown, and there is time for one step towards the whole picture.
    fn refine(
        &mut self,
        mut resting: Resting,
        photo: &Photo,
        edit: FrameEdit,
        budget: &mut RayBudget,
        seconds: &mut LiveSeconds,
    ) -> Result<(), LiveError> {
        let mut clock = Clock::start();
        let (rays, most) = (
            self.renderer.samples(),
            self.scene().settings.rays_per_pixel,
        );
        let step = resting.step(edit.time_secs, rays, most);
        match step {
            Step::Begin => {
                let pose = (edit.time_secs, edit.camera.world_from_camera);
                let edit = FrameEdit {
                    photo: Some(photo.clone()),
                    camera_path: CameraPath::new(vec![pose]),
                    // The noise of pictures that follow one another is alike.
                    seed: self.seed,
                    coarseness: 1,
                    ..edit
                };
                self.renderer.set_frame(edit, &Watcher::none())?;
                seconds.edit = clock.lap();
            }
            Step::Refine => {
                let given = budget.left_at_rest(seconds.total());
                let before = self.renderer.rays().traced();
                let end = Instant::now().checked_add(Duration::from_secs_f64(given));
                self.take_rays(1, &Watcher::none().until(end))?;
                seconds.render = clock.lap();
                let any = self.renderer.rays().traced() > before;
                budget.refined(given, seconds.render, any);
            }
            Step::Show => {
                self.renderer.deliver_into(&mut self.shown);
                self.fineness = Fineness {
                    rays_per_pixel: f64::from(rays),
                    coarseness: 1,
                };
                seconds.composite = clock.lap();
            }
            Step::Keep => {}
        }
        self.resting = Some(resting);
        Ok(())
    }

    fn take_rays(&mut self, rays: u32, watcher: &Watcher<'_>) -> Result<(), LiveError> {
        let pixels = self.renderer.film().pixels.len() as u64;
        let all = Budget::Rays(pixels * u64::from(rays));
        Ok(self.renderer.advance(all, watcher)?)
    }
}
