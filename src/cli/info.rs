//! `mixray info`: what this machine can render on, or what a file is.

use std::path::PathBuf;

use clap::Args;

use super::{Failure, Outcome, file_info, print};
use crate::gpu::{AdapterReport, list_adapters};

/// Tells what a file is and holds; without one lists graphics adapters and their limits
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Model, photograph, environment, film, trajectory, camera, noise profile or scene
    file: Option<PathBuf>,
    /// Adapters as JSON, with every limit
    #[arg(long, conflicts_with = "file")]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    if let Some(file) = &arguments.file {
        print(&file_info::describe(file)?)?;
        return Ok(Outcome::Done);
    }
    let adapters = list_adapters();
    if arguments.json {
        let mut json = serde_json::to_string_pretty(&adapters)?;
        json.push('\n');
        print(&json)?;
        return Ok(Outcome::Done);
    }
    let mut out = format!(
        "mixray {}\ncpu  {} threads\n",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads()
    );
    for adapter in &adapters {
        out += &lines(adapter);
    }
    if !adapters.iter().any(|a| a.hardware) {
        out += "no hardware GPU: --backend auto renders on the CPU\n";
    }
    print(&out)?;
    Ok(Outcome::Done)
}

fn lines(adapter: &AdapterReport) -> String {
    let mib = |bytes: u64| bytes >> 20;
    format!(
        "gpu  {} ({}, {}; driver {})\n     \
         largest array {} MiB, largest buffer {} MiB, {} arrays a kernel, {} KiB workgroup memory, {} threads a workgroup, timestamps: {}\n",
        adapter.name,
        adapter.kind,
        adapter.backend,
        adapter.driver,
        mib(adapter.max_storage_binding_bytes),
        mib(adapter.max_buffer_bytes),
        adapter.max_storage_buffers,
        adapter.max_workgroup_memory_bytes >> 10,
        adapter.max_workgroup_invocations,
        if adapter.timestamps { "yes" } else { "no" },
    )
}
