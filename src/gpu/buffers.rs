//! The packed scene in storage buffers: bind group 0 of every kernel, under the names that `shaders/gpu/buffers.wgsl` declares.

use std::ops::Range;

use bytemuck::Zeroable;

use super::kernel::UNIFORM_USAGE;
use super::{GpuDevice, GpuError};
use crate::accel::{Refitted, WorldBvh};
use crate::packed::{
    Frame, Light, Material, Moved, PackedScene, PixelInfo, Resting, TextureRef, Triangle, Vertex,
};

/// What an edit has changed in a packed scene; each includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Changed {
    /// Lens and sampling, and what is planned for them.
    Plan,
    /// The camera's pose, and what the photograph tells of the albedo.
    View,
    /// The photograph.
    Photo,
    /// Where the moving virtual objects are, and the lights.
    Moving,
    /// A virtual object that rests was moved: what [`SceneParts::moved`] says, or all of the virtual world where that says nothing.
    Object,
    /// All of the virtual world.
    Virtual,
    All,
}

/// The arrays of a packed scene, any of them possibly empty; `From` a packed scene: all of them.
#[derive(Clone, Copy)]
pub struct SceneParts<'a> {
    pub frame: Frame,
    /// Those that move are the last.
    pub triangles: &'a [Triangle],
    pub vertices: &'a [Vertex],
    /// How many triangles and vertices rest.
    pub resting: Resting,
    pub materials: &'a [Material],
    pub texture_refs: &'a [TextureRef],
    pub texels: &'a [u32],
    pub lights: &'a [Light],
    pub env_texels: &'a [f32],
    pub env_cdf: &'a [f32],
    pub photo_albedo: &'a [[f32; 4]],
    pub guide: &'a [[f32; 4]],
    pub backdrop: &'a [f32],
    pub facet_tables: &'a [f32],
    pub pixels: &'a [PixelInfo],
    /// Both worlds, the real one first, each as [`WorldBvh::gpu_nodes`].
    pub bvh_nodes: [[&'a [[[u32; 4]; 5]]; 3]; 2],
    /// As [`WorldBvh::gpu_leaves`].
    pub bvh_leaves: [[&'a [[f32; 4]]; 2]; 2],
    /// The records of an object that was moved, and those that its tree's refit changed.
    pub moved: Option<(&'a Moved, &'a Refitted)>,
}

impl Default for SceneParts<'_> {
    fn default() -> Self {
        Self {
            frame: Frame::zeroed(),
            triangles: &[],
            vertices: &[],
            resting: Resting::default(),
            materials: &[],
            texture_refs: &[],
            texels: &[],
            lights: &[],
            env_texels: &[],
            env_cdf: &[],
            photo_albedo: &[],
            guide: &[],
            backdrop: &[],
            facet_tables: &[],
            pixels: &[],
            bvh_nodes: [[&[]; 3]; 2],
            bvh_leaves: [[&[]; 2]; 2],
            moved: None,
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
            resting: scene.resting,
            materials: &scene.materials,
            texture_refs: &scene.texture_refs,
            texels: &scene.texels,
            lights: &scene.lights,
            env_texels: &scene.env_texels,
            env_cdf: &scene.env_cdf,
            photo_albedo: &scene.photo_albedo,
            guide: &scene.guide,
            backdrop: &scene.backdrop,
            facet_tables: &scene.facet_tables,
            pixels: &scene.pixels,
            bvh_nodes: worlds.map(WorldBvh::gpu_nodes),
            bvh_leaves: worlds.map(WorldBvh::gpu_leaves),
            moved: (scene.moved.as_ref()).zip(scene.virtual_bvh.gpu_refitted()),
        }
    }
}

/// A scene on the device.
pub struct SceneBuffers {
    frame: wgpu::Buffer,
    /// In the order of [`arrays`].
    arrays: Vec<(&'static str, wgpu::Buffer)>,
}

impl SceneBuffers {
    /// Uploads `parts`, of which the frame gets its GPU traversal bases.
    ///
    /// # Errors
    /// [`GpuError::Limit`] for an array that the adapter cannot bind or hold.
    pub fn from_parts(gpu: &GpuDevice, parts: &SceneParts<'_>) -> Result<Self, GpuError> {
        let arrays = arrays(parts);
        for array in &arrays {
            check_size(gpu, array.what, array.len())?;
        }
        let made = gpu.catching(|| Self {
            frame: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("frame"),
                size: size_of::<Frame>() as u64,
                usage: UNIFORM_USAGE,
                mapped_at_creation: false,
            }),
            arrays: arrays
                .iter()
                .map(|array| (array.name, storage(gpu, array)))
                .collect(),
        });
        let scene = made.map_err(|error| out_of_memory(gpu, &arrays, &error))?;
        scene.set_frame(gpu, parts);
        Ok(scene)
    }

    /// Sends what has changed; an array that has become too long for its buffer gets another. True where one did: what is bound to the old ones has
    /// to be bound again.
    ///
    /// # Errors
    /// As [`SceneBuffers::from_parts`]; nothing is sent then.
    pub fn update(
        &mut self,
        gpu: &GpuDevice,
        parts: &SceneParts<'_>,
        changed: Changed,
    ) -> Result<bool, GpuError> {
        let arrays = arrays(parts);
        let changed = match (changed, parts.moved) {
            (Changed::Object, None) => Changed::Virtual,
            (changed, _) => changed,
        };
        let is_too_long = |at: &usize| arrays[*at].len() > self.arrays[*at].1.size();
        let too_long: Vec<usize> = (0..arrays.len()).filter(is_too_long).collect();
        if !too_long.is_empty() {
            self.replace(gpu, &arrays, &too_long)?;
        }
        for (at, ((_, buffer), array)) in self.arrays.iter().zip(&arrays).enumerate() {
            if !too_long.contains(&at) {
                array.write(gpu, buffer, changed);
            }
        }
        self.set_frame(gpu, parts);
        Ok(!too_long.is_empty())
    }

    /// Puts those of the arrays into buffers that they fit into.
    fn replace(
        &mut self,
        gpu: &GpuDevice,
        arrays: &[Array<'_>],
        which: &[usize],
    ) -> Result<(), GpuError> {
        for &at in which {
            check_size(gpu, arrays[at].what, arrays[at].len())?;
        }
        let made = gpu.catching(|| -> Vec<wgpu::Buffer> {
            let arrays = which.iter().map(|&at| &arrays[at]);
            arrays.map(|array| storage(gpu, array)).collect()
        });
        let made = made.map_err(|error| out_of_memory(gpu, arrays, &error))?;
        for (&at, buffer) in which.iter().zip(made) {
            self.arrays[at].1 = buffer;
        }
        Ok(())
    }

    /// Replaces the frame (camera, lens and sampling) by that of `parts`, whose arrays are those that are here.
    pub fn set_frame(&self, gpu: &GpuDevice, parts: &SceneParts<'_>) {
        gpu.write(&self.frame, 0, bytemuck::bytes_of(&with_bases(parts)));
    }

    /// The buffer of that name in `shaders/gpu/buffers.wgsl`.
    pub fn get(&self, name: &str) -> Option<&wgpu::Buffer> {
        let mut arrays = self.arrays.iter();
        match name {
            "frame" => Some(&self.frame),
            _ => arrays.find(|(of, _)| *of == name).map(|(_, buffer)| buffer),
        }
    }
}

/// One array of a packed scene, in pieces.
struct Array<'a> {
    /// In the shaders.
    name: &'static str,
    /// In messages.
    what: &'static str,
    pieces: Vec<Piece<'a>>,
}

struct Piece<'a> {
    bytes: &'a [u8],
    /// The smallest edit that changes all of it.
    changed_by: Changed,
    /// Those of its bytes that [`Changed::Object`] changes.
    moved: Vec<Range<usize>>,
}

