//! What a job is made of, and that its tasks give what one run gives.

use std::collections::BTreeSet;
use std::process::Command;

use mixray::output::read_film;
use serde_json::Value;

use crate::sequence::support::{BALL, frames_of};
use crate::support::{Folder, stderr};

const STILL: &str = "[photo]\nimage = \"photo.png\"\n";

fn shot() -> Folder {
    let folder = Folder::with_scene(&format!(
        "[check]\nallow = [\"floating\"]\n{STILL}{}",
        BALL.replace("pixel = 4", "pixel = 10")
    ));
    folder.frames(7, 0.1);
    folder.trajectory(7, 0.1, &[2]);
    folder
}

const VIDEO: &str = "submit scene.toml --frames in --trajectory poses.json --seed 5";

/// The arguments of a step's action with its task's and the job's parameters in their places.
fn filled(job: &Folder, step: &Value, part: &str) -> Vec<String> {
    let action = &step["script"]["actions"]["onRun"];
    assert_eq!(action["command"], "{{Param.Mixray}}");
    let fill = |word: &Value| {
        let word = word.as_str().expect("a word");
        let at = |name: &str| job.path(&format!("job/{name}")).display().to_string();
        (word.replace("{{Param.Shot}}", &at("shot")))
            .replace("{{Param.Output}}", &at("output"))
            .replace("{{Task.Param.Frames}}", part)
            .replace("{{Task.Param.Rays}}", part)
    };
    action["args"]
        .as_array()
        .expect("words")
        .iter()
        .map(fill)
        .collect()
}

fn run_step(job: &Folder, step: &Value, part: &str) {
    let words = filled(job, step, part);
    assert!(!words.iter().any(|word| word.contains("{{")), "{words:?}");
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let said = job.succeed(&words);
    assert!(
        step["name"] == "Merge" || said.contains("openjd_progress: "),
        "{said}"
    );
}

/// Keys of an object; the specification refuses any that it does not know.
fn keys(value: &Value) -> BTreeSet<&str> {
    let object = value.as_object().expect("an object");
    object.keys().map(String::as_str).collect()
}

#[test]
fn frames_for_open_job_description() {
    let folder = shot();
    folder.succeed(&format!(
        "{VIDEO} --engine openjd --chunk 3 -o job --cpus 2 --memory 512"
    ));
    let template = folder.json("job/template.json");
    assert_eq!(template["specificationVersion"], "jobtemplate-2023-09");
    assert_eq!(template["extensions"], serde_json::json!(["TASK_CHUNKING"]));
    let known = [
        "extensions",
        "name",
        "parameterDefinitions",
        "specificationVersion",
        "steps",
    ];
    assert_eq!(keys(&template), BTreeSet::from(known));
    let parameters = template["parameterDefinitions"].as_array().expect("a list");
    let default = |name: &str| {
        let found = parameters.iter().find(|p| p["name"] == name);
        found.unwrap_or_else(|| panic!("no {name}"))["default"].clone()
    };
    assert_eq!(default("Frames"), "0-6");
    assert_eq!(default("ChunkSize"), 3);
    assert_eq!(
        (default("Shot"), default("Output")),
        ("shot".into(), "output".into())
    );
    let steps = template["steps"].as_array().expect("a list");
    let task = &steps[0]["parameterSpace"]["taskParameterDefinitions"][0];
    assert_eq!(
        (&task["type"], &task["name"]),
        (&"CHUNK[INT]".into(), &"Frames".into())
    );
    assert_eq!(task["chunks"]["rangeConstraint"], "CONTIGUOUS");
    assert_eq!(steps[0]["hostRequirements"]["amounts"][1]["min"], 512);
    assert_eq!(steps[1]["dependencies"][0]["dependsOn"], "Render");

    folder.sequence(&["--frames", "in", "--seed", "5", "-o", "whole"]);
    // The job needs nothing of where it came from, and may be moved.
    for name in ["scene.toml", "photo.png", "poses.json"] {
        folder.remove(name);
    }
    for part in ["3-5", "6", "0-2", "3-5"] {
        run_step(&folder, &steps[0], part);
    }
    run_step(&folder, &steps[1], "");
    let done = frames_of(&folder.path("job/output/frames"));
    assert_eq!(done.len(), 7);
    assert_eq!(done, folder.frames_of("whole"));
    // A shot that has changed is another one.
    let scene = folder.read("job/shot/scene/scene.toml");
    folder.write(
        "job/shot/scene/scene.toml",
        scene.replace("scale = 0.3", "scale = 0.2"),
    );
    let words = filled(&folder, &steps[0], "0-2");
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    // The engine reads its lines from standard output.
    let refused = folder.run(&words);
    assert_eq!(refused.status.code(), Some(2));
    let message = stderr(&refused);
    assert!(message.contains("another render"), "{message}");
}

