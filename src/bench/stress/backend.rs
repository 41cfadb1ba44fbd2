//! The two backends, asked alike for pictures and for hits.

use std::sync::Arc;

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::accel::{AccelError, Hit, Ray, WorldBvh};
use crate::film::{Film, Picture, composite};
use crate::gpu::harness::Probe;
use crate::gpu::{Features, GpuBackend, GpuDevice, GpuError, SceneBuffers, SceneParts};
use crate::packed::Frame;
use crate::renderer::{Budget, RayCounts, RenderError, Renderer, RendererOptions, Skip, Watcher};
use crate::scene::{BackendChoice, Scene};
use crate::work::{PhotonWork, WorkList};

/// A case that could not be measured at all.
#[derive(Debug, thiserror::Error)]
pub enum StressError {
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Accel(#[from] AccelError),
}

/// Where a case runs.
pub enum Backend {
    Cpu,
    Gpu(Gpu),
}

/// A device with the kernels that were compiled on it so far.
pub struct Gpu {
    device: Arc<GpuDevice>,
    compiled: Vec<(Features, GpuBackend)>,
}

/// A finished render.
pub(super) struct Shown {
    pub film: Film,
    pub picture: Picture,
}

/// Rays that a device is given at once.
const RAYS_AT_ONCE: usize = 1 << 20;

impl Backend {
    pub fn gpu(device: Arc<GpuDevice>) -> Self {
        Self::Gpu(Gpu {
            device,
            compiled: Vec::new(),
        })
    }

    pub fn name(&self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Gpu(_) => "gpu",
        }
    }

    /// False: a program that plays a graphics device on the CPU.
    pub(super) fn is_hardware_gpu(&self) -> bool {
        match self {
            Self::Cpu => false,
            Self::Gpu(gpu) => gpu.device.info.device_type != wgpu::DeviceType::Cpu,
        }
    }

    /// All rays of a scene. The difference is evaluated at every sample, so that what is drawn at random is the place on pixel and lens alone
    /// where the scene's materials and lights leave nothing else to chance.
    pub(super) fn render(&mut self, scene: &Scene) -> Result<Shown, StressError> {
        self.render_samples(scene, (0, scene.settings.rays_per_pixel))
    }

    /// Each pixel's samples from the first number to before the second.
    pub(super) fn render_samples(
        &mut self,
        scene: &Scene,
        samples: (u32, u32),
    ) -> Result<Shown, StressError> {
        let mut scene = scene.clone();
        scene.settings.backend = BackendChoice::Cpu;
        let options = RendererOptions {
            sample_range: Some(samples),
            without: [Skip::Plan].into_iter().collect(),
            ..RendererOptions::default()
        };
        let mut renderer = Renderer::new(scene, options, &Watcher::none())?;
        let film = match self {
            Self::Cpu => {
                renderer.advance(Budget::Complete, &Watcher::none())?;
                renderer.film().clone()
            }
            Self::Gpu(gpu) => gpu.film(&renderer, samples)?,
        };
        let scene = renderer.scene();
        let picture = composite(&film, scene.photo.as_ref(), scene.settings.composite);
        Ok(Shown { film, picture })
    }

    /// Nearest hits in one world; `any`: only whether there is one counts.
    pub(super) fn hits(
        &self,
        world: &WorldBvh,
        rays: &[Ray],
        any: bool,
    ) -> Result<Vec<Hit>, StressError> {
        match self {
            Self::Cpu => Ok(rays
                .par_iter()
                .map(|ray| {
                    if !any {
                        return world.closest(ray);
                    }
                    let triangle = if world.any(ray) {
                        0
                    } else {
                        Hit::MISS.triangle
                    };
                    Hit {
                        triangle,
                        ..Hit::MISS
                    }
                })
                .collect()),
            Self::Gpu(gpu) => {
                let mut hits = Vec::with_capacity(rays.len());
                for rays in rays.chunks(RAYS_AT_ONCE) {
                    let rays: Vec<(Ray, u32)> = rays.iter().map(|ray| (*ray, 0)).collect();
                    hits.extend(traced_by_shader(&gpu.device, [world; 2], &rays, any)?);
                }
                Ok(hits)
            }
        }
    }
}

impl Gpu {
    fn film(&mut self, renderer: &Renderer, (first, end): (u32, u32)) -> Result<Film, GpuError> {
        let packed = renderer.packed();
        let features = Features::for_scene(packed);
        let known = self.compiled.iter().position(|(f, _)| *f == features);
        let at = match known {
            Some(at) => {
                self.compiled[at].1.set_scene(packed)?;
                at
            }
            None => {
                let backend = GpuBackend::new(Arc::clone(&self.device), packed, true)?;
                self.compiled.push((features, backend));
                self.compiled.len() - 1
            }
        };
        let mut film = Film::new(packed.frame.width, packed.frame.height, first, false);
        film.set_photons(packed.photons_per_ray > 0);
        let backend = &mut self.compiled[at].1;
        let (mut rays, infos) = (RayCounts::default(), &packed.pixels);
        let main = WorkList::main(infos, &film, |_| end);
        backend.render(&mut film, &main, &mut rays, &Watcher::none())?;
        if packed.photons_per_ray > 0 {
            let numbered = |ray: u32| u64::from(ray) * packed.photons_per_ray;
            let work = PhotonWork {
                first: numbered(first),
                end: numbered(end),
                window: [0.0, 1.0],
            };
            backend.trace_photons(&mut film, &work, &mut rays, &Watcher::none())?;
        }
        let real = WorkList::real(infos, &film, false, |_| end);
        backend.render(&mut film, &real, &mut rays, &Watcher::none())?;
        Ok(film)
    }
}

/// Hits as the shader finds them: each ray in the world of its number, 0 real, 1 virtual.
pub(crate) fn traced_by_shader(
    gpu: &GpuDevice,
    worlds: [&WorldBvh; 2],
    rays: &[(Ray, u32)],
    any_hit: bool,
) -> Result<Vec<Hit>, GpuError> {
    let parts = SceneParts {
        frame: Frame::zeroed(),
        bvh_nodes: worlds.map(WorldBvh::gpu_nodes),
        bvh_leaves: worlds.map(WorldBvh::gpu_leaves),
        ..SceneParts::default()
    };
    let scene = SceneBuffers::from_parts(gpu, &parts)?;
    let body = format!(
        "let ray = Ray(input_vec3(0u), input_f32(3u), input_vec3(4u), input_f32(7u), input(8u));
         let hit = trace(ray, input(9u), {any_hit}, probe_record % 64u);
         output_f32(0u, hit.t); output_f32(1u, hit.u); output_f32(2u, hit.v); output(3u, hit.triangle);"
    );
    let probe = Probe {
        features: Features::default(),
        prelude: "import package::accel::trace::{trace, Ray, Hit};",
        body: &body,
        input_words: 10,
        output_words: 4,
        scene: Some(&scene),
    };
    let mut inputs = Vec::with_capacity(10 * rays.len());
    for (ray, world) in rays {
        let [ox, oy, oz] = ray.origin.to_array();
        let [dx, dy, dz] = ray.direction.to_array();
        inputs.extend([ox, oy, oz, ray.t_min, dx, dy, dz, ray.t_max].map(f32::to_bits));
        inputs.extend([ray.skip, *world]);
    }
    let outputs = probe.run(gpu, &inputs)?;
    let hits = outputs.chunks_exact(4).map(|words| Hit {
        t: f32::from_bits(words[0]),
        u: f32::from_bits(words[1]),
        v: f32::from_bits(words[2]),
        triangle: words[3],
    });
    Ok(hits.collect())
}
