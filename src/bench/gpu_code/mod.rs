//! What a GPU's compiler makes of the kernels: registers, spills, local memory, waves. No kernel runs, so no GPU is needed where the driver can
//! compile for a chip that is not there.

mod compiler;
mod spirv;

use std::collections::HashSet;
use std::fmt::Write as _;

use serde::Serialize;

pub use compiler::{Compiler, CompilerError};

use super::columns::aligned;
use super::shrink;
use crate::gpu::kernel::reflect_bindings;
use crate::gpu::{Composer, Features, GpuError, KERNELS, PHOTON_KERNEL};

use crate::renderer::{RenderError, Renderer, RendererOptions, Watcher};
use crate::scene::{BackendChoice, Scene};

/// Why there are no figures.
#[derive(Debug, thiserror::Error)]
pub enum GpuCodeError {
    #[error(transparent)]
    Render(#[from] RenderError),
    #[error(transparent)]
    Shader(#[from] GpuError),
    #[error("{kernel}: {message}")]
    Wgsl {
        kernel: &'static str,
        message: String,
    },
    #[error(transparent)]
    Compiler(#[from] CompilerError),
}

/// The features that kernels are compiled for, by a name.
#[derive(Clone, Debug)]
pub struct Variant {
    pub name: String,
    pub features: Features,
}

/// Figures of one kernel of a variant; None where the driver does not tell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KernelCode {
    pub variant: String,
    pub kernel: &'static str,
    /// Vector registers of a lane.
    pub registers: Option<u32>,
    /// Vector registers kept in memory for want of room.
    pub spilled_registers: Option<u32>,
    /// Registers of a whole wave kept in lanes of vector registers for want of room; AMD's alone.
    pub spilled_scalars: Option<u32>,
    /// Memory of a lane, or of a wave on AMD, for what has no register.
    pub scratch_bytes: Option<u32>,
    /// Memory of a workgroup.
    pub shared_bytes: Option<u32>,
    /// Waves that fit a SIMD unit at once.
    pub waves: Option<u32>,
    pub code_bytes: Option<u32>,
}

/// Pixels along a side at most, where only a scene's features are asked for.
const SIDE_PX: u32 = 64;

/// What the kernels of `scene` are compiled for, its pilot run on a small picture.
///
/// # Errors
/// The scene cannot be rendered.
pub fn variant_of(scene: &Scene) -> Result<Variant, RenderError> {
    let longest = scene.camera.width.max(scene.camera.height);
    let mut small = shrink(scene.clone(), longest.div_ceil(SIDE_PX));
    small.settings.backend = BackendChoice::Cpu;
    let renderer = Renderer::new(small, RendererOptions::default(), &Watcher::none())?;
    Ok(Variant {
        name: scene.name.clone(),
        features: Features::for_scene(renderer.packed()),
    })
}

/// Variants beyond those of scenes: what few scenes switch on added to `base`, and everything at once with either estimator.
pub fn further_variants(base: &Variant) -> Vec<Variant> {
    let with = |names: &[&str]| Variant {
        name: format!("{}, {}", base.name, names.join(", ")),
        features: names.iter().fold(base.features, |features, name| {
            if features.flags().contains(&(name, true)) {
                features
            } else {
                features.toggled(name)
            }
        }),
    };
    let mut all = vec![
        with(&["textures"]),
        with(&["alpha", "textures"]),
        with(&["normal_maps", "textures"]),
    ];
    for (name, paper) in [("everything", false), ("everything, paper", true)] {
        let features = Features {
            paper,
            sharing: !paper,
            ..Features::ALL
        };
        all.push(Variant {
            name: name.to_owned(),
            features,
        });
    }
    all
}

/// Every kernel of `variants` as `compiler` compiles it; code that was seen in an earlier variant is not shown again. `told` hears of each variant.
///
/// # Errors
/// A kernel that does not compile.
pub fn kernel_code(
    compiler: &Compiler,
    variants: &[Variant],
    mut told: impl FnMut(&Variant),
) -> Result<Vec<KernelCode>, GpuCodeError> {
    let composer = Composer::default();
    let mut seen = HashSet::new();
    let mut rows = Vec::new();
    for variant in variants {
        told(variant);
        let wavefront = KERNELS.map(|kernel| ("gpu::kernels", kernel));
        let photons = (variant.features.photons).then_some(("gpu::photons", PHOTON_KERNEL));
        for (root, kernel) in wavefront.into_iter().chain(photons) {
            if kernel == "kernel_share" && !variant.features.sharing {
                continue;
            }
            let wgsl = composer.compose(root, kernel, &variant.features)?;
            let wrong = |message| GpuCodeError::Wgsl { kernel, message };
            let bindings = reflect_bindings(&wgsl).map_err(wrong)?;
            let spirv = spirv::spirv(&wgsl, kernel).map_err(wrong)?;
            if seen.insert(wgsl) {
                let statistics = compiler.statistics(&spirv, kernel, &bindings)?;
                rows.push(KernelCode::of(&variant.name, kernel, &statistics));
            }
        }
    }
    Ok(rows)
}

impl KernelCode {
    fn of(variant: &str, kernel: &'static str, statistics: &[compiler::Statistic]) -> Self {
        // By RADV's name or NVIDIA's.
        let figure = |names: &[&str]| {
            (statistics.iter())
                .find(|statistic| names.contains(&statistic.name.as_str()))
                .map(|statistic| statistic.value as u32)
        };
        Self {
            variant: variant.to_owned(),
            kernel,
            registers: figure(&["VGPRs", "Register Count"]),
            spilled_registers: figure(&["Spilled VGPRs"]),
            spilled_scalars: figure(&["Spilled SGPRs"]),
            scratch_bytes: figure(&["Scratch size", "Local Memory Size"]),
            shared_bytes: figure(&["LDS size", "Shared Memory Size"]),
            waves: figure(&["Subgroups per SIMD"]),
            code_bytes: figure(&["Code size", "Binary Size"]),
        }
    }
}

const HEADS: [&str; 9] = [
    "variant",
    "kernel",
    "registers",
    "spilled",
    "scalars",
    "scratch B",
    "shared B",
    "waves",
    "code B",
];

fn cells(row: &KernelCode) -> Vec<String> {
    let figure = |value: Option<u32>| value.map_or_else(|| "-".to_owned(), |x| x.to_string());
    vec![
        row.variant.clone(),
        row.kernel.trim_start_matches("kernel_").to_owned(),
        figure(row.registers),
        figure(row.spilled_registers),
        figure(row.spilled_scalars),
        figure(row.scratch_bytes),
        figure(row.shared_bytes),
        figure(row.waves),
        figure(row.code_bytes),
    ]
}

/// For a terminal.
pub fn gpu_code_text(compiler: &Compiler, rows: &[KernelCode]) -> String {
    let mut all = vec![HEADS.map(str::to_owned).to_vec()];
    all.extend(rows.iter().map(cells));
    format!(
        "{}; {}\n{}",
        compiler.device_name,
        compiler.driver,
        aligned(&all)
    )
}

/// The same as Markdown, with the command.
pub fn gpu_code_markdown(command: &str, compiler: &Compiler, rows: &[KernelCode]) -> String {
    let mut out = format!(
        "    {command}\n\n- {}; {}\n\n",
        compiler.device_name, compiler.driver
    );
    let _ = writeln!(out, "| {} |", HEADS.join(" | "));
    let _ = writeln!(out, "| --- | --- |{}", " ---: |".repeat(HEADS.len() - 2));
    for row in rows {
        let _ = writeln!(out, "| {} |", cells(row).join(" | "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_taken_by_the_names_that_drivers_have() {
        let statistic = |name: &str, value| compiler::Statistic {
            name: name.to_owned(),
            value,
        };
        let amd = [
            statistic("VGPRs", 96.0),
            statistic("Spilled VGPRs", 2.0),
            statistic("Spilled SGPRs", 3.0),
            statistic("Scratch size", 0.0),
        ];
        let row = KernelCode::of("v", "kernel_trace", &amd);
        assert_eq!(row.registers, Some(96));
        assert_eq!(row.spilled_registers, Some(2));
        assert_eq!(row.spilled_scalars, Some(3));
        assert_eq!(row.scratch_bytes, Some(0));
        // Not told is not nought.
        assert_eq!(row.waves, None);
        assert_eq!(cells(&row)[7], "-");
        let nvidia = KernelCode::of("v", "kernel_trace", &[statistic("Register Count", 40.0)]);
        assert_eq!((nvidia.registers, nvidia.scratch_bytes), (Some(40), None));
    }

    #[test]
    fn further_variants_switch_on_what_they_name() {
        let base = Variant {
            name: "base".to_owned(),
            features: Features {
                textures: true,
                ..Features::default()
            },
        };
        let further = further_variants(&base);
        for variant in &further {
            assert!(variant.features.textures, "{}", variant.name);
        }
        assert!(further.iter().any(|variant| variant.features.normal_maps));
        let paper = further.iter().filter(|variant| variant.features.paper);
        assert_eq!(paper.count(), 1);
    }
}
