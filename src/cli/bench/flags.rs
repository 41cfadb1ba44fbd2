//! Flags that several measurements take: what is measured, and where the figures go.

use std::path::{Path, PathBuf};

use clap::Args;

use super::docs::Docs;
use crate::bench::{Machine, Method, Plan, shrink};
use crate::cli::scene_flags::SceneFlags;
use crate::cli::threads::ThreadsFlag;
use crate::cli::values::{choice, rays_per_pixel};
use crate::cli::{Failure, Outcome, say};
use crate::files;
use crate::output::{check_folder_name, remove_leftovers};
use crate::scene::{BackendChoice, Composite, Estimator, SamplerKind, Scene};

/// Where figures go, and on how many threads they are made.
#[derive(Debug, Args)]
pub(super) struct OutputFlags {
    /// Folder to write
    #[arg(short, long, value_name = "DIR", default_value = "bench")]
    output: PathBuf,
    /// Write the table into this page, between <!-- NAME --> and <!-- end -->, NAME being the subcommand, or bench without one
    #[arg(long, value_name = "FILE")]
    write_docs: Option<PathBuf>,
    #[command(flatten)]
    threads: ThreadsFlag,
}

impl OutputFlags {
    /// Starts the threads, and opens the page for the table, if there is one.
    pub(super) fn start(&self, section: &'static str) -> Result<Option<Docs>, Failure> {
        check_folder_name(&self.output, "a folder")?;
        let page = self.write_docs.as_deref();
        let docs = page.map(|path| Docs::open(path, section)).transpose()?;
        self.threads.start()?;
        Ok(docs)
    }

    /// Makes the folder for what is written, once it is known that something will be; `names` are files that will be in it.
    pub(super) fn make_folder(&self, names: &[&str]) -> Result<&Path, Failure> {
        let folder = &self.output;
        files::output(folder)?;
        for name in names {
            files::output(&folder.join(name))?;
        }
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure(format!(
                "{}: {error}; expected a folder that can be made; give another with -o",
                folder.display()
            ))
        })?;
        // References are kept there too.
        remove_leftovers(folder, |output| {
            let output = output.to_string_lossy();
            names.contains(&output.as_ref()) || output.starts_with("reference-")
        });
        Ok(folder)
    }
}

/// How the measurement ended; the table goes into the page if it is whole.
pub(super) fn finish(
    docs: Option<Docs>,
    table: &str,
    interrupted: bool,
) -> Result<Outcome, Failure> {
    if interrupted {
        return Ok(Outcome::Interrupted);
    }
    if let Some(docs) = docs {
        docs.write(table)?;
    }
    Ok(Outcome::Done)
}

/// What is measured, and how often.
#[derive(Debug, Args)]
pub(super) struct RunFlags {
    /// Where to render [default: cpu, and gpu where there is a hardware GPU]
    #[arg(long, value_delimiter = ',', value_parser = choice::<BackendChoice>())]
    backends: Vec<BackendChoice>,
    /// [default: direct with sobol and paper with jittered]
    #[arg(long, value_delimiter = ',', value_parser = choice::<Estimator>())]
    pub estimators: Vec<Estimator>,
    /// With every estimator
    #[arg(long, value_delimiter = ',', value_parser = choice::<SamplerKind>())]
    samplers: Vec<SamplerKind>,
    #[arg(long, value_delimiter = ',', value_parser = choice::<Composite>(), default_value = "additive")]
    pub composites: Vec<Composite>,
    /// Runs of each row, each with its own seed
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Seed of the first run
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u32,
    /// Divide the scenes' width and height
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub shrink: u32,
}

impl RunFlags {
    /// The machine, its GPU if one may be measured.
    pub(super) fn machine(&self) -> Machine {
        Machine::this(self.backends.as_slice() != [BackendChoice::Cpu])
    }

    /// What to measure there: every combination of what was asked for.
    pub(super) fn methods(&self, machine: &Machine) -> Vec<Method> {
        let hardware_gpu = has_hardware_gpu(machine);
        let backends = match self.backends.as_slice() {
            [] if hardware_gpu => vec![BackendChoice::Cpu, BackendChoice::Gpu],
            [] => vec![BackendChoice::Cpu],
            given => given
                .iter()
                .map(|choice| match choice {
                    BackendChoice::Auto if hardware_gpu => BackendChoice::Gpu,
                    BackendChoice::Auto => BackendChoice::Cpu,
                    named => *named,
                })
                .collect(),
        };
        let estimators = match self.estimators.as_slice() {
            [] => vec![Estimator::Direct, Estimator::Paper],
            given => given.to_vec(),
        };
        let mut methods = Vec::new();
        for &backend in &backends {
            for &estimator in &estimators {
                let samplers = match (self.samplers.as_slice(), estimator) {
                    ([], Estimator::Direct) => vec![SamplerKind::Sobol],
                    ([], Estimator::Paper) => vec![SamplerKind::Jittered],
                    (given, _) => given.to_vec(),
                };
                for &sampler in &samplers {
                    for &composite in &self.composites {
                        let method = Method {
                            backend,
                            estimator,
                            sampler,
                            composite,
                            without: None,
                            goal: None,
                            filter: false,
                        };
                        if !methods.contains(&method) {
                            methods.push(method);
                        }
                    }
                }
            }
        }
        methods
    }

    pub(super) fn plan(
        &self,
        rays_per_pixel: Vec<u32>,
        methods: Vec<Method>,
        machine: &Machine,
    ) -> Plan {
        Plan {
            methods,
            rays_per_pixel,
            repeats: self.repeats,
            first_seed: self.seed,
            hardware_gpu: has_hardware_gpu(machine),
        }
    }
}

pub(super) fn has_hardware_gpu(machine: &Machine) -> bool {
    machine.gpu.as_ref().is_some_and(|gpu| gpu.hardware)
}

/// The machine as figures of these methods name it: without a GPU that none of them uses.
pub(super) fn machine_of(machine: &Machine, methods: &[Method]) -> Machine {
    let mut machine = machine.clone();
    if !methods.iter().any(|m| m.backend == BackendChoice::Gpu) {
        machine.gpu = None;
    }
    machine
}

/// Rays per pixel, ascending, each once.
#[derive(Debug, Args)]
pub(super) struct RaysFlag {
    /// Rays per pixel
    #[arg(long, value_name = "N,N", value_delimiter = ',', default_values_t = [1, 4, 9, 16, 25, 49, 100],
        value_parser = rays_per_pixel(1))]
    rpp: Vec<u32>,
}

impl RaysFlag {
    pub(super) fn ascending(&self) -> Vec<u32> {
        let mut rays = self.rpp.clone();
        rays.sort_unstable();
        rays.dedup();
        rays
    }
}

/// Scenes by different names, to be rendered on the CPU until told otherwise; `by` divides their sizes.
pub(super) fn load_scenes(
    paths: &[PathBuf],
    flags: SceneFlags,
    by: u32,
) -> Result<Vec<Scene>, Failure> {
    let mut scenes: Vec<Scene> = Vec::new();
    for path in paths {
        let mut scene = shrink(flags.load(path)?, by);
        scene.settings.backend = BackendChoice::Cpu;
        for warning in &scene.warnings {
            say("warning", warning);
        }
        if scenes.iter().any(|known| known.name == scene.name) {
            return Err(Failure(format!(
                "two scenes are called {}; put them into folders of different names",
                scene.name
            )));
        }
        scenes.push(scene);
    }
    Ok(scenes)
}
