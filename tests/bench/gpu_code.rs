//! `mixray bench gpu-code`: what AMD's compiler makes of every kernel, held to budgets. No GPU is needed, Mesa's RADV is.

use std::path::Path;

use serde_json::Value;

use crate::support::{Folder, root, stderr};

/// The Mesa whose compiler the budgets were taken from; another one's figures are printed and not judged.
const KNOWN_MESA: &str = "Mesa 22.3";

/// What a kernel may take at most, and the waves that it must leave room for.
struct Budget {
    kernel: &'static str,
    registers: u64,
    scalars: u64,
    shared_bytes: u64,
    waves: u64,
}

const fn budget(
    kernel: &'static str,
    registers: u64,
    scalars: u64,
    shared_bytes: u64,
    waves: u64,
) -> Budget {
    Budget {
        kernel,
        registers,
        scalars,
        shared_bytes,
        waves,
    }
}

/// Of all features at once, which no scene has: of any kernel.
const EVERYTHING: Budget = budget("", 256, 96, 5632, 4);

/// Of variants whose trees are shallow. More registers than these leave room for fewer waves.
const BUDGETS: [Budget; 9] = [
    budget("kernel_begin", 64, 0, 0, 16),
    budget("kernel_end", 16, 0, 0, 16),
    budget("kernel_generate", 96, 0, 512, 10),
    budget("kernel_turn", 16, 0, 0, 16),
    budget("kernel_trace", 96, 0, 5632, 10),
    budget("kernel_advance", 256, 24, 512, 4),
    budget("kernel_accumulate", 96, 0, 512, 10),
    budget("kernel_share", 128, 0, 5632, 8),
    budget("kernel_photons", 256, 0, 5632, 4),
];

/// What of a row of gpu-code.json is not as it should be.
fn faults(row: &Value) -> Vec<String> {
    let figure = |name: &str| {
        row[name]
            .as_u64()
            .unwrap_or_else(|| panic!("{name} of {row}"))
    };
    let kernel = row["kernel"].as_str().expect("a name");
    let own = (BUDGETS.iter().find(|budget| budget.kernel == kernel))
        .unwrap_or_else(|| panic!("{kernel} has no budget"));
    let has_everything = row["variant"]
        .as_str()
        .is_some_and(|v| v.starts_with("everything"));
    let budget = if has_everything { &EVERYTHING } else { own };
    let mut faults = Vec::new();
    for (name, most) in [
        ("scratch_bytes", 0),
        ("spilled_registers", 0),
        ("spilled_scalars", budget.scalars),
        ("registers", budget.registers),
        ("shared_bytes", budget.shared_bytes),
    ] {
        if figure(name) > most {
            faults.push(format!("{name} is {}, above {most}: {row}", figure(name)));
        }
    }
    if figure("waves") < budget.waves {
        faults.push(format!(
            "waves are {}, below {}: {row}",
            figure("waves"),
            budget.waves
        ));
    }
    faults
}

#[test]
fn kernels_keep_within_their_registers() {
    if !Path::new("/usr/share/vulkan/icd.d/radeon_icd.x86_64.json").exists() {
        assert_ne!(
            std::env::var("MIXRAY_REQUIRE_GPU").as_deref(),
            Ok("1"),
            "MIXRAY_REQUIRE_GPU=1, but there is no RADV; install mesa-vulkan-drivers"
        );
        eprintln!("SKIPPED: Mesa's RADV is not there");
        return;
    }
    let scenes: Vec<String> = ["demo", "room", "far", "sunny", "paper", "table", "caustics"]
        .iter()
        .map(|name| {
            root()
                .join(format!("scenes/{name}/scene.toml"))
                .display()
                .to_string()
        })
        .collect();
    let folder = Folder::new();
    let table = folder.succeed(&format!(
        "bench gpu-code {} --further --amd navi21 -o out",
        scenes.join(" ")
    ));
    let json = folder.json("out/gpu-code.json");
    let rows = json["kernels"].as_array().expect("rows");
    let has = |variant: &str, kernel: &str| {
        (rows.iter()).any(|row| row["variant"] == variant && row["kernel"] == kernel)
    };
    assert!(
        has("demo", "kernel_advance") && has("everything", "kernel_photons"),
        "{table}"
    );
    assert!(has("everything, paper", "kernel_advance"), "{table}");
    let driver = json["machine"]["gpu"]["driver"].as_str().expect("a driver");
    if !driver.contains(KNOWN_MESA) {
        eprintln!("SKIPPED: the budgets are those of {KNOWN_MESA}, this is {driver}\n{table}");
        return;
    }
    let faults: Vec<String> = rows.iter().flat_map(faults).collect();
    assert!(faults.is_empty(), "{}\n{table}", faults.join("\n"));

    // Control: the same row with what the guard is for.
    let mut row = rows
        .iter()
        .find(|row| row["kernel"] == "kernel_trace")
        .expect("traced")
        .clone();
    row["scratch_bytes"] = 64.into();
    row["waves"] = 5.into();
    assert_eq!(self::faults(&row).len(), 2);
}

#[test]
fn an_unknown_chip_is_refused() {
    let folder = Folder::new();
    let scene = root().join("scenes/table/scene.toml");
    let output = folder.run(&format!(
        "bench gpu-code {} --amd not-a-chip -o out",
        scene.display()
    ));
    // Before our line stands what the driver says.
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("error: --amd not-a-chip:"), "{message}");
    assert!(!folder.path("out/gpu-code.json").exists());
}
