use std::sync::atomic::{AtomicU32, Ordering};

use super::*;
use crate::pack::{test_mesh, test_scene};
use crate::packed::{PIXEL_BEAM_MAY_MEET_VIRTUAL, PixelInfo};
use crate::scene::{Environment, EnvironmentMap, Material, Side};

/// A square before half of a bright sky, six tiles.
pub fn scene() -> PackedScene {
    let mut scene = test_scene();
    let camera = &mut scene.camera;
    (camera.width, camera.height) = (64, 48);
    (camera.fx, camera.fy, camera.cx, camera.cy) = (64.0, 64.0, 32.0, 24.0);
    let corners = [
        [0.0, -1.0, -1.0],
        [1.0, -1.0, -1.0],
        [1.0, 1.0, -1.0],
        [0.0, 1.0, -1.0],
    ];
    let triangles = [[0, 1, 2], [0, 2, 3]];
    scene.objects = vec![test_mesh(
        Side::Virtual,
        &corners,
        &triangles,
        Material::default(),
    )];
    scene.environment = Some(Environment {
        map: EnvironmentMap::Constant([1.0; 3]),
        rotation_deg: 0.0,
        scale: 1.0,
    });
    let mut packed = PackedScene::build(&scene, &Watcher::none()).expect("packs");
    packed.pixels = vec![PixelInfo::uniform(PIXEL_BEAM_MAY_MEET_VIRTUAL); 64 * 48];
    packed
}

#[test]
fn a_cancelled_render_leaves_whole_pixels_and_what_is_left_completes_it() {
    let scene = scene();
    for with_guides in [false, true] {
        let empty = Film::new(64, 48, 0, with_guides);
        let work = WorkList::main(&scene.pixels, &empty, |row| 1 + row as u32 % 3);
        let mut whole = empty.clone();
        let rays = render(&scene, &mut whole, &work, &Watcher::none());

        let mut film = empty.clone();
        let asked = AtomicU32::new(0);
        let after_two_tiles = || asked.fetch_add(1, Ordering::Relaxed) > 1;
        let watcher = Watcher::none().cancelled_by(&after_two_tiles);
        let mut again = render(&scene, &mut film, &work, &watcher);
        for work in &work.pixels {
            let n = film.pixels[work.pixel as usize].n;
            assert!(n == 0 || n == work.samples());
        }
        let left = work.left(&film);
        assert_eq!(left.pixels.len(), work.pixels.len() - 2 * 64 * 8);
        assert!(film != whole, "control: it was cancelled");
        again += render(&scene, &mut film, &left, &Watcher::none());
        assert!(film == whole && again == rays);
        assert!(work.left(&film).is_empty());
    }
}

#[test]
fn real_samples_follow_in_any_portions() {
    let scene = scene();
    let mut film = Film::new(64, 48, 0, false);
    let main = WorkList::main(&scene.pixels, &film, |_| 8);
    render(&scene, &mut film, &main, &Watcher::none());
    let mut whole = film.clone();
    let real = |film: &Film, end| WorkList::real(&scene.pixels, film, true, |_| end);
    let all = real(&film, 8);
    render(&scene, &mut whole, &all, &Watcher::none());
    for end in [3, 8] {
        assert!(film != whole, "control: something is missing");
        let part = real(&film, end);
        render(&scene, &mut film, &part, &Watcher::none());
    }
    assert!(film == whole);
}
