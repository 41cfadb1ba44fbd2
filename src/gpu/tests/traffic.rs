//! The table of docs/architecture.md: what a step reads and writes, by the sizes that the kernels declare.

use std::collections::BTreeMap;

use crate::cpu::state::POINTS;
use crate::gpu::kernel::reflect_bindings;
use crate::gpu::lanes::PARTS_GROUP;
use crate::gpu::profile::KERNELS;
use crate::gpu::{Composer, Features};

const DOC: &str = include_str!("../../../docs/architecture.md");
const LANE: u32 = 4;
/// What a first vertex remembers while a point's light is captured.
const CAPTURE: u32 = 16;
/// A vertex while lights wait to be drawn there, and the direction that it was reached along.
const WAITING: u32 = 16 + 12;

/// The largest variants: `direct`, with second vertices shared and without, and `paper`.
const SHARING: Features = Features {
    paper: false,
    panes: false,
    ..Features::ALL
};
const DIRECT: Features = Features {
    sharing: false,
    ..SHARING
};
const PAPER: Features = Features {
    paper: true,
    ..DIRECT
};

/// Bytes of an element of each array of the state that a kernel binds.
fn parts(kernel: &str, features: Features) -> BTreeMap<String, u32> {
    let wgsl = Composer::default()
        .compose("gpu::kernels", kernel, &features)
        .expect("composes");
    reflect_bindings(&wgsl)
        .expect("valid")
        .into_iter()
        .filter(|binding| binding.group == PARTS_GROUP)
        .map(|binding| (binding.name, binding.stride))
        .collect()
}

fn state_bytes(features: Features) -> u32 {
    let all: BTreeMap<_, _> = KERNELS
        .iter()
        .flat_map(|kernel| parts(kernel, features))
        .collect();
    all.values().sum()
}

/// Rows of the table.
fn rows(size: &BTreeMap<String, u32>) -> Vec<String> {
    let [
        ray,
        hits,
        path,
        next,
        real,
        difference,
        result,
        first,
        points,
    ] = [
        "path_rays",
        "path_hits",
        "paths",
        "path_nexts",
        "path_reals",
        "path_differences",
        "path_results",
        "path_firsts",
        "path_points",
    ]
    .map(|part| size[part]);
    let advance = (LANE + ray + hits + path, ray + path + LANE);
    let row = |what: &str, (read, written): (u32, u32)| format!("| {what} | {read} | {written} |");
    let with = |read: u32, written: u32| (advance.0 + read, advance.1 + written);
    vec![
        row("sample that ends before its first ray", (0, result)),
        row(
            "sample that asks for its first ray",
            (0, result + ray + hits + path + LANE),
        ),
        row("trace", (LANE + ray, hits)),
        row("advance, at least", advance),
        row(
            "advance to a difference vertex, all techniques played",
            with(0, next + difference),
        ),
        row(
            "advance to a first one, where other lights wait for the shadow ray",
            with(0, WAITING),
        ),
        row(
            "advance from its shadow ray, which adds light, to the next light",
            with(result + WAITING, result + WAITING),
        ),
        row(
            "advance from its shadow ray, which adds light, to its cones",
            with(result + next, result),
        ),
        row(
            "advance from its cones, where virtual geometry is nearer",
            with(0, real),
        ),
        row("advance to the real path behind", with(real, 0)),
        row("advance to the recursion", with(difference, 0)),
        row("to keep a first vertex, beside", (0, first)),
        row(
            "to offer a point, beside",
            (result, points / POINTS + CAPTURE + result),
        ),
    ]
}

#[test]
fn a_step_moves_as_many_bytes_as_the_documentation_says() {
    let mut size = parts("kernel_advance", SHARING);
    for row in rows(&size) {
        assert!(DOC.contains(&row), "docs/architecture.md lacks: {row}");
    }
    let [direct, sharing, paper] = [DIRECT, SHARING, PAPER].map(state_bytes);
    let sentence =
        format!("{direct} bytes, {sharing} where second vertices are shared, with `paper` {paper}");
    assert!(
        DOC.contains(&sentence),
        "docs/architecture.md lacks: {sentence}"
    );
    *size.get_mut("path_rays").expect("is bound") += 4;
    let wrong = rows(&size);
    assert!(!DOC.contains(&wrong[2]), "control: {}", wrong[2]);
}

#[test]
fn tracing_touches_the_hot_record_and_the_hits_alone() {
    for features in [DIRECT, SHARING, PAPER] {
        let trace = parts("kernel_trace", features);
        assert_eq!(trace.keys().collect::<Vec<_>>(), ["path_hits", "path_rays"]);
        assert!(trace["path_rays"] <= 64, "{trace:?}");
        let advance = parts("kernel_advance", features);
        assert!(advance.len() > trace.len(), "control: {advance:?}");
    }
}
