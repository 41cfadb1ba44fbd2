//! `--gpu-time`.

use super::{Job, command_line, load_scenes};
use crate::bench::{FORMAT, gpu_time, gpu_time_markdown, gpu_time_text};
use crate::cli::{Failure, Outcome, interrupt, print, progress};
use crate::output::quick::write_text;

pub(super) fn gpu_times(job: &Job) -> Result<Outcome, Failure> {
    let interrupted = interrupt::watch()?;
    let scenes = load_scenes(&job.arguments, false)?;
    job.make_folder(&["gpu-time.json"])?;
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