impl Array<'_> {
    /// Bytes.
    fn len(&self) -> u64 {
        let pieces = self.pieces.iter();
        pieces.map(|piece| piece.bytes.len() as u64).sum()
    }

    /// Sends the pieces that an edit has changed.
    fn write(&self, gpu: &GpuDevice, buffer: &wgpu::Buffer, changed: Changed) {
        let mut offset = 0;
        for piece in &self.pieces {
            if piece.changed_by <= changed {
                gpu.write(buffer, offset, piece.bytes);
            } else if changed == Changed::Object {
                for range in &piece.moved {
                    let at = offset + range.start as u64;
                    gpu.write(buffer, at, &piece.bytes[range.clone()]);
                }
            }
            offset += piece.bytes.len() as u64;
        }
    }
}

fn arrays<'a>(parts: &SceneParts<'a>) -> [Array<'a>; 15] {
    use Changed::{All, Moving, Photo, Plan, View, Virtual};
    let array = |name, what, pieces| Array { name, what, pieces };
    let SceneParts {
        frame: _,
        triangles,
        vertices,
        resting,
        materials,
        texture_refs,
        texels,
        lights,
        env_texels,
        env_cdf,
        photo_albedo,
        guide,
        backdrop,
        facet_tables,
        pixels,
        bvh_nodes: [[real_roots, real_nodes, _], [roots, nodes, moving_nodes]],
        bvh_leaves: [[real_leaves, _], [leaves, moving_leaves]],
        moved,
    } = *parts;
    let (object, refitted) = moved.unzip();
    let triangles = triangles.split_at(resting.triangles);
    let vertices = vertices.split_at(resting.vertices);
    [
        array(
            "triangles",
            "triangles",
            vec![
                in_part(triangles.0, object.map(|o| &o.triangles)),
                piece(Moving, triangles.1),
            ],
        ),
        array(
            "vertices",
            "vertices",
            vec![
                in_part(vertices.0, object.map(|o| &o.vertices)),
                piece(Moving, vertices.1),
            ],
        ),
        array("materials", "materials", vec![piece(Virtual, materials)]),
        array("texture_refs", "textures", vec![piece(All, texture_refs)]),
        array("texels", "texels", vec![piece(All, texels)]),
        array("lights", "lights", vec![piece(Moving, lights)]),
        array(
            "env_texels",
            "environment map",
            vec![piece(All, env_texels)],
        ),
        array("env_cdf", "environment table", vec![piece(All, env_cdf)]),
        array(
            "photo_albedo",
            "albedo of the photograph",
            vec![piece(View, photo_albedo)],
        ),
        array("guide", "guide", vec![piece(Plan, guide)]),
        array("backdrop", "photograph", vec![piece(Photo, backdrop)]),
        array(
            "facet_tables",
            "tables of rough lobes",
            vec![piece(Virtual, facet_tables)],
        ),
        array("pixels", "pixels", vec![piece(Plan, pixels)]),
        array(
            "bvh_nodes",
            "BVH nodes",
            vec![
                piece(All, real_roots),
                piece(All, real_nodes),
                piece(Moving, roots),
                in_part(nodes, refitted.into_iter().flat_map(|r| &r.nodes)),
                piece(Moving, moving_nodes),
            ],
        ),
        array(
            "bvh_leaves",
            "BVH triangles",
            vec![
                piece(All, real_leaves),
                in_part(leaves, refitted.into_iter().flat_map(|r| &r.leaves)),
                piece(Moving, moving_leaves),
            ],
        ),
    ]
}

