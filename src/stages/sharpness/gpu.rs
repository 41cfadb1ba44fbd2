//! Host side of `shaders/stages/sharpness/gpu.wgsl`.

use bytemuck::{Pod, Zeroable};

use super::{PointSpread, VirtualLight, reach};
use crate::film::Picture;
use crate::gpu::GpuError;
use crate::shared::shared;
use crate::stages::GpuStages;

shared! {
    #[derive(Clone, Copy, Pod, Zeroable)]
    struct SharpnessParams {
        sigma_px: [f32; 4],
        corner_sigma_px: [f32; 4],
        lateral_px: [f32; 4],
        width: u32,
        height: u32,
        reach: u32,
        sharpening: f32,
        radius_px: f32,
        pad_0: u32,
        pad_1: u32,
        pad_2: u32,
    }
}

impl GpuStages {
    /// Twin of [`sharpen`](super::sharpen).
    ///
    /// # Errors
    /// The picture does not fit the device, or the device was lost; the picture is then unchanged.
    pub fn sharpen(
        &self,
        picture: &mut Picture,
        light: &VirtualLight,
        spread: &PointSpread,
    ) -> Result<(), GpuError> {
        let of_channels = |[red, green, blue]: [f32; 3]| [red, green, blue, 0.0];
        let params = self.uniform(&SharpnessParams {
            sigma_px: of_channels(spread.sigma_px),
            corner_sigma_px: of_channels(spread.corner_sigma_px),
            lateral_px: of_channels([spread.lateral_px[0], 0.0, spread.lateral_px[1]]),
            width: picture.width,
            height: picture.height,
            reach: reach(spread),
            sharpening: spread.sharpening,
            radius_px: spread.sharpening_radius_px,
            pad_0: 0,
            pad_1: 0,
            pad_2: 0,
        });
        let planes = self.array("virtual light", light.planes(picture).as_flattened())?;
        let count = 3 * picture.linear.len();
        let photo = match light.photo {
            Some(photo) => self.array("photograph", photo.as_flattened())?,
            None => self.array("photograph", &vec![0.0; count])?,
        };
        let result = self.room("picture", count)?;
        let mut encoder = self.encoder();
        self.dispatch(
            &mut encoder,
            (SHARED.path(), "stage_sharpness"),
            &[
                ("params", &params),
                ("photo", &photo),
                ("planes", &planes),
                ("picture", &result),
            ],
            (picture.width, picture.height),
        )?;
        let words = self.finish(encoder, &result, count)?;
        picture.linear = words.as_chunks::<3>().0.to_vec();
        Ok(())
    }
}
