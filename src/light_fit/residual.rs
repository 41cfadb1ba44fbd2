//! The fit as a picture to look at: four panels.

use super::LightFit;
use super::points::Grid;
use crate::film::Picture;

/// Width of a panel in pixels, about.
const PANEL_PX: usize = 480;
/// Light that the photograph has over that of the fit at which the colour is full.
const FULL: f32 = std::f32::consts::LN_2;
/// Half-width in cells, and step, of the neighbourhood whose median stands for the albedo.
const RADIUS: isize = 12;
const STEP: usize = 3;
/// Difference in ln of chromaticity of what may be the same albedo.
const CHROMATICITY: f32 = 0.15;
const NO_POINT: [f32; 3] = [0.05, 0.05, 0.05];
/// A reflectance that the light's panel shows it by.
const GREY: f32 = 0.35;

/// The photograph and the fitted light on a grey proxy; below them the photograph without that light, and what is left: red where the photograph is
/// brighter than the fit, blue where it is darker, full colour a factor of two.
pub fn picture(fit: &LightFit) -> Picture {
    let grid = &*fit.grid;
    let scale = PANEL_PX.div_ceil(grid.width);
    let left = left_over(fit);
    let light: Vec<f32> = fit.log_light.iter().map(|log| log.exp()).collect();
    let mean_light = light.iter().sum::<f32>() / light.len() as f32;
    let photograph = |cell: usize| grid.shown[cell];
    let of_point = |cell: usize, value: &dyn Fn(usize) -> [f32; 3]| {
        grid.point_of_cell[cell].map_or(NO_POINT, |point| value(point as usize))
    };
    let lit = |cell| of_point(cell, &|point| [GREY * light[point] / mean_light; 3]);
    let unlit = |cell| {
        of_point(cell, &|point| {
            grid.points[point]
                .shown
                .map(|value| value * mean_light / light[point])
        })
    };
    let residual = |cell| of_point(cell, &|point| colour(left[point]));
    let panels: [&dyn Fn(usize) -> [f32; 3]; 4] = [&photograph, &lit, &unlit, &residual];
    let (width, height) = (grid.width * scale, grid.height * scale);
    let linear = (0..4 * width * height)
        .map(|i| {
            let (x, y) = (i % (2 * width), i / (2 * width));
            let cell = y % height / scale * grid.width + x % width / scale;
            panels[y / height * 2 + x / width](cell)
        })
        .collect();
    Picture {
        width: 2 * width as u32,
        height: 2 * height as u32,
        linear,
    }
}

fn colour(left: f32) -> [f32; 3] {
    let fade = 1.0 - (left.abs() / FULL).min(1.0);
    match left > 0.0 {
        true => [1.0, fade, fade],
        false => [fade, fade, 1.0],
    }
}

/// ln of what the photograph shows over the fit: over the median of like colours near by, where the albedo is not known.
fn left_over(fit: &LightFit) -> Vec<f32> {
    let grid = &*fit.grid;
    let over: Vec<f32> = (grid.points.iter().zip(&fit.log_light))
        .map(|(point, light)| point.log_shown() as f32 - light)
        .collect();
    (grid.points.iter().enumerate())
        .map(|(at, point)| match point.albedo {
            Some(_) => over[at],
            None => over[at] - median_around(grid, &over, at),
        })
        .collect()
}

/// Of the point's own kind.
pub fn median_around(grid: &Grid, over: &[f32], at: usize) -> f32 {
    let [column, row] = grid.points[at].cell;
    let own = grid.points[at].chromaticity();
    let mut around = vec![over[at]];
    for dy in (-RADIUS..=RADIUS).step_by(STEP) {
        for dx in (-RADIUS..=RADIUS).step_by(STEP) {
            let x = column.checked_add_signed(dx).filter(|x| *x < grid.width);
            let y = row.checked_add_signed(dy).filter(|y| *y < grid.height);
            let Some((x, y)) = x.zip(y) else { continue };
            let Some(point) = grid.point_of_cell[y * grid.width + x] else {
                continue;
            };
            let other = grid.points[point as usize].chromaticity();
            if (own[0] - other[0]).hypot(own[1] - other[1]) < CHROMATICITY {
                around.push(over[point as usize]);
            }
        }
    }
    let middle = around.len() / 2;
    *around.select_nth_unstable_by(middle, f32::total_cmp).1
}
