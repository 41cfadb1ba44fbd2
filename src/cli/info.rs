//! `mixray info`: what this machine can render on.

use clap::Args;

use super::{Failure, Outcome, print};
use crate::gpu::{AdapterReport, list_adapters};

/// Lists graphics adapters and their limits
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// As JSON, with every limit
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
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
