//! `mixray bench SCENE...` and `mixray bench ablate SCENE...`: error against time, scene by scene.

mod ablation;

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;

use crate::bench::{
    FORMAT, Machine, Method, Plan, ReferenceGoal, Report, Source, markdown, measure, reference,
    text,
};
use crate::cli::bench::command_line;
use crate::cli::bench::conclusions::conclude;
use crate::cli::bench::docs::Docs;
use crate::cli::bench::files::{Gallery, write_figures, write_pictures};
use crate::cli::bench::flags::{
    OutputFlags, RaysFlag, RunFlags, finish, has_hardware_gpu, load_scenes, machine_of,
};
use crate::cli::bench::regression::compare;
use crate::cli::scene_flags::SceneFlags;
use crate::cli::values::{above_zero, camera_noise, choice, rays_per_pixel};
use crate::cli::{Failure, Outcome, interrupt, print, progress, say};
use crate::renderer::{CameraNoise, SCRAMBLES, Skip, Watcher};
use crate::scene::{BackendChoice, Choice, Estimator, Scene};

use ablation::without_each;

/// Flags that say what is measured, which nothing is with `--report`.
const OF_MEASURING: [&str; 16] = [
    "rpp",
    "backends",
    "estimators",
    "samplers",
    "composites",
    "repeats",
    "seed",
    "shrink",
    "reference",
    "reference_error",
    "reference_rpp",
    "no_skip",
    "target_error",
    "camera_noise",
    "goal_rpp",
    "filter",
];

/// Measures `direct` without each of its savings in turn, beside what `mixray bench SCENE...` measures
#[derive(Debug, Args)]
#[group(id = "rows")]
pub(super) struct Arguments {
    /// Scene files
    #[arg(value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    pub rays: RaysFlag,
    #[command(flatten)]
    pub runs: RunFlags,
    /// Converged picture of the scene, from this or another program (only with one scene)
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Standard error of a reference made here, root mean square over the picture, from 16 independent scrambles or more
    #[arg(long, value_name = "X", default_value_t = 1e-3, value_parser = above_zero)]
    reference_error: f64,
    /// Rays per pixel after which the reference is left as it is
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = rays_per_pixel(16))]
    reference_rpp: u32,
    /// Every saving is left out in turn.
    #[arg(skip)]
    pub ablate: bool,
    /// Measure `direct` without this saving too; may be given several times
    #[arg(long, value_name = "NAME", value_parser = choice::<Skip>())]
    pub no_skip: Vec<Skip>,
    /// Measure `direct` at this standard error too, root mean square over each tile of 16 x 16 pixels [default, for the saving adaptive: the RMSE
    /// of `direct` at the middle of --rpp, to one digit: rows for --against want it given, for what is measured may come out otherwise]
    #[arg(long, value_name = "E", value_parser = above_zero)]
    pub target_error: Option<f64>,
    /// Measure `direct` where it stops at this camera noise too: a file of `mixray noise calibrate`, or A,B as `mixray render` takes them [default, for
    /// the saving camera-noise: the scene's [noise], else 0.02,0.5]
    #[arg(long, value_name = "NOISE.toml|A,B")]
    pub camera_noise: Option<String>,
    /// Rays per pixel after which rows with such a goal stop [default: 1024]
    #[arg(long, value_name = "N", value_parser = rays_per_pixel(SCRAMBLES))]
    pub goal_rpp: Option<u32>,
    /// Measure `direct` with the preview filter too
    #[arg(long)]
    pub filter: bool,
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
    #[arg(long, value_name = "FILE", conflicts_with = "scenes", conflicts_with_all = OF_MEASURING)]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputFlags,
}

/// What was asked for, with files that can be read and written.
pub(super) struct Job {
    pub arguments: Arguments,
    earlier: Option<Report>,
    docs: Option<Docs>,
    pub methods: Vec<Method>,
    pub camera_noise: Option<CameraNoise>,
    scenes: Vec<Scene>,
    machine: Machine,
}

impl Arguments {
    /// With each of the savings left out in turn.
    pub(super) fn ablated(mut self) -> Result<Self, Failure> {
        if let [skip, ..] = self.no_skip.as_slice() {
            return Err(Failure(format!(
                "ablate leaves out every saving in turn, {} too; expected no --no-skip; leave it away, or leave away ablate",
                skip.name()
            )));
        }
        self.ablate = true;
        Ok(self)
    }

