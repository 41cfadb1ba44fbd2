use super::*;

const ROOT: &str = "
import package::gpu::buffers::{frame, lights};
import package::shared::NONE;
import package::extra::helper;
@if(lens) fn radius() -> f32 { return frame.aperture_radius; }
@else fn radius() -> f32 { return 0.0; }
fn unused() -> u32 { return lights[0].kind; }
@compute @workgroup_size(1) fn first() { var x = radius() + helper(); @if(paper) { x += 7.25; } _ = x; }
@compute @workgroup_size(1) fn second() { let light = lights[0].kind; _ = light + NONE; }
";

fn compose(entry_point: &str, features: &Features) -> String {
    Composer::default()
        .with_module(
            "extra",
            "fn helper() -> f32 { let frame = 3.5; return frame; }",
        )
        .with_module("root", ROOT)
        .compose("root", entry_point, features)
        .expect("composes")
}

fn binding_names(wgsl: &str) -> Vec<String> {
    crate::gpu::kernel::reflect_bindings(wgsl)
        .expect("valid")
        .into_iter()
        .map(|binding| binding.name)
        .collect()
}

#[test]
fn only_what_an_entry_point_reaches_is_emitted() {
    let lens = Features {
        lens: true,
        ..Features::default()
    };
    let first = compose("first", &lens);
    assert_eq!(binding_names(&first), ["frame"], "{first}");
    assert!(
        first.contains("extra__helper") && !first.contains("second"),
        "{first}"
    );
    let second = compose("second", &lens);
    assert_eq!(binding_names(&second), ["lights"], "{second}");
}

#[test]
fn a_feature_that_is_off_leaves_no_trace() {
    let off = compose("first", &Features::default());
    assert!(
        binding_names(&off).is_empty() && !off.contains("7.25"),
        "{off}"
    );
    let on = compose("first", &Features::all());
    assert!(
        on.contains("aperture_radius") && on.contains("7.25"),
        "{on}"
    );
}

#[test]
fn an_unknown_feature_is_an_error() {
    let composed = Composer::default()
        .with_module(
            "root",
            "@if(lense) const x = 1; @compute @workgroup_size(1) fn main() { }",
        )
        .compose("root", "main", &Features::default());
    let message = composed.expect_err("refused").to_string();
    assert!(
        message.contains("lense") && !message.contains('\u{1b}'),
        "{message}"
    );
}
