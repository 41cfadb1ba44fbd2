//! Every variant of every kernel, composed and validated without a device, and what its code binds.

use std::collections::BTreeSet;

use wgpu::naga;

use crate::gpu::profile::KERNELS;
use crate::gpu::{Composer, Features, kernel::reflect_bindings};

/// Nothing on, everything on, each feature alone, all but each.
fn variants() -> Vec<Features> {
    let mut variants = vec![Features::default(), Features::ALL];
    for (name, _) in Features::default().flags() {
        for base in [Features::default(), Features::ALL] {
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
    let turn = bound(&composer, "kernel_turn", &Features::ALL);
    assert_eq!(turn, set(&["counters", "indirect"]));
    let accumulate: BTreeSet<String> = set(&[
        "frame",
        "batches",
        "counters",
        "group_sums",
        "guide_sums",
        "path_first_hits",
        "path_firsts",
        "path_links",
        "path_points",
        "path_radiances_real",
        "path_results",
        "pixel_sums",
        "work",
    ]);
    assert_eq!(
        bound(&composer, "kernel_accumulate", &Features::ALL),
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
            "gpu_buffers__texels",
            "fn material_texture__slot",
            "fn material_texture__texture_sample",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "alpha",
        with: &["fn material_surface__coverage_of"],
        ..ADVANCE
    },
    Trace {
        feature: "alpha",
        kernel: "kernel_trace",
        with: &[
            "fn cpu_request__meets",
            "fn material_surface__surface_alpha",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "transmission",
        with: &[".sigma_a", "fn math__exp_"],
        ..ADVANCE
    },
    Trace {
        feature: "transmission",
        with: &[
            "fn material_lobes__eval_transmission",
            "fn material_lobes__transmit_straight",
            "fn material_ggx__ggx_refract",
            "fn material_fresnel__refract_about",
        ],
        beside: &["rough_specular"],
        ..ADVANCE
    },
    Trace {
        feature: "clearcoat",
        with: &["fn material_lobes__sample_coat"],
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
            "gpu_buffers__env_cdf",
            "gpu_buffers__env_texels",
            "fn light_environment__env_sample_map",
            "fn light_environment__find_interval",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "area_lights",
        with: &[
            "fn light_lights__sample_area_light",
            "fn light_lights__light_pdf_hit",
            "fn light_rectangle__",
            "fn material_surface__triangle_emission",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "delta_lights",
        with: &[
            "fn light_lights__sample_point_light",
            "fn light_lights__spot_falloff",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "lens",
        kernel: "kernel_generate",
        with: &[
            "fn camera_lens__sample_lens",
            "gpu_buffers__frame.inv_focus_distance",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "lens_models",
        kernel: "kernel_generate",
        with: &[
            "fn distortion__fisheye_direction",
            "fn distortion__rational_jacobian",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "multi_bounce",
        with: &[
            "cpu_vertex__ROULETTE_GAIN",
            "cpu_vertex__ROULETTE_FROM_DEPTH",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "photo_albedo",
        with: &[
            "gpu_buffers__photo_albedo",
            "fn material_surface__photo_albedo_at",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "normal_maps",
        with: &[
            "fn material_surface__perturbed",
            "fn material_normal__mapped_normal",
            "fn material_normal__tangent_from_uv",
        ],
        beside: &["textures"],
        ..ADVANCE
    },
    Trace {
        feature: "paper",
        with: &["fn cpu_estimator__paper_behind", "path_radiances_real"],
        without: &[
            "fn cpu_estimator__primary_virtual",
            "fn cpu_estimator__difference_shadow",
            "fn cpu_estimator__difference_cone",
            "fn cpu_estimator__difference_bsdf",
            "fn cpu_estimator__split_difference",
            "fn cpu_vertex__plan_cone",
            "fn light_cones__",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "paper",
        kernel: "kernel_accumulate",
        with: &["path_radiances_real"],
        ..ADVANCE
    },
    Trace {
        feature: "shutter",
        kernel: "kernel_generate",
        with: &[
            "fn camera_shutter__shutter_share",
            "fn camera_shutter__camera_pose_at",
            "gpu_buffers__frame.shutter_poses",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "sharing",
        with: &[
            "fn cpu_points__keep_first_vertex",
            "fn cpu_points__offer_point",
            "cpu_state__path_points",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "photons",
        with: &[
            "fn cpu_contribution__left_to_photons",
            "fn cpu_vertex__light_left_to_eye",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "guide",
        with: &[
            "fn light_guide__",
            "fn cpu_vertex__path_sample",
            "gpu_buffers__guide",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "sharing",
        kernel: "kernel_share",
        with: &["fn cpu_sharing__link_points", "fn cpu_request__answer"],
        ..ADVANCE
    },
    Trace {
        feature: "panes",
        with: &[
            "fn cpu_panes__pass_straight",
            "fn cpu_panes__is_pane",
            "cpu_state__path_passed_m",
        ],
        beside: &["transmission", "rough_specular"],
        ..ADVANCE
    },
    Trace {
        feature: "panes",
        kernel: "kernel_trace",
        with: &["fn cpu_panes__pass", "fn material_bsdf__bsdf_straight"],
        beside: &["transmission", "rough_specular"],
        ..ADVANCE
    },
    Trace {
        feature: "backdrop",
        with: &[
            "fn light_backdrop__backdrop_radiance",
            "fn cpu_contribution__from_lens_after",
            "gpu_buffers__backdrop",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "shallow_trees",
        kernel: "kernel_trace",
        with: &["STACK_LEVELS = accel_trace__SHALLOW_LEVELS"],
        without: &["STACK_LEVELS = accel_trace__MOST_LEVELS"],
        ..ADVANCE
    },
    Trace {
        feature: "facets",
        with: &[
            "fn material_facets__kept_by_facets",
            "gpu_buffers__facet_tables",
        ],
        ..ADVANCE
    },
    Trace {
        feature: "rough_specular",
        with: &[
            "fn material_ggx__ggx_reflect",
            "fn material_lobes__lobes_sample",
            "fn material_lobes__eval_reflection",
            "fn material_normal__valid_shading_normal",
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
        let code = [on, off, Features::ALL.toggled(trace.feature)]
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
            .split_once("fn cpu_estimator__difference_bsdf")
            .expect("is there");
        let (body, _) = rest.split_once("\nfn ").unwrap_or((rest, ""));
        body.matches("cpu_estimator__plan_vertex(").count()
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
    valid(&broken, "kernel_trace", &Features::ALL);
}
