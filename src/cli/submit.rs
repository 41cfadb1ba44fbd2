//! `mixray submit`: a render as a job for the engine of a farm.

use std::path::{Path, PathBuf};
use std::process::Command;

use clap::{ArgMatches, Args, ValueEnum};

use super::bundle::check;
use super::forwarded::typed;
use super::frame_flags::FrameFlags;
use super::picture_flags::PictureFlags;
use super::sequence::tell;
use super::{Failure, Outcome, print, say};
use crate::farm::{
    Bundle, Engine, Job, OUTPUT, Requirements, SHOT, Word, even, gather, in_chunks, part_file,
    write_new_folder,
};
use crate::output::write_text;
use crate::sequence::{SequenceOptions, Survey, survey};
use crate::video::sequence_note;

/// Of [`SHOT`].
const SCENE: &str = "scene";
const FRAMES: &str = "frames";
const TRAJECTORY: &str = "trajectory";
const CALIBRATION: &str = "calibration";
/// Handled by the job itself.
const LEFT_OUT: &[&str] = &["frames", "intrinsics", "stats", "progress", "camera_noise"];

/// Writes a render as a job: a folder with all that is read, and what the engine of a farm needs to run it
///
/// With --trajectory the frames of a video are shared among the tasks (options of `mixray sequence`), else the rays of a picture (options of
/// `mixray render`). Tasks may be repeated: what is finished is kept.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene file (TOML)
    scene: PathBuf,
    /// openjd: Open Job Description template; slurm: job array; make: Makefile
    #[arg(long, value_name = "ENGINE")]
    engine: EngineName,
    /// New folder for the job
    #[arg(short, long, value_name = "JOB")]
    output: PathBuf,
    /// Frames in a task
    #[arg(long, value_name = "N", requires = "trajectory", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    chunk: u32,
    /// Tasks among which the rays per pixel are shared
    #[arg(long, value_name = "N", conflicts_with = "trajectory", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..))]
    ranges: u32,
    /// Poses of the frames, as `mixray sequence` takes them
    #[arg(long, value_name = "FILE", requires = "frames")]
    trajectory: Option<PathBuf>,
    /// Open Job Description: list the tasks instead of letting the engine form chunks of frames (extension TASK_CHUNKING)
    #[arg(long)]
    no_task_chunking: bool,
    /// Shell command in the job's output folder after all else, such as one that makes a film of frames/
    #[arg(long, value_name = "COMMAND")]
    encode: Option<String>,
    /// CPUs that a task asks for
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    cpus: Option<u32>,
    /// Memory that a task asks for, MiB
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..))]
    memory: Option<u64>,
    /// GPUs that a task asks for
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    gpus: Option<u32>,
    /// Hand the job over: `openjd run`, sbatch, or make
    #[arg(long)]
    submit: bool,
    #[command(flatten)]
    frames: FrameFlags,
    #[command(flatten)]
    flags: PictureFlags,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum EngineName {
    Openjd,
    Slurm,
    Make,
}

impl EngineName {
    fn engine(self) -> Engine {
        match self {
            Self::Openjd => Engine::OpenJd,
            Self::Slurm => Engine::Slurm,
            Self::Make => Engine::Make,
        }
    }
}

/// `matches`: what was typed, to be handed on to the tasks.
pub(super) fn run(arguments: &Arguments, matches: &ArgMatches) -> Result<Outcome, Failure> {
    if arguments.flags.stats.is_some() || arguments.flags.progress.is_some() {
        let message = "--stats and --progress are of one run; expected neither; leave them out";
        return Err(Failure(message.to_owned()));
    }
    let tasks = write_new_folder(&arguments.output, |folder| -> Result<usize, Failure> {
        let job = match &arguments.trajectory {
            Some(trajectory) => frames_job(arguments, matches, trajectory, folder)?,
            None => rays_job(arguments, matches, folder)?,
        };
        for (name, text) in job.files(arguments.engine.engine())? {
            write_text(&folder.join(name), &text)?;
        }
        Ok(job.parts.len())
    })?;
    print(&format!(
        "job {} ({tasks} tasks)\n",
        arguments.output.display()
    ))?;
    match arguments.submit {
        true => hand_over(arguments),
        false => Ok(Outcome::Done),
    }
}

impl Arguments {
    fn job(&self, name: &str, unit: &'static str) -> Job {
        Job {
            name: format!("mixray {name}"),
            unit,
            parts: Vec::new(),
            chunk: None,
            task: Vec::new(),
            merge: Vec::new(),
            encode: self.encode.clone(),
            requirements: Requirements {
                cpus: self.cpus,
                memory_mib: self.memory,
                gpus: self.gpus,
            },
        }
    }

    /// What tells an engine how far a task is, where it listens.
    fn progress(&self) -> Option<Word> {
        (self.engine == EngineName::Openjd).then(|| Word::text("--progress=openjd"))
    }

