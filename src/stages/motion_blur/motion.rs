//! How objects moved in the picture since the frame before.

/// How an object moved in the picture since the frame before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectBlur {
    /// Index of the scene's object.
    pub object: u32,
    /// Of its centre, pixels.
    pub blur_px: [f32; 2],
    /// Of its centre along the view axis, metres.
    pub depth_m: f64,
}

/// What the copies need to know that the film does not.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureMotion {
    /// By pixel: index of the object that is seen through its centre, or NONE.
    pub objects: Vec<u32>,
    pub blurs: Vec<ObjectBlur>,
}
