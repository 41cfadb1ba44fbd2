// Which pixels share second vertices. Rust twin: src/cpu/sharing_tile.rs.

fn tile_of(width: u32, pixel: u32) -> u32 {
    let x = pixel % width;
    let y = pixel / width;
    let blocks = (width + BLOCK_SIDE - 1u) / BLOCK_SIDE;
    let block = y / BLOCK_SIDE * blocks + x / BLOCK_SIDE;
    return (block * TILE_STRIDE + y % TILE_STRIDE) * TILE_STRIDE + x % TILE_STRIDE;
}

fn member_of(width: u32, pixel: u32) -> u32 {
    let column = pixel % width % BLOCK_SIDE / TILE_STRIDE;
    let row = pixel / width % BLOCK_SIDE / TILE_STRIDE;
    let quarter = row / QUARTER_SIDE * 2u + column / QUARTER_SIDE;
    return quarter * QUARTER + row % QUARTER_SIDE * QUARTER_SIDE + column % QUARTER_SIDE;
}
