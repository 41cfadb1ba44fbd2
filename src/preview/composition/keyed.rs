//! Where things stand at the picture's time, and the keys that say so.

use glam::{DMat4, DVec3};

use super::{Composition, LensForm, Placement};
use crate::preview::keyframes::Keys;
use crate::scene::{FocusPath, Lens, MotionKey, ObjectMotion, Shutter};

/// What can have keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Track {
    Object(usize),
    Focus,
}

impl Composition {
    /// The picture's time is another from now on; a shutter that is made for it stays closed.
    pub fn set_time(&mut self, time_secs: f64) {
        let closed = Shutter {
            exposure_secs: 0.0,
            readout_secs: 0.0,
            samples: None,
            time_secs,
        };
        self.shutter = Some(Shutter {
            time_secs,
            ..self.shutter.unwrap_or(closed)
        });
    }

    /// As it is focused at the picture's time.
    pub fn lens(&self) -> Lens {
        LensForm {
            focus_distance_m: self.focus_distance_m(),
            ..self.lens
        }
        .lens()
    }

    /// At the picture's time.
    pub fn focus_distance_m(&self) -> f64 {
        let by_frame = self.frame.focus_distance_m;
        let by_keys = || self.focus_path().distance_m(self.time_secs());
        by_frame
            .or_else(by_keys)
            .unwrap_or(self.lens.focus_distance_m)
    }

    pub(super) fn focus_path(&self) -> FocusPath {
        let keys = self.focus_keys.iter();
        FocusPath::new(keys.map(|key| (key.time_secs, key.value)).collect())
    }

    /// Sets the focus; where it has keys, one at the picture's time. Nothing happens where the frame brings it.
    pub fn focus(&mut self, distance_m: f64) {
        match (self.frame.focus_distance_m, self.focus_keys.is_empty()) {
            (Some(_), _) => {}
            (None, true) => self.lens.focus_distance_m = distance_m,
            (None, false) => {
                let time_secs = self.time_secs();
                self.focus_keys.set(time_secs, distance_m);
            }
        }
    }

    /// How an object moves, if it has keys.
    pub(super) fn motion(&self, object: usize) -> Option<ObjectMotion> {
        let keys = self.motions.get(object).filter(|keys| !keys.is_empty())?;
        let keys = keys.iter().map(|key| MotionKey {
            time_secs: key.time_secs,
            translation: key.value.translation,
            rotation: key.value.rotation.quaternion(),
            scale: key.value.scale,
        });
        let rest = self.objects[object].world_from_object();
        Some(ObjectMotion::new(rest, keys.collect()))
    }

    /// At the picture's time.
    pub fn world_from_object(&self, object: usize) -> DMat4 {
        match self.motion(object) {
            Some(motion) => motion.at(self.time_secs()),
            None => self.objects[object].world_from_object(),
        }
    }

    /// Where an object stands at the picture's time.
    pub fn placement(&self, object: usize) -> Placement {
        match self.motions[object].is_empty() {
            true => self.objects[object],
            false => Placement::of(self.world_from_object(object)).tidy(),
        }
    }

    /// Puts an object there; where it has keys, by one at the picture's time.
    pub fn place(&mut self, object: usize, placement: Placement) {
        if self.motions[object].is_empty() {
            self.objects[object] = placement;
            return;
        }
        let rest = self.objects[object];
        let key = match rest == rest.scale_alone() {
            true => Placement {
                scale: placement.scale / rest.scale,
                ..placement
            },
            false => {
                let inverse = rest.world_from_object().inverse();
                Placement::of(placement.world_from_object() * inverse)
            }
        };
        let time_secs = self.time_secs();
        self.motions[object].set(time_secs, key.tidy());
    }

    /// Sets a key at the picture's time, where things are.
    pub fn set_key(&mut self, track: Track) {
        let time_secs = self.time_secs();
        match track {
            Track::Focus => {
                let distance_m = self.focus_distance_m();
                self.focus_keys.set(time_secs, distance_m);
            }
            Track::Object(object) if self.motions[object].has(time_secs) => {}
            Track::Object(object) if self.motions[object].is_empty() => {
                // Keys alone say where it stands: an object that turns between two of them turns about itself, not about the world's origin.
                let first = self.objects[object];
                self.objects[object] = self.objects[object].scale_alone();
                let key = Placement {
                    scale: DVec3::ONE,
                    ..first
                };
                self.motions[object].set(time_secs, key);
            }
            Track::Object(object) => self.place(object, self.placement(object)),
        }
    }

    /// Takes the key at the picture's time out; where it was the last, things stay where it had them.
    pub fn delete_key(&mut self, track: Track) {
        let time_secs = self.time_secs();
        match track {
            Track::Focus => {
                let distance_m = self.focus_path().distance_m(time_secs);
                self.focus_keys.delete(time_secs);
                if let (true, Some(distance_m)) = (self.focus_keys.is_empty(), distance_m) {
                    self.lens.focus_distance_m = distance_m;
                }
            }
            Track::Object(object) => {
                let placement = self.placement(object);
                self.motions[object].delete(time_secs);
                if self.motions[object].is_empty() {
                    self.objects[object] = placement;
                }
            }
        }
    }

    /// The key of one time is that of another from now on, unless there is one already.
    pub fn shift_key(&mut self, track: Track, from_secs: f64, to_secs: f64) -> bool {
        match track {
            Track::Focus => self.focus_keys.shift(from_secs, to_secs),
            Track::Object(object) => self.motions[object].shift(from_secs, to_secs),
        }
    }

    /// Rising; empty for an object that there is not.
    pub fn key_times_secs(&self, track: Track) -> Vec<f64> {
        match track {
            Track::Focus => self.focus_keys.times_secs(),
            Track::Object(object) => {
                (self.motions.get(object)).map_or(Vec::new(), Keys::times_secs)
            }
        }
    }

    /// Something has keys that are set in the window.
    pub fn has_keys(&self) -> bool {
        !self.focus_keys.is_empty() || self.motions.iter().any(|keys| !keys.is_empty())
    }
}
