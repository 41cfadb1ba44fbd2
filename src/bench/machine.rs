//! What a benchmark ran on.

use serde::{Deserialize, Serialize};

use crate::gpu::list_adapters;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    pub cpu: String,
    /// Threads that rendered.
    pub threads: usize,
    pub os: String,
    /// The adapter that `--backend gpu` takes; none where the GPU was not asked for or there is none.
    pub gpu: Option<Gpu>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gpu {
    pub name: String,
    pub driver: String,
    /// False: a program that plays a graphics device on the CPU.
    pub hardware: bool,
}

impl Machine {
    /// This one; its best graphics adapter is looked for only where it is wanted.
    pub fn this(with_gpu: bool) -> Self {
        let adapters = if with_gpu {
            list_adapters()
        } else {
            Vec::new()
        };
        let gpu = adapters.into_iter().next().map(|adapter| Gpu {
            name: format!("{} ({})", adapter.name, adapter.backend),
            driver: adapter.driver,
            hardware: adapter.hardware,
        });
        Self {
            cpu: cpu_model(),
            threads: rayon::current_num_threads(),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            gpu,
        }
    }
}

/// As the system calls it; elsewhere than on Linux and Windows the architecture.
fn cpu_model() -> String {
    let from_proc = std::fs::read_to_string("/proc/cpuinfo").ok();
    from_proc
        .as_deref()
        .and_then(model_name)
        .map(str::to_owned)
        .or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok())
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

fn model_name(cpuinfo: &str) -> Option<&str> {
    cpuinfo
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(':'))
        .map(|(_, name)| name.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_model_stands_after_its_colon() {
        let text =
            "processor\t: 0\nmodel\t\t: 143\nmodel name\t: Some CPU @ 2.0GHz\nflags\t: fpu\n";
        assert_eq!(model_name(text), Some("Some CPU @ 2.0GHz"));
        assert_eq!(model_name("processor : 0\n"), None);
        assert!(!cpu_model().is_empty());
    }
}
