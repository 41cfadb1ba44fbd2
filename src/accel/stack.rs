//! The children that a traversal has yet to visit.

use std::mem::MaybeUninit;

use super::wide::MAX_LEVELS;

const CAPACITY: usize = 7 * MAX_LEVELS + 1;

pub(super) type Storage = [MaybeUninit<u64>; CAPACITY];

/// Nothing is cleared: that would cost as much as visiting several nodes.
pub(super) const UNUSED: Storage = [const { MaybeUninit::uninit() }; CAPACITY];

/// Entries: bits of the distance << 32 | child word.
pub(super) struct Stack<'a> {
    entries: &'a mut Storage,
    /// Entries below this have been written.
    waiting: usize,
}

impl Stack<'_> {
    #[inline(always)]
    pub(super) fn new(entries: &mut Storage) -> Stack<'_> {
        Stack {
            entries,
            waiting: 0,
        }
    }

    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.waiting == 0
    }

    #[inline(always)]
    pub(super) fn push(&mut self, entry: u64) {
        self.entries[self.waiting].write(entry);
        self.waiting += 1;
    }

    #[inline(always)]
    pub(super) fn pop(&mut self) -> Option<u64> {
        self.waiting = self.waiting.checked_sub(1)?;
        // SAFETY: `push` wrote every entry below the former `waiting`, and this is the last of them.
        Some(unsafe { self.entries[self.waiting].assume_init() })
    }
}
