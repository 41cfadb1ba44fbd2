//! Host side of `shaders/stages/motion_blur/gpu.wgsl`.

use bytemuck::{Pod, Zeroable};

use super::Copies;
use crate::gpu::GpuError;
use crate::shared::shared;
use crate::stages::GpuStages;

shared! {
    #[derive(Clone, Copy, Pod, Zeroable)]
    struct CopiesParams {
        width: u32,
        height: u32,
        count: u32,
        opacity: f32,
        start: [f32; 2],
        step: [f32; 2],
        centre_opacity: f32,
        pad_0: u32,
        pad_1: u32,
        pad_2: u32,
    }
}

impl GpuStages {
    /// Twin of [`crate::stages::copies::draw_copies`], for several layers in their order.
    ///
    /// # Errors
    /// The picture does not fit the device, or the device was lost; the canvas is then unchanged.
    pub fn draw_copies(
        &self,
        canvas: &mut [[f32; 4]],
        (width, height): (u32, u32),
        layers: &[(&[[f32; 4]], Copies)],
    ) -> Result<(), GpuError> {
        let result = self.array("picture", canvas.as_flattened())?;
        let mut encoder = self.encoder();
        for (layer, copies) in layers {
            let params = self.uniform(&CopiesParams {
                width,
                height,
                count: copies.count,
                opacity: copies.opacity,
                start: copies.start,
                step: copies.step,
                centre_opacity: copies.centre_opacity,
                pad_0: 0,
                pad_1: 0,
                pad_2: 0,
            });
            let layer = self.array("layer", layer.as_flattened())?;
            self.dispatch(
                &mut encoder,
                (SHARED.path(), "stage_copies"),
                &[("params", &params), ("layer", &layer), ("canvas", &result)],
                (width, height),
            )?;
        }
        let words = self.finish(encoder, &result, 4 * canvas.len())?;
        canvas.copy_from_slice(words.as_chunks::<4>().0);
        Ok(())
    }
}
