//! Which pixels share second vertices: the tiles of a picture and their members. WGSL twin: `shaders/cpu/sharing_tile.wgsl`.

use crate::shared::shared;

shared! {
    /// Pixels of a tile in either direction, and from one to the next.
    const TILE_SIDE: u32 = 4;
    pub const TILE_STRIDE: u32 = 2;
    /// Pixels along a block's side, which hold the tiles.
    pub const BLOCK_SIDE: u32 = TILE_SIDE * TILE_STRIDE;
    /// Members of a tile.
    pub const MEMBERS: u32 = TILE_SIDE * TILE_SIDE;
    /// Points found by the cones are dear to share, and are shared within quarters of a tile.
    const QUARTER_SIDE: u32 = TILE_SIDE / 2;
    /// Members of a quarter, whose numbers follow one another.
    pub const QUARTER: u32 = QUARTER_SIDE * QUARTER_SIDE;
}

/// Number of a pixel's tile.
pub fn tile_of(width: u32, pixel: u32) -> u32 {
    let (x, y) = (pixel % width, pixel / width);
    let blocks = width.div_ceil(BLOCK_SIDE);
    let block = y / BLOCK_SIDE * blocks + x / BLOCK_SIDE;
    (block * TILE_STRIDE + y % TILE_STRIDE) * TILE_STRIDE + x % TILE_STRIDE
}

/// Number of a pixel among the members of its tile: quarter by quarter, and row by row in each.
pub fn member_of(width: u32, pixel: u32) -> u32 {
    let column = pixel % width % BLOCK_SIDE / TILE_STRIDE;
    let row = pixel / width % BLOCK_SIDE / TILE_STRIDE;
    let quarter = row / QUARTER_SIDE * 2 + column / QUARTER_SIDE;
    quarter * QUARTER + row % QUARTER_SIDE * QUARTER_SIDE + column % QUARTER_SIDE
}
