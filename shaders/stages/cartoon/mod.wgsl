// Twin of src/stages/cartoon/mod.rs.

// Where a pixel of the full picture lies among the shrunk one's.
fn tap(index: u32, large: u32, small: u32) -> f32 {
    let scale = f32(small) / f32(large);
    return clamp((f32(index) + 0.5) * scale - 0.5, 0.0, f32(small - 1u));
}
