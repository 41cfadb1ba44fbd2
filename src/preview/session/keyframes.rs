//! Keys of objects and of the focus, set at the picture's time.

use super::Session;
use crate::preview::composition::{Track, moves_within, rounded};

/// To which hands set times, seconds.
const STEP_SECS: f64 = 1e-4;
/// The timeline is no shorter.
const LEAST_SPAN_SECS: f64 = 1.0;

impl Session {
    /// Something changes with the scene's own time.
    pub fn moves(&self) -> bool {
        let has_keys = self
            .composition()
            .is_some_and(|composition| composition.has_keys());
        let is_led = |loaded: &super::Loaded| {
            let scene = &loaded.scene;
            !scene.camera_path.is_empty() || scene.objects.iter().any(moves_within)
        };
        has_keys || self.loaded().is_some_and(is_led)
    }

    /// From the first of all keys to the last, the picture's time among them; at least a second.
    pub fn span_secs(&self) -> Option<(f64, f64)> {
        let (loaded, composition) = (self.loaded()?, self.composition()?);
        let scene = &loaded.scene;
        let tracks = (0..scene.objects.len())
            .map(Track::Object)
            .chain([Track::Focus]);
        let keys = tracks.flat_map(|track| composition.key_times_secs(track));
        let ends = [
            scene.camera_path.key_after(f64::NEG_INFINITY),
            scene.camera_path.key_before(f64::INFINITY),
        ];
        let of_camera = ends.into_iter().flatten().map(|(time_secs, _)| time_secs);
        let parts = scene.objects.iter().flat_map(|object| &object.instances);
        let durations =
            parts.filter_map(|part| Some(part.animation.as_ref()?.animation.duration_secs));
        let of_parts = durations.flat_map(|duration_secs| [0.0, duration_secs]);
        let times = keys.chain(of_camera).chain(of_parts);
        let (first, last) = times.fold(
            (composition.time_secs(), composition.time_secs()),
            |(first, last), time_secs| (first.min(time_secs), last.max(time_secs)),
        );
        Some((first, last.max(first + LEAST_SPAN_SECS)))
    }

    /// What a name stands for: `focus`, or a virtual object.
    pub fn track(&self, name: &str) -> Option<Track> {
        match name {
            "focus" => Some(Track::Focus),
            name => self.object(name).map(Track::Object),
        }
    }

    /// There is a key at the picture's time.
    pub fn has_key(&self, track: Track) -> bool {
        self.composition().is_some_and(|composition| match track {
            Track::Focus => composition.focus_keys.has(composition.time_secs()),
            Track::Object(object) => {
                let keys = composition.motions.get(object);
                keys.is_some_and(|keys| keys.has(composition.time_secs()))
            }
        })
    }

    /// Sets a key at the picture's time, where things are.
    pub fn set_key(&mut self, track: Track) {
        self.end_gesture();
        self.edit("key", |composition| composition.set_key(track));
        self.end_gesture();
    }

    /// Takes the key at the picture's time out.
    pub fn delete_key(&mut self, track: Track) {
        self.end_gesture();
        self.edit("key", |composition| composition.delete_key(track));
        self.end_gesture();
    }

    /// Another time for the key of a time, which is told; the old one where it stays.
    pub fn shift_key(&mut self, track: Track, from_secs: f64, to_secs: f64) -> f64 {
        let to_secs = rounded(to_secs, STEP_SECS);
        let mut is_there = false;
        self.edit("key moved", |composition| {
            is_there = composition.shift_key(track, from_secs, to_secs);
        });
        match is_there {
            true => to_secs,
            false => from_secs,
        }
    }
}
