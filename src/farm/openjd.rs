//! An Open Job Description template, version 2023-09: <https://github.com/OpenJobDescription/openjd-specifications/wiki>.
//!
//! Frames are a CHUNK[INT] parameter where the engine knows the extension TASK_CHUNKING, else and for rays a list of parts.

use serde_json::{Value, json};

use super::{FarmError, Job, OUTPUT, SHOT, Word, part_file, part_text};

/// Of a list of a task parameter's values.
const MAX_VALUES: usize = 1024;
const MAX_NAME_CHARS: usize = 128;
const TEMPLATE: &str = "template.json";

pub(super) fn files(job: &Job) -> Result<Vec<(&'static str, String)>, FarmError> {
    let words = [&job.task, &job.merge].into_iter().flatten();
    let texts = words.filter_map(|word| match word {
        Word::Text(text) | Word::Shot(text) | Word::Output(text) => Some(text),
        Word::Part | Word::PartFile => None,
    });
    if let Some(text) = texts.chain(&job.encode).find(|text| text.contains("{{")) {
        return Err(FarmError::Unfit(format!(
            "{text}: has {{{{, which Open Job Description reads as the begin of an expression; expected none in names and options; rename it, or use another engine"
        )));
    }
    if job.chunk.is_none() && job.parts.len() > MAX_VALUES {
        return Err(FarmError::Unfit(format!(
            "{} tasks in a list, of which Open Job Description takes {MAX_VALUES}; expected fewer; choose larger parts",
            job.parts.len()
        )));
    }
    // serde_json writes any value that it built.
    let text = serde_json::to_string_pretty(&template(job)).unwrap_or_default();
    Ok(vec![(TEMPLATE, text + "\n")])
}

fn template(job: &Job) -> Value {
    let unit = job.unit;
    let mut parameters = vec![
        json!({"name": "Mixray", "type": "STRING", "default": "mixray", "description": "The program on the hosts"}),
        json!({"name": "Shot", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "IN", "default": SHOT, "description": "All that is read"}),
        json!({"name": "Output", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "INOUT", "default": OUTPUT, "description": "All that is written"}),
    ];
    let space = match job.chunk {
        Some(size) => {
            let numbers: Vec<String> = merged(&job.parts).map(part_text).collect();
            let numbers = numbers.join(",");
            parameters.push(json!({"name": unit, "type": "STRING", "default": numbers, "description": "The numbers to render, such as 0-23,48-71"}));
            parameters.push(json!({"name": "ChunkSize", "type": "INT", "default": size, "minValue": 1, "description": "Numbers in a task, at most"}));
            json!({"name": unit, "type": "CHUNK[INT]", "range": format!("{{{{Param.{unit}}}}}"),
                "chunks": {"defaultTaskCount": "{{Param.ChunkSize}}", "rangeConstraint": "CONTIGUOUS"}})
        }
        None => {
            let values: Vec<String> = job.parts.iter().map(|part| part_text(*part)).collect();
            json!({"name": unit, "type": "STRING", "range": values})
        }
    };
    let part = format!("{{{{Task.Param.{unit}}}}}");
    let mut render = step("Render", run(&words(&job.task, &part)), None);
    render["parameterSpace"] = json!({"taskParameterDefinitions": [space]});
    let mut steps = vec![
        render,
        step("Merge", run(&words(&job.merge, "")), Some("Render")),
    ];
    if let Some(command) = &job.encode {
        let script = format!("cd \"$1\" && {command}");
        let action = json!({"command": "sh", "args": ["-ec", script, "sh", "{{Param.Output}}"]});
        steps.push(step("Encode", action, Some("Merge")));
    }
    if let Some(requirements) = requirements(job) {
        for step in &mut steps {
            step["hostRequirements"] = requirements.clone();
        }
    }
    let is_printable = |c: &char| !c.is_control();
    let name: String = (job.name.chars().filter(is_printable))
        .take(MAX_NAME_CHARS)
        .collect();
    let mut template = json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": name.replace("{{", "{ {"),
        "parameterDefinitions": parameters,
        "steps": steps,
    });
    if job.chunk.is_some() {
        template["extensions"] = json!(["TASK_CHUNKING"]);
    }
    template
}

/// Parts that follow one another are one.
fn merged(parts: &[(u32, u32)]) -> impl Iterator<Item = (u32, u32)> {
    let numbers = parts.iter().flat_map(|&(first, last)| first..=last);
    super::in_chunks(numbers, u32::MAX).into_iter()
}

fn step(name: &str, action: Value, after: Option<&str>) -> Value {
    let mut step = json!({"name": name, "script": {"actions": {"onRun": action}}});
    if let Some(other) = after {
        step["dependencies"] = json!([{"dependsOn": other}]);
    }
    step
}

/// A process is told to end first, so that it leaves nothing half written.
fn run(arguments: &[String]) -> Value {
    json!({"command": "{{Param.Mixray}}", "args": arguments, "cancelation": {"mode": "NOTIFY_THEN_TERMINATE"}})
}

fn words(words: &[Word], part: &str) -> Vec<String> {
    let below = |folder: &str, path: &str| match path {
        "" => format!("{{{{Param.{folder}}}}}"),
        _ => format!("{{{{Param.{folder}}}}}/{path}"),
    };
    let word = |word: &Word| match word {
        Word::Text(text) => text.clone(),
        Word::Shot(path) => below("Shot", path),
        Word::Output(path) => below("Output", path),
        Word::Part => part.to_owned(),
        Word::PartFile => below("Output", &part_file(part)),
    };
    words.iter().map(word).collect()
}

fn requirements(job: &Job) -> Option<Value> {
    let asked = &job.requirements;
    let amounts = [
        ("amount.worker.vcpu", asked.cpus.map(u64::from)),
        ("amount.worker.memory", asked.memory_mib),
        ("amount.worker.gpu", asked.gpus.map(u64::from)),
    ];
    let amounts: Vec<Value> = (amounts.into_iter())
        .filter_map(|(name, least)| Some(json!({"name": name, "min": least?})))
        .collect();
    (!amounts.is_empty()).then(|| json!({"amounts": amounts}))
}