    /// The camera's noise, a file of which goes into the shot.
    fn camera_noise(&self, bundle: &mut Bundle) -> Vec<Word> {
        let Some(noise) = &self.flags.goal.camera_noise else {
            return Vec::new();
        };
        let flag = Word::text("--camera-noise");
        match Path::new(noise).is_file() {
            true => {
                bundle.add("camera-noise.toml", Path::new(noise));
                vec![flag, Word::Shot("camera-noise.toml".to_owned())]
            }
            false => vec![Word::text(format!("--camera-noise={noise}"))],
        }
    }
}

/// A still: each task takes some of every pixel's rays.
fn rays_job(arguments: &Arguments, matches: &ArgMatches, folder: &Path) -> Result<Job, Failure> {
    let goal = &arguments.flags.goal;
    if goal.filter.is_some() || goal.goal(None)?.is_some() {
        let message = "--target-error, --stop-at and --filter look at all rays of a picture; expected the frames of a video (--trajectory), or a number of rays to share; leave them out";
        return Err(Failure(message.to_owned()));
    }
    let mut scene = arguments.flags.scene.load(&arguments.scene)?;
    for warning in &scene.warnings {
        say("warning", warning);
    }
    let bundle = gather(&scene)?;
    let place = folder.join(SHOT).join(SCENE);
    bundle.write_into(&place)?;
    check(&bundle, &scene, &place)?;
    make_folder(&folder.join(OUTPUT))?;
    scene.settings.apply(&arguments.flags.overrides());
    let scene_file = Word::Shot(format!("{SCENE}/{}", bundle.scene_file()));
    let mut job = arguments.job(&scene.name, "Rays");
    job.parts = even(scene.settings.rays_per_pixel, arguments.ranges);
    job.task = vec![Word::text("render"), scene_file.clone()];
    job.task.extend([Word::text("--range"), Word::Part]);
    job.task.extend([Word::text("-o"), Word::PartFile]);
    job.task.push(Word::text("--resume"));
    job.task.extend(arguments.progress());
    let of_pictures = ["png_bits", "sandbox"];
    let takes = |id: &str| !LEFT_OUT.contains(&id) && id != "png_bits";
    let options = typed::<PictureFlags>(matches, takes);
    job.task.extend(options.into_iter().map(Word::Text));
    job.merge = vec![Word::text("merge")];
    for (first, last) in &job.parts {
        let file = part_file(&format!("{first}-{last}"));
        job.merge.push(Word::Output(file));
    }
    job.merge.extend([Word::text("--scene"), scene_file]);
    for name in ["picture.exr", "picture.png"] {
        job.merge
            .extend([Word::text("-o"), Word::Output(name.to_owned())]);
    }
    let options = typed::<PictureFlags>(matches, |id| of_pictures.contains(&id));
    job.merge.extend(options.into_iter().map(Word::Text));
    Ok(job)
}

/// A video: each task takes some of the frames.
fn frames_job(
    arguments: &Arguments,
    matches: &ArgMatches,
    trajectory: &Path,
    folder: &Path,
) -> Result<Job, Failure> {
    if arguments.frames.frames.as_deref() == Some(Path::new("-")) {
        let message = "--frames -: standard input reaches no task; expected a folder or a file; write the frames to one";
        return Err(Failure(message.to_owned()));
    }
    let files = (arguments.scene.clone(), trajectory.to_path_buf());
    let options = arguments
        .frames
        .options(files, FRAMES.into(), &arguments.flags)?;
    let surveyed = survey(&options, &tell)?;
    let numbers: Vec<u32> = match (&surveyed.frames, options.range) {
        (Some(frames), _) => frames.iter().map(|(name, _)| name.number).collect(),
        (None, Some((from, to))) => (from..to).collect(),
        (None, None) => {
            let message = "--frames: how many frames the film has is not known before it is read; expected a range; give --range";
            return Err(Failure(message.to_owned()));
        }
    };
    let shot = Shot::gather(&options, &surveyed)?;
    let mut bundle = shot.bundle.clone();
    let noise = arguments.camera_noise(&mut bundle);
    let place = folder.join(SHOT);
    bundle.write_into(&place)?;
    let copy = SequenceOptions {
        scene: place.join(&shot.scene),
        frames: Some(place.join(&shot.frames)),
        trajectory: place.join(&shot.trajectory),
        intrinsics: shot.calibration.as_ref().map(|name| place.join(name)),
        sandbox: true,
        ..options.clone()
    };
    if survey(&copy, &|_| {})?.fingerprint != surveyed.fingerprint {
        return Err(Failure(format!(
            "{}: its copy in the job is another shot; expected names of frames and poses that tell the same without the folders around, and files that do not change meanwhile; rename them, or try again",
            arguments.scene.display()
        )));
    }
    // From the first task on the folder takes no other render's frames.
    let frames = folder.join(OUTPUT).join(FRAMES);
    make_folder(&frames)?;
    let (name, text) = sequence_note(&surveyed.fingerprint);
    write_text(&frames.join(name), &text)?;

    let mut job = arguments.job(&surveyed.scene.name, "Frames");
    job.parts = in_chunks(numbers, arguments.chunk);
    job.chunk = (!arguments.no_task_chunking).then_some(arguments.chunk);
    let mut command = vec![Word::text("sequence"), Word::Shot(shot.scene)];
    command.extend([Word::text("--frames"), Word::Shot(shot.frames)]);
    command.extend([Word::text("--trajectory"), Word::Shot(shot.trajectory)]);
    if let Some(name) = shot.calibration {
        command.extend([Word::text("--intrinsics"), Word::Shot(name)]);
    }
    command.extend([Word::text("-o"), Word::Output(FRAMES.to_owned())]);
    let takes = |id: &str| !LEFT_OUT.contains(&id);
    let of_frames = typed::<FrameFlags>(matches, takes);
    let of_pictures = typed::<PictureFlags>(matches, takes);
    command.extend(of_frames.into_iter().chain(of_pictures).map(Word::Text));
    command.extend(noise);
    command.extend(arguments.progress());
    // The whole range once more: what is finished is looked at, and kept.
    job.merge = command.clone();
    job.task = command;
    job.task.extend([Word::text("--part"), Word::Part]);
    Ok(job)
}

