//! One place for what arrives: the newest wins, and what nobody fetched in time is counted.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Between a thread that puts and one that takes.
#[derive(Debug)]
pub struct Slot<T, E> {
    state: Mutex<State<T, E>>,
    changed: Condvar,
}

#[derive(Debug)]
struct State<T, E> {
    newest: Option<T>,
    arrived: u64,
    dropped: u64,
    /// Nothing more comes, and why.
    end: Option<Result<(), E>>,
}

/// What [`Slot::take`] finds.
#[derive(Debug, PartialEq)]
pub enum Fetched<T, E> {
    Newest(T),
    /// Nothing came while it waited.
    Nothing,
    /// Nothing more comes.
    End(Result<(), E>),
}

/// What has gone through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub arrived: u64,
    pub dropped: u64,
}

impl<T, E> Default for Slot<T, E> {
    fn default() -> Self {
        Self {
            state: Mutex::new(State {
                newest: None,
                arrived: 0,
                dropped: 0,
                end: None,
            }),
            changed: Condvar::new(),
        }
    }
}

impl<T, E> Slot<T, E> {
    fn state(&self) -> MutexGuard<'_, State<T, E>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// In place of what waits there, if anything does.
    pub fn put(&self, newest: T) {
        let mut state = self.state();
        state.arrived += 1;
        if state.newest.replace(newest).is_some() {
            state.dropped += 1;
        }
        self.changed.notify_all();
    }

    /// Nothing more comes; what waits can still be taken.
    pub fn end(&self, how: Result<(), E>) {
        self.state().end = Some(how);
        self.changed.notify_all();
    }

    /// The newest, as soon as there is one; waits no longer than `most`.
    pub fn take(&self, most: Duration) -> Fetched<T, E> {
        let waits = |state: &mut State<T, E>| state.newest.is_none() && state.end.is_none();
        let waited = self.changed.wait_timeout_while(self.state(), most, waits);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        if let Some(newest) = state.newest.take() {
            return Fetched::Newest(newest);
        }
        state.end.take().map_or(Fetched::Nothing, Fetched::End)
    }

    pub fn counts(&self) -> Counts {
        let state = self.state();
        Counts {
            arrived: state.arrived,
            dropped: state.dropped,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOON: Duration = Duration::from_millis(1);

    #[test]
    fn the_newest_wins_and_the_rest_is_counted() {
        let slot = Slot::<u32, &str>::default();
        assert_eq!(slot.take(SOON), Fetched::Nothing);
        for frame in 0..3 {
            slot.put(frame);
        }
        assert_eq!(slot.take(SOON), Fetched::Newest(2));
        slot.put(3);
        slot.end(Err("cut"));
        assert_eq!(slot.take(SOON), Fetched::Newest(3), "before the end");
        assert_eq!(slot.take(SOON), Fetched::End(Err("cut")));
        let counts = Counts {
            arrived: 4,
            dropped: 2,
        };
        assert_eq!(slot.counts(), counts);
    }

    #[test]
    fn whatever_the_threads_do_all_are_taken_or_dropped_and_in_order() {
        let slot = Slot::<u32, ()>::default();
        let taken = std::thread::scope(|scope| {
            scope.spawn(|| {
                for frame in 0..20_000 {
                    slot.put(frame);
                }
                slot.end(Ok(()));
            });
            let mut taken = Vec::new();
            loop {
                match slot.take(Duration::from_secs(10)) {
                    Fetched::Newest(frame) => taken.push(frame),
                    Fetched::Nothing => panic!("nothing came"),
                    Fetched::End(_) => break taken,
                }
            }
        });
        assert!(taken.is_sorted_by(|a, b| a < b));
        assert_eq!(taken.last(), Some(&19_999));
        let Counts { arrived, dropped } = slot.counts();
        assert_eq!((arrived, dropped), (20_000, 20_000 - taken.len() as u64));
    }
}
