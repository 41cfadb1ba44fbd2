//! `mixray bench`: time against error.

mod ablation;
mod benchmark;
mod conclusions;
mod docs;
mod files;
mod gpu_times;
mod growth;
mod methods;
mod paper;
mod regression;
mod stress;

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;

use super::picture_flags::start_threads;
use super::render::{above_zero, camera_noise, choice};
use super::{Failure, Outcome, print, say};
use crate::bench::{FORMAT, Law, Machine, Method, Plan, Report, markdown, shrink, text};
use crate::renderer::{CameraNoise, SCRAMBLES, Skip};
use crate::scene::{self, BackendChoice, Composite, Estimator, SamplerKind, Scene, Settings};

use benchmark::benchmark;
use conclusions::conclude;
use docs::Docs;
use files::read_report;
use gpu_times::gpu_times;
use paper::paper_table;
use regression::compare;

/// Flags that say how each row is measured.
const OF_RUNS: [&str; 8] = [
    "rpp",
    "backends",
    "estimators",
    "samplers",
    "composites",
    "repeats",
    "seed",
    "shrink",
];
/// Flags of rows of error against time, which the other measurements do not have.
const OF_ROWS: [&str; 8] = [
    "reference",
    "reference_error",
    "reference_rpp",
    "no_skip",
    "target_error",
    "camera_noise",
    "goal_rpp",
    "filter",
];
/// Flags of results.json.
const OF_RESULTS: [&str; 3] = ["target_rmse", "against", "ablate"];

