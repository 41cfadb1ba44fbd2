//! The copies of a film's objects: which pixel shows which object, what is behind, and what the copies make of it.

use super::{Copies, CopyLayer, MotionBlurMethod, PictureMotion, draw_copies};
use crate::film::{Film, Means, background_pixel};
use crate::gpu::GpuError;
use crate::packed::NONE;
use crate::stages::GpuStages;
use crate::stages::finish::{Shot, Stage};

pub(in crate::stages) const STAGE: Stage = Stage {
    name: "motion_blur",
    declared: &[&super::gpu::SHARED],
    wants: |shot| {
        let settings = shot.scene.stages.motion_blur;
        shot.motion.is_some() && settings.is_some_and(|s| s.method == MotionBlurMethod::Copies)
    },
    run,
};

/// Where nothing moves enough the shot stays as it is.
fn run(shot: &mut Shot, gpu: Option<&GpuStages>) -> Result<(), GpuError> {
    let settings = shot.scene.stages.motion_blur.unwrap_or_default();
    let Some(motion) = shot.motion else {
        return Ok(());
    };
    let copies_of = |blur_px| Copies::of(blur_px, &settings);
    if (motion.blurs.iter()).all(|blur| copies_of(blur.blur_px).is_none()) {
        return Ok(());
    }
    let film = shot.film;
    let layers = layers(film, motion);
    let drawn: Vec<(&[[f32; 4]], Copies)> = layers
        .iter()
        .map(|layer| {
            let copies = copies_of(layer.blur_px).unwrap_or(Copies::ONE);
            (layer.pixels.as_slice(), copies)
        })
        .collect();
    let photo = shot.scene.photo.as_ref();
    let mut canvas: Vec<[f32; 4]> = (0..film.pixels.len())
        .map(|pixel| {
            let ic = photo.map_or([0.0; 3], |photo| photo.linear[pixel]);
            let [r, g, b] = background_pixel(&film.sums(pixel), ic, shot.scene.settings.composite);
            [r, g, b, 0.0]
        })
        .collect();
    let size = (film.width, film.height);
    match gpu {
        Some(gpu) => gpu.draw_copies(&mut canvas, size, &drawn)?,
        None => {
            for (layer, copies) in &drawn {
                draw_copies(&mut canvas, size, layer, copies);
            }
        }
    }
    for (value, [r, g, b, covered]) in shot.picture.linear.iter_mut().zip(&canvas) {
        // Where no copy reaches, the composite stays to the bit.
        if *covered > 0.0 {
            *value = [*r, *g, *b];
        }
    }
    shot.changed_mask = Some(canvas.iter().map(|pixel| pixel[3]).collect());
    // Copies average the estimate's own noise away.
    shot.estimate_gain = 0.0;
    Ok(())
}

/// What is drawn, the farthest first.
fn layers(film: &Film, motion: &PictureMotion) -> Vec<CopyLayer> {
    let owners = spread(&motion.objects, film);
    let mut blurs = motion.blurs.clone();
    blurs.sort_by(|a, b| b.depth_m.total_cmp(&a.depth_m));
    // What no known object owns is drawn first, as it is.
    let still = (NONE, [0.0; 2]);
    let order = std::iter::once(still).chain(blurs.iter().map(|blur| (blur.object, blur.blur_px)));
    order
        .map(|(object, blur_px)| CopyLayer {
            pixels: layer_of(film, &owners, object),
            blur_px,
        })
        .filter(|layer| layer.pixels.iter().any(|pixel| pixel[3] > 0.0))
        .collect()
}

/// Object of each pixel that shows something virtual: where its centre shows none, that of the nearest pixels that do.
fn spread(objects: &[u32], film: &Film) -> Vec<u32> {
    let (width, height) = (film.width as usize, film.height as usize);
    let mut owners = objects.to_vec();
    let is_virtual = |pixel: usize| film.pixels[pixel].m > 0;
    let mut open: Vec<usize> = (0..owners.len())
        .filter(|&pixel| is_virtual(pixel) && owners[pixel] == NONE)
        .collect();
    loop {
        let found: Vec<(usize, u32)> = open
            .iter()
            .filter_map(|&pixel| {
                let (x, y) = (pixel % width, pixel / width);
                let rows = y.saturating_sub(1)..(y + 2).min(height);
                let near = rows.flat_map(|row| {
                    let columns = x.saturating_sub(1)..(x + 2).min(width);
                    columns.map(move |column| row * width + column)
                });
                let owner = near.map(|near| owners[near]).find(|owner| *owner != NONE)?;
                Some((pixel, owner))
            })
            .collect();
        if found.is_empty() {
            return owners;
        }
        for (pixel, owner) in found {
            owners[pixel] = owner;
        }
        open.retain(|pixel| owners[*pixel] == NONE);
    }
}

fn layer_of(film: &Film, owners: &[u32], object: u32) -> Vec<[f32; 4]> {
    let pixels = owners.iter().enumerate();
    pixels
        .map(|(pixel, owner)| {
            let sums = film.sums(pixel);
            if sums.m == 0 || *owner != object {
                return [0.0; 4];
            }
            let means = Means::of(&sums);
            let colour = means.m_im.as_vec3();
            colour.extend(means.mask as f32).to_array()
        })
        .collect()
}
