//! Asks memory for what shading reads while other samples are being traced. A triangle and then its vertices, somewhere in the scene, are two
//! cache misses one after the other, which take longer than what is done with them. Results do not depend on it.

use super::state::PathState;
use crate::packed::{NONE, PackedScene};

/// Asks for the triangles that the sample's ray has met.
#[inline]
pub fn fetch_triangles(scene: &PackedScene, st: &PathState) {
    for hit in [st.hits.in_real, st.hits.in_virtual] {
        if hit.triangle != NONE {
            fetch(&scene.triangles, hit.triangle);
        }
    }
}

/// Asks for the vertices of the triangles that the sample's ray has met.
#[inline]
pub fn fetch_vertices(scene: &PackedScene, st: &PathState) {
    for hit in [st.hits.in_real, st.hits.in_virtual] {
        // What answers a shadow ray is no triangle.
        let Some(triangle) = scene.triangles.get(hit.triangle as usize) else {
            continue;
        };
        for vertex in triangle.vertices {
            fetch(&scene.vertices, vertex);
        }
    }
}

/// Bytes of a record that are read of most triangles and vertices.
const READ_BYTES: usize = 32;

/// Asks for the beginning of an item.
#[inline]
fn fetch<T>(items: &[T], index: u32) {
    let start = items.as_ptr().wrapping_add(index as usize).cast::<i8>();
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint, which faults for no address.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(start);
            _mm_prefetch::<_MM_HINT_T0>(start.wrapping_add(READ_BYTES - 1));
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = start;
}
