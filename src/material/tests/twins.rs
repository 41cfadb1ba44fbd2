//! The WGSL twins against the Rust functions, on a GPU or a software device.

use glam::{Vec2, Vec3};

use super::kinds::{READ_SURFACE, SURFACE_WORDS, draw_material, plain_surface, surface_words};
use super::surface::gallery;
use super::texture::random_texture;
use super::{Random, around};
use crate::accel::Hit;
use crate::gpu::harness::{Probe, test_device};
use crate::gpu::{Composer, Features, GpuDevice, SceneBuffers, SceneParts};
use crate::material::normal::valid_shading_normal;
use crate::material::{
    Surface, bsdf_albedo, bsdf_directional_albedo_bound, bsdf_eval, bsdf_is_delta, bsdf_sample,
    surface_alpha, surface_at, texture_sample,
};
use crate::packed::PackedScene;

/// The number of records with a word that is off by more than `relative` of its size plus `absolute`.
fn outliers(expected: &[Vec<f32>], got: &[u32], relative: f32, absolute: f32) -> usize {
    let words = expected[0].len();
    let close = |e: f32, g: f32| g.is_finite() && (e - g).abs() <= relative * e.abs() + absolute;
    expected
        .iter()
        .zip(got.chunks_exact(words))
        .filter(|(record, got)| {
            !record
                .iter()
                .zip(*got)
                .all(|(e, g)| close(*e, f32::from_bits(*g)))
        })
        .count()
}

/// Surfaces of every kind with directions: (surface, wo, wi or random numbers).
fn scattering_inputs(count: usize) -> Vec<(Surface, Vec3, Vec3, [f32; 3])> {
    let mut random = Random::new(21);
    let mut inputs = Vec::new();
    while inputs.len() < count {
        let mut s = plain_surface();
        s.ng = random.direction();
        let wo = around(
            s.ng,
            f64::from(random.range(0.0, 1.5)),
            f64::from(random.range(0.0, 6.2)),
        );
        let tilted = |random: &mut Random| {
            around(
                s.ng,
                f64::from(random.range(0.0, 0.4)),
                f64::from(random.range(0.0, 6.2)),
            )
        };
        let ns = tilted(&mut random);
        let coat_ns = tilted(&mut random);
        s.ns = valid_shading_normal(s.ng, ns, wo);
        s.coat_ns = valid_shading_normal(s.ng, coat_ns, wo);
        draw_material(&mut random, &mut s);
        inputs.push((s, wo, random.direction(), random.triple()));
    }
    inputs
}

const PRELUDE: &str = "
import package::shared::NONE;
import package::material::bsdf::{bsdf_albedo, bsdf_directional_albedo_bound, bsdf_eval, bsdf_is_delta, bsdf_sample};
import package::material::surface::Surface;
";

fn run(
    gpu: &GpuDevice,
    prelude: &str,
    body: &str,
    words: [usize; 2],
    scene: Option<&SceneBuffers>,
    inputs: &[u32],
) -> Vec<u32> {
    let probe = Probe {
        features: Features::all(),
        prelude,
        body,
        input_words: words[0],
        output_words: words[1],
        scene,
    };
    probe.run(gpu, inputs).expect("runs")
}

