//! Packing against what the scene says, in f64.

use crate::work::Watcher;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3, Vec3};

use super::*;
use crate::accel::{Ray, WorldBvh};
use crate::packed::*;
use crate::scene::{
    AlphaMode, Environment, EnvironmentMap, Light as SceneLight, LightKind,
    Material as SceneMaterial, MotionKey, ObjectMotion, Scene, Side,
};

const TETRAHEDRON: [[f32; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [0.1, 0.0, 0.0],
    [0.0, 0.1, 0.0],
    [0.0, 0.0, 0.1],
];
/// Counter-clockwise from outside.
const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn tetrahedron(side: Side, at: DVec3, scale: DVec3) -> crate::scene::Object {
    let mut object = test_mesh(side, &TETRAHEDRON, &FACES, SceneMaterial::default());
    object.world_from_object =
        DMat4::from_translation(at) * DMat4::from_rotation_y(0.7) * DMat4::from_scale(scale);
    object
}

fn quad(side: Side, x: f64) -> SceneLight {
    SceneLight {
        kind: LightKind::Quad {
            corner: [x, 1.0, -3.0],
            edge_u: [1.0, 0.0, 0.0],
            edge_v: [0.0, 0.0, 1.0],
            radiance: [1.0; 3],
        },
        side,
    }
}

fn pack(scene: &Scene) -> PackedScene {
    PackedScene::build(scene, &Watcher::none()).expect("packs")
}

fn two_objects(offset: DVec3) -> Scene {
    let mut scene = test_scene();
    scene.camera.world_from_camera = DMat4::from_translation(offset);
    let at = offset + DVec3::new(0.1, 0.2, -2.0);
    scene.objects = vec![
        tetrahedron(Side::Virtual, at, DVec3::ONE),
        tetrahedron(Side::Real, at - DVec3::Y, DVec3::splat(3.0)),
    ];
    scene
}

#[test]
fn an_offset_world_packs_to_the_same_positions() {
    let here = pack(&two_objects(DVec3::ZERO));
    let far_off = DVec3::new(1e6, -1e6, 1e6);
    let far = pack(&two_objects(far_off));
    assert_eq!(DVec3::from(far.anchor_m), far_off);
    assert_eq!(here.vertices.len(), far.vertices.len());
    let mut control = 0.0_f32;
    for i in 0..here.vertices.len() as u32 {
        let (a, b) = (here.position(i), far.position(i));
        assert!((a - b).length() < 1e-6 * 0.1, "{a} {b}");
        // Negative control: f32 subtraction would have lost it.
        let coarse = (a.as_dvec3() + far_off).as_vec3() - far_off.as_vec3();
        control = control.max((a - coarse).length());
    }
    assert!(control > 1e-3);
}

#[test]
fn real_comes_first_and_ids_are_global() {
    let packed = pack(&two_objects(DVec3::ZERO));
    assert_eq!(packed.frame.real_triangle_count, 4);
    assert_eq!(packed.triangles.len(), 8);
    let object = |i: usize| packed.triangles[i].object;
    assert_eq!((object(0), object(3), object(4), object(7)), (1, 1, 0, 0));
    for (bvh, ids) in [(&packed.real_bvh, 0..4), (&packed.virtual_bvh, 4..8)] {
        for id in ids {
            let [a, b, c] = packed.triangles[id].vertices.map(|v| packed.position(v));
            let n = (b - a).cross(c - a).normalize();
            let hit = bvh.closest(&Ray {
                origin: (a + b + c) / 3.0 + n * 0.01,
                direction: -n,
                t_min: 0.0,
                t_max: f32::INFINITY,
                skip: NONE,
            });
            assert_eq!(hit.triangle as usize, id);
            // Shading normals agree with the winding.
            let normals = packed.triangles[id].vertices.map(|v| {
                let [x, y, z, _] = packed.vertices[v as usize].normal_v0;
                Vec3::new(x, y, z)
            });
            assert!(normals.iter().all(|m| (m.length() - 1.0).abs() < 1e-6));
        }
    }
}

#[test]
fn mirrored_and_squeezed_objects_keep_their_outside() {
    let outward = |scale: DVec3| {
        let mut scene = test_scene();
        let at = DVec3::new(0.0, 0.0, -1.0);
        scene.objects.push(tetrahedron(Side::Virtual, at, scale));
        let packed = pack(&scene);
        let centre = (0..4).map(|v| packed.position(v)).sum::<Vec3>() / 4.0;
        packed.triangles.iter().all(|t| {
            let [a, b, c] = t.vertices.map(|v| packed.position(v));
            (b - a).cross(c - a).dot(a - centre) > 0.0
        })
    };
    for scale in [
        [1.0; 3],
        [-1.0, 1.0, 1.0],
        [-1.0, -2.0, -0.3],
        [1.0, -1.0, -1.0],
    ] {
        assert!(outward(DVec3::from(scale)), "{scale:?}");
    }
    // A sheared plane: the normal is the cross product of the transformed edges, not the transformed normal.
    let mut scene = test_scene();
    let mut object = test_mesh(
        Side::Virtual,
        &[[0.0; 3], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        &[[0, 1, 2]],
        SceneMaterial::default(),
    );
    object.world_from_object = DMat4::from_scale(DVec3::new(5.0, 1.0, 1.0));
    scene.objects.push(object);
    let packed = pack(&scene);
    let [a, b, c] = [0, 1, 2].map(|v| packed.position(v));
    let [x, y, z, _] = packed.vertices[0].normal_v0;
    let want = (b - a).cross(c - a).normalize();
    assert!((Vec3::new(x, y, z) - want).length() < 1e-6);
    let naive = Vec3::new(5.0, -1.0, 0.0).normalize();
    assert!((want - naive).length() > 0.5);
}

#[test]
fn degenerate_triangles_are_left_out() {
    let mut scene = two_objects(DVec3::ZERO);
    scene.objects.push(tetrahedron(
        Side::Virtual,
        DVec3::ZERO,
        DVec3::new(1.0, 0.0, 0.0),
    ));
    assert_eq!(pack(&scene).triangles.len(), 8);
    // Flattened to a plane, the faces that still have an area stay.
    scene.objects[2] = tetrahedron(Side::Virtual, DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(pack(&scene).triangles.len(), 10);
    // A quad that rounding swallows is no reason to fail, and the next one keeps its light.
    let mut tiny = quad(Side::Real, 1e6);
    if let LightKind::Quad { edge_u, .. } = &mut tiny.kind {
        *edge_u = [1e-9, 0.0, 0.0];
    }
    scene.lights = vec![tiny, quad(Side::Real, 0.0)];
    let packed = pack(&scene);
    assert_eq!(packed.lights.len(), 2);
    let lights: Vec<u32> = packed
        .triangles
        .iter()
        .map(|t| t.light)
        .filter(|&l| l != NONE)
        .collect();
    assert_eq!(lights, [1, 1]);
}

#[test]
fn quads_are_black_surfaces_of_their_side() {
    let mut scene = two_objects(DVec3::ZERO);
    scene.lights = vec![quad(Side::Virtual, 0.0), quad(Side::Real, 2.0)];
    let packed = pack(&scene);
    assert_eq!(packed.frame.real_triangle_count, 6);
    assert_eq!(packed.triangles.len(), 12);
    for (range, light) in [(4..6, 1), (10..12, 0)] {
        for triangle in &packed.triangles[range] {
            assert_eq!((triangle.light, triangle.object), (light, NONE));
            let material = &packed.materials[triangle.material as usize];
            assert!(material.flags & MATERIAL_QUAD_LIGHT != 0);
            // edge_u x edge_v is -Y: the front, which emits, is below.
            let [a, b, c] = triangle.vertices.map(|v| packed.position(v));
            assert!((b - a).cross(c - a).y < 0.0);
        }
    }
    assert_eq!(packed.lights[0].side, 1);
    // The bounding spheres cover the virtual quad too.
    let spheres = &packed.frame.spheres[..packed.frame.sphere_count as usize];
    for triangle in &packed.triangles[6..] {
        for v in triangle.vertices {
            let p = packed.position(v);
            assert!(
                spheres
                    .iter()
                    .any(|s| { (p - Vec3::new(s[0], s[1], s[2])).length() <= s[3] * (1.0 + 1e-5) })
            );
        }
    }
}

#[test]
fn materials_are_packed_once_with_their_flags() {
    let mut scene = test_scene();
    let glass = SceneMaterial {
        attenuation_color: [0.5, 1.0, 0.0],
        attenuation_distance_m: 2.0,
        transmission: 1.0,
        ..SceneMaterial::default()
    };
    let chalk = SceneMaterial {
        specular: 0.0,
        alpha_mode: AlphaMode::Mask(0.25),
        ..SceneMaterial::default()
    };
    for material in [glass, chalk] {
        let mut object = test_mesh(Side::Virtual, &TETRAHEDRON, &FACES, material);
        let again = object.instances[0].clone();
        object.instances.push(again);
        scene.objects.push(object);
    }
    // The same material with another bias is another record.
    let mut biased = scene.objects[1].clone();
    biased.side = Side::Real;
    biased.self_shadow_bias_m = 0.004;
    scene.objects.push(biased);
    let packed = pack(&scene);
    assert_eq!(packed.materials.len(), 3);
    let [real, glass, chalk] = [0, 1, 2].map(|i| packed.materials[i]);
    assert_eq!(
        (real.self_shadow_bias, chalk.self_shadow_bias),
        (0.004, 0.0)
    );
    assert!((glass.sigma_a[0] - std::f32::consts::LN_2 / 2.0).abs() < 1e-6);
    assert!(glass.sigma_a[1] == 0.0 && glass.sigma_a[2] > 10.0 && glass.sigma_a[2].is_finite());
    assert_eq!(glass.flags & MATERIAL_LAMBERTIAN, 0);
    assert_ne!(chalk.flags & MATERIAL_LAMBERTIAN, 0);
    assert_ne!(chalk.flags & MATERIAL_ALPHA_MASK, 0);
    assert_eq!(chalk.alpha_cutoff, 0.25);
}

#[test]
fn rebuilding_the_virtual_part_equals_building_anew() {
    let mut scene = two_objects(DVec3::ZERO);
    scene.lights = vec![quad(Side::Virtual, 0.0), quad(Side::Real, 2.0)];
    let mut packed = pack(&scene);
    let before: Vec<Triangle> = packed.triangles.clone();
    packed.rebuild_virtual(&scene).expect("packs");
    assert_eq!(packed.triangles.len(), before.len());
    assert_eq!(packed.lights, pack(&scene).lights);
    // An edit moves the virtual object and nothing else.
    let real: Vec<Vertex> = packed.vertices[..8].to_vec();
    let moved = DVec3::new(0.5, 0.0, -2.0);
    scene.objects[0] = tetrahedron(Side::Virtual, moved, DVec3::ONE);
    packed.rebuild_virtual(&scene).expect("packs");
    let anew = pack(&scene);
    assert_eq!(packed.vertices, anew.vertices);
    assert_eq!(packed.vertices[..8], real);
    assert_eq!(packed.frame.spheres, anew.frame.spheres);
    let first = packed.frame.real_triangle_count as usize;
    let corner = packed.position(packed.triangles[first].vertices[0]);
    assert!((corner.as_dvec3() - moved).length() < 1e-6);
}

#[test]
fn rectangles_and_points_suffice_and_nothing_else_does() {
    let suffice = |edit: &dyn Fn(&mut Scene)| {
        let mut scene = two_objects(DVec3::ZERO);
        scene.lights = vec![
            quad(Side::Real, 0.0),
            SceneLight {
                kind: LightKind::Point {
                    position: [0.0, 2.0, 0.0],
                    intensity: [1.0; 3],
                },
                side: Side::Virtual,
            },
        ];
        edit(&mut scene);
        pack(&scene).frame.flags & FRAME_LIGHTS_SUFFICE != 0
    };
    assert!(suffice(&|_| ()));
    assert!(suffice(&|scene| scene.lights.clear()));
    assert!(!suffice(&|scene| {
        if let LightKind::Quad { edge_v, .. } = &mut scene.lights[0].kind {
            edge_v[0] = 0.1;
        }
    }));
    assert!(!suffice(&|scene| {
        scene.lights = (0..5).map(|i| quad(Side::Real, f64::from(i))).collect();
    }));
    assert!(!suffice(&|scene| {
        Arc::make_mut(&mut scene.objects[0].instances[0].material).emissive = [0.1; 3];
    }));
    assert!(!suffice(&|scene| {
        Arc::make_mut(&mut scene.objects[1].instances[0].material).unlit = true;
    }));
    assert!(!suffice(&|scene| {
        scene.environment = Some(Environment {
            map: EnvironmentMap::Constant([0.1; 3]),
            rotation_deg: 0.0,
            scale: 1.0,
        });
    }));
}

/// A tetrahedron that goes from one place to another within a second.
fn moving_tetrahedron() -> crate::scene::Object {
    let mut object = tetrahedron(Side::Virtual, DVec3::new(0.0, 0.0, -2.0), DVec3::ONE);
    let key = |time_secs, x| MotionKey {
        time_secs,
        translation: DVec3::new(x, 0.0, 0.0),
        rotation: DQuat::IDENTITY,
        scale: DVec3::ONE,
    };
    object.motion = Some(ObjectMotion::new(
        object.world_from_object,
        vec![key(0.0, 0.0), key(1.0, 5.0)],
    ));
    object
}

#[test]
fn what_moves_is_packed_anew_as_if_all_were_and_what_rests_stays() {
    let mut scene = two_objects(DVec3::ZERO);
    scene.objects.insert(0, moving_tetrahedron());
    scene.lights = vec![quad(Side::Virtual, 0.0)];
    scene.set_time(0.0);
    let mut packed = pack(&scene);
    assert_eq!(packed.resting.triangles, 4 + 4 + 2);
    assert_eq!(packed.triangles[10].object, 0);
    let resting_of = |world: &WorldBvh| world.gpu_nodes()[1].as_ptr();
    let resting = |packed: &PackedScene| resting_of(&packed.virtual_bvh);
    let kept = resting(&packed);
    let before = packed.frame.spheres;
    for time_secs in [0.25, 1.0, 0.5] {
        scene.set_time(time_secs);
        packed.rebuild_moving(&scene).expect("packs");
        let fresh = pack(&scene);
        assert_eq!(packed.vertices, fresh.vertices);
        assert_eq!(packed.triangles, fresh.triangles);
        assert_eq!(packed.lights, fresh.lights);
        assert_eq!(packed.frame.spheres, fresh.frame.spheres);
        assert_eq!(
            packed.virtual_bvh.gpu_nodes(),
            fresh.virtual_bvh.gpu_nodes()
        );
        assert_eq!(
            packed.virtual_bvh.gpu_leaves(),
            fresh.virtual_bvh.gpu_leaves()
        );
        assert_eq!(resting(&packed), kept);
    }
    assert_ne!(packed.frame.spheres, before, "it moves");
    // Kept, so that its place is not taken.
    let empty = WorldBvh::build(&[], 0).expect("builds");
    let old = std::mem::replace(&mut packed.virtual_bvh, empty);
    packed.rebuild_virtual(&scene).expect("packs");
    assert_ne!(resting(&packed), resting_of(&old), "control");
}

/// A glass triangle a metre across, under a square lamp of that side two metres above it.
fn glass_under_a_lamp(side: f64) -> PackedScene {
    let glass = SceneMaterial {
        transmission: 1.0,
        roughness: 0.0,
        ..SceneMaterial::default()
    };
    let corners = [[-0.5, 0.0, -0.5], [0.5, 0.0, -0.5], [0.0, 0.0, 0.5]];
    let mut scene = test_scene();
    scene.objects = vec![test_mesh(Side::Virtual, &corners, &[[0, 1, 2]], glass)];
    scene.lights = vec![SceneLight {
        side: Side::Real,
        kind: LightKind::Quad {
            corner: [-0.5 * side, 2.0, -0.5 * side],
            edge_u: [side, 0.0, 0.0],
            edge_v: [0.0, 0.0, side],
            radiance: [5.0; 3],
        },
    }];
    PackedScene::build(&scene, &Watcher::none()).expect("packs")
}

#[test]
fn photons_leave_large_lamps_to_the_eye() {
    let small = glass_under_a_lamp(0.3);
    let count = small.frame.photon_sphere_count as usize;
    assert!(count > 0);
    // Shaders find the end of the list by its radius, the CPU by the count.
    let (there, after) = small.frame.photon_spheres.split_at(count);
    assert!(there.iter().all(|sphere| sphere[3] > 0.0));
    assert!(!after.is_empty() && after.iter().all(|sphere| sphere[3] == 0.0));
    assert_eq!(small.lights[0].photon_pdf, 1.0);
    let large = glass_under_a_lamp(4.0);
    assert_eq!(large.frame.photon_sphere_count, 0);
    assert_eq!(large.lights[0].photon_pdf, 0.0);
}

/// What a draft packs of a moved object is what it packs of the scene as it then is, and the object's spheres hold it. Control: the scene before.
#[test]
fn a_draft_moves_an_object_as_if_it_had_stood_there() {
    let mut scene = two_objects(DVec3::ZERO);
    let beside = tetrahedron(Side::Virtual, DVec3::new(-0.5, 0.1, -1.5), DVec3::ONE);
    scene.objects.insert(1, beside);
    let draft = |scene: &Scene| {
        PackedScene::build_draft(scene, DVec3::ZERO, &Watcher::none()).expect("packs")
    };
    let mut moved = draft(&scene);
    let before = draft(&scene);
    scene.objects[0].world_from_object = DMat4::from_translation(DVec3::new(0.4, -0.3, -2.5))
        * DMat4::from_quat(DQuat::from_rotation_z(1.1))
        * DMat4::from_scale(DVec3::new(0.5, 2.0, 1.5));
    moved.move_virtual(&scene).expect("packs");
    let bytes = |packed: &PackedScene| -> [Vec<u8>; 3] {
        [
            bytemuck::cast_slice(&packed.vertices).to_vec(),
            bytemuck::cast_slice(&packed.triangles).to_vec(),
            bytemuck::bytes_of(&packed.frame).to_vec(),
        ]
    };
    assert_eq!(bytes(&moved), bytes(&draft(&scene)));
    assert_ne!(bytes(&moved), bytes(&before), "control");
    let is_held = |packed: &PackedScene, p: Vec3| {
        let spheres = &packed.frame.spheres[..packed.frame.sphere_count as usize];
        let inside = |s: &[f32; 4]| (p - xyz(*s)).length() <= s[3];
        spheres.iter().any(inside)
    };
    let first = moved.real_vertex_count as u32;
    let mut points = (first..moved.vertices.len() as u32).map(|v| moved.position(v));
    assert!(points.clone().all(|p| is_held(&moved, p)));
    assert!(!points.all(|p| is_held(&before, p)), "control");
}
