//! `mixray bench`: time against error.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;

use super::render::{above_zero, choice};
use super::{Failure, Outcome, growth, interrupt, print, progress, say, stress};
use crate::output::{write_bytes, write_text};
use crate::renderer::Skip;
use crate::report::{
    Axis, FORMAT, Law, Machine, Method, PAPER_SCENE, PaperRow, Plan, Plot, Reach, ReferenceGoal,
    Report, Row, Shot, Source, Target, Truth, Verdict, against, cost_to_reach, csv, gpu_time,
    gpu_time_markdown, gpu_time_text, log_log_slope, markdown, measure, page, paper_markdown,
    paper_rays_per_pixel, paper_rows, paper_text, picture_png, plots, reference, replace_section,
    shrink, text,
};
use crate::scene::{
    self, BackendChoice, Choice, Composite, Estimator, SamplerKind, Scene, Settings,
};

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
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scenes", "paper_table"])]
    report: Option<PathBuf>,
    /// The frame rates of Kan and Kaufmann 2012, Table 1, and ours on a scene like theirs
    #[arg(long, conflicts_with_all = ["scenes", "rpp", "reference", "target_rmse", "against", "ablate"])]
    paper_table: bool,
    /// Numerical stability: a table of hard cases, each with the figure that it must hold against closed forms and f64 brute force; minutes.
    /// Writes stress.json, .csv and .md; exits with 1 if a case fails
    #[arg(long, conflicts_with_all = ["scenes", "rpp", "reference", "target_rmse", "against", "ablate", "report", "paper_table"])]
    stress: bool,
    /// Where the time of a GPU render goes, kernel by kernel, at each number of rays per pixel. Writes gpu-time.json
    #[arg(long, conflicts_with_all = ["reference", "target_rmse", "against", "ablate", "report", "paper_table", "stress"])]
    gpu_time: bool,
    /// How the cost grows with triangles, pixels, rays, objects and lights: the exponent of each, beside what is expected; minutes.
    /// Writes growth.json, .csv and plots
    #[arg(long, value_name = "WHAT,WHAT", num_args = 0.., require_equals = true, value_delimiter = ',', value_parser = choice::<Law>(),
        conflicts_with_all = ["scenes", "rpp", "reference", "target_rmse", "against", "ablate", "filter", "report", "paper_table", "stress", "gpu_time"])]
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
    machine: Machine,
}

/// A page with a section for this table.
struct Docs {
    path: PathBuf,
    page: String,
    section: &'static str,
}

impl Arguments {
    pub(super) fn check(mut self) -> Result<Job, Failure> {
        self.rpp.sort_unstable();
        self.rpp.dedup();
        if self.reference.is_some() && self.scenes.len() != 1 {
            let message = "--reference is of one scene, and so must be the scenes";
            return Err(Failure(message.to_owned()));
        }
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
        if let Some(threads) = self.threads {
            rayon::ThreadPoolBuilder::new()
                .num_threads(usize::from(threads))
                .build_global()?;
        }
        let cpu_only = self.backends.as_slice() == [BackendChoice::Cpu];
        let machine = Machine::this(!cpu_only && self.report.is_none());
        let methods = self.methods(machine.gpu.as_ref().is_some_and(|gpu| gpu.hardware));
        Ok(Job {
            arguments: self,
            earlier,
            docs,
            methods,
            machine,
        })
    }

    /// What to measure.
    fn methods(&self, hardware_gpu: bool) -> Vec<Method> {
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
                            filter: false,
                        };
                        if methods.contains(&method) {
                            continue;
                        }
                        methods.push(method);
                        if self.filter && estimator == Estimator::Direct {
                            methods.push(Method {
                                filter: true,
                                ..method
                            });
                        }
                        if self.ablate && estimator == Estimator::Direct {
                            methods.extend(without_each(method));
                        }
                    }
                }
            }
        }
        methods
    }
}

/// The method once for each saving that it has, with that one switched off.
fn without_each(method: Method) -> impl Iterator<Item = Method> {
    let savings = Skip::CHOICES.iter().map(|(_, skip)| *skip);
    savings
        .filter(move |skip| match skip {
            Skip::Specialisation => method.backend == BackendChoice::Gpu,
            // It acts where rays are bought by error, and the rows are by rays.
            Skip::Adaptive => false,
            _ => true,
        })
        .map(move |skip| Method {
            without: Some(skip),
            ..method
        })
}

