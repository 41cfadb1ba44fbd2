//! The sharpness of a film's composite.

use super::{NoEdges, PointSpread, VirtualLight, gpu, measure, sharpen, variance_gain};
use crate::film::Picture;
use crate::gpu::GpuError;
use crate::stages::GpuStages;
use crate::stages::finish::{Shot, Stage};

pub(in crate::stages) const STAGE: Stage = Stage {
    name: "sharpness",
    declared: &[&super::SHARED, &gpu::SHARED],
    wants: |shot| shot.scene.stages.sharpness.is_some(),
    run,
};

fn run(shot: &mut Shot, gpu: Option<&GpuStages>) -> Result<(), GpuError> {
    let Some(spread) = wanted(shot) else {
        return Ok(());
    };
    let filter = |picture: &mut Picture, light: &VirtualLight| match gpu {
        Some(gpu) => gpu.sharpen(picture, light, &spread),
        None => {
            sharpen(picture, light, &spread);
            Ok(())
        }
    };
    let mask = shot.mask().into_owned();
    let ratio = shot.ratio();
    let mut light = VirtualLight {
        photo: (shot.scene.photo.as_ref()).map(|photo| photo.linear.as_slice()),
        mask: &mask,
        ratio: ratio.as_deref(),
    };
    let mut picture = shot.picture.clone();
    filter(&mut picture, &light)?;
    if shot.scene.stages.noise.is_some() {
        // The mask is filtered as a white thing over black.
        let mut white = Picture {
            linear: mask.iter().map(|m| [*m; 3]).collect(),
            ..shot.picture
        };
        (light.photo, light.ratio) = (None, None);
        filter(&mut white, &light)?;
        let shares = white
            .linear
            .iter()
            .map(|[_, green, _]| green.clamp(0.0, 1.0));
        shot.changed_mask = Some(shares.collect());
        shot.estimate_gain *= variance_gain(&spread);
    }
    shot.picture = picture;
    Ok(())
}

/// What the scene gives, or what its photograph shows; None, and a note, where that shows nothing.
fn wanted(shot: &mut Shot) -> Option<PointSpread> {
    let settings = shot.scene.stages.sharpness?;
    if settings.given.is_some() {
        return settings.given;
    }
    let measured = match &shot.scene.photo {
        Some(photo) => measure(&photo.linear, (photo.width, photo.height)),
        None => Err(NoEdges::Unphotographed),
    };
    match measured {
        Ok(measured) => Some(measured.spread),
        Err(problem) => {
            shot.notes.push(format!("[sharpness] is off: {problem}"));
            None
        }
    }
}
