//! Copies of things that are see-through themselves: drawn over one another they would hide more than one of them does.

use rayon::prelude::*;

/// Pixels to each side within which a thing's largest coverage is looked for.
const REACH_PX: usize = 2;

/// How much of each pixel the thing's shape takes: its coverage over the largest nearby. That of a see-through pane is 1 within its borders.
pub fn shape(coverage: &[f32], (width, height): (u32, u32)) -> Vec<f32> {
    let (width, height) = (width as usize, height as usize);
    let rows = |y: usize| y.saturating_sub(REACH_PX)..(y + REACH_PX + 1).min(height);
    (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            if coverage[pixel] == 0.0 {
                return 0.0;
            }
            let (x, y) = (pixel % width, pixel / width);
            let columns = x.saturating_sub(REACH_PX)..(x + REACH_PX + 1).min(width);
            let largest = rows(y)
                .flat_map(|row| &coverage[row * width..][columns.clone()])
                .fold(0.0f32, |most, c| most.max(*c));
            coverage[pixel] / largest
        })
        .collect()
}

/// The picture of a see-through thing in motion over `photo`. `draw` draws the copies of a layer over black: its fourth channel is what hides the
/// copies below, and is the shape here, so that they share one coverage instead of adding theirs up.
///
/// # Errors
/// That of `draw`.
pub fn draw_see_through<E>(
    photo: &[[f32; 3]],
    layer: &[[f32; 4]],
    shape: &[f32],
    mut draw: impl FnMut(&mut [[f32; 4]], &[[f32; 4]]) -> Result<(), E>,
) -> Result<Vec<[f32; 3]>, E> {
    let mut drawn = |value: fn(&[f32; 4]) -> [f32; 3]| -> Result<Vec<[f32; 4]>, E> {
        let pixels = layer.iter().zip(shape);
        let copy: Vec<[f32; 4]> = pixels
            .map(|(pixel, s)| {
                let [r, g, b] = value(pixel);
                [r, g, b, *s]
            })
            .collect();
        let mut canvas = vec![[0.0; 4]; layer.len()];
        draw(&mut canvas, &copy)?;
        Ok(canvas)
    };
    let light = drawn(|[r, g, b, _]| [*r, *g, *b])?;
    let covered = drawn(|[.., a]| [*a; 3])?;
    let pixels = photo.iter().zip(light.iter().zip(&covered));
    Ok(pixels
        .map(|(photo, (light, covered))| match covered[0] == 0.0 {
            true => std::array::from_fn(|c| photo[c] + light[c]),
            false => std::array::from_fn(|c| (1.0 - covered[0]) * photo[c] + light[c]),
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::motion_blur::{Copies, MotionBlurSettings, draw_copies};

    const SIZE: (u32, u32) = (40, 5);

    /// White, this see-through, from column 10 to 30, with a soft border.
    fn pane(alpha: f32) -> Vec<[f32; 4]> {
        let row = (0..40).map(|x| match x {
            10 | 29 => 0.5 * alpha,
            11..=28 => alpha,
            _ => 0.0,
        });
        let row: Vec<[f32; 4]> = row.map(|a| [a; 4]).collect();
        row.repeat(5)
    }

    fn coverage(layer: &[[f32; 4]]) -> Vec<f32> {
        layer.iter().map(|pixel| pixel[3]).collect()
    }

    fn blurred(alpha: f32) -> Vec<[f32; 3]> {
        let copies = Copies::of([8.0, 0.0], &MotionBlurSettings::default()).unwrap();
        let layer = pane(alpha);
        let shape = shape(&coverage(&layer), SIZE);
        let photo = vec![[0.0; 3]; layer.len()];
        draw_see_through(&photo, &layer, &shape, |canvas, layer| {
            draw_copies(canvas, SIZE, layer, &copies);
            Ok::<(), ()>(())
        })
        .unwrap()
    }

    /// Half of the light of one that hides everything, wherever it is; drawn as the others are it would be more.
    #[test]
    fn a_pane_that_moves_is_as_see_through_as_one_that_rests() {
        let (opaque, half) = (blurred(1.0), blurred(0.5));
        for (opaque, half) in opaque.iter().zip(&half) {
            assert!(
                (half[0] - 0.5 * opaque[0]).abs() < 1e-6,
                "{half:?} {opaque:?}"
            );
        }
        let copies = Copies::of([8.0, 0.0], &MotionBlurSettings::default()).unwrap();
        let mut stacked = vec![[0.0; 4]; pane(0.5).len()];
        draw_copies(&mut stacked, SIZE, &pane(0.5), &copies);
        assert!(stacked[100][0] > 1.2 * half[100][0], "control");
    }

    #[test]
    fn an_opaque_thing_is_its_own_shape() {
        let opaque = coverage(&pane(1.0));
        assert_eq!(shape(&opaque, SIZE), opaque);
        let half = shape(&coverage(&pane(0.5)), SIZE);
        assert_eq!(half, opaque, "soft borders too");
    }
}
