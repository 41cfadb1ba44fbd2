//! What a ray found.

/// The nearest accepted triangle; the point is (1-u-v)*v0 + u*v1 + v*v2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, metres for unit directions; infinity on a miss.
    pub t: f32,
    pub u: f32,
    pub v: f32,
    /// Global triangle id; `packed::NONE` on a miss.
    pub triangle: u32,
}
