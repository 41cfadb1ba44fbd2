//! `shaders/light/lights.wgsl`, `environment.wgsl` and `cones.wgsl` against their Rust twins.

use glam::Vec3;

use super::{Random, lit_by, map_environment};
use crate::gpu::harness::{Probe, test_device};
use crate::gpu::{Features, SceneBuffers, SceneParts};
use crate::light::cones::{
    cone_pdf, cone_sample, cone_solid_angle_fraction, cones_at, direction_meets_spheres,
};
use crate::light::environment::env_radiance;
use crate::light::lights::{env_arriving, light_pdf_hit, light_sample, light_select};
use crate::packed::PackedScene;
use crate::scene::{Environment, EnvironmentMap, LightKind};

const BODY: &str = "
let position = input_vec3(0u);
let direction = input_vec3(3u);
let u = vec4<f32>(input_f32(6u), input_f32(7u), input_f32(8u), input_f32(9u));
let s = light_sample(light_select(u.x, u.w), position, u.yz);
output_vec3(0u, s.direction);
output_f32(3u, s.distance);
output_vec3(4u, s.radiance);
output_f32(7u, s.pdf);
output_f32(8u, env_arriving(direction).pdf);
output_vec3(9u, env_radiance(direction));
let c = cone_sample(cones_at(position, direction), u.x, u.yz);
output_vec3(12u, c.direction);
output_f32(15u, c.pdf);
output_f32(16u, cone_pdf(cones_at(position, direction), s.direction));
output_f32(17u, cone_solid_angle_fraction(cones_at(position, direction)));
output_f32(18u, select(0.0, 1.0, direction_meets_spheres(position, direction)));
output_f32(19u, light_pdf_hit(light_select(u.x, u.w), position, s.direction, s.distance));
";
const PRELUDE: &str = "
import package::light::cones::{cone_pdf, cone_sample, cone_solid_angle_fraction, cones_at, direction_meets_spheres};
import package::light::environment::env_radiance;
import package::light::lights::{env_arriving, light_pdf_hit, light_sample, light_select};
";
const OUTPUTS: usize = 20;

fn on_the_cpu(scene: &PackedScene, input: &[f32]) -> [f32; OUTPUTS] {
    let position = Vec3::from_slice(&input[0..3]);
    let direction = Vec3::from_slice(&input[3..6]);
    let u = [input[6], input[7], input[8], input[9]];
    let frame = &scene.frame;
    let light = light_select(scene, u[0], u[3]);
    let s = light_sample(scene, light, position, [u[1], u[2]]);
    let c = cone_sample(&cones_at(frame, position, direction), u[0], [u[1], u[2]]);
    let radiance = env_radiance(scene, direction);
    [
        s.direction.x,
        s.direction.y,
        s.direction.z,
        s.distance,
        s.radiance.x,
        s.radiance.y,
        s.radiance.z,
        s.pdf,
        env_arriving(scene, direction).1,
        radiance.x,
        radiance.y,
        radiance.z,
        c.direction.x,
        c.direction.y,
        c.direction.z,
        c.pdf,
        cone_pdf(&cones_at(frame, position, direction), s.direction),
        cone_solid_angle_fraction(&cones_at(frame, position, direction)),
        if direction_meets_spheres(frame, position, direction) {
            1.0
        } else {
            0.0
        },
        light_pdf_hit(scene, light, position, s.direction, s.distance),
    ]
}

fn scene(environment: Environment) -> PackedScene {
    let quad = |x: f64, shear: f64| LightKind::Quad {
        corner: [x, 2.0, -1.0],
        edge_u: [1.5, shear, 0.0],
        edge_v: [0.0, 0.0, 2.0],
        radiance: [2.0, 3.0, 4.0],
    };
    let lights = [
        quad(-1.0, 0.0),
        quad(2.0, 0.4),
        LightKind::Point {
            position: [0.0, 2.0, 0.0],
            intensity: [1.0; 3],
        },
        LightKind::Spot {
            position: [1.0, 2.0, 0.0],
            direction: [0.0, -1.0, 0.0],
            intensity: [5.0; 3],
            inner_deg: 20.0,
            outer_deg: 60.0,
        },
        LightKind::Directional {
            direction: [0.0, -1.0, 0.3],
            irradiance: [1.0; 3],
        },
    ];
    let mut scene = lit_by(Some(environment), &lights);
    let spheres = [
        [0.0, 0.0, -3.0, 0.5],
        [0.3, 0.2, -3.0, 0.6],
        [4.0, 1.0, 0.0, 0.1],
        [0.0, 1.0, 0.0, 0.4],
    ];
    scene.frame.sphere_count = 4;
    scene.frame.spheres[..4].copy_from_slice(&spheres);
    scene
}

/// Share of outputs that are not within 1e-4 relative plus 1e-5 of each other.
fn disagreement(scene: &PackedScene, cpu: &PackedScene) -> Option<f64> {
    let gpu = test_device()?;
    let buffers = SceneBuffers::from_parts(gpu, &SceneParts::from(scene)).expect("uploads");
    let mut random = Random::new(77);
    let records = 4096;
    let mut inputs = Vec::new();
    for _ in 0..records {
        let position = random.direction() * (3.0 * random.uniform());
        inputs.extend(position.to_array());
        inputs.extend(random.direction().to_array());
        inputs.extend(random.uniforms::<4>());
    }
    let words: Vec<u32> = inputs.iter().map(|x| x.to_bits()).collect();
    let outputs = Probe {
        features: Features::for_scene(scene),
        prelude: PRELUDE,
        body: BODY,
        input_words: 10,
        output_words: OUTPUTS,
        scene: Some(&buffers),
    }
    .run(gpu, &words)
    .expect("runs");
    let mut off = 0;
    for (input, found) in inputs.chunks(10).zip(outputs.chunks(OUTPUTS)) {
        for (want, found) in on_the_cpu(cpu, input).iter().zip(found) {
            let found = f32::from_bits(*found);
            // The shader's infinite distance is a large number.
            let both_far = *want == f32::INFINITY && found > 1e20;
            let near = (found - want).abs() <= 1e-4 * want.abs() + 1e-5;
            off += usize::from(!near && !both_far);
        }
    }
    Some(off as f64 / (records * OUTPUTS) as f64)
}

#[test]
fn shaders_agree_with_their_twins() {
    let mut random = Random::new(5);
    let texels = (0..16 * 8)
        .map(|_| random.uniforms::<3>().map(|x| x * x))
        .collect();
    let map = Environment {
        rotation_deg: 33.0,
        ..map_environment(16, 8, texels)
    };
    let constant = Environment {
        map: EnvironmentMap::Constant([0.5, 0.6, 0.7]),
        rotation_deg: 0.0,
        scale: 1.0,
    };
    for environment in [map, constant] {
        let packed = scene(environment.clone());
        let Some(share) = disagreement(&packed, &packed) else {
            return;
        };
        assert!(share < 1e-3, "{share}");
        // Negative control: lights a thousandth brighter.
        let mut other = scene(environment);
        for light in &mut other.lights {
            light.radiance[0] *= 1.001;
        }
        assert!(disagreement(&packed, &other).is_some_and(|share| share > 5e-3));
    }
}
