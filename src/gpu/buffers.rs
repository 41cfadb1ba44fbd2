//! The packed scene in storage buffers: bind group 0 of every kernel, under the names that `shaders/gpu/buffers.wgsl` declares.

use bytemuck::Zeroable;

use super::kernel::UNIFORM_USAGE;
use super::{GpuDevice, GpuError};
use crate::accel::WorldBvh;
use crate::packed::{
    Frame, Light, Material, PackedScene, PixelInfo, Resting, TextureRef, Triangle, Vertex,
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

    /// Sends what has changed, where the buffers have room for it; false, and nothing is sent, where they have not.
    pub fn update(&self, gpu: &GpuDevice, parts: &SceneParts<'_>, changed: Changed) -> bool {
        let arrays = arrays(parts);
        let mut pairs = self.arrays.iter().zip(&arrays);
        if changed == Changed::All
            || !pairs.all(|((_, buffer), array)| array.len() <= buffer.size())
        {
            return false;
        }
        for ((_, buffer), array) in self.arrays.iter().zip(&arrays) {
            array.write(gpu, buffer, changed);
        }
        self.set_frame(gpu, parts);
        true
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

/// Bytes, and the smallest edit that changes them.
type Piece<'a> = (Changed, &'a [u8]);

impl Array<'_> {
    /// Bytes.
    fn len(&self) -> u64 {
        (self.pieces.iter())
            .map(|(_, bytes)| bytes.len() as u64)
            .sum()
    }

    /// Sends the pieces that an edit has changed.
    fn write(&self, gpu: &GpuDevice, buffer: &wgpu::Buffer, changed: Changed) {
        let mut offset = 0;
        for (changed_by, bytes) in &self.pieces {
            if *changed_by <= changed {
                gpu.write(buffer, offset, bytes);
            }
            offset += bytes.len() as u64;
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
    } = *parts;
    let triangles = triangles.split_at(resting.triangles);
    let vertices = vertices.split_at(resting.vertices);
    [
        array(
            "triangles",
            "triangles",
            vec![piece(Virtual, triangles.0), piece(Moving, triangles.1)],
        ),
        array(
            "vertices",
            "vertices",
            vec![piece(Virtual, vertices.0), piece(Moving, vertices.1)],
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
                piece(Virtual, nodes),
                piece(Moving, moving_nodes),
            ],
        ),
        array(
            "bvh_leaves",
            "BVH triangles",
            vec![
                piece(All, real_leaves),
                piece(Virtual, leaves),
                piece(Moving, moving_leaves),
            ],
        ),
    ]
}

fn piece<T: bytemuck::NoUninit>(changed_by: Changed, records: &[T]) -> Piece<'_> {
    (changed_by, bytemuck::cast_slice(records))
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
mod tests {
    use super::*;
    use crate::gpu::kernel::reflect_bindings;
    use crate::gpu::{AdapterChoice, Composer, Features};

    /// A kernel that reads all of `names`.
    fn bound(names: &[&str]) -> Result<Vec<String>, GpuError> {
        let reads: String = names.iter().map(|name| format!("_ = &{name};")).collect();
        let root = format!(
            "import package::gpu::buffers::{{{}}};
            @compute @workgroup_size(1) fn main() {{ {reads} }}",
            names.join(", ")
        );
        let wgsl = Composer::default().with_module("root", root).compose(
            "root",
            "main",
            &Features::ALL,
        )?;
        let bindings = reflect_bindings(&wgsl).expect("valid");
        Ok(bindings.into_iter().map(|binding| binding.name).collect())
    }

    #[test]
    fn every_buffer_has_the_name_and_place_of_its_declaration() {
        let parts = SceneParts::default();
        let arrays = arrays(&parts).map(|array| array.name);
        let names: Vec<&str> = std::iter::once("frame").chain(arrays).collect();
        assert_eq!(bound(&names).expect("all are declared"), names);
        let (_, text) = crate::gpu::compose::MODULES
            .iter()
            .find(|(module, _)| *module == "gpu::buffers")
            .expect("is embedded");
        assert_eq!(text.matches("@binding").count(), names.len());
        // Negative control: a name that no shader declares.
        assert!(bound(&["frame", "vertexes"]).is_err());
    }

    #[test]
    fn an_edit_sends_what_it_changes_and_no_more() {
        if crate::gpu::harness::test_device().is_none() {
            return;
        }
        let gpu = GpuDevice::open(AdapterChoice::Any).expect("opens");
        let pixels = [PixelInfo::uniform(0); 10];
        let parts = SceneParts {
            pixels: &pixels,
            photo_albedo: &[[0.5; 4]; 3],
            backdrop: &[0.5; 30],
            ..SceneParts::default()
        };
        let scene = SceneBuffers::from_parts(&gpu, &parts).expect("fits");
        let frame = size_of::<Frame>() as u64;
        for (changed, bytes) in [
            (Changed::Plan, 120),
            (Changed::View, 120 + 48),
            (Changed::Photo, 120 + 48 + 120),
            (Changed::Virtual, 120 + 48 + 120),
        ] {
            let before = gpu.traffic();
            assert!(scene.update(&gpu, &parts, changed));
            assert_eq!(
                (gpu.traffic() - before).bytes_up,
                frame + bytes,
                "{changed:?}"
            );
        }
        assert!(!scene.update(&gpu, &parts, Changed::All), "made anew");
        let more = [PixelInfo::uniform(0); 1000];
        let parts = SceneParts {
            pixels: &more,
            ..parts
        };
        assert!(!scene.update(&gpu, &parts, Changed::Plan), "no room");
    }

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