#[test]
fn rays_for_open_job_description() {
    let folder = shot();
    folder.succeed("submit scene.toml --engine openjd --ranges 4 -o job");
    let template = folder.json("job/template.json");
    assert!(template.get("extensions").is_none());
    let steps = template["steps"].as_array().expect("a list");
    let task = &steps[0]["parameterSpace"]["taskParameterDefinitions"][0];
    let parts = ["0-1", "2-4", "5-6", "7-9"];
    assert_eq!(task["range"], serde_json::json!(parts));
    for part in parts.iter().rev() {
        run_step(&folder, &steps[0], part);
    }
    run_step(&folder, &steps[1], "");
    folder.succeed("render scene.toml --range 0..10 -o whole.exr");
    folder.succeed("merge whole.exr -o whole_merged.exr -o whole.png");
    let [a, b] = ["job/output/picture.png", "whole.png"].map(|name| folder.open(name));
    let codes = a.as_raw().iter().zip(b.as_raw());
    assert!(codes.clone().all(|(a, b)| a.abs_diff(*b) <= 1));
    let differ = codes.filter(|(a, b)| a != b).count();
    assert!(
        differ <= 1,
        "{differ} of {} on a rounding edge",
        a.as_raw().len()
    );
    assert!(folder.open("photo.png").as_raw() != a.as_raw(), "control");
    let (_, note) = read_film(&folder.path("job/output/rays_2-4.exr")).expect("a film");
    assert_eq!((note.range, note.total), ((2, 5), 10));
}

#[test]
fn jobs_for_slurm() {
    let folder = shot();
    let encode = "ls frames > list.txt";
    let mut words: Vec<&str> = VIDEO.split(' ').collect();
    words.extend([
        "--engine", "slurm", "--chunk", "2", "-o", "job", "--gpus", "1",
    ]);
    words.extend(["--encode", encode]);
    folder.succeed(&words);
    assert_eq!(folder.read("job/parts.txt"), "0-1\n2-3\n4-5\n6-6\n");
    let tasks = folder.read("job/tasks.sbatch");
    assert!(tasks.contains("#SBATCH --array=0-3\n") && tasks.contains("#SBATCH --gpus=1\n"));
    assert!(
        folder
            .read("job/submit.sh")
            .contains("--dependency=\"afterany:")
    );
    // As Slurm runs them: one script, one number each.
    let run = |script: &str, task: u32| {
        let mut command = Command::new("sh");
        command
            .current_dir(folder.path("job"))
            .arg(script)
            .env("MIXRAY", env!("CARGO_BIN_EXE_mixray"))
            .env("SLURM_ARRAY_TASK_ID", task.to_string());
        let output = command.output().expect("runs");
        assert!(output.status.success(), "{}", stderr(&output));
    };
    for task in [3, 1, 0, 2] {
        run("tasks.sbatch", task);
    }
    run("merge.sbatch", 0);
    folder.sequence(&["--frames", "in", "--seed", "5", "-o", "whole"]);
    assert_eq!(
        frames_of(&folder.path("job/output/frames")),
        folder.frames_of("whole")
    );
    // The frames, and the note of the render.
    assert_eq!(folder.read("job/output/list.txt").lines().count(), 8);
}

#[test]
fn jobs_for_make() {
    let folder = shot();
    folder.succeed("submit scene.toml --engine make --ranges 3 -o job");
    let text = folder.read("job/Makefile");
    assert!(
        text.contains("TASKS := $(addprefix part-,0-2 3-5 6-9)\n"),
        "{text}"
    );
    assert!(
        text.contains("--range \"$*\" -o \"output/rays_$*.exr\" --resume"),
        "{text}"
    );
}

#[test]
fn what_makes_no_job_is_refused() {
    let folder = shot();
    let job =
        |engine: &str, more: &str| format!("submit scene.toml --engine {engine} -o job {more}");
    let video = "--frames in --trajectory poses.json";
    for (line, part) in [
        (job("make", "--target-error 0.01"), "all rays of a picture"),
        (job("make", "--ranges 2 --filter"), "all rays of a picture"),
        (job("make", &format!("{video} --ranges 2")), "--ranges"),
        (
            job("make", "").replace("scene.toml", "none.toml"),
            "none.toml: the scene file cannot be read",
        ),
        (job("make", "--ranges 2 --stats a.json"), "--stats"),
        (
            job("make", "--frames - --trajectory poses.json"),
            "standard input",
        ),
        (
            job("openjd", &format!("{video} --fps 10 --encode x{{{{y")),
            "{{",
        ),
        (job("slurm", &format!("{video} --range 9..12")), "--range"),
    ] {
        let output = folder.run(&line);
        assert_eq!(output.status.code(), Some(2), "{line}");
        assert!(
            stderr(&output).contains(part),
            "{line}: {}",
            stderr(&output)
        );
        assert!(!folder.path("job").exists(), "{line}");
    }
    folder.create("job");
    folder.write("job/mine.txt", "kept");
    folder.refuse(&job("make", "--ranges 2"), "is there already");
    assert_eq!(folder.read("job/mine.txt"), "kept");
}
