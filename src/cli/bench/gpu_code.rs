//! `mixray bench gpu-code`.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus};

use clap::Args;

use super::command_line;
use super::files::write_json;
use super::flags::{OutputFlags, finish, load_scenes};
use crate::bench::{
    Compiler, Machine, further_variants, gpu_code_markdown, gpu_code_text, kernel_code, variant_of,
};
use crate::cli::scene_flags::SceneFlags;
use crate::cli::{Failure, Outcome, print, progress};

/// What a GPU's compiler makes of the kernels of each scene: registers, spills, scratch memory, waves
///
/// Nothing runs on a GPU. With --amd none is needed: Mesa's RADV compiles for chips that are not there. Writes gpu-code.json.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Scene files
    #[arg(required = true, value_name = "SCENE")]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    /// Compile for this AMD chip by Mesa's RADV without a card: navi21, for instance (Mesa 22 to 25, Linux)
    #[arg(long, value_name = "CHIP")]
    amd: Option<String>,
    /// Also with textures, alpha and normal maps added to the first scene, and with all features at once
    #[arg(long)]
    further: bool,
    #[command(flatten)]
    output: OutputFlags,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    if let Some(chip) = &arguments.amd
        && std::env::var_os(RADV_CHIP).is_none_or(|set| set != chip.as_str())
    {
        return with_radv(chip);
    }
    let docs = arguments.output.start("gpu-code")?;
    let scenes = load_scenes(&arguments.scenes, arguments.scene, 1)?;
    let compiler = Compiler::open()?;
    let folder = arguments.output.make_folder(&["gpu-code.json"])?;
    let mut variants = (scenes.iter())
        .map(variant_of)
        .collect::<Result<Vec<_>, _>>()?;
    if arguments.further {
        variants.extend(further_variants(&variants[0]));
    }
    let steps = progress::Steps::new(variants.len() as u64);
    let rows = kernel_code(&compiler, &variants, |variant| {
        steps.say(&variant.name);
        steps.step();
    })?;
    steps.clear();
    let mut machine = Machine::this(false);
    machine.gpu = Some(crate::bench::Gpu {
        name: compiler.device_name.clone(),
        driver: compiler.driver.clone(),
        hardware: arguments.amd.is_none(),
    });
    write_json(&folder.join("gpu-code.json"), &machine, "kernels", &rows)?;
    print(&gpu_code_text(&compiler, &rows))?;
    let table = gpu_code_markdown(&command_line(), &compiler, &rows);
    finish(docs, &table, false)
}

/// Tells RADV to play a chip; read when the driver is loaded.
const RADV_CHIP: &str = "RADV_FORCE_FAMILY";

/// Where the Vulkan loader looks for drivers.
const DRIVER_FOLDERS: [&str; 3] = [
    "/usr/share/vulkan/icd.d",
    "/usr/local/share/vulkan/icd.d",
    "/etc/vulkan/icd.d",
];

/// Runs the same command with RADV as the only driver, for `chip`.
fn with_radv(chip: &str) -> Result<Outcome, Failure> {
    let driver = DRIVER_FOLDERS
        .iter()
        .find_map(|folder| radv_in(Path::new(folder)));
    let Some(driver) = driver else {
        return Err(Failure(format!(
            "--amd: there is no radeon_icd*.json in {}; expected Mesa's RADV; install mesa-vulkan-drivers",
            DRIVER_FOLDERS.join(", ")
        )));
    };
    let status: ExitStatus = Command::new(std::env::current_exe()?)
        .args(std::env::args_os().skip(1))
        .env(RADV_CHIP, chip)
        .env("VK_DRIVER_FILES", &driver)
        .env("VK_ICD_FILENAMES", &driver)
        // Compute kernels in waves of 32, as newer Mesa compiles them by itself.
        .env("RADV_PERFTEST", "cswave32")
        .status()?;
    if status.success() {
        Ok(Outcome::Done)
    } else {
        Err(Failure(format!(
            "--amd {chip}: RADV did not compile the kernels; expected a chip that it knows, navi21 for instance, and a Mesa of 22 to 25"
        )))
    }
}

fn radv_in(folder: &Path) -> Option<PathBuf> {
    let names = std::fs::read_dir(folder).ok()?;
    names
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("radeon_icd") && name.ends_with(".json")
        })
}
