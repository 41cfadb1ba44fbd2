//! Host side of `shaders/stages/antialias/gpu.wgsl`.

use bytemuck::{Pod, Zeroable};

use super::{AntialiasSettings, is_binary};
use crate::film::Picture;
use crate::gpu::GpuError;
use crate::shared::shared;
use crate::stages::GpuStages;

shared! {
    #[derive(Clone, Copy, Pod, Zeroable)]
    struct AntialiasParams {
        width: u32,
        height: u32,
        beta: f32,
        pad: u32,
    }
}

impl GpuStages {
    /// Twin of [`antialias`](super::antialias).
    ///
    /// # Errors
    /// The picture does not fit the device, or the device was lost; the picture is then unchanged.
    pub fn antialias(
        &self,
        picture: &mut Picture,
        mask: &[f32],
        settings: &AntialiasSettings,
    ) -> Result<bool, GpuError> {
        if !is_binary(mask) {
            return Ok(false);
        }
        let params = self.uniform(&AntialiasParams {
            width: picture.width,
            height: picture.height,
            beta: settings.beta,
            pad: 0,
        });
        let values = picture.linear.as_flattened();
        let source = self.array("picture", values)?;
        let result = self.array("picture", values)?;
        let mask = self.array("mask", mask)?;
        let mut encoder = self.encoder();
        self.dispatch(
            &mut encoder,
            (SHARED.path(), "stage_antialias"),
            &[
                ("params", &params),
                ("source", &source),
                ("mask", &mask),
                ("picture", &result),
            ],
            (picture.width, picture.height),
        )?;
        let words = self.finish(encoder, &result, values.len())?;
        picture.linear = words.as_chunks::<3>().0.to_vec();
        Ok(true)
    }
}