impl Docs {
    fn open(path: &Path, section: &'static str) -> Result<Self, Failure> {
        let page = read_text(path)?;
        if replace_section(&page, section, "").is_none() {
            return Err(Failure(format!(
                "{}: has no section <!-- {section} --> ... <!-- end -->",
                path.display()
            )));
        }
        Ok(Self {
            path: path.to_owned(),
            page,
            section,
        })
    }

    fn write(&self, content: &str) -> Result<(), Failure> {
        if let Some(page) = replace_section(&self.page, self.section, content) {
            write_text(&self.path, &page)?;
        }
        Ok(())
    }
}

pub(super) fn run(job: Job) -> Result<Outcome, Failure> {
    if job.arguments.stress || job.arguments.growth.is_some() {
        job.make_folder()?;
        let (folder, command) = (&job.arguments.output, command_line());
        let (outcome, table) = match &job.arguments.growth {
            Some(laws) => {
                let about = (&job.empty_report().machine, command.as_str());
                growth::run(
                    laws,
                    &job.plan(Vec::new()),
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

/// All that a scene's pictures are shown with.
#[derive(Default)]
struct Gallery {
    shots: Vec<Shot>,
    truths: Vec<(String, Composite, Truth)>,
}

/// Measures; true if it was interrupted.
fn benchmark(job: &Job) -> Result<(Report, bool), Failure> {
    let arguments = &job.arguments;
    let scenes = load_scenes(arguments, job.hardware_gpu())?;
    job.make_folder()?;
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let plan = job.plan(arguments.rpp.clone());
    let runs = 1 + u64::from(plan.repeats) * plan.rays_per_pixel.len() as u64;
    let steps = progress::Steps::new(scenes.len() as u64 * runs * plan.methods.len() as u64);
    let mut report = job.empty_report();
    let mut gallery = Gallery::default();
    let goal = ReferenceGoal {
        standard_error: arguments.reference_error,
        max_rays_per_pixel: arguments.reference_rpp,
    };
    let source = match &arguments.reference {
        Some(path) => Source::Given(path.clone()),
        None => Source::Folder(arguments.output.clone()),
    };
    'scenes: for scene in &scenes {
        let mut truths = BTreeMap::new();
        for composite in &arguments.composites {
            let found = reference(scene, *composite, &source, goal, &cancelled, &mut |what| {
                steps.say(what);
            })?;
            let Some(found) = found else {
                break 'scenes;
            };
            report.references.push(found.note);
            truths.insert(composite.name(), found.truth);
        }
        let truth_of = |method: &Method| truths.get(method.composite.name());
        let (rows, shots) = measure(scene, &plan, &truth_of, &cancelled, &mut |what| {
            steps.say(what);
            steps.step();
        })?;
        report.rows.extend(rows);
        gallery.shots.extend(shots);
        for composite in &arguments.composites {
            if let Some(truth) = truths.remove(composite.name()) {
                let name = scene.name.clone();
                gallery.truths.push((name, *composite, truth));
            }
        }
        conclude(&mut report, arguments.target_rmse);
        write_figures(&report, &arguments.output)?;
        if cancelled() {
            break;
        }
    }
    steps.clear();
    if report.rows.is_empty() {
        say("note", "interrupted before anything was measured");
    } else {
        write_pictures(&report, &gallery, &arguments.output)?;
    }
    Ok((report, cancelled()))
}

impl Job {
    fn plan(&self, rays_per_pixel: Vec<u32>) -> Plan {
        Plan {
            methods: self.methods.clone(),
            rays_per_pixel,
            repeats: self.arguments.repeats,
            first_seed: self.arguments.seed,
            hardware_gpu: self.hardware_gpu(),
        }
    }

    /// Makes the folder for what is written, once it is known that something will be.
    fn make_folder(&self) -> Result<(), Failure> {
        let folder = &self.arguments.output;
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

/// Slopes and targets from the rows.
fn conclude(report: &mut Report, target_rmse: Option<f64>) {
    report.slopes.clear();
    report.targets.clear();
    let mut lines: Vec<(&str, Method)> = Vec::new();
    for row in &report.rows {
        let line = (row.scene.as_str(), row.method);
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    for (scene, method) in lines {
        let rows: Vec<&Row> = report
            .rows
            .iter()
            .filter(|r| r.scene == scene && r.method == method)
            .collect();
        let points = |x: fn(&Row) -> f64| -> Vec<(f64, f64)> {
            let pairs = rows.iter().map(|row| (x(row), row.errors.all.rmse));
            pairs.collect()
        };
        let by_rays = points(|r| f64::from(r.rays_per_pixel));
        if let Some(slope) = log_log_slope(&by_rays) {
            let name = format!("{scene} {}", method.label());
            report.slopes.insert(name, slope);
        }
        if let Some(rmse) = target_rmse {
            let reach = |points: &[(f64, f64)]| -> Reach { cost_to_reach(points, rmse) };
            report.targets.push(Target {
                scene: scene.to_owned(),
                method,
                rmse,
                wall_secs: reach(&points(|r| r.wall_secs)),
                cpu_secs: reach(&points(|r| r.cpu_secs)),
                rays_per_pixel: reach(&by_rays),
            });
        }
    }
}

fn write_figures(report: &Report, folder: &Path) -> Result<(), Failure> {
    let mut json = serde_json::to_string_pretty(report)?;
    json.push('\n');
    write_text(&folder.join("results.json"), &json)?;
    write_text(&folder.join("results.csv"), &csv(report))?;
    Ok(())
}

fn write_pictures(report: &Report, gallery: &Gallery, folder: &Path) -> Result<(), Failure> {
    let plots: Vec<Plot> = plots(report)?;
    for plot in &plots {
        let axis = match plot.axis {
            Axis::Secs => "time",
            Axis::RaysPerPixel => "rays",
        };
        let path = folder.join(format!("{}-error-{axis}.svg", plot.scene));
        write_text(&path, &plot.svg)?;
        write_bytes(&path.with_extension("png"), &plot.png)?;
    }
    let page = page(report, &plots, &gallery.shots, &gallery.truths)?;
    write_text(&folder.join("index.html"), &page)?;
    say(
        "note",
        &format!("the report is {}", folder.join("index.html").display()),
    );
    Ok(())
}

fn read_text(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| Failure(format!("{}: {error}", path.display())))
}

fn read_report(path: &Path) -> Result<Report, Failure> {
    let problem = |reason: String| Failure(format!("{}: {reason}", path.display()));
    let text = read_text(path)?;
    let value: serde_json::Value = serde_json::from_str(&text)
        .map_err(|error| problem(format!("is no results.json: {error}")))?;
    let format = value.get("format").and_then(serde_json::Value::as_u64);
    if format != Some(u64::from(FORMAT)) {
        return Err(problem(format!(
            "is no results.json of format {FORMAT}; make it again with this version"
        )));
    }
    serde_json::from_value(value).map_err(|error| problem(format!("is no results.json: {error}")))
}

/// Prints the comparison; true if something regressed.
fn compare(report: &Report, earlier: &Report, tolerance: f64) -> Result<bool, Failure> {
    if report.machine != earlier.machine {
        say(
            "warning",
            "the two were measured on different machines or devices: their times say little of each other",
        );
    }
    let verdict = against(report, earlier, tolerance);
    if verdict.changes.is_empty() {
        return Err(Failure(
            "the two have no row in common: same scenes, sizes, methods and rays per pixel are compared"
                .to_owned(),
        ));
    }
    print(&comparison(&verdict, tolerance))?;
    let regressions: Vec<&str> = verdict
        .changes
        .iter()
        .filter(|change| change.is_regression())
        .map(|change| change.key.as_str())
        .collect();
    if regressions.is_empty() {
        return Ok(false);
    }
    say(
        "check failed",
        &format!("regression in {}", regressions.join("; ")),
    );
    Ok(true)
}

fn comparison(verdict: &Verdict, tolerance: f64) -> String {
    let mut out = String::from("\nnew over old:\n");
    for change in &verdict.changes {
        out += &format!(
            "{:7.3} x efficiency (at least {:.3})  {:7.3} x seconds  {:7.3} x RMSE  {}{}\n",
            change.efficiency,
            change.least,
            change.secs,
            change.rmse,
            change.key,
            if change.is_regression() {
                "  REGRESSION"
            } else {
                ""
            }
        );
    }
    for key in &verdict.not_compared {
        out += &format!("not compared: {key}\n");
    }
    out += &format!(
        "A regression is a fall of the efficiency, 1/(seconds x MSE), by more than 3 standard errors and {:.0}%; \
         the standard error comes from the standard deviation between runs, pooled over all rows: {:.1}%{}.\n",
        100.0 * tolerance,
        100.0 * verdict.spread,
        if verdict.spread_assumed {
            ", assumed: no row was run twice"
        } else {
            ""
        }
    );
    out
}

fn paper_table(job: &Job) -> Result<Outcome, Failure> {
    job.make_folder()?;
    let folder = &job.arguments.output;
    let path = folder.join("paper.toml");
    write_text(&path, PAPER_SCENE)?;
    let mut scene = shrink(scene::load(&path)?, job.arguments.shrink);
    "paper".clone_into(&mut scene.name);
    let interrupted = interrupt::watch()?;
    let cancelled = || interrupted.is_set();
    let plan = job.plan(paper_rays_per_pixel());
    let runs = 1 + u64::from(plan.repeats) * plan.rays_per_pixel.len() as u64;
    let steps = progress::Steps::new(runs * plan.methods.len() as u64);
    let (rows, shots) = measure(&scene, &plan, &|_| None, &cancelled, &mut |what| {
        steps.say(what);
        steps.step();
    })?;
    steps.clear();
    let machine = job.empty_report().machine;
    let rows: Vec<PaperRow> = paper_rows(&rows);
    let mut json = serde_json::to_string_pretty(&serde_json::json!({
        "format": FORMAT,
        "mixray": env!("CARGO_PKG_VERSION"),
        "command": command_line(),
        "machine": machine,
        "rows": rows,
    }))?;
    json.push('\n');
    write_text(&folder.join("paper.json"), &json)?;
    if let Some(shot) = shots.iter().max_by_key(|shot| shot.rays_per_pixel) {
        write_bytes(&folder.join("paper.png"), &picture_png(&shot.picture)?)?;
    }
    print(&paper_text(&machine, &rows))?;
    if let Some(docs) = &job.docs
        && !cancelled()
    {
        docs.write(&paper_markdown(&command_line(), &machine, &rows))?;
    }
    Ok(if cancelled() {
        Outcome::Interrupted
    } else {
        Outcome::Done
    })
}

fn gpu_times(job: &Job) -> Result<Outcome, Failure> {
    let interrupted = interrupt::watch()?;
    let scenes = load_scenes(&job.arguments, false)?;
    job.make_folder()?;
    let steps = progress::Steps::new((scenes.len() * job.arguments.rpp.len()) as u64);
    let mut times = Vec::new();
    'scenes: for scene in &scenes {
        for &rays_per_pixel in &job.arguments.rpp {
            steps.say(&format!("{}: {rays_per_pixel} rays per pixel", scene.name));
            let Some(time) = gpu_time(scene, rays_per_pixel)? else {
                return Err(Failure(
                    "the graphics device takes no timestamps; expected one that does (`mixray info` says)"
                        .to_owned(),
                ));
            };
            times.push(time);
            steps.step();
            if interrupted.is_set() {
                break 'scenes;
            }
        }
    }
    steps.clear();
    let mut json = serde_json::to_string_pretty(&serde_json::json!({
        "format": FORMAT,
        "mixray": env!("CARGO_PKG_VERSION"),
        "command": command_line(),
        "machine": job.machine,
        "times": times,
    }))?;
    json.push('\n');
    write_text(&job.arguments.output.join("gpu-time.json"), &json)?;
    print(&gpu_time_text(&job.machine, &times))?;
    if let Some(docs) = &job.docs
        && !interrupted.is_set()
    {
        docs.write(&gpu_time_markdown(&command_line(), &job.machine, &times))?;
    }
    Ok(match interrupted.is_set() {
        true => Outcome::Interrupted,
        false => Outcome::Done,
    })
}
