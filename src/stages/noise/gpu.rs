//! Host side of `shaders/stages/noise/gpu.wgsl`.

use bytemuck::{Pod, Zeroable};

use super::{LAGS, NoiseInput, NoiseSource, NoiseStage, sigma_table};
use crate::film::Picture;
use crate::gpu::GpuError;
use crate::shared::shared;
use crate::stages::GpuStages;

shared! {
    #[derive(Clone, Copy, Pod, Zeroable)]
    struct NoiseParams {
        width: u32,
        height: u32,
        bins: u32,
        seed: u32,
        frame: u32,
        /// Of the kernels, pixels; 0 where the noise is white.
        reach: u32,
        has_photo: u32,
        texture_size: u32,
        scale: f32,
        magnification: f32,
        rotation_sin: f32,
        rotation_cos: f32,
        offset_x: f32,
        offset_y: f32,
        pad0: u32,
        pad1: u32,
    }
}

impl GpuStages {
    /// Twin of [`NoiseStage::apply`].
    ///
    /// # Errors
    /// The picture does not fit the device, or the device was lost; the picture is then unchanged.
    pub fn noise(
        &self,
        stage: &NoiseStage,
        picture: &mut Picture,
        input: &NoiseInput,
        frame: u32,
    ) -> Result<(), GpuError> {
        let settings = stage.settings();
        let frame = frame / settings.update_delay_frames.max(1);
        let size = (picture.width, picture.height);
        let count = picture.linear.len();
        let mut params = NoiseParams {
            width: picture.width,
            height: picture.height,
            bins: settings.profile.bins.len() as u32,
            frame,
            has_photo: u32::from(input.photo.is_some()),
            scale: settings.scale,
            magnification: settings.magnification,
            ..NoiseParams::zeroed()
        };
        let mask = match input.mask {
            Some(mask) => self.array("mask", mask)?,
            None => self.array("mask", &vec![1.0; count])?,
        };
        let values = self.array("picture", picture.linear.as_flattened())?;
        let mut encoder = self.encoder();
        match stage.source() {
            NoiseSource::Missing(field) => {
                params.seed = field.seed;
                params.reach = if field.kernels.is_empty() {
                    0
                } else {
                    LAGS as u32
                };
                let mut weights = sigma_table(&settings.profile).into_flattened();
                weights.extend(field.mix.as_flattened());
                weights.extend(field.kernels.as_flattened().as_flattened());
                let weights = self.array("weights", &weights)?;
                let plane = |what, plane: Option<&[[f32; 3]]>, default: f32| match plane {
                    Some(plane) => self.array(what, plane.as_flattened()),
                    None => self.array(what, &vec![default; 3 * count]),
                };
                let photo = plane("photograph", input.photo, 0.0)?;
                let ratio = plane("ratio", input.ratio, 1.0)?;
                let variance = plane("variance", input.variance, 0.0)?;
                let wide = (size.0 + 2 * params.reach, size.1 + 2 * params.reach);
                let white = self.room("noise", 4 * wide.0 as usize * wide.1 as usize)?;
                let params = self.uniform(&params);
                let buffers = [
                    ("params", &params),
                    ("picture", &values),
                    ("photo", &photo),
                    ("mask", &mask),
                    ("ratio", &ratio),
                    ("variance", &variance),
                    ("weights", &weights),
                    ("white", &white),
                ];
                self.dispatch(&mut encoder, (SHARED.path(), "stage_white"), &buffers, wide)?;
                self.dispatch(
                    &mut encoder,
                    (SHARED.path(), "stage_missing"),
                    &buffers,
                    size,
                )?;
            }
            NoiseSource::Textures(textures) => {
                let placement = textures.placement(frame);
                params.texture_size = textures.size;
                params.rotation_sin = placement.sin;
                params.rotation_cos = placement.cos;
                [params.offset_x, params.offset_y] = placement.offset;
                let texels: Vec<f32> = textures.bins.iter().flatten().flatten().copied().collect();
                let texels = self.array("noise textures", &texels)?;
                let params = self.uniform(&params);
                let buffers = [
                    ("params", &params),
                    ("picture", &values),
                    ("mask", &mask),
                    ("textures", &texels),
                ];
                self.dispatch(
                    &mut encoder,
                    (SHARED.path(), "stage_textures"),
                    &buffers,
                    size,
                )?;
            }
        }
        let words = self.finish(encoder, &values, 3 * count)?;
        picture.linear = words.as_chunks::<3>().0.to_vec();
        Ok(())
    }
}
