//! The camera's way while the shutter is open.

use glam::{DMat4, DQuat, DVec3};

use crate::scene::fingerprint::content;

/// Poses at times. Between two of them the position moves along a straight line and the orientation turns at a constant rate; beyond the
/// ends the last motion goes on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraPath {
    /// Seconds, rising, with world-from-camera.
    keys: Vec<(f64, DMat4)>,
}

content! {
    CameraPath { keys }
}

impl CameraPath {
    /// `keys` in any order; of two at one time the first counts.
    pub fn new(mut keys: Vec<(f64, DMat4)>) -> Self {
        keys.sort_by(|a, b| a.0.total_cmp(&b.0));
        keys.dedup_by(|later, earlier| later.0 == earlier.0);
        Self { keys }
    }

    /// The path around `time_secs` alone: its own key with the neighbours that are at most `reach_secs` away, so that a gap of the
    /// tracking is not taken for motion.
    pub fn around(&self, time_secs: f64, reach_secs: f64) -> Self {
        let near = |key: &&(f64, DMat4)| (key.0 - time_secs).abs() <= reach_secs;
        Self {
            keys: self.keys.iter().filter(near).copied().collect(),
        }
    }

    /// The camera stands still.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// World-from-camera at a time; `None` without any key.
    pub fn pose(&self, time_secs: f64) -> Option<DMat4> {
        let (first, last) = (self.keys.first()?, self.keys.last()?);
        if self.keys.len() == 1 {
            return Some(first.1);
        }
        let after = (self.keys)
            .partition_point(|key| key.0 <= time_secs)
            .clamp(1, self.keys.len() - 1);
        let (from, to) = (&self.keys[after - 1], &self.keys[after]);
        if time_secs == from.0 {
            return Some(from.1);
        }
        if time_secs == last.0 {
            return Some(last.1);
        }
        Some(between(
            from.1,
            to.1,
            (time_secs - from.0) / (to.0 - from.0),
        ))
    }

    /// The last key before a time.
    pub fn key_before(&self, time_secs: f64) -> Option<(f64, DMat4)> {
        let before = self.keys.partition_point(|key| key.0 < time_secs);
        Some(self.keys[before.checked_sub(1)?])
    }

    /// The first key after a time.
    pub fn key_after(&self, time_secs: f64) -> Option<(f64, DMat4)> {
        let after = self.keys.partition_point(|key| key.0 <= time_secs);
        self.keys.get(after).copied()
    }

    /// The time lies between two keys or on one.
    pub fn covers(&self, time_secs: f64) -> bool {
        match (self.keys.first(), self.keys.last()) {
            (Some(first), Some(last)) => (first.0..=last.0).contains(&time_secs),
            _ => false,
        }
    }
}

/// The rigid pose a share of the way from `a` to `b`; shares outside 0 to 1 go on at the same rates. Equal poses stay as they are.
fn between(a: DMat4, b: DMat4, share: f64) -> DMat4 {
    if a == b {
        return a;
    }
    let from = DQuat::from_mat4(&a);
    let to = DQuat::from_mat4(&b);
    let mut turn = to * from.inverse();
    if turn.w < 0.0 {
        turn = -turn;
    }
    let turned = DQuat::from_scaled_axis(turn.to_scaled_axis() * share) * from;
    let position = |m: DMat4| -> DVec3 { m.w_axis.truncate() };
    let at = position(a) + (position(b) - position(a)) * share;
    DMat4::from_rotation_translation(turned.normalize(), at)
}
