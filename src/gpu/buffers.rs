//! The packed scene in storage buffers: bind group 0 of every kernel, as `shaders/packed/bindings.wgsl` declares it.

use bytemuck::Zeroable;

use super::{GpuDevice, GpuError};
use crate::packed::{Frame, Light, Material, PackedScene, PixelInfo, TextureRef, Triangle, Vertex};

/// What an edit has changed in a packed scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Changed {
    /// Camera, lens, sampling, and what the photograph tells of the albedo.
    View,
    /// The virtual world and the lights too.
    Virtual,
    All,
}

/// The arrays of a packed scene, any of them possibly empty; `From` a packed scene: all of them.
#[derive(Clone, Copy)]
pub struct SceneParts<'a> {
    pub frame: Frame,
    pub triangles: &'a [Triangle],
    pub vertices: &'a [Vertex],
    pub materials: &'a [Material],
    pub texture_refs: &'a [TextureRef],
    pub texels: &'a [u32],
    pub lights: &'a [Light],
    pub env_texels: &'a [f32],
    pub env_cdf: &'a [f32],
    pub photo_albedo: &'a [[f32; 4]],
    pub pixels: &'a [PixelInfo],
    /// Both worlds, the real one first.
    pub bvh_nodes: [&'a [[u32; 4]]; 2],
    pub bvh_leaves: [&'a [[f32; 4]]; 2],
}

impl Default for SceneParts<'_> {
    fn default() -> Self {
        Self {
            frame: Frame::zeroed(),
            triangles: &[],
            vertices: &[],
            materials: &[],
            texture_refs: &[],
            texels: &[],
            lights: &[],
            env_texels: &[],
            env_cdf: &[],
            photo_albedo: &[],
            pixels: &[],
            bvh_nodes: [&[], &[]],
            bvh_leaves: [&[], &[]],
        }
    }
}

impl<'a> From<&'a PackedScene> for SceneParts<'a> {
    fn from(scene: &'a PackedScene) -> Self {
        let worlds = [&scene.real_bvh, &scene.virtual_bvh];
        Self {
            frame: scene.frame,
            triangles: &scene.triangles,
            vertices: &scene.vertices,
            materials: &scene.materials,
            texture_refs: &scene.texture_refs,
            texels: &scene.texels,
            lights: &scene.lights,
            env_texels: &scene.env_texels,
            env_cdf: &scene.env_cdf,
            photo_albedo: &scene.photo_albedo,
            pixels: &scene.pixels,
            bvh_nodes: worlds.map(|bvh| bytemuck::cast_slice(bvh.gpu_nodes())),
            bvh_leaves: worlds.map(|bvh| bvh.gpu_leaves()),
        }
    }
}

/// A scene on the device.
pub struct SceneBuffers {
    /// By binding number.
    buffers: Vec<wgpu::Buffer>,
}

impl SceneBuffers {
    /// Uploads `parts`, of which the frame gets its GPU traversal bases.
    ///
    /// # Errors
    /// [`GpuError::Limit`] for an array that the adapter cannot bind or hold.
    pub fn from_parts(gpu: &GpuDevice, parts: &SceneParts<'_>) -> Result<Self, GpuError> {
        let arrays = arrays(parts).map(|(what, _, bytes)| (what, bytes));
        for (what, [first, second]) in &arrays {
            check_size(gpu, what, (first.len() + second.len()) as u64)?;
        }
        let made = gpu.catching(|| {
            let mut buffers = vec![gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("frame"),
                size: size_of::<Frame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })];
            for (what, [first, second]) in &arrays {
                buffers.push(storage(gpu, what, first, second));
            }
            buffers
        });
        let buffers = made.map_err(|error| out_of_memory(gpu, &arrays, &error))?;
        let scene = Self { buffers };
        scene.write_frame(gpu, &with_bases(parts));
        Ok(scene)
    }

    /// Sends what has changed, where the buffers have room for it; false, and nothing is sent, where they have not.
    pub fn update(&self, gpu: &GpuDevice, parts: &SceneParts<'_>, changed: Changed) -> bool {
        let arrays = arrays(parts);
        let fits = |(buffer, (_, _, [first, second])): (&wgpu::Buffer, &(_, _, [&[u8]; 2]))| {
            (first.len() + second.len()) as u64 <= buffer.size()
        };
        if changed == Changed::All || !self.buffers[1..].iter().zip(&arrays).all(fits) {
            return false;
        }
        for (buffer, (_, of, [first, second])) in self.buffers[1..].iter().zip(&arrays) {
            if *of == Changed::View || *of == changed {
                gpu.queue.write_buffer(buffer, 0, first);
                gpu.queue.write_buffer(buffer, first.len() as u64, second);
            }
        }
        self.write_frame(gpu, &with_bases(parts));
        true
    }

    /// Replaces the frame by that of `parts`, whose arrays are those that are here.
    pub fn set_frame(&self, gpu: &GpuDevice, parts: &SceneParts<'_>) {
        self.write_frame(gpu, &with_bases(parts));
    }

    /// Replaces camera, lens and sampling; the arrays stay.
    fn write_frame(&self, gpu: &GpuDevice, frame: &Frame) {
        gpu.queue
            .write_buffer(&self.buffers[0], 0, bytemuck::bytes_of(frame));
    }

    /// The buffer of a binding of group 0.
    pub fn get(&self, binding: u32) -> Option<&wgpu::Buffer> {
        self.buffers.get(binding as usize)
    }
}

