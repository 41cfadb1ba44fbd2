//! Undo and redo of whole states.

use std::time::{Duration, Instant};

/// Changes of one gesture that follow each other sooner than this are undone together.
const GESTURE: Duration = Duration::from_millis(600);

/// States before and after the present one.
#[derive(Debug)]
pub struct History<T> {
    past: Vec<T>,
    future: Vec<T>,
    /// The last change: what it was of, and when.
    last: Option<(String, Instant)>,
    /// A gesture lasts until it is ended, however slow.
    is_held: bool,
}

/// More are forgotten, the oldest first.
const MAX_STATES: usize = 500;

impl<T> Default for History<T> {
    fn default() -> Self {
        Self {
            past: Vec::new(),
            future: Vec::new(),
            last: None,
            is_held: false,
        }
    }
}

impl<T: PartialEq> History<T> {
    /// `before` is left for another state by a change of `what`: the name of a slider, or of a gesture.
    pub fn changed(&mut self, before: T, what: &str, now: Instant) {
        self.future.clear();
        let goes_on = (self.last.as_ref()).is_some_and(|(name, at)| {
            name == what && (self.is_held || now.duration_since(*at) < GESTURE)
        });
        if !goes_on {
            if self.past.len() == MAX_STATES {
                self.past.remove(0);
            }
            self.past.push(before);
        }
        self.last = Some((what.to_owned(), now));
    }

    /// Changes of one thing are one step until the gesture ends.
    pub fn begin_gesture(&mut self) {
        (self.last, self.is_held) = (None, true);
    }

    /// The next change begins a step of its own.
    pub fn end_gesture(&mut self) {
        (self.last, self.is_held) = (None, false);
    }

    pub fn undo(&mut self, present: T) -> Option<T> {
        self.last = None;
        let before = self.past.pop()?;
        self.future.push(present);
        Some(before)
    }

    pub fn redo(&mut self, present: T) -> Option<T> {
        self.last = None;
        let after = self.future.pop()?;
        self.past.push(present);
        Some(after)
    }

    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }

    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gesture_is_one_step() {
        let mut history = History::default();
        let start = Instant::now();
        for (before, ms) in [(0, 0), (1, 100), (2, 200)] {
            history.changed(before, "aperture", start + Duration::from_millis(ms));
        }
        history.changed(3, "focus", start + Duration::from_millis(250));
        history.changed(4, "focus", start + Duration::from_secs(5));
        assert_eq!(history.undo(5), Some(4), "long after");
        assert_eq!(history.undo(4), Some(3), "another slider");
        assert_eq!(history.undo(3), Some(0), "three at once");
        assert_eq!(history.undo(0), None);
        assert_eq!(history.redo(0), Some(3));
        history.changed(3, "scale", start + Duration::from_secs(9));
        assert!(!history.can_redo(), "a change forgets what was undone");
        history.begin_gesture();
        for (before, secs) in [(4, 10), (5, 20), (6, 30)] {
            history.changed(before, "drag", start + Duration::from_secs(secs));
        }
        history.end_gesture();
        assert_eq!(history.undo(7), Some(4), "a slow drag");
    }
}
