//! What follows from the rows of the environment's map alone, for the CPU; a shader works it out anew.

/// The upper edge of a row of cells. Zenith angles are in units of pi, as v is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowEdge {
    pub v: f32,
    /// Squared sine and cosine of half the angle from the zenith: each is precise at its own pole.
    pub sin2: f32,
    pub cos2: f32,
    /// Half the difference of the cosines of the row's edges.
    pub half_height: f32,
}
