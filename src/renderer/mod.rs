//! renderer.

mod stats;

use std::time::{Duration, Instant};

pub use stats::Stats;

use crate::film::{Film, Picture, Planes, composite, planes};
use crate::scene::Scene;

#[derive(Clone, Copy, Debug, Default)]
pub struct RendererOptions {
    pub all_planes: bool,
}

#[derive(Debug, thiserror::Error)]
#[error("render")]
pub struct RenderError;

pub enum Budget {
    Complete,
}

pub struct Progress {
    pub samples: u32,
    pub samples_total: u32,
    pub rays: RayTotals,
    pub elapsed: Duration,
}

#[derive(Clone, Copy, Default)]
pub struct RayTotals {
    pub primary: u64,
    pub mixed: u64,
    pub real: u64,
    pub mixed_shadow: u64,
    pub real_shadow: u64,
}

impl RayTotals {
    pub fn traced(&self) -> u64 {
        self.mixed + self.real + self.mixed_shadow + self.real_shadow
    }
}

#[derive(Clone, Copy, Default)]
pub struct Seconds {
    pub build: f64,
    pub compile: f64,
    pub render: f64,
}

/// Renders nothing.
pub struct Renderer {
    scene: Scene,
    film: Film,
}

impl Renderer {
    pub fn new(scene: Scene, options: RendererOptions) -> Result<Self, RenderError> {
        let film = Film::new(
            scene.camera.width,
            scene.camera.height,
            0,
            options.all_planes,
        );
        Ok(Self { scene, film })
    }

    pub fn advance(
        &mut self,
        _budget: Budget,
        cancelled: &(dyn Fn() -> bool + Sync),
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(), RenderError> {
        let start = Instant::now();
        for samples in 0..self.scene.settings.rays_per_pixel {
            if cancelled() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
            progress(Progress {
                samples,
                samples_total: self.scene.settings.rays_per_pixel,
                rays: RayTotals::default(),
                elapsed: start.elapsed(),
            });
        }
        Ok(())
    }

    pub fn samples(&self) -> u32 {
        0
    }

    pub fn film(&self) -> &Film {
        &self.film
    }

    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    pub fn picture(&self) -> Picture {
        composite(
            &self.film,
            self.scene.photo.as_ref(),
            self.scene.settings.composite,
        )
    }

    pub fn planes(&self) -> Planes {
        planes(&self.film, self.scene.photo.as_ref())
    }

    pub fn rays(&self) -> RayTotals {
        RayTotals::default()
    }

    pub fn seconds(&self) -> Seconds {
        Seconds::default()
    }

    pub fn notes(&self) -> &[String] {
        &[]
    }

    pub fn backend_name(&self) -> &'static str {
        "cpu"
    }

    pub fn device_name(&self) -> String {
        "none".to_owned()
    }
}
