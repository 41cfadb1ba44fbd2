//! The last resort where memory runs out that nothing had foreseen.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;

/// The system's allocator, for a program: where it has nothing left, one line says so and the program ends with exit code 2 in place of an
/// abort.
pub struct EndWhenShort;

// SAFETY: all that it hands out and takes back is the system allocator's own; it only looks whether a pointer is null.
unsafe impl GlobalAlloc for EndWhenShort {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are the same.
        checked(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are the same.
        checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's promises are the same.
        checked(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are the same.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[inline(always)]
fn checked(pointer: *mut u8, bytes: usize) -> *mut u8 {
    if pointer.is_null() {
        end(bytes);
    }
    pointer
}

/// Nothing here allocates.
#[cold]
fn end(bytes: usize) -> ! {
    let mut line = [0_u8; 160];
    let mut rest = &mut line[..];
    // What does not fit is cut off.
    let _ = writeln!(
        rest,
        "error: {bytes} more bytes of memory cannot be had; use something smaller or more memory"
    );
    let unused = rest.len();
    let length = line.len() - unused;
    let _ = std::io::stderr().write_all(&line[..length]);
    leave()
}

/// Without what libraries do at an end: their threads still run, and may wait for memory too.
#[cfg(target_os = "linux")]
fn leave() -> ! {
    // SAFETY: it ends the process and returns nowhere.
    unsafe { libc::_exit(2) }
}

#[cfg(not(target_os = "linux"))]
fn leave() -> ! {
    std::process::exit(2)
}