/// Each array by binding, with the smallest edit that changes it.
fn arrays<'a>(parts: &SceneParts<'a>) -> [(&'static str, Changed, [&'a [u8]; 2]); 12] {
    let [real_nodes, virtual_nodes] = parts.bvh_nodes.map(bytemuck::cast_slice);
    let [real_leaves, virtual_leaves] = parts.bvh_leaves.map(bytemuck::cast_slice);
    use Changed::{All, View, Virtual};
    [
        ("triangles", Virtual, one(parts.triangles)),
        ("vertices", Virtual, one(parts.vertices)),
        ("materials", Virtual, one(parts.materials)),
        ("textures", All, one(parts.texture_refs)),
        ("texels", All, one(parts.texels)),
        ("lights", Virtual, one(parts.lights)),
        ("environment map", All, one(parts.env_texels)),
        ("environment table", All, one(parts.env_cdf)),
        ("albedo of the photograph", View, one(parts.photo_albedo)),
        ("pixels", View, one(parts.pixels)),
        ("BVH nodes", Virtual, [real_nodes, virtual_nodes]),
        ("BVH triangles", Virtual, [real_leaves, virtual_leaves]),
    ]
}

/// Nodes are five vec4 each, leaves three a triangle.
fn with_bases(parts: &SceneParts<'_>) -> Frame {
    Frame {
        virtual_node_base: (parts.bvh_nodes[0].len() / 5) as u32,
        virtual_leaf_base: (parts.bvh_leaves[0].len() / 3) as u32,
        ..parts.frame
    }
}

fn one<T: bytemuck::NoUninit>(records: &[T]) -> [&[u8]; 2] {
    [bytemuck::cast_slice(records), &[]]
}

fn storage(gpu: &GpuDevice, what: &str, first: &[u8], second: &[u8]) -> wgpu::Buffer {
    // An empty array still needs room for one element of the largest record.
    let size = (first.len() + second.len()).max(size_of::<Material>().max(256)) as u64;
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(what),
        size,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&buffer, 0, first);
    gpu.queue.write_buffer(&buffer, first.len() as u64, second);
    buffer
}

/// # Errors
/// [`GpuError::Limit`] if one binding of `bytes` is more than the adapter allows.
pub(super) fn check_size(gpu: &GpuDevice, what: &str, bytes: u64) -> Result<(), GpuError> {
    let allowed = gpu
        .limits
        .max_storage_buffer_binding_size
        .min(gpu.limits.max_buffer_size);
    if bytes <= allowed {
        return Ok(());
    }
    Err(GpuError::Limit {
        what: what.to_owned(),
        needed: mebibytes(bytes),
        available: mebibytes(allowed),
        adapter: gpu.name(),
        advice: "render with --backend cpu, or simplify the meshes and shrink the textures",
    })
}

fn out_of_memory(gpu: &GpuDevice, arrays: &[(&str, [&[u8]; 2])], error: &wgpu::Error) -> GpuError {
    let total: usize = arrays.iter().map(|(_, [a, b])| a.len() + b.len()).sum();
    GpuError::Limit {
        what: "the scene".to_owned(),
        needed: mebibytes(total as u64),
        available: format!("memory ({error})"),
        adapter: gpu.name(),
        advice: "render with --backend cpu, or simplify the meshes and shrink the textures",
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::AdapterChoice;

    #[test]
    fn a_scene_beyond_the_limits_is_refused_with_what_to_do() {
        if crate::gpu::harness::test_device().is_none() {
            return;
        }
        let mut gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
        let vertices = vec![Vertex::zeroed(); 20_000];
        let parts = SceneParts {
            vertices: &vertices,
            ..SceneParts::default()
        };
        assert!(SceneBuffers::from_parts(&gpu, &parts).is_ok());
        gpu.limits.max_storage_buffer_binding_size = 1 << 20;
        let error = SceneBuffers::from_parts(&gpu, &parts)
            .err()
            .expect("does not fit")
            .to_string();
        for part in ["vertices", "1.5 MiB", "1.0 MiB", "--backend cpu"] {
            assert!(error.contains(part), "{error}");
        }
    }
}
