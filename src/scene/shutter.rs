//! `[shutter]` and what moves while it is open: `[[camera.motion]]` and `[[virtual.motion]]`.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};

use super::Scene;
use super::error::Result;
use super::fingerprint::content;
use super::pose::{read_camera_pose, read_placement};
use super::reader::{Node, Table, is_not_negative};
use super::trajectory::CameraPath;

/// When the sensor gathers light. Each row is exposed for `exposure_secs`; the last row starts `readout_secs` after the first. The middle of
/// the middle row's exposure is the picture's time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    pub exposure_secs: f64,
    /// 0: all rows at once.
    pub readout_secs: f64,
    /// Instants at which moving objects stand, over the exposure of a row; `None`: so many that they move by at most a pixel between two.
    pub samples: Option<u32>,
    /// The picture's time; of a sequence, each frame has its own.
    pub time_secs: f64,
}

impl Shutter {
    /// Most instants over the exposure.
    pub const MAX_SAMPLES: u32 = 4096;

    /// Light is gathered for some time; else everything stands still.
    pub fn is_open(&self) -> bool {
        self.exposure_secs + self.readout_secs > 0.0
    }

    /// When the first row opens and the last one closes, seconds.
    pub fn interval_secs(&self) -> (f64, f64) {
        let half = 0.5 * (self.exposure_secs + self.readout_secs);
        (self.time_secs - half, self.time_secs + half)
    }

    /// Share of the interval for which a row is open; 1 if nothing is open for any time.
    pub fn open_share(&self) -> f64 {
        let all = self.exposure_secs + self.readout_secs;
        if all > 0.0 {
            self.exposure_secs / all
        } else {
            1.0
        }
    }
}

/// Where an object is at some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionKey {
    pub time_secs: f64,
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

/// Keys in the order of their times; an object moves at constant rates between two, and rests before the first and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectMotion {
    /// World-from-object without the motion.
    rest: DMat4,
    keys: Vec<MotionKey>,
}

content! {
    ObjectMotion { rest, keys }
}

impl ObjectMotion {
    /// `keys` must not be empty.
    pub fn new(rest: DMat4, mut keys: Vec<MotionKey>) -> Self {
        keys.sort_by(|a, b| a.time_secs.total_cmp(&b.time_secs));
        Self { rest, keys }
    }

    /// World-from-object without the motion.
    pub fn rest(&self) -> DMat4 {
        self.rest
    }

    /// From the first key to the last.
    pub fn span_secs(&self) -> Option<(f64, f64)> {
        Some((self.keys.first()?.time_secs, self.keys.last()?.time_secs))
    }

    /// World-from-object at a time: the object as it is placed, then moved.
    pub fn at(&self, time_secs: f64) -> DMat4 {
        let after = self.keys.partition_point(|key| key.time_secs <= time_secs);
        let moved = match (
            after.checked_sub(1).map(|i| self.keys[i]),
            self.keys.get(after),
        ) {
            (None, None) => return self.rest,
            (None, Some(key)) => *key,
            (Some(key), None) => key,
            (Some(a), Some(b)) => {
                let share = (time_secs - a.time_secs) / (b.time_secs - a.time_secs);
                MotionKey {
                    time_secs,
                    translation: a.translation.lerp(b.translation, share),
                    rotation: a.rotation.slerp(b.rotation, share),
                    scale: a.scale.lerp(b.scale, share),
                }
            }
        };
        let MotionKey {
            translation,
            rotation,
            scale,
            ..
        } = moved;
        DMat4::from_scale_rotation_translation(scale, rotation, translation) * self.rest
    }
}

impl Scene {
    /// Puts the moving objects where they are at that time.
    pub fn set_time(&mut self, time_secs: f64) {
        for object in self.objects.iter_mut().filter(|o| o.is_animated()) {
            object.world_from_object = object.world_from_object_at(time_secs);
            for instance in &mut object.instances {
                instance.object_from_local = instance.object_from_local_at(time_secs);
                if let Some(deformation) = instance.deformation.as_ref().filter(|d| d.moves()) {
                    instance.primitive = Arc::new(deformation.at(time_secs));
                }
            }
        }
    }
}

const SHUTTER_KEYS: &[&str] = &["exposure_secs", "readout_secs", "samples", "time_secs"];

pub(super) fn read_shutter(root: &Table) -> Result<Option<Shutter>> {
    let Some(table) = root.table("shutter", "[shutter]", SHUTTER_KEYS)? else {
        return Ok(None);
    };
    let seconds =
        |node: &Node| node.number("seconds from 0 to 1e6", |x| is_not_negative(x) && x <= 1e6);
    Ok(Some(Shutter {
        exposure_secs: table.required("exposure_secs", "exposure_secs = 0.02", seconds)?,
        readout_secs: table.optional("readout_secs", seconds)?.unwrap_or(0.0),
        samples: table.optional("samples", |node| node.integer(1, Shutter::MAX_SAMPLES))?,
        time_secs: table.optional("time_secs", Node::finite)?.unwrap_or(0.0),
    }))
}

/// `[[camera.motion]]`: where the camera is at times.
pub(super) fn read_camera_motion(root: &Table) -> Result<CameraPath> {
    let Some(camera) = root.get("camera") else {
        return Ok(CameraPath::default());
    };
    let camera = camera.any_table("[camera]")?;
    let keys = camera.list("motion")?;
    if !keys.is_empty() {
        for key in ["world_from_camera", "position"] {
            camera.refuse_both("motion", key)?;
        }
    }
    let keys = keys.iter().map(|node| {
        let known = &[
            "time_secs",
            "world_from_camera",
            "position",
            "look_at",
            "up",
        ];
        let table = node.table("[[camera.motion]]", known)?;
        Ok((read_time(&table)?, read_camera_pose(&table)?))
    });
    Ok(CameraPath::new(keys.collect::<Result<_>>()?))
}

/// The `motion` of an object that stands at `rest` without it.
pub(super) fn read_object_motion(table: &Table, rest: DMat4) -> Result<Option<ObjectMotion>> {
    let nodes = table.list("motion")?;
    let keys = nodes.iter().map(|node| {
        let known = &[
            "time_secs",
            "translation",
            "rotation_deg",
            "rotation",
            "scale",
        ];
        let table = node.table("[[virtual.motion]]", known)?;
        let (scale, rotation, translation) = read_placement(&table)?;
        Ok(MotionKey {
            time_secs: read_time(&table)?,
            translation,
            rotation,
            scale,
        })
    });
    let keys = keys.collect::<Result<Vec<_>>>()?;
    Ok((!keys.is_empty()).then(|| ObjectMotion::new(rest, keys)))
}

pub(super) fn read_time(table: &Table) -> Result<f64> {
    table.required("time_secs", "time_secs = 0.04", Node::finite)
}