#[test]
fn scattering_agrees_with_its_twin() {
    let Some(gpu) = test_device() else { return };
    let inputs = scattering_inputs(20_000);
    let words: Vec<u32> = inputs
        .iter()
        .flat_map(|(s, wo, wi, _)| surface_words(s, *wo, *wi))
        .collect();
    assert_eq!(words.len(), inputs.len() * SURFACE_WORDS);
    let body = "let s = read_surface(); let wo = input_vec3(0u); let wi = input_vec3(3u);
        let e = bsdf_eval(s, wo, wi); output_vec3(0u, e.f_cos); output_f32(3u, e.pdf);
        output_vec3(4u, bsdf_albedo(s, wo)); output_f32(7u, select(0.0, 1.0, bsdf_is_delta(s)) + bsdf_directional_albedo_bound(s));";
    let prelude = format!("{PRELUDE}{READ_SURFACE}");
    let got = run(gpu, &prelude, body, [SURFACE_WORDS, 8], None, &words);
    let expected = |bend: f32| -> Vec<Vec<f32>> {
        inputs
            .iter()
            .map(|(s, wo, wi, _)| {
                let s = Surface {
                    ior: s.ior * bend,
                    ..*s
                };
                let e = bsdf_eval(&s, *wo, *wi);
                let mut record = e.f_cos.to_array().to_vec();
                record.push(e.pdf);
                record.extend(bsdf_albedo(&s, *wo).to_array());
                let delta = if bsdf_is_delta(&s) { 1.0 } else { 0.0 };
                record.push(delta + bsdf_directional_albedo_bound(&s));
                record
            })
            .collect()
    };
    let differ = outliers(&expected(1.0), &got, 1e-5, 1e-6);
    eprintln!("{differ} of {} differ", inputs.len());
    assert!(differ <= 20, "{differ} of {}", inputs.len());
    // Negative control: an index off by a thousandth.
    let differ = outliers(&expected(1.001), &got, 1e-5, 1e-6);
    assert!(differ > inputs.len() / 10, "{differ}");
}

#[test]
fn sampling_agrees_with_its_twin() {
    let Some(gpu) = test_device() else { return };
    let inputs = scattering_inputs(20_000);
    let words: Vec<u32> = inputs
        .iter()
        .flat_map(|(s, wo, _, u)| surface_words(s, *wo, Vec3::from(*u)))
        .collect();
    let body = "let b = bsdf_sample(read_surface(), input_vec3(0u), input_vec3(3u));
        output_vec3(0u, b.wi); output_vec3(3u, b.weight); output_f32(6u, b.pdf);
        output_f32(7u, f32(u32(b.delta) + 2u * u32(b.transmitted) + 4u * u32(b.valid)));";
    let prelude = format!("{PRELUDE}{READ_SURFACE}");
    let got = run(gpu, &prelude, body, [SURFACE_WORDS, 8], None, &words);
    let expected = |shift: f32| -> Vec<Vec<f32>> {
        inputs
            .iter()
            .map(|(s, wo, _, u)| {
                let b = bsdf_sample(s, *wo, [u[0], (u[1] + shift).fract(), u[2]]);
                let mut record = b.wi.to_array().to_vec();
                record.extend(b.weight.to_array());
                record.push(b.pdf);
                record.push(
                    f32::from(u8::from(b.delta))
                        + 2.0 * f32::from(u8::from(b.transmitted))
                        + 4.0 * f32::from(u8::from(b.valid)),
                );
                record
            })
            .collect()
    };
    let differ = outliers(&expected(0.0), &got, 2e-5, 2e-6);
    eprintln!("{differ} of {} differ", inputs.len());
    assert!(differ <= 40, "{differ} of {}", inputs.len());
    // Negative control.
    let differ = outliers(&expected(1e-3), &got, 2e-5, 2e-6);
    assert!(differ > inputs.len() / 3, "{differ}");
}

