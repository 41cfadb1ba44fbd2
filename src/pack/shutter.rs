//! The shutter in the frame, and the instants at which moving objects stand.

use glam::{DMat4, DQuat, DVec3};

use super::build::PackError;
use crate::packed::{FRAME_SHUTTER, FRAME_SHUTTER_ORDERED, Frame, PackedScene, SHUTTER_POSES};
use crate::scene::projection::project;
use crate::scene::{MotionBlurMethod, SamplerKind, Scene, Shutter};
use crate::work::{Meter, Phase, Watcher};

/// Where objects move, they stand still from one of these to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Where the objects are, in its middle.
    pub time_secs: f64,
    /// Where it ends, as a share of the time from the opening of the first row to the closing of the last.
    pub end_share: f64,
}

/// The shutter whose light is traced; `None`: nothing moves, or the copies show it.
pub fn traced_shutter(scene: &Scene) -> Option<Shutter> {
    let copies = (scene.stages.motion_blur)
        .is_some_and(|settings| settings.method == MotionBlurMethod::Copies);
    (scene.shutter).filter(|shutter| !copies && shutter.is_open())
}

impl PackedScene {
    /// The camera's way while the shutter is open. Where the camera rests the frame is as without a shutter.
    pub fn set_shutter(&mut self, scene: &Scene, objects_move: bool) {
        self.frame.flags &= !(FRAME_SHUTTER | FRAME_SHUTTER_ORDERED);
        let Some(shutter) = traced_shutter(scene) else {
            (self.frame.shutter_open, self.frame.shutter_row) = (1.0, 0.0);
            return;
        };
        let open = shutter.open_share();
        let rows = f64::from(self.frame.height.max(2) - 1);
        self.frame.shutter_open = open as f32;
        self.frame.shutter_row = ((1.0 - open) / rows) as f32;
        let (opens, closes) = shutter.interval_secs();
        let steps = (SHUTTER_POSES - 1) as f64;
        let at = |i: usize| {
            let time = opens + (closes - opens) * i as f64 / steps;
            (scene.camera_path.pose(time)).unwrap_or(scene.camera.world_from_camera)
        };
        let poses: [DMat4; SHUTTER_POSES] = std::array::from_fn(at);
        if !frame_poses(&poses, DVec3::from(self.anchor_m), &mut self.frame) {
            return;
        }
        self.frame.flags |= FRAME_SHUTTER;
        // The others stratify pairs of numbers, not a single one.
        if objects_move || scene.settings.sampler != SamplerKind::Sobol {
            self.frame.flags |= FRAME_SHUTTER_ORDERED;
        }
    }

    /// Finds what moving objects sweep over while the shutter is open, for the pilot. No tree is built for it; the virtual world is left at the picture's time.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn sweep(
        &mut self,
        scene: &mut Scene,
        instants: &[Instant],
        watcher: &Watcher<'_>,
    ) -> Result<(), PackError> {
        self.swept_spheres.clear();
        if instants.is_empty() {
            return Ok(());
        }
        let meter = Meter::begin(watcher, Phase::Trees, instants.len() as u64);
        for instant in instants {
            scene.set_time(instant.time_secs);
            self.place_moving(scene)?;
            let count = self.frame.sphere_count as usize;
            self.swept_spheres
                .extend_from_slice(&self.frame.spheres[..count]);
            meter.add(1);
        }
        if let Some(shutter) = scene.shutter {
            scene.set_time(shutter.time_secs);
            self.rebuild_moving(scene)?;
        }
        meter.end();
        Ok(())
    }
}

/// The instants of a scene whose objects move while the shutter is open; empty if none does. They are stratified: one in each of equal
/// slices of time.
pub fn instants(scene: &Scene) -> Vec<Instant> {
    let Some(shutter) = traced_shutter(scene) else {
        return Vec::new();
    };
    let (opens, closes) = shutter.interval_secs();
    let step = fastest_step_px(scene, opens, closes);
    if step == 0.0 {
        return Vec::new();
    }
    let open = shutter.open_share();
    let wanted = shutter.samples.map_or(step.ceil(), f64::from);
    // A slice without a sample would only cost.
    let most = f64::from(scene.settings.rays_per_pixel);
    let in_exposure = wanted.clamp(1.0, most.min(f64::from(Shutter::MAX_SAMPLES)));
    let count = match open > 0.0 {
        true => (in_exposure / open)
            .ceil()
            .min(f64::from(Shutter::MAX_SAMPLES)),
        false => wanted.clamp(1.0, f64::from(scene.camera.height)),
    } as u32;
    let share = |i: f64| i / f64::from(count);
    (0..count)
        .map(|i| Instant {
            time_secs: opens + (closes - opens) * share(f64::from(i) + 0.5),
            end_share: share(f64::from(i) + 1.0),
        })
        .collect()
}

