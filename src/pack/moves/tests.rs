use glam::{DMat4, DVec3, Vec3};

use crate::pack::{test_mesh, test_scene};
use crate::packed::PackedScene;
use crate::scene::{Light, LightKind, Material, Object, Scene, Side};
use crate::work::Watcher;

/// A strip of so many squares.
fn strip(side: Side, squares: u32, at: DVec3, material: Material) -> Object {
    let positions: Vec<[f32; 3]> = (0..2 * squares + 2)
        .map(|i| {
            [
                0.02 * (i / 2) as f32,
                0.05 * (i % 2) as f32,
                0.01 * (i % 7) as f32,
            ]
        })
        .collect();
    let triangles: Vec<[u32; 3]> = (0..squares)
        .flat_map(|s| {
            [
                [2 * s, 2 * s + 2, 2 * s + 1],
                [2 * s + 1, 2 * s + 2, 2 * s + 3],
            ]
        })
        .collect();
    let mut object = test_mesh(side, &positions, &triangles, material);
    object.world_from_object = DMat4::from_translation(at);
    object
}

/// Three virtual objects, of which the last shines, and a virtual lamp over a floor.
fn scene() -> Scene {
    let mut scene = test_scene();
    let shining = Material {
        emissive: [2.0, 1.0, 0.5],
        ..Material::default()
    };
    let virtually =
        |squares, x, material| strip(Side::Virtual, squares, DVec3::new(x, 0.2, -2.0), material);
    scene.objects = vec![
        virtually(40, -1.0, Material::default()),
        strip(
            Side::Real,
            5,
            DVec3::new(0.0, -1.0, -3.0),
            Material::default(),
        ),
        virtually(300, 0.3, Material::default()),
        virtually(3, 1.0, shining),
    ];
    scene.lights = vec![Light {
        kind: LightKind::Quad {
            corner: [0.0, 1.0, -3.0],
            edge_u: [1.0, 0.0, 0.0],
            edge_v: [0.0, 0.0, 1.0],
            radiance: [1.0; 3],
        },
        side: Side::Virtual,
    }];
    scene
}

fn pack(scene: &Scene, is_draft: bool) -> PackedScene {
    let nobody = Watcher::none();
    let packed = match is_draft {
        true => PackedScene::build_draft(scene, DVec3::ZERO, &nobody),
        false => PackedScene::build_at(scene, DVec3::ZERO, &nobody),
    };
    let packed = packed.expect("packs");
    // As once a device has asked.
    packed.virtual_bvh.gpu_nodes();
    packed
}

fn bytes(packed: &PackedScene) -> [Vec<u8>; 5] {
    [
        bytemuck::cast_slice(&packed.vertices).to_vec(),
        bytemuck::cast_slice(&packed.triangles).to_vec(),
        bytemuck::cast_slice(&packed.materials).to_vec(),
        bytemuck::cast_slice(&packed.lights).to_vec(),
        bytemuck::bytes_of(&packed.frame).to_vec(),
    ]
}

/// Control: the scene before, and all moved.
#[test]
fn a_moved_object_is_packed_as_if_it_had_stood_there() {
    for is_draft in [false, true] {
        for object in [0, 2, 3] {
            let mut scene = scene();
            let mut packed = pack(&scene, is_draft);
            let before = bytes(&packed);
            let mirrored = DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0));
            let placed = &mut scene.objects[object].world_from_object;
            *placed = DMat4::from_translation(DVec3::new(0.01, 0.02, 0.0)) * *placed * mirrored;
            packed.move_object(&scene, object).expect("packs");
            let fresh = pack(&scene, is_draft);
            assert_eq!(bytes(&packed), bytes(&fresh), "{object}");
            assert_ne!(bytes(&packed), before, "control");
            let moved = packed.moved.clone().expect("moved alone");
            assert_eq!(moved.object, object);
            let squares = [40, 0, 300, 3][object];
            assert_eq!(moved.triangles.len(), 2 * squares);
            assert_eq!(moved.vertices.len(), 2 * squares + 2);
            let of_object = |at: usize| packed.triangles[at].object == object as u32;
            assert!(moved.triangles.clone().all(of_object));
            assert!(!of_object(moved.triangles.end), "control");
        }
    }
}

/// Its triangles vanish, or are of another number: all is packed again.
#[test]
fn an_object_that_does_not_fit_into_its_place_is_packed_with_all_others() {
    let mut scene = scene();
    let mut packed = pack(&scene, false);
    scene.objects[0].world_from_object *= DMat4::from_scale(DVec3::new(1.0, 0.0, 0.0));
    packed.move_object(&scene, 0).expect("packs");
    assert_eq!(packed.moved, None);
    assert_eq!(bytes(&packed), bytes(&pack(&scene, false)));
    // Nothing is there to shine any more: other triangles name other lights.
    scene.objects[3].world_from_object *= DMat4::from_scale(DVec3::splat(0.0));
    packed.move_object(&scene, 3).expect("packs");
    assert_eq!(packed.moved, None);
    let position = packed.position(packed.real_vertex_count as u32);
    assert_ne!(position, Vec3::ZERO, "control: something is there");
}