    fn check(self) -> Result<Job, Failure> {
        if self.scenes.is_empty() && self.report.is_none() {
            let message = "there is nothing to measure; expected a scene; type `mixray bench SCENE...` (`mixray bench --help` names the other measurements)";
            return Err(Failure(message.to_owned()));
        }
        if self.reference.is_some() && self.scenes.len() != 1 {
            let message = "--reference is of one scene, and so must be the scenes";
            return Err(Failure(message.to_owned()));
        }
        self.check_direct()?;
        self.check_goals()?;
        let docs = (self.output).start(if self.ablate { "ablate" } else { "bench" })?;
        let earlier = self.against.as_deref().map(Report::read).transpose()?;
        let camera_noise = self.camera_noise.as_deref().map(camera_noise).transpose()?;
        let mut scenes = load_scenes(&self.scenes, self.scene, self.runs.shrink)?;
        // Asks for graphics devices, which may take seconds: after all that may be refused.
        let machine = match self.report {
            Some(_) => Machine::this(false),
            None => self.runs.machine(),
        };
        // References are made there.
        for scene in &mut scenes {
            scene.settings.backend = match has_hardware_gpu(&machine) {
                true => BackendChoice::Gpu,
                false => BackendChoice::Cpu,
            };
        }
        let methods = self.methods(&machine);
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
            scenes,
            machine,
        })
    }

    /// The rows by rays per pixel: `direct` with the filter and without savings beside itself.
    fn methods(&self, machine: &Machine) -> Vec<Method> {
        let mut methods = Vec::new();
        for method in self.runs.methods(machine) {
            methods.push(method);
            if method.estimator == Estimator::Direct {
                methods.extend(self.filter.then_some(Method {
                    filter: true,
                    ..method
                }));
                methods.extend(without_each(method, &self.savings()));
            }
        }
        methods
    }
}

pub(super) fn run(arguments: Arguments) -> Result<Outcome, Failure> {
    let job = arguments.check()?;
    let arguments = &job.arguments;
    let (report, interrupted) = match &arguments.report {
        Some(path) => {
            let mut report = Report::read(path)?;
            if arguments.target_rmse.is_some() {
                conclude(&mut report, arguments.target_rmse);
            }
            (report, false)
        }
        None => benchmark(&job)?,
    };
    print(&text(&report))?;
    let outcome = finish(job.docs, &markdown(&report), interrupted)?;
    let regression = match &job.earlier {
        Some(earlier) => compare(&report, earlier, arguments.tolerance)?,
        None => false,
    };
    Ok(match (outcome, regression) {
        (Outcome::Done, true) => Outcome::CheckFailed,
        (outcome, _) => outcome,
    })
}

impl Job {
    pub(super) fn plan(&self, rays_per_pixel: Vec<u32>, methods: Vec<Method>) -> Plan {
        let arguments = &self.arguments;
        (arguments.runs).plan(rays_per_pixel, methods, &self.machine)
    }

    fn empty_report(&self) -> Report {
        Report {
            format: FORMAT,
            mixray: env!("CARGO_PKG_VERSION").to_owned(),
            command: command_line(),
            machine: machine_of(&self.machine, &self.methods),
            references: Vec::new(),
            rows: Vec::new(),
            slopes: BTreeMap::new(),
            targets: Vec::new(),
        }
    }
}

/// Measures; true if it was interrupted.
fn benchmark(job: &Job) -> Result<(Report, bool), Failure> {
    let arguments = &job.arguments;
    let rays_per_pixel = arguments.rays.ascending();
    let scenes = &job.scenes;
    let plots = scenes.iter().flat_map(|scene| {
        ["time.svg", "time.png", "rays.svg", "rays.png"]
            .map(|axis| format!("{}-error-{axis}", scene.name))
    });
    let plots: Vec<String> = plots.collect();
    let mut names = vec!["results.json", "results.csv", "index.html"];
    names.extend(plots.iter().map(String::as_str));
    let folder = arguments.output.make_folder(&names)?;
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let watcher = Watcher::none().cancelled_by(&cancelled);
    let steps = progress::Steps::new(scenes.iter().map(|scene| job.runs_of(scene)).sum());
    let mut report = job.empty_report();
    let mut gallery = Gallery::default();
    let goal = ReferenceGoal {
        standard_error: arguments.reference_error,
        max_rays_per_pixel: arguments.reference_rpp,
    };
    let source = match &arguments.reference {
        Some(path) => Source::Given(path.clone()),
        None => Source::Folder(folder.to_owned()),
    };
    'scenes: for scene in scenes {
        let mut truths = BTreeMap::new();
        for composite in &arguments.runs.composites {
            let found = reference(scene, *composite, &source, goal, &watcher, &mut |what| {
                steps.say(what);
            })?;
            let Some(found) = found else {
                break 'scenes;
            };
            report.references.push(found.note);
            truths.insert(composite.name(), found.truth);
        }
        let truth_of = |method: &Method| truths.get(method.composite.name());
        let mut methods = job.methods.clone();
        methods.extend(job.goal_methods(scene, &truth_of, &watcher, &steps)?);
        if watcher.is_cancelled() {
            break;
        }
        let plan = job.plan(rays_per_pixel.clone(), methods);
        let (rows, shots) = measure(scene, &plan, &truth_of, &watcher, &mut |what| {
            steps.say(what);
            steps.step();
        })?;
        report.rows.extend(rows);
        gallery.shots.extend(shots);
        for composite in &arguments.runs.composites {
            if let Some(truth) = truths.remove(composite.name()) {
                let name = scene.name.clone();
                gallery.truths.push((name, *composite, truth));
            }
        }
        conclude(&mut report, arguments.target_rmse);
        write_figures(&report, folder)?;
        if watcher.is_cancelled() {
            break;
        }
    }
    steps.clear();
    if report.rows.is_empty() {
        say("note", "interrupted before anything was measured");
    } else {
        write_pictures(&report, &gallery, folder)?;
    }
    Ok((report, watcher.is_cancelled()))
}