#[test]
fn textures_agree_with_their_twin() {
    let Some(gpu) = test_device() else { return };
    let mut random = Random::new(31);
    let mut texels = Vec::new();
    let refs: Vec<_> = (0..60)
        .map(|_| random_texture(&mut random, &mut texels))
        .collect();
    let inputs: Vec<(u32, Vec2)> = (0..20_000)
        .map(|_| {
            let uv = Vec2::new(random.range(-3.0, 3.0), random.range(-3.0, 3.0));
            (random.bits() % 60, uv)
        })
        .collect();
    let words: Vec<u32> = inputs
        .iter()
        .flat_map(|(t, uv)| [*t, uv.x.to_bits(), uv.y.to_bits()])
        .collect();
    let parts = SceneParts {
        texture_refs: &refs,
        texels: &texels,
        ..SceneParts::default()
    };
    let scene = SceneBuffers::from_parts(gpu, &parts).expect("uploads");
    let prelude = "import package::gpu::buffers::texture_refs; import package::material::texture::texture_sample;";
    let body =
        "let c = texture_sample(texture_refs[input(0u)], vec2<f32>(input_f32(1u), input_f32(2u)));
        output_vec3(0u, c.xyz); output_f32(3u, c.w);";
    let got = run(gpu, prelude, body, [3, 4], Some(&scene), &words);
    let expected = |shift: f32| -> Vec<Vec<f32>> {
        inputs
            .iter()
            .map(|(t, uv)| {
                texture_sample(&texels, &refs[*t as usize], *uv + Vec2::splat(shift))
                    .to_array()
                    .to_vec()
            })
            .collect()
    };
    let differ = outliers(&expected(0.0), &got, 1e-5, 2e-5);
    eprintln!("{differ} of {} differ", inputs.len());
    assert!(differ <= 5, "{differ} of {}", inputs.len());
    // Negative control.
    let differ = outliers(&expected(0.01), &got, 1e-5, 2e-5);
    assert!(differ > inputs.len() / 3, "{differ}");
}

fn upload(gpu: &GpuDevice, scene: &PackedScene) -> SceneBuffers {
    let parts = SceneParts {
        frame: scene.frame,
        triangles: &scene.triangles,
        vertices: &scene.vertices,
        materials: &scene.materials,
        texture_refs: &scene.texture_refs,
        texels: &scene.texels,
        photo_albedo: &scene.photo_albedo,
        ..SceneParts::default()
    };
    SceneBuffers::from_parts(gpu, &parts).expect("uploads")
}

#[test]
fn shading_points_agree_with_their_twin() {
    let Some(gpu) = test_device() else { return };
    let mut random = Random::new(41);
    let scene = gallery(&mut random);
    let buffers = upload(gpu, &scene);
    let inputs: Vec<(Hit, Vec3)> = (0..20_000)
        .map(|_| {
            let u = random.uniform();
            let hit = Hit {
                t: 1.0,
                u,
                v: random.uniform() * (1.0 - u),
                triangle: random.bits() % scene.triangles.len() as u32,
            };
            (hit, random.direction())
        })
        .collect();
    let words: Vec<u32> = inputs
        .iter()
        .flat_map(|(hit, d)| {
            [hit.u.to_bits(), hit.v.to_bits(), hit.triangle]
                .into_iter()
                .chain(d.to_array().map(f32::to_bits))
        })
        .collect();
    let prelude = "import package::material::surface::{surface_alpha, surface_at}; import package::accel::trace::Hit;";
    let body = "let hit = Hit(1.0, input_f32(0u), input_f32(1u), input(2u)); let s = surface_at(hit, input_vec3(3u));
        output_vec3(0u, s.position); output_vec3(3u, s.ng); output_vec3(6u, s.ns); output_vec3(9u, s.coat_ns);
        output_vec3(12u, s.base_color); output_vec3(15u, s.emission); output_vec3(18u, s.specular_color);
        output_f32(21u, s.error * 1e5); output_f32(22u, s.metallic); output_f32(23u, s.ggx_alpha); output_f32(24u, s.ior);
        output_f32(25u, s.specular); output_f32(26u, s.transmission); output_f32(27u, s.clearcoat);
        output_f32(28u, s.coat_alpha); output_f32(29u, s.coverage); output_f32(30u, f32(s.flags));
        output_f32(31u, f32(u32(s.front))); output_f32(32u, surface_alpha(hit)); output_f32(33u, f32(s.object));";
    let got = run(gpu, prelude, body, [6, 34], Some(&buffers), &words);
    let record = |s: &Surface, alpha: f32| {
        let mut record = Vec::new();
        for v in [
            s.position,
            s.ng,
            s.ns,
            s.coat_ns,
            s.base_color,
            s.emission,
            s.specular_color,
        ] {
            record.extend(v.to_array());
        }
        record.extend([
            s.error * 1e5,
            s.metallic,
            s.ggx_alpha,
            s.ior,
            s.specular,
            s.transmission,
        ]);
        record.extend([s.clearcoat, s.coat_alpha, s.coverage, s.flags as f32]);
        record.extend([f32::from(u8::from(s.front)), alpha, s.object as f32]);
        record
    };
    let expected = |scene: &PackedScene| -> Vec<Vec<f32>> {
        inputs
            .iter()
            .map(|(hit, d)| record(&surface_at(scene, *hit, *d), surface_alpha(scene, *hit)))
            .collect()
    };
    let differ = outliers(&expected(&scene), &got, 2e-5, 2e-5);
    eprintln!("{differ} of {} differ", inputs.len());
    assert!(differ <= 20, "{differ} of {}", inputs.len());
    // Negative controls: other medians of the photograph's albedo, another normal map strength.
    let mut other = scene;
    let pixels = (other.frame.width * other.frame.height) as usize;
    other.photo_albedo[pixels..].rotate_left(1);
    let differ = outliers(&expected(&other), &got, 2e-5, 2e-5);
    assert!(differ > 500, "{differ}");
    other.photo_albedo[pixels..].rotate_right(1);
    for material in &mut other.materials {
        material.normal_scale *= 1.01;
    }
    let differ = outliers(&expected(&other), &got, 2e-5, 2e-5);
    assert!(differ > 500, "{differ}");
}