/// How far, in pixels, the corner of a moving object's box goes in the picture during the exposure of a row, the camera at rest; 0 if nothing moves, at
/// least 1 if something does.
fn fastest_step_px(scene: &Scene, opens: f64, closes: f64) -> f64 {
    const STEPS: u32 = 16;
    let mut longest = 0.0f64;
    let time = |i: u32| opens + (closes - opens) * f64::from(i) / f64::from(STEPS);
    let animated = scene.objects.iter().filter(|o| o.is_animated());
    let parts = animated.flat_map(|object| object.instances.iter().map(move |i| (object, i)));
    for (object, instance) in parts {
        let places: Vec<DMat4> = (0..=STEPS)
            .map(|i| object.world_from_object_at(time(i)) * instance.object_from_local_at(time(i)))
            .collect();
        if places.iter().all(|place| *place == places[0]) && !instance.deforms() {
            continue;
        }
        longest = longest.max(1.0);
        let corners = instance.corners();
        // Points of the part at each of the times.
        let points: Vec<Vec<DVec3>> = (0..=STEPS)
            .map(|i| match &instance.deformation {
                Some(deformation) => deformation.sampled_points(time(i)),
                None => corners.clone(),
            })
            .collect();
        for point in 0..points[0].len() {
            let seen: Vec<Option<DVec3>> = places
                .iter()
                .zip(&points)
                .map(|(place, points)| {
                    project(&scene.camera, place.transform_point3(points[point]))
                })
                .collect();
            let length: f64 = seen
                .windows(2)
                .filter_map(|pair| Some((pair[0]?, pair[1]?)))
                .map(|(a, b)| a.truncate().distance(b.truncate()))
                .sum();
            longest = longest.max(length);
        }
    }
    longest
}

/// The samples of a pixel of each of `height` rows that lie before the end of an instant, in rays per pixel of `total`.
pub fn row_ends(scene: &Scene, height: u32, instant: &Instant, total: u32) -> Vec<u32> {
    let open = traced_shutter(scene).map_or(1.0, |shutter| shutter.open_share());
    let rows = f64::from(height.max(2) - 1);
    (0..height)
        .map(|row| {
            let opened = (1.0 - open) * f64::from(row) / rows;
            let since = instant.end_share - opened;
            let share = match open > 0.0 {
                true => since / open,
                // All of a row's light comes at once.
                false => f64::from(u8::from(since >= 0.0)),
            };
            // Rounded the same way at the end of one instant and the beginning of the next.
            (share.clamp(0.0, 1.0) * f64::from(total) + 0.5).floor() as u32
        })
        .collect()
}

/// Fills the frame's poses from those at equal steps of the shutter's time; false, and nothing changes, if they are all one.
pub fn frame_poses(
    world_from_camera: &[DMat4; SHUTTER_POSES],
    anchor: DVec3,
    frame: &mut Frame,
) -> bool {
    let first = world_from_camera[0];
    if world_from_camera.iter().all(|pose| *pose == first) {
        return false;
    }
    let mut before = DQuat::from_mat4(&first);
    for (i, pose) in world_from_camera.iter().enumerate() {
        let mut turned = DQuat::from_mat4(pose);
        // Of the two quaternions of a rotation, the one nearer to the last, so that what lies between is short.
        if turned.dot(before) < 0.0 {
            turned = -turned;
        }
        before = turned;
        let position = pose.w_axis.truncate() - anchor;
        frame.shutter_poses[2 * i] = position.as_vec3().extend(0.0).to_array();
        frame.shutter_poses[2 * i + 1] = turned.as_quat().to_array();
    }
    true
}
