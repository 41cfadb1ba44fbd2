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
        .compose("gpu::kernels", kernel, features)
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
    assert_eq!(turn, set(&["gpu_lanes_counters", "gpu_lanes_indirect"]));
    let accumulate: BTreeSet<String> = set(&[
        "packed_bindings_frame",
        "cpu_state_path_first_hits",
        "cpu_state_path_radiances_real",
        "cpu_state_path_results",
        "gpu_lanes_batch",
        "gpu_lanes_guide_sums",
        "gpu_lanes_pixel_sums",
        "gpu_lanes_work",
    ]);
    assert_eq!(
        bound(&composer, "kernel_accumulate", &Features::all()),
        accumulate
    );
}

/// What a feature puts into a kernel, and what goes with it: declarations and expressions of the emitted code.
struct Trace {
    feature: &'static str,
    kernel: &'static str,
    /// There with the feature, and only then.
    with: &'static [&'static str],
    /// There without the feature, and only then.
    without: &'static [&'static str],
    /// The features that the code needs beside this one.
    beside: &'static [&'static str],
}

const ADVANCE: Trace = Trace {
    feature: "",
    kernel: "kernel_advance",
    with: &[],
    without: &[],
    beside: &[],
};

/// Every feature of [`Features`] at least once.
const TRACES: &[Trace] = &[
    Trace {
        feature: "textures",
        with: &[
            "packed_bindings_texels",
            "fn material_texture_slot",
            "fn material_texture_texture_sample",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "alpha",
        with: &["fn material_surface_coverage_of"],
        ..ADVANCE
    },
    Trace {
        feature: "alpha",
        kernel: "kernel_trace",
        with: &[
            "packed_bindings_materials",
            "packed_bindings_vertices",
            "fn cpu_request_meets",
            "fn material_surface_surface_alpha",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "transmission",
        with: &[".sigma_a", "fn math_exp_"],
        ..ADVANCE
    },
    Trace {
        feature: "transmission",
        with: &[
            "fn material_bsdf_eval_transmission",
            "fn material_bsdf_transmit_straight",
            "fn material_ggx_ggx_refract",
            "fn material_fresnel_refract_about",
        ],
        beside: &["rough_specular"],
        ..ADVANCE
    },
    Trace {
        feature: "clearcoat",
        with: &["fn material_bsdf_sample_coat"],
        beside: &["rough_specular"],
        ..ADVANCE
    },
    Trace {
        feature: "clearcoat",
        with: &[".clearcoat_texture", ".clearcoat_normal_texture"],
        beside: &["rough_specular", "textures", "normal_maps"],
        ..ADVANCE
    },
    Trace {
        feature: "environment_map",
        with: &[
            "packed_bindings_env_cdf",
            "packed_bindings_env_texels",
            "fn light_environment_env_sample_map",
            "fn light_environment_find_interval",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "area_lights",
        with: &[
            "fn light_lights_sample_area_light",
            "fn light_lights_light_pdf_hit",
            "fn light_rectangle_",
            "fn material_surface_triangle_emission",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "delta_lights",
        with: &[
            "fn light_lights_sample_point_light",
            "fn light_lights_spot_falloff",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "lens",
        kernel: "kernel_generate",
        with: &[
            "fn camera_lens_sample_lens",
            "packed_bindings_frame.aperture_radius",
            "packed_bindings_frame.inv_focus_distance",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "multi_bounce",
        with: &["cpu_vertex_ROULETTE_GAIN", "cpu_vertex_ROULETTE_FROM_DEPTH"],
        ..ADVANCE
    },
    Trace {
        feature: "photo_albedo",
        with: &[
            "packed_bindings_photo_albedo",
            "fn material_surface_photo_albedo_at",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "normal_maps",
        with: &[
            "fn material_surface_perturbed",
            "fn material_normal_mapped_normal",
            "fn material_normal_tangent_from_uv",
        ],
        beside: &["textures"],
        ..ADVANCE
    },
    Trace {
        feature: "paper",
        with: &["fn cpu_estimator_paper_behind", ".radiance_real"],
        without: &[
            "fn cpu_estimator_primary_virtual",
            "fn cpu_estimator_difference_shadow",
            "fn cpu_estimator_difference_cone",
            "fn cpu_estimator_difference_bsdf",
            "fn cpu_estimator_split_difference",
            "fn cpu_vertex_plan_cone",
            "fn light_cones_",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "paper",
        kernel: "kernel_accumulate",
        with: &[".radiance_real"],
        ..ADVANCE
    },
    Trace {
        feature: "shutter",
        kernel: "kernel_generate",
        with: &[
            "fn camera_shutter_shutter_share",
            "fn camera_shutter_camera_pose_at",
            "packed_bindings_frame.shutter_poses",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "rough_specular",
        with: &[
            "fn material_ggx_",
            "fn material_bsdf_sample_layers",
            "fn material_bsdf_eval_reflection",
            "fn material_normal_valid_shading_normal",
        ],
        ..ADVANCE
    },
];

#[test]
fn a_feature_brings_its_code_and_leaves_with_it() {
    let composer = Composer::default();
    for (feature, _) in Features::default().flags() {
        assert!(
            TRACES.iter().any(|trace| trace.feature == feature),
            "{feature} leaves no trace"
        );
    }
    for trace in TRACES {
        let mut off = Features::default();
        for name in trace.beside {
            off = off.toggled(name);
        }
        let on = off.toggled(trace.feature);
        assert_ne!(on, off, "there is no feature {}", trace.feature);
        let code = [on, off, Features::all().toggled(trace.feature)]
            .map(|features| valid(&composer, trace.kernel, &features));
        let [on, off, all_but] = &code;
        for (parts, there, gone) in [(trace.with, on, off), (trace.without, off, on)] {
            for part in parts {
                assert!(
                    there.contains(part),
                    "{}: {part} is not there",
                    trace.feature
                );
                assert!(!gone.contains(part), "{}: {part} is there", trace.feature);
            }
        }
        for part in trace.with {
            assert!(
                !all_but.contains(part),
                "everything but {}: {part} is there",
                trace.feature
            );
        }
    }
}

/// At max_bounces 1 the difference at a real point behind a real point is never asked for: one call plans a vertex less.
#[test]
fn one_bounce_has_no_recursion() {
    let plans = |multi_bounce| {
        let features = Features {
            multi_bounce,
            ..Features::default()
        };
        let wgsl = valid(&Composer::default(), "kernel_advance", &features);
        let (_, rest) = wgsl
            .split_once("fn cpu_estimator_difference_bsdf")
            .expect("is there");
        let (body, _) = rest.split_once("\nfn ").unwrap_or((rest, ""));
        body.matches("cpu_estimator_plan_vertex(").count()
    };
    assert_eq!((plans(true), plans(false)), (1, 0));
}

#[test]
#[should_panic(expected = "no definition in scope")]
fn an_invalid_variant_is_noticed() {
    let broken = Composer::default().with_module(
        "cpu::request",
        "import package::cpu::state::PathState;
        fn answer(st: ptr<function, PathState>, thread: u32) { @if(clearcoat) { _ = not_there(thread); } }",
    );
    valid(&broken, "kernel_trace", &Features::all());
}
