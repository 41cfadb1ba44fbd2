//! Host side of `shaders/stages/cartoon/gpu.wgsl`.

use bytemuck::{Pod, Zeroable};

use super::{Cartoon, CartoonSettings, CartoonStyle, EdgeResponses, FlowSettings, flow_weights};
use crate::gpu::GpuError;
use crate::shared::shared;
use crate::stages::{EncodedImage, GpuStages};

shared! {
    #[derive(Clone, Copy, Pod, Zeroable)]
    struct CartoonParams {
        width: u32,
        height: u32,
        small_width: u32,
        small_height: u32,
        /// -1 / (2 sigma_p^2).
        factor: f32,
        alpha: f32,
        beta: f32,
        s0: f32,
        s1: f32,
        a0: f32,
        a1: f32,
        /// 1: `lines` hold the silhouettes.
        flow: u32,
    }

    #[derive(Clone, Copy, Pod, Zeroable)]
    struct FlowParams {
        /// Weights of each half Gaussian stand in `weights`, one after the other: tensor, inner, outer, line.
        tensor_count: u32,
        inner_count: u32,
        outer_count: u32,
        line_count: u32,
        tau: f32,
        t0: f32,
        t1: f32,
        pad: u32,
    }
}

impl GpuStages {
    /// Twin of [`crate::stages::cartoon::cartoon`].
    ///
    /// # Errors
    /// The picture does not fit the device, or the device was lost.
    pub fn cartoon(
        &self,
        image: &EncodedImage,
        settings: &CartoonSettings,
        with_edges: bool,
    ) -> Result<Cartoon, GpuError> {
        let size = (image.width, image.height);
        let small = (
            image.width.min(settings.shrunk_width),
            image.height.min(settings.shrunk_height),
        );
        let count = image.rgb.len();
        let params = self.uniform(&CartoonParams {
            width: size.0,
            height: size.1,
            small_width: small.0,
            small_height: small.1,
            factor: -0.5 / (settings.sigma_p * settings.sigma_p),
            alpha: settings.alpha,
            beta: settings.beta,
            s0: settings.s0,
            s1: settings.s1,
            a0: settings.a0,
            a1: settings.a1,
            flow: u32::from(settings.style == CartoonStyle::Flow),
        });
        let clamped = image.clone().clamped();
        let pixels = self.array("picture", clamped.rgb.as_flattened())?;
        let small_words = 4 * small.0 as usize * small.1 as usize;
        let mut simplified = self.room("simplified picture", small_words)?;
        let mut next = self.room("simplified picture", small_words)?;
        let result = self.room("cartoon", 6 * count)?;
        let mut encoder = self.encoder();
        let passes = ["stage_shrink"]
            .into_iter()
            .chain((0..settings.iterations).map(|_| "stage_filter"))
            .chain(["stage_respond"]);
        for pass in passes {
            let buffers = [
                ("params", &params),
                ("image", &pixels),
                ("simplified", &simplified),
                ("next", &next),
            ];
            self.dispatch(&mut encoder, (SHARED.path(), pass), &buffers, small)?;
            std::mem::swap(&mut simplified, &mut next);
        }
        let lines = match settings.style {
            CartoonStyle::Photometric => self.room("lines", 0)?,
            CartoonStyle::Flow => {
                self.flow_lines(&mut encoder, &params, &pixels, size, &settings.flow)?
            }
        };
        let buffers = [
            ("params", &params),
            ("image", &pixels),
            ("simplified", &simplified),
            ("lines", &lines),
            ("result", &result),
        ];
        self.dispatch(
            &mut encoder,
            (SHARED.path(), "stage_compose"),
            &buffers,
            size,
        )?;
        let words = if with_edges { 6 * count } else { 3 * count };
        let words = self.finish(encoder, &result, words)?;
        let (rgb, planes) = words.split_at(3 * count);
        let plane = |index: usize| planes[index * count..][..count].to_vec();
        Ok(Cartoon {
            image: EncodedImage {
                width: size.0,
                height: size.1,
                rgb: rgb.as_chunks::<3>().0.to_vec(),
            },
            edges: with_edges.then(|| EdgeResponses {
                width: size.0,
                height: size.1,
                simplified: plane(0),
                original: plane(1),
                silhouette: plane(2),
            }),
        })
    }

    fn flow_lines(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        params: &wgpu::Buffer,
        pixels: &wgpu::Buffer,
        size: (u32, u32),
        settings: &FlowSettings,
    ) -> Result<wgpu::Buffer, GpuError> {
        let count = size.0 as usize * size.1 as usize;
        let gaussians = flow_weights(settings);
        let [tensor_count, inner_count, outer_count, line_count] =
            [0, 1, 2, 3].map(|i| gaussians[i].len() as u32);
        let flow = self.uniform(&FlowParams {
            tensor_count,
            inner_count,
            outer_count,
            line_count,
            tau: settings.tau,
            t0: settings.t0,
            t1: settings.t1,
            pad: 0,
        });
        let weights = self.array("weights", &gaussians.concat())?;
        let lines = self.room("lines", count)?;
        let luma = self.room("brightness", count)?;
        let mut field = self.room("contours", 4 * count)?;
        let mut next = self.room("contours", 4 * count)?;
        for pass in [
            "stage_tensor",
            "stage_blur_rows",
            "stage_blur_columns",
            "stage_across",
            "stage_along",
        ] {
            let buffers = [
                ("params", params),
                ("image", pixels),
                ("flow", &flow),
                ("weights", &weights),
                ("field", &field),
                ("next_field", &next),
                ("lines_out", &lines),
                ("luma", &luma),
            ];
            self.dispatch(encoder, (SHARED.path(), pass), &buffers, size)?;
            std::mem::swap(&mut field, &mut next);
        }
        Ok(lines)
    }
}