fn piece<T: bytemuck::NoUninit>(changed_by: Changed, records: &[T]) -> Piece<'_> {
    Piece {
        bytes: bytemuck::cast_slice(records),
        changed_by,
        moved: Vec::new(),
    }
}

/// Of the virtual world, with the records that go with a moved object.
fn in_part<'a, 'b, T: bytemuck::NoUninit>(
    records: &'a [T],
    moved: impl IntoIterator<Item = &'b Range<usize>>,
) -> Piece<'a> {
    let bytes = |range: &Range<usize>| size_of::<T>() * range.start..size_of::<T>() * range.end;
    Piece {
        moved: moved.into_iter().map(bytes).collect(),
        ..piece(Changed::Virtual, records)
    }
}

/// The real world comes first, and nothing moves in it.
fn with_bases(parts: &SceneParts<'_>) -> Frame {
    let [[real_roots, real_nodes, _], _] = parts.bvh_nodes;
    let [[real_leaves, _], _] = parts.bvh_leaves;
    Frame {
        virtual_node_base: (real_roots.len() + real_nodes.len()) as u32,
        virtual_leaf_base: (real_leaves.len() / 3) as u32,
        ..parts.frame
    }
}

fn storage(gpu: &GpuDevice, array: &Array<'_>) -> wgpu::Buffer {
    // An empty array still needs room for one element of the largest record.
    let least = size_of::<Material>().max(256) as u64;
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(array.what),
        size: array.len().max(least),
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    array.write(gpu, &buffer, Changed::All);
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

fn out_of_memory(gpu: &GpuDevice, arrays: &[Array<'_>], error: &wgpu::Error) -> GpuError {
    let total: u64 = arrays.iter().map(Array::len).sum();
    GpuError::Limit {
        what: "the scene".to_owned(),
        needed: mebibytes(total),
        available: format!("memory ({error})"),
        adapter: gpu.name(),
        advice: "render with --backend cpu, or simplify the meshes and shrink the textures",
    }
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

#[cfg(test)]
mod tests;
