//! The quick cut of the stress test: every case on the CPU and on a graphics device, and every case's control. `mixray bench stress` runs
//! the whole.

use std::sync::Arc;

use mixray::bench::stress::{Backend, Effort, cases};
use mixray::gpu::harness::test_device;

/// All that is wrong, so that one run shows it whole.
fn failures(backend: &mut Backend) -> Vec<String> {
    let mut failures = Vec::new();
    for case in cases() {
        for &setting in case.settings(backend, Effort::Quick) {
            let figure = case
                .measure(backend, Effort::Quick, setting)
                .unwrap_or_else(|error| panic!("{}: {error}", case.name));
            println!(
                "{:20} {:28} {} {:.2e} (bound {:.0e}), {} not finite, {:.2} s",
                figure.case,
                figure.setting,
                figure.backend,
                figure.measured,
                figure.bound,
                figure.non_finite_samples,
                figure.seconds
            );
            if !figure.passed {
                failures.push(format!("{figure:?}"));
            }
        }
    }
    failures
}

#[test]
fn every_case_holds_its_bound_on_the_cpu() {
    let failures = failures(&mut Backend::Cpu);
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_case_holds_its_bound_on_a_graphics_device() {
    let Some(gpu) = test_device() else { return };
    let failures = failures(&mut Backend::gpu(Arc::clone(gpu)));
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_control_is_noticed() {
    let mut unnoticed = Vec::new();
    for case in cases() {
        let control = case
            .control(&mut Backend::Cpu)
            .unwrap_or_else(|error| panic!("{}: {error}", case.name));
        println!(
            "{:20} control {:.2e} (bound {:.0e})",
            control.case, control.measured, control.bound
        );
        if !control.noticed {
            unnoticed.push(format!("{control:?}"));
        }
    }
    assert!(unnoticed.is_empty(), "{}", unnoticed.join("\n"));
}