/// The files of a sequence, with their paths below [`SHOT`].
struct Shot {
    bundle: Bundle,
    scene: String,
    frames: String,
    trajectory: String,
    calibration: Option<String>,
}

impl Shot {
    fn gather(options: &SequenceOptions, surveyed: &Survey) -> Result<Self, Failure> {
        let scene = gather(&surveyed.scene)?;
        let scene_file = format!("{SCENE}/{}", scene.scene_file());
        let mut bundle = scene.below(SCENE);
        let mut frames = FRAMES.to_owned();
        let source = options.frames.as_deref().unwrap_or(Path::new("-"));
        if source.is_dir() {
            // Poses may name frames by the folder that they lie in.
            frames += &format!("/{}", name_of(&std::path::absolute(source)?)?);
            let pictures = surveyed.frames.iter().flatten();
            for path in pictures.filter_map(|(_, path)| path.as_ref()) {
                bundle.add(format!("{frames}/{}", name_of(path)?), path);
            }
        } else {
            frames += &format!("/{}", name_of(source)?);
            bundle.add(&frames, source);
        }
        let mut trajectory = TRAJECTORY.to_owned();
        for path in &surveyed.trajectory_files {
            bundle.add(format!("{TRAJECTORY}/{}", name_of(path)?), path);
        }
        if !options.trajectory.is_dir() {
            trajectory += &format!("/{}", name_of(&options.trajectory)?);
        }
        let calibration = options.intrinsics.as_deref().map(|path| {
            let name = format!("{CALIBRATION}/{}", name_of(path)?);
            bundle.add(&name, path);
            Ok::<_, Failure>(name)
        });
        Ok(Self {
            calibration: calibration.transpose()?,
            bundle,
            scene: scene_file,
            frames,
            trajectory,
        })
    }
}

fn name_of(path: &Path) -> Result<&str, Failure> {
    let name = path.file_name().and_then(|name| name.to_str());
    name.ok_or_else(|| {
        Failure(format!(
            "{}: has no name in UTF-8; expected one that every host can read; rename it",
            path.display()
        ))
    })
}

fn make_folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path)
        .map_err(|error| Failure(format!("{}: cannot be made: {error}", path.display())))
}

/// Starts what takes the job; it says the rest itself. Tasks run this very program.
fn hand_over(arguments: &Arguments) -> Result<Outcome, Failure> {
    let folder = std::path::absolute(&arguments.output)?;
    let program = std::env::current_exe()?;
    let (name, words) = match arguments.engine {
        EngineName::Openjd => {
            let program = format!("Mixray={}", program.display());
            (
                "openjd",
                ["run", "template.json", "-p", &program]
                    .map(str::to_owned)
                    .to_vec(),
            )
        }
        EngineName::Slurm => ("sh", vec!["submit.sh".to_owned()]),
        EngineName::Make => ("make", Vec::new()),
    };
    let mut command = Command::new(name);
    command
        .current_dir(&folder)
        .args(words)
        .env("MIXRAY", &program);
    let status = command.status().map_err(|error| {
        Failure(format!(
            "{name}: cannot be started ({error}); expected the engine on this host; install it, or hand over {} elsewhere",
            arguments.output.display()
        ))
    })?;
    match status.success() {
        true => Ok(Outcome::Done),
        false => Ok(Outcome::CheckFailed),
    }
}