/// Measures time against error
///
/// Renders each scene at each number of rays per pixel with every combination of backend, estimator, sampler and composite, in turns, and compares
/// with a converged reference, which is made once and kept in the output folder. Writes results.csv, results.json, plots (SVG, PNG) and
/// index.html. Ctrl-C keeps what is finished.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene files
    #[arg(required_unless_present_any = ["paper_table", "report", "stress", "growth"])]
    scenes: Vec<PathBuf>,
    /// Folder to write
    #[arg(short, long, value_name = "DIR", default_value = "bench")]
    output: PathBuf,
    /// Rays per pixel
    #[arg(long, value_name = "N,N", value_delimiter = ',', default_values_t = [1, 4, 9, 16, 25, 49, 100],
        value_parser = clap::value_parser!(u32).range(1..=i64::from(Settings::MAX_RAYS_PER_PIXEL)))]
    rpp: Vec<u32>,
    /// Where to render [default: cpu, and gpu where there is a hardware GPU]
    #[arg(long, value_delimiter = ',', value_parser = choice::<BackendChoice>())]
    backends: Vec<BackendChoice>,
    /// [default: direct with sobol and paper with jittered]
    #[arg(long, value_delimiter = ',', value_parser = choice::<Estimator>())]
    estimators: Vec<Estimator>,
    /// With every estimator
    #[arg(long, value_delimiter = ',', value_parser = choice::<SamplerKind>())]
    samplers: Vec<SamplerKind>,
    #[arg(long, value_delimiter = ',', value_parser = choice::<Composite>(), default_value = "additive")]
    composites: Vec<Composite>,
    /// Runs of each row, each with its own seed
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
    /// Seed of the first run
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Converged picture of the scene, from this or another program (only with one scene)
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Standard error of a reference made here, root mean square over the picture, from 16 independent scrambles or more
    #[arg(long, value_name = "X", default_value_t = 1e-3, value_parser = above_zero)]
    reference_error: f64,
    /// Rays per pixel after which the reference is left as it is
    #[arg(long, value_name = "N", default_value_t = 4096,
        value_parser = clap::value_parser!(u32).range(16..=i64::from(Settings::MAX_RAYS_PER_PIXEL)))]
    reference_rpp: u32,
    /// Divide the scenes' width and height
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    shrink: u32,
    /// Measure `direct` without each of its savings too
    #[arg(long)]
    ablate: bool,
    /// Measure `direct` without this saving too; may be given several times
    #[arg(long, value_name = "NAME", value_parser = choice::<Skip>())]
    no_skip: Vec<Skip>,
    /// Measure `direct` at this standard error too, root mean square over each tile of 16 x 16 pixels [default, for the saving adaptive: the RMSE
    /// of `direct` at the middle of --rpp, to one digit: rows for --against want it given, for what is measured may come out otherwise]
    #[arg(long, value_name = "E", value_parser = above_zero)]
    target_error: Option<f64>,
    /// Measure `direct` where it stops at this camera noise too: a file of `mixray noise calibrate`, or A,B as `mixray render` takes them [default, for
    /// the saving camera-noise: the scene's [noise], else 0.02,0.5]
    #[arg(long, value_name = "NOISE.toml|A,B")]
    camera_noise: Option<String>,
    /// Rays per pixel after which rows with such a goal stop [default: 1024]
    #[arg(long, value_name = "N",
        value_parser = clap::value_parser!(u32).range(i64::from(SCRAMBLES)..=i64::from(Settings::MAX_RAYS_PER_PIXEL)))]
    goal_rpp: Option<u32>,
    /// Measure `direct` with the preview filter too
    #[arg(long)]
    filter: bool,
    /// Find the time that each method needs for this RMSE
    #[arg(long, value_name = "X", value_parser = above_zero)]
    target_rmse: Option<f64>,
    /// Compare with an earlier results.json and exit with 1 on a regression
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// Fall of the efficiency, 1/(seconds x MSE), that is no regression, beside what the spread between runs explains
    #[arg(long, value_name = "X", default_value_t = 0.05, value_parser = above_zero, requires = "against")]
    tolerance: f64,
    /// Measure nothing: take this results.json
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scenes", "paper_table"], conflicts_with_all = OF_RUNS, conflicts_with_all = OF_ROWS)]
    report: Option<PathBuf>,
    /// The frame rates of Kan and Kaufmann 2012, Table 1, and ours on a scene like theirs
    #[arg(long, conflicts_with_all = ["scenes", "rpp"], conflicts_with_all = OF_ROWS, conflicts_with_all = OF_RESULTS)]
    paper_table: bool,
    /// Numerical stability: a table of hard cases, each with the figure that it must hold against closed forms and f64 brute force; minutes.
    /// Writes stress.json, .csv and .md; exits with 1 if a case fails
    #[arg(long, conflicts_with_all = ["scenes", "rpp", "report", "paper_table"], conflicts_with_all = OF_ROWS, conflicts_with_all = OF_RESULTS)]
    stress: bool,
    /// Where the time of a GPU render goes, kernel by kernel, at each number of rays per pixel. Writes gpu-time.json
    #[arg(long, conflicts_with_all = ["report", "paper_table", "stress"], conflicts_with_all = OF_ROWS, conflicts_with_all = OF_RESULTS)]
    gpu_time: bool,
    /// How the cost grows with triangles, pixels, rays, objects and lights: the exponent of each, beside what is expected; minutes.
    /// Writes growth.json, .csv and plots
    #[arg(long, value_name = "WHAT,WHAT", num_args = 0.., require_equals = true, value_delimiter = ',', value_parser = choice::<Law>(),
        conflicts_with_all = ["scenes", "rpp", "report", "paper_table", "stress", "gpu_time"],
        conflicts_with_all = OF_ROWS, conflicts_with_all = OF_RESULTS)]
    growth: Option<Vec<Law>>,
    /// Write the table into this page, between <!-- bench --> (<!-- ablate -->, <!-- paper-table -->, <!-- stress -->, <!-- gpu-time -->, <!-- growth -->) and
    /// <!-- end -->
    #[arg(long, value_name = "FILE")]
    write_docs: Option<PathBuf>,
    /// CPU threads [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// What was asked for, with files that can be read and written.
pub(super) struct Job {
    arguments: Arguments,
    earlier: Option<Report>,
    docs: Option<Docs>,
    methods: Vec<Method>,
    camera_noise: Option<CameraNoise>,
    machine: Machine,
}

impl Arguments {
    pub(super) fn check(mut self) -> Result<Job, Failure> {
        self.rpp.sort_unstable();
        self.rpp.dedup();
        if self.reference.is_some() && self.scenes.len() != 1 {
            let message = "--reference is of one scene, and so must be the scenes";
            return Err(Failure(message.to_owned()));
        }
        self.check_direct()?;
        self.check_goals()?;
        let section = if self.stress {
            "stress"
        } else if self.growth.is_some() {
            "growth"
        } else if self.paper_table {
            "paper-table"
        } else if self.gpu_time {
            "gpu-time"
        } else if self.ablate {
            "ablate"
        } else {
            "bench"
        };
        let docs = self
            .write_docs
            .as_deref()
            .map(|path| Docs::open(path, section))
            .transpose()?;
        let earlier = self.against.as_deref().map(read_report).transpose()?;
        start_threads(self.threads)?;
        let cpu_only = self.backends.as_slice() == [BackendChoice::Cpu];
        let machine = Machine::this(!cpu_only && self.report.is_none());
        let camera_noise = self.camera_noise.as_deref().map(camera_noise).transpose()?;
        let methods = self.methods(machine.gpu.as_ref().is_some_and(|gpu| gpu.hardware));
        let on_gpu = methods.iter().any(|m| m.backend == BackendChoice::Gpu);
        if self.no_skip.contains(&Skip::Specialisation) && !on_gpu {
            let message = "--no-skip specialisation is of the GPU; expected --backends gpu";
            return Err(Failure(message.to_owned()));
        }
        Ok(Job {
            arguments: self,
            earlier,
            docs,
            methods,
            camera_noise,
            machine,
        })
    }
}

