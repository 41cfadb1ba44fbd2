//! Keys of one thing that changes with the scene's own time, in the order in which the scene file has them.

/// A value at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key<T> {
    pub time_secs: f64,
    pub value: T,
    /// Its number in the file's list; `None`: the file does not have it yet.
    pub place: Option<usize>,
}

/// Times nearer to each other are one: hands set them to a tenth of a millisecond.
const SAME_SECS: f64 = 0.5e-4;

/// Empty: it rests.
#[derive(Clone, Debug, PartialEq)]
pub struct Keys<T>(Vec<Key<T>>);

impl<T> Default for Keys<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Keys<T> {
    /// As a file has them: times and values.
    pub fn of_file(keys: impl IntoIterator<Item = (f64, T)>) -> Self {
        let keys = keys.into_iter().enumerate();
        let read = keys.map(|(place, (time_secs, value))| Key {
            time_secs,
            value,
            place: Some(place),
        });
        Self(read.collect())
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn iter(&self) -> impl Iterator<Item = &Key<T>> {
        self.0.iter()
    }

    /// Rising.
    pub fn times_secs(&self) -> Vec<f64> {
        let mut times: Vec<f64> = self.iter().map(|key| key.time_secs).collect();
        times.sort_by(f64::total_cmp);
        times
    }

    fn index_at(&self, time_secs: f64) -> Option<usize> {
        let is_there = |key: &Key<T>| (key.time_secs - time_secs).abs() < SAME_SECS;
        self.0.iter().position(is_there)
    }

    pub fn has(&self, time_secs: f64) -> bool {
        self.index_at(time_secs).is_some()
    }

    /// A new key, or another value of the one that is there.
    pub fn set(&mut self, time_secs: f64, value: T) {
        match self.index_at(time_secs) {
            Some(index) => self.0[index].value = value,
            None => self.0.push(Key {
                time_secs,
                value,
                place: None,
            }),
        }
    }

    /// Takes the key of a time out, if there is one.
    pub fn delete(&mut self, time_secs: f64) {
        if let Some(index) = self.index_at(time_secs) {
            self.0.remove(index);
        }
    }

    /// The key of one time is that of another from now on; false, and nothing happens, where there is none, or one already.
    pub fn shift(&mut self, from_secs: f64, to_secs: f64) -> bool {
        match self.index_at(from_secs) {
            Some(index) if !self.has(to_secs) => {
                self.0[index].time_secs = to_secs;
                true
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_set_moved_and_deleted_by_their_times() {
        let mut keys = Keys::of_file([(1.0, 'a'), (0.0, 'b')]);
        keys.set(1.000_01, 'c');
        keys.set(0.5, 'd');
        assert_eq!(keys.times_secs(), [0.0, 0.5, 1.0]);
        let places: Vec<_> = keys.iter().map(|key| (key.value, key.place)).collect();
        assert_eq!(places, [('c', Some(0)), ('b', Some(1)), ('d', None)]);
        assert!(!keys.shift(0.5, 1.0), "there is one");
        assert!(!keys.shift(0.7, 2.0), "there is none");
        assert!(keys.shift(1.0, 2.0));
        keys.delete(0.0);
        keys.delete(9.0);
        assert_eq!(keys.times_secs(), [0.5, 2.0]);
        assert!(keys.has(2.0) && !keys.has(1.0));
    }
}