#[test]
fn features_that_are_off_leave_the_materials() {
    const ROOT: &str = "
import package::material::bsdf::{bsdf_albedo, bsdf_eval, bsdf_sample};
import package::material::surface::{surface_alpha, surface_at};
import package::accel::trace::Hit;
@group(1) @binding(0) var<storage, read_write> out: array<vec4<f32>>;
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let hit = Hit(1.0, 0.25, 0.25, id.x);
    let s = surface_at(hit, vec3<f32>(0.0, 0.0, -1.0));
    let b = bsdf_sample(s, s.ng, vec3<f32>(0.5));
    let e = bsdf_eval(s, s.ng, b.wi);
    out[id.x] = vec4<f32>(b.weight + e.f_cos + bsdf_albedo(s, s.ng), surface_alpha(hit));
}
";
    let compose = |features: &Features| {
        Composer::default()
            .with_module("root", ROOT)
            .compose("root", "main", features)
            .expect("composes")
    };
    let traces: [(&str, &[&str]); 7] = [
        (
            "textures",
            &["material_texture__texture_sample", "gpu_buffers__texels"],
        ),
        ("normal_maps", &["material_normal__mapped_normal"]),
        (
            "transmission",
            &[
                "material_ggx__ggx_refract",
                "material_fresnel__refract_about",
            ],
        ),
        ("clearcoat", &["material_lobes__sample_coat"]),
        (
            "rough_specular",
            &[
                "material_lobes__lobes_at",
                "material_ggx__ggx_d",
                "material_normal__valid_shading_normal",
            ],
        ),
        ("photo_albedo", &["material_surface__photo_albedo_at"]),
        ("alpha", &["material_surface__coverage_of"]),
    ];
    let all = compose(&Features::all());
    for (feature, names) in traces {
        let off = Features::all().toggled(feature);
        let without = compose(&off);
        for name in names {
            assert!(all.contains(name), "{name}: {all}");
            assert!(
                !without.contains(name),
                "{feature} leaves {name}: {without}"
            );
        }
        crate::gpu::kernel::reflect_bindings(&without).expect("valid");
    }
    let none = compose(&Features::default());
    crate::gpu::kernel::reflect_bindings(&none).expect("valid");
    assert!(none.len() < all.len() / 2);
}
