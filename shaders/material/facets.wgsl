// Light that facets of a rough surface send to each other. Rust twin: src/material/facets.rs.

import package::gpu::buffers::facet_tables;

fn table_entry(first: u32, row: u32, column: u32) -> f32 {
    return facet_tables[first + row * TABLE_SIDE + column];
}

fn kept_by_facets(first: u32, alpha: f32, cos: f32) -> f32 {
    let last = f32(TABLE_SIDE - 1u);
    let y = sqrt(alpha) * last;
    let x = sqrt(cos) * last;
    let row = min(u32(y), TABLE_SIDE - 2u);
    let column = min(u32(x), TABLE_SIDE - 2u);
    let fy = y - f32(row);
    let fx = x - f32(column);
    let c00 = table_entry(first, row, column);
    let c10 = table_entry(first, row, column + 1u);
    let c01 = table_entry(first, row + 1u, column);
    let c11 = table_entry(first, row + 1u, column + 1u);
    let top = c00 + (c10 - c00) * fx;
    let bottom = c01 + (c11 - c01) * fx;
    return top + (bottom - top) * fy;
}
