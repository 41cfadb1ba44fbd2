//! Motion vectors against the projection of the same points in f64, by formulas of the test's own.

use mixray::output::ChannelFile;

use crate::support::Folder;

const FOCAL_PX: f64 = 60.0;
const SIZE: [usize; 2] = [64, 48];
/// Of the wall, and of the board before it, which goes right and down and comes nearer, metres a second.
const WALL_Z: f64 = -3.0;
const BOARD_Z: f64 = -1.5;
const SPEED: [f64; 3] = [0.4, -0.2, 0.3];
/// Metres and degrees a frame.
const STEP_M: f64 = 0.03;
const TURN_DEG: f64 = 1.2;
const RATE: f64 = 10.0;

fn camera(frame: i32) -> (f64, f64) {
    (
        STEP_M * f64::from(frame),
        (TURN_DEG * f64::from(frame)).to_radians(),
    )
}

/// Pixels, y down, of a point before the camera of a frame, which turns left about its vertical.
fn seen(frame: i32, [x, y, z]: [f64; 3]) -> [f64; 2] {
    let (at, angle) = camera(frame);
    let (sin, cos) = angle.sin_cos();
    let (right, ahead) = ((x - at) * cos - z * sin, -((x - at) * sin + z * cos));
    [
        0.5 * SIZE[0] as f64 + FOCAL_PX * right / ahead,
        0.5 * SIZE[1] as f64 - FOCAL_PX * y / ahead,
    ]
}

/// Where the ray through a pixel's middle meets a plane across -Z.
fn on_plane(frame: i32, column: usize, row: usize, z: f64) -> [f64; 3] {
    let (at, angle) = camera(frame);
    let (sin, cos) = angle.sin_cos();
    let x = (column as f64 + 0.5 - 0.5 * SIZE[0] as f64) / FOCAL_PX;
    let y = (0.5 * SIZE[1] as f64 - row as f64 - 0.5) / FOCAL_PX;
    let direction = [x * cos - sin, y, -x * sin - cos];
    let length = z / direction[2];
    [at + direction[0] * length, direction[1] * length, z]
}

fn moved(point: [f64; 3], frames: i32) -> [f64; 3] {
    let secs = f64::from(frames) / RATE;
    std::array::from_fn(|axis| point[axis] + SPEED[axis] * secs)
}

#[test]
fn vectors_are_where_points_are_seen_in_the_frames_beside() {
    let folder = Folder::new();
    let keys = [0.0, 1.0].map(|time: f64| {
        let shift = SPEED.map(|speed| speed * time);
        format!("[[virtual.motion]]\ntime_secs = {time:?}\ntranslation = {shift:?}\n")
    });
    folder.write(
        "scene.toml",
        format!(
            "[camera]\nfx = {FOCAL_PX:?}\n[environment]\nradiance = [0.6, 0.6, 0.6]\n\
             [[real]]\nshape = \"quad\"\ncorner = [-4, -1, {WALL_Z:?}]\nedge_u = [8, 0, 0]\nedge_v = [0, 5, 0]\n\
             [[virtual]]\nshape = \"quad\"\ncorner = [-0.3, -0.3, {BOARD_Z:?}]\nedge_u = [0.6, 0, 0]\nedge_v = [0, 0.6, 0]\n{}\
             [shutter]\nexposure_secs = 0.02\n[render]\nrays_per_pixel = 2\nbackend = \"cpu\"\n",
            keys.concat()
        ),
    );
    folder.create("in");
    let frames: Vec<String> = (0..3)
        .map(|frame| {
            let [width, height] = SIZE.map(|size| size as u32);
            folder.save_frame(&format!("in/f_{frame:04}.png"), width, height, frame);
            let (x, angle) = camera(frame as i32);
            let (sin, cos) = angle.sin_cos();
            format!(r#"{{"frame": {frame}, "world_from_camera": [[{cos},0,{sin},{x}],[0,1,0,0],[{},0,{cos},0],[0,0,0,1]]}}"#, -sin)
        })
        .collect();
    folder.write(
        "poses.json",
        format!(
            r#"{{"frames_per_second": {RATE}, "frames": [{}]}}"#,
            frames.join(", ")
        ),
    );
    folder.sequence(&[
        "--frames",
        "in",
        "-o",
        "out.#.exr",
        "--layers",
        "motion,mask",
    ]);
    let read = |frame: u32| {
        let file = ChannelFile::read(&folder.path(&format!("out.{frame}.exr")));
        file.expect("reads").floats
    };
    let (mut worst, mut swapped) = (0.0f64, 0.0f64);
    let mut kinds = [0, 0, 0];
    let layers = read(1);
    for row in 0..SIZE[1] {
        for column in 0..SIZE[0] {
            let pixel = row * SIZE[0] + column;
            let mask = layers["mask.Y"][pixel];
            let here = [column as f64 + 0.5, row as f64 + 0.5];
            // At the picture's time the board is where it is in frame 1; borders are left out.
            let (kind, then): (usize, [[f64; 3]; 2]) = match mask {
                1.0 => {
                    let z = BOARD_Z + SPEED[2] / RATE;
                    let point = on_plane(1, column, row, z);
                    (0, [moved(point, 1), moved(point, -1)])
                }
                0.0 => match on_plane(1, column, row, WALL_Z) {
                    point if point[1] > -0.95 => (1, [point; 2]),
                    point if point[1] < -1.05 => {
                        // Nothing is there: infinitely far.
                        let far = on_plane(1, column, row, -1e9);
                        (2, [far; 2])
                    }
                    _ => continue,
                },
                _ => continue,
            };
            kinds[kind] += 1;
            for (layer, frame, point) in [("forward", 2, then[0]), ("backward", 0, then[1])] {
                let there = seen(frame, point);
                let truth = [there[0] - here[0], here[1] - there[1]];
                let vector = |layer: &str| {
                    ["u", "v"].map(|axis| f64::from(layers[&format!("{layer}.{axis}")][pixel]))
                };
                let off = |layer: &str| {
                    let vector = vector(layer);
                    (vector[0] - truth[0]).hypot(vector[1] - truth[1])
                };
                worst = worst.max(off(layer));
                let other = if frame == 2 { "backward" } else { "forward" };
                swapped = swapped.max(off(other));
            }
        }
    }
    assert!(worst < 2e-3, "{worst}");
    assert!(swapped > 2.0, "control: {swapped}");
    assert!(kinds.iter().all(|count| *count > 100), "{kinds:?}");
    for (frame, layer) in [(0, "backward"), (2, "forward")] {
        let layers = read(frame);
        for axis in ["u", "v"] {
            let values = &layers[&format!("{layer}.{axis}")];
            assert!(values.iter().all(|value| *value == 0.0), "no such frame");
        }
    }
}
