//! The scene as both backends read it: flat arrays of plain records, f32, positions relative to an anchor near the camera.
//!
//! The records are declared for both sides at once ([`records`], [`crate::shared`]).
//! Triangle ids are global: real triangles come first (`0..Frame::real_triangle_count`), then virtual ones that rest, then those that move.

mod environment;
pub(crate) mod materials;
pub(crate) mod records;
mod triangles;

pub use environment::RowEdge;
pub use materials::Material;
pub use records::*;

use std::ops::Range;

use crate::accel::{Cover, WorldBvh};
pub use crate::shared::NONE;

/// What a backend renders.
pub struct PackedScene {
    pub frame: Frame,
    /// Anchor in world space, metres; `position_world = position_packed + anchor`.
    pub anchor_m: [f64; 3],
    /// Built over the real triangles; hit ids are global ids.
    pub real_bvh: WorldBvh,
    pub virtual_bvh: WorldBvh,
    /// By global triangle id.
    pub triangles: Vec<Triangle>,
    pub vertices: Vec<Vertex>,
    pub materials: Vec<Material>,
    pub texture_refs: Vec<TextureRef>,
    /// RGBA8 texels of all textures, one after the other.
    pub texels: Vec<u32>,
    /// Light 0.. in selection order; empty without lights.
    pub lights: Vec<Light>,
    /// Environment texels, three floats each, row-major; empty for a constant environment or none.
    pub env_texels: Vec<f32>,
    /// Cumulative distributions of the environment's cells (see `light::environment_table::EnvironmentTable`).
    pub env_cdf: Vec<f32>,
    /// `EnvironmentTable::starts`, for the CPU alone.
    pub env_starts: Vec<u32>,
    /// `EnvironmentTable::edges`, for the CPU alone.
    pub env_edges: Vec<RowEdge>,
    /// For `albedo = "from-photo"`, empty where unused: albedo of the photograph's pixels and the depth (metres along the axis) it was seen
    /// at, then for each scene object its patches, [`records::PHOTO_PATCHES`] pairs: mean albedo of the pixels that see a part of it and how many
    /// they are; their mean position, metres, and mean squared distance from it.
    pub photo_albedo: Vec<[f32; 4]>,
    /// Lobes of the cells of `light::guide`: the point that each is about and 1 - cos of its half-angle, 0 where a cell has no more.
    pub guide: Vec<[f32; 4]>,
    /// What it was filled with the last time, as long as photons would teach the same.
    pub(crate) taught: Option<Taught>,
    /// What rough lobes keep of light: metal, then the glasses (see `material::facets`); empty where none is rough.
    pub facet_tables: Vec<f32>,
    /// Indices of the glasses in it, as bits, and where their tables begin.
    pub(crate) facet_table_of: Vec<(u32, u32)>,
    /// Linear values of the photograph's pixels, three floats each, row-major, where paths may see it (`FRAME_BACKDROP`); else empty.
    pub backdrop: Vec<f32>,
    /// One word a pixel: what the pilot found (see [`PixelInfo`]).
    pub pixels: Vec<PixelInfo>,
    /// What bounds moving objects over the whole time of the shutter; empty where nothing moves: then the frame's spheres do.
    pub swept_spheres: Vec<[f32; 4]>,
    pub(crate) material_table: materials::MaterialTable,
    pub(crate) real_vertex_count: usize,
    pub(crate) resting: Resting,
    /// Where the virtual objects' parts that rest are.
    pub(crate) resting_objects: Vec<Moved>,
    /// What the last edit moved, where that was one object and nothing else of the virtual world is new.
    pub(crate) moved: Option<Moved>,
    /// Over the virtual triangles that rest.
    pub(crate) resting_covers: Vec<Cover>,
    /// Over those of them that are smooth.
    pub(crate) resting_smooth_covers: Vec<Cover>,
    /// Of a draft: the virtual objects' that were found so far.
    pub(crate) object_covers: Option<Vec<ObjectCover>>,
    pub(crate) env_mean_luminance: f64,
    pub(crate) env_traced: TracedEnvironment,
    /// Half-angle at which the lights that send photons show at smooth objects, radians: a mean by their shares, of each at its largest.
    pub(crate) photon_light_radius: f32,
    /// Photons traced for every ray per pixel; 0 where none are.
    pub photons_per_ray: u64,
}

/// The part of the environment that photons bring.
#[derive(Clone, Copy, Debug, Default)]
pub struct TracedEnvironment {
    /// Luminance.
    pub above: f64,
    /// Luminance of what lies above it, mean over the sphere.
    pub mean_radiance: f64,
    /// Of the directions where it is brighter.
    pub solid_angle_sr: f64,
}

/// What photons have taught of the scene, wherever the camera is.
pub(crate) struct Taught {
    /// How many, their seed, the frame's flags and the most bounces.
    pub photons: [u32; 4],
    pub guide: Vec<[f32; 4]>,
    pub guide_cell_count: u32,
    pub guide_cells_per_m: f32,
}

/// Spheres about a virtual object, in its own space.
pub(crate) struct ObjectCover {
    /// Index in the scene.
    pub object: usize,
    /// Of its triangles that rest.
    pub triangles: usize,
    pub whole: Cover,
    /// About what of it is smooth.
    pub smooth: Cover,
}

/// How many of a scene's triangles and vertices rest: those of animated virtual objects come after them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Resting {
    pub triangles: usize,
    pub vertices: usize,
}

/// A virtual object that rests: its records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Moved {
    /// Index in the scene.
    pub object: usize,
    pub triangles: Range<usize>,
    pub vertices: Range<usize>,
}

impl PackedScene {
    /// No geometry, no light, at the origin.
    pub(crate) fn empty() -> Self {
        let world = || WorldBvh::build(&[], 0).expect("an empty world is legal");
        Self {
            frame: bytemuck::Zeroable::zeroed(),
            anchor_m: [0.0; 3],
            real_bvh: world(),
            virtual_bvh: world(),
            triangles: Vec::new(),
            vertices: Vec::new(),
            materials: Vec::new(),
            texture_refs: Vec::new(),
            texels: Vec::new(),
            lights: Vec::new(),
            env_texels: Vec::new(),
            env_cdf: Vec::new(),
            env_starts: Vec::new(),
            env_edges: Vec::new(),
            photo_albedo: Vec::new(),
            guide: Vec::new(),
            taught: None,
            facet_tables: Vec::new(),
            facet_table_of: Vec::new(),
            backdrop: Vec::new(),
            pixels: Vec::new(),
            swept_spheres: Vec::new(),
            material_table: materials::MaterialTable::default(),
            real_vertex_count: 0,
            resting: Resting::default(),
            resting_objects: Vec::new(),
            moved: None,
            resting_covers: Vec::new(),
            resting_smooth_covers: Vec::new(),
            object_covers: None,
            env_mean_luminance: 0.0,
            env_traced: TracedEnvironment::default(),
            photon_light_radius: 0.0,
            photons_per_ray: 0,
        }
    }
}
