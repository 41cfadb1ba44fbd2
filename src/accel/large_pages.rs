//! Large pages for the arrays in which rays jump about: with small ones many a load would wait for its address to be translated too.

use std::mem::MaybeUninit;

/// Copies `values` to memory for which large pages were asked for. Where there are none the copy is as good, only slower to jump about in.
pub(super) fn on_large_pages<T: Copy>(values: &[T]) -> Vec<T> {
    let mut copy = Vec::with_capacity(values.len());
    ask_for_large_pages(copy.spare_capacity_mut());
    copy.extend_from_slice(values);
    copy
}

#[cfg(target_os = "linux")]
fn ask_for_large_pages<T>(memory: &mut [MaybeUninit<T>]) {
    /// The least size of a large page; a multiple of any small one.
    const LARGE_PAGE_BYTES: usize = 2 << 20;
    let range = memory.as_mut_ptr_range();
    let start = range.start.addr().next_multiple_of(LARGE_PAGE_BYTES);
    let end = range.end.addr() / LARGE_PAGE_BYTES * LARGE_PAGE_BYTES;
    if start < end {
        let start = range.start.with_addr(start);
        // SAFETY: whole pages inside memory that the caller owns. Advice changes how they are backed, never what they hold; a refusal
        // changes nothing.
        unsafe { libc::madvise(start.cast(), end - start.addr(), libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_large_pages<T>(_: &mut [MaybeUninit<T>]) {}
