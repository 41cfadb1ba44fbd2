//! Every variant of every kernel, composed and validated without a device, and what its code binds.

use std::collections::BTreeSet;

use wgpu::naga;

use super::profile::KERNELS;
use super::{Composer, Features, kernel::reflect_bindings};

/// Nothing on, everything on, each feature alone, all but each.
fn variants() -> Vec<Features> {
    let mut variants = vec![Features::default(), Features::all()];
    for (name, _) in Features::default().flags() {
        for base in [Features::default(), Features::all()] {
            variants.push(base.toggled(name));
        }
    }
    variants
}

/// The kernel's WGSL.
///
/// # Panics
/// If naga, with no capability beyond the standard's, objects.
fn valid(composer: &Composer, kernel: &str, features: &Features) -> String {
    let wgsl = composer
        .compose("kernels", kernel, features)
        .unwrap_or_else(|error| panic!("{features:?}: {error}"));
    let module = naga::front::wgsl::parse_str(&wgsl)
        .unwrap_or_else(|error| panic!("{features:?}: {}", error.emit_to_string(&wgsl)));
    let mut validator = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::empty(),
    );
    if let Err(error) = validator.validate(&module) {
        panic!("{features:?}: {}", error.emit_to_string(&wgsl));
    }
    wgsl
}

fn bound(composer: &Composer, kernel: &str, features: &Features) -> BTreeSet<String> {
    reflect_bindings(&valid(composer, kernel, features))
        .expect("valid")
        .into_iter()
        .map(|binding| binding.name)
        .collect()
}

#[test]
fn every_variant_is_valid() {
    let composer = Composer::default();
    for features in variants() {
        for kernel in KERNELS {
            valid(&composer, kernel, &features);
        }
    }
}

#[test]
fn kernels_bind_what_they_use_and_no_more() {
    let composer = Composer::default();
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let turn = bound(&composer, "kernel_turn", &Features::all());
    assert_eq!(turn, set(&["lanes_counters", "lanes_indirect"]));
    let accumulate: BTreeSet<String> = set(&[
        "bindings_frame",
        "lanes_batch",
        "lanes_counters",
        "lanes_guide_sums",
        "lanes_paths",
        "lanes_pixel_sums",
        "lanes_work",
    ]);
    assert_eq!(
        bound(&composer, "kernel_accumulate", &Features::all()),
        accumulate
    );
}

#[test]
fn a_specialised_kernel_lacks_the_other_estimator() {
    let accumulate = |paper| {
        let features = Features {
            paper,
            ..Features::default()
        };
        valid(&Composer::default(), "kernel_accumulate", &features)
    };
    assert!(accumulate(true).contains(".radiance_real"));
    assert!(!accumulate(false).contains(".radiance_real"));
}

#[test]
#[should_panic(expected = "no definition in scope")]
fn an_invalid_variant_is_noticed() {
    let broken = Composer::default().with_module(
        "request",
        "import package::state::PathState;
        fn answer(path: ptr<function, PathState>, thread: u32) { @if(clearcoat) { _ = not_there(thread); } }",
    );
    valid(&broken, "kernel_trace", &Features::all());
}