pub(super) fn run(job: Job) -> Result<Outcome, Failure> {
    if job.arguments.stress || job.arguments.growth.is_some() {
        job.make_folder(match job.arguments.stress {
            true => &["stress.json", "stress.csv", "stress.md"],
            false => &["growth.json", "growth.csv"],
        })?;
        let (folder, command) = (&job.arguments.output, command_line());
        let (outcome, table) = match &job.arguments.growth {
            Some(laws) => {
                let about = (&job.empty_report().machine, command.as_str());
                growth::run(
                    laws,
                    &job.plan(Vec::new(), job.methods.clone()),
                    job.arguments.shrink,
                    folder,
                    about,
                )?
            }
            None => stress::run(folder, &job.machine, &command)?,
        };
        if let Some(docs) = &job.docs
            && outcome != Outcome::Interrupted
        {
            docs.write(&table)?;
        }
        return Ok(outcome);
    }
    if job.arguments.paper_table {
        return paper_table(&job);
    }
    if job.arguments.gpu_time {
        return gpu_times(&job);
    }
    let (report, interrupted) = match &job.arguments.report {
        Some(path) => {
            let mut report = read_report(path)?;
            if job.arguments.target_rmse.is_some() {
                conclude(&mut report, job.arguments.target_rmse);
            }
            (report, false)
        }
        None => benchmark(&job)?,
    };
    print(&text(&report))?;
    if let Some(docs) = &job.docs
        && !interrupted
    {
        docs.write(&markdown(&report))?;
    }
    let regression = match &job.earlier {
        Some(earlier) => compare(&report, earlier, job.arguments.tolerance)?,
        None => false,
    };
    Ok(match (interrupted, regression) {
        (true, _) => Outcome::Interrupted,
        (false, true) => Outcome::CheckFailed,
        (false, false) => Outcome::Done,
    })
}

impl Job {
    fn plan(&self, rays_per_pixel: Vec<u32>, methods: Vec<Method>) -> Plan {
        Plan {
            methods,
            rays_per_pixel,
            repeats: self.arguments.repeats,
            first_seed: self.arguments.seed,
            hardware_gpu: self.hardware_gpu(),
        }
    }

    /// Makes the folder for what is written, once it is known that something will be; `names` are the files that are.
    fn make_folder(&self, names: &[&str]) -> Result<(), Failure> {
        let folder = &self.arguments.output;
        crate::files::output(folder)?;
        for name in names {
            crate::files::output(&folder.join(name))?;
        }
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure(format!(
                "{}: {error}; expected a folder that can be made; give another with -o",
                folder.display()
            ))
        })
    }

    fn hardware_gpu(&self) -> bool {
        self.machine.gpu.as_ref().is_some_and(|gpu| gpu.hardware)
    }

    fn empty_report(&self) -> Report {
        let mut machine = self.machine.clone();
        if !self.methods.iter().any(|m| m.backend == BackendChoice::Gpu) {
            machine.gpu = None;
        }
        Report {
            format: FORMAT,
            mixray: env!("CARGO_PKG_VERSION").to_owned(),
            command: command_line(),
            machine,
            references: Vec::new(),
            rows: Vec::new(),
            slopes: BTreeMap::new(),
            targets: Vec::new(),
        }
    }
}

/// `hardware_gpu`: references are made on it.
fn load_scenes(arguments: &Arguments, hardware_gpu: bool) -> Result<Vec<Scene>, Failure> {
    let mut scenes: Vec<Scene> = Vec::new();
    for path in &arguments.scenes {
        let mut scene = shrink(scene::load(path)?, arguments.shrink);
        scene.settings.backend = if hardware_gpu {
            BackendChoice::Gpu
        } else {
            BackendChoice::Cpu
        };
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

/// What was typed, with the program by its name.
fn command_line() -> String {
    let quoted = std::env::args().skip(1).map(|argument| {
        if argument.chars().any(char::is_whitespace) || argument.is_empty() {
            format!("'{argument}'")
        } else {
            argument
        }
    });
    std::iter::once("mixray".to_owned())
        .chain(quoted)
        .collect::<Vec<_>>()
        .join(" ")
}
