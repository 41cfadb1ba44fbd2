//! Plain records shared with the shaders, where they are `package::packed::records`. All sizes are multiples of 16 bytes where an array of
//! them is bound.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::shared::shared;

shared! {
    /// Patches of an object that the photograph shows: what its other points take their albedo from.
    pub const PHOTO_PATCHES: u32 = 16;

    /// Bounding spheres of the virtual geometry, at most this many.
    pub const MAX_SPHERES: usize = 16;

    /// Spheres that photons are sent to, at most this many.
    pub const MAX_PHOTON_SPHERES: usize = 8;

    /// Camera poses at equal steps of the time for which the shutter is open, the first and the last moment included.
    pub const SHUTTER_POSES: usize = 9;

    /// The uniform block: camera, lens, sampling and counts.
    #[derive(Clone, Copy, Debug, Pod, Zeroable)]
    pub struct Frame {
        /// Anchor-relative camera position, w unused.
        pub camera_position: [f32; 4],
        /// Camera axes in world orientation: right (+X), up (+Y), back (+Z); w unused.
        pub camera_right: [f32; 4],
        pub camera_up: [f32; 4],
        pub camera_back: [f32; 4],
        /// fx, fy, cx, cy in pixels.
        pub intrinsics: [f32; 4],
        /// k1, k2, p1, p2; of a fisheye k1 to k4.
        pub distortion: [f32; 4],
        /// Distortion k3.
        pub distortion_k3: f32,
        /// 0 is the pinhole.
        pub aperture_radius: f32,
        /// 1 / focus distance; 0 focuses at infinity.
        pub inv_focus_distance: f32,
        /// Radians.
        pub blade_rotation: f32,
        /// `APERTURE_*`, else the number of blades.
        pub aperture_shape: u32,
        pub width: u32,
        pub height: u32,
        pub seed: u32,
        /// `SAMPLER_*`.
        pub sampler: u32,
        /// Rays per pixel the sampler is laid out for.
        pub rays_total: u32,
        pub max_bounces: u32,
        /// `ESTIMATOR_*`.
        pub estimator: u32,
        pub real_triangle_count: u32,
        pub light_count: u32,
        pub sphere_count: u32,
        /// Bits: see `FRAME_*`.
        pub flags: u32,
        /// cos and sin of the environment's rotation.
        pub env_cos: f32,
        pub env_sin: f32,
        pub env_width: u32,
        pub env_height: u32,
        /// Constant radiance, or the scale of the map; w: the map's `EnvironmentTable::normaliser`.
        pub env_radiance: [f32; 4],
        /// Index of the environment in the light list, or NONE.
        pub env_light: u32,
        /// 2^exposure_ev, applied to radiance where it is accumulated.
        pub exposure_scale: f32,
        /// GPU traversal: first node of the virtual BVH in the concatenated node buffer, in nodes.
        pub virtual_node_base: u32,
        /// GPU traversal: first triangle of the virtual BVH in the concatenated triangle buffer.
        pub virtual_leaf_base: u32,
        /// Largest radiance that an indirect contribution may have; infinity: off.
        pub clamp_indirect: f32,
        /// Between the openings of two rows: share of the time from the opening of the first row to the closing of the last.
        pub shutter_row: f32,
        /// Share of that time for which each row is open.
        pub shutter_open: f32,
        /// Luminance of the environment above which photons bring its light through smooth virtual objects; what is under it is left to
        /// the eye's paths. Infinity: all is.
        pub env_traced_above: f32,
        /// Bounding spheres of the virtual geometry: centre, radius.
        pub spheres: [[f32; 4]; MAX_SPHERES],
        /// Anchor-relative position (w unused) and unit quaternion x, y, z, w of each pose.
        pub shutter_poses: [[f32; 4]; 2 * SHUTTER_POSES],
        /// Bounding spheres of what photons are sent to, virtual surfaces that mirror or refract: centre, radius. After the last one radius 0.
        pub photon_spheres: [[f32; 4]; MAX_PHOTON_SPHERES + 1],
        /// k4, k5, k6, s1; s2, s3, s4, unused.
        pub distortion_more: [[f32; 4]; 2],
        /// 0: no photons are traced.
        pub photon_sphere_count: u32,
        /// Cells of the guide, a power of two; 0: there is none.
        pub guide_cell_count: u32,
        pub guide_cells_per_m: f32,
        /// 1 / distance of the backdrop along the view axis; 0: infinitely far.
        pub inv_backdrop_distance: f32,
        /// `LENS_*` of `distortion`.
        pub lens_model: u32,
        pub pad: u32,
        pub pad_end: [u32; 2],
    }

    pub const APERTURE_DISC: u32 = 0;
    pub const APERTURE_SQUARE: u32 = 1;

    pub const SAMPLER_JITTERED: u32 = 0;
    /// Correlated multi-jittered.
    pub const SAMPLER_CMJ: u32 = 1;
    pub const SAMPLER_SOBOL: u32 = 2;

    pub const ESTIMATOR_DIRECT: u32 = 0;
    pub const ESTIMATOR_PAPER: u32 = 1;

    /// The environment is visible to primary rays (a photograph is present).
    pub const FRAME_ENV_DRAWN: u32 = 1;
    /// Depth, normal and albedo of the first hit are wanted, so the real primary ray is always traced.
    pub const FRAME_AOVS: u32 = 2;
    /// Some material is alpha-masked or blended.
    pub const FRAME_ALPHA: u32 = 4;
    /// All light comes from a few lights that are drawn well wherever they are seen from: the last diffuse vertex need not look for it.
    pub const FRAME_LIGHTS_SUFFICE: u32 = 8;
    /// The camera moves while the shutter is open.
    pub const FRAME_SHUTTER: u32 = 16;
    /// A pixel's samples follow one another in time.
    pub const FRAME_SHUTTER_ORDERED: u32 = 32;
    /// Without the saving `virtual-first`: every light sample of a difference asks both worlds.
    pub const FRAME_BOTH_SHADOWS: u32 = 64;
    /// Without the saving `cones`: the BSDF alone looks for virtual geometry.
    pub const FRAME_NO_CONES: u32 = 128;
    /// Without the saving `last-vertex`: every last vertex looks for light, as if `FRAME_LIGHTS_SUFFICE` were not.
    pub const FRAME_NO_LAST_VERTEX: u32 = 256;
    /// Without the saving `sharing`. No shader reads it.
    pub const FRAME_NO_SHARING: u32 = 1024;
    /// Without the saving `photons`: the eye's paths look for caustics.
    pub const FRAME_NO_PHOTONS: u32 = 512;
    /// Without the saving `guide`. No shader reads it.
    pub const FRAME_NO_GUIDE: u32 = 8192;
    /// Some material is a pane ([`MATERIAL_PANE`]).
    pub const FRAME_PANES: u32 = 2048;
    /// Paths that leave virtual objects see the photograph.
    pub const FRAME_BACKDROP: u32 = 4096;

    #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
    pub struct Vertex {
        /// xyz anchor-relative, w = u of set 0.
        pub position_u0: [f32; 4],
        /// xyz unit normal, w = v of set 0.
        pub normal_v0: [f32; 4],
        /// xyz tangent, w handedness; w = 0: none.
        pub tangent: [f32; 4],
        pub color: [f32; 4],
        /// uv of set 1, then unused.
        pub uv1: [f32; 4],
    }

    #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
    pub struct Triangle {
        /// Vertex indices.
        pub vertices: [u32; 3],
        pub material: u32,
        /// Unit geometric normal, on the side on which the vertices run counter-clockwise; zero where that is lost in f32.
        pub normal: [f32; 3],
        /// How far from its plane the tracer may find the triangle, metres.
        pub plane_error: f32,
        /// Index into the lights if the triangle emits and is sampled as a light, else NONE.
        pub light: u32,
        /// Index of the scene object; NONE for quad lights.
        pub object: u32,
        /// `TRIANGLE_*` bits.
        pub flags: u32,
        pub pad: u32,
    }

    /// The vertices' colours are all 1.
    pub const TRIANGLE_UNTINTED: u32 = 1;

    /// The material has no delta or glossy lobe and does not transmit: f = base colour / pi.
    pub const MATERIAL_LAMBERTIAN: u32 = 1;
    pub const MATERIAL_ALPHA_MASK: u32 = 2;
    pub const MATERIAL_ALPHA_BLEND: u32 = 4;
    pub const MATERIAL_UNLIT: u32 = 8;
    pub const MATERIAL_THIN_WALLED: u32 = 16;
    /// Base colour comes from `PackedScene::photo_albedo`.
    pub const MATERIAL_PHOTO_ALBEDO: u32 = 32;
    /// Emits to the front side only and reflects nothing (quad lights).
    pub const MATERIAL_QUAD_LIGHT: u32 = 64;
    /// Some texture is referenced.
    pub const MATERIAL_TEXTURED: u32 = 128;
    /// A normal map tilts the shading normal.
    pub const MATERIAL_NORMAL_MAPPED: u32 = 512;
    /// Somewhere light goes straight through: a smooth thin wall, or a volume of index 1.
    pub const MATERIAL_PANE: u32 = 256;

    pub const TEXTURE_SRGB: u32 = 1;
    pub const TEXTURE_NEAREST: u32 = 2;
    pub const TEXTURE_UV1: u32 = 4;
    /// Bits 4-5: wrap of u, bits 6-7: wrap of v; see `WRAP_*`.
    pub const TEXTURE_WRAP_U_SHIFT: u32 = 4;
    pub const TEXTURE_WRAP_V_SHIFT: u32 = 6;

    pub const WRAP_REPEAT: u32 = 0;
    pub const WRAP_MIRROR: u32 = 1;
    pub const WRAP_CLAMP: u32 = 2;

    #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
    pub struct TextureRef {
        /// First texel.
        pub offset: u32,
        pub width: u32,
        pub height: u32,
        pub flags: u32,
        /// Row for u': m0 m1 m2, then pad.
        pub transform_u: [f32; 4],
        pub transform_v: [f32; 4],
    }

    /// Worlds that a light, a ray's origin or a hit belongs to.
    pub const SIDE_REAL: u32 = 0;
    pub const SIDE_VIRTUAL: u32 = 1;

    pub const LIGHT_POINT: u32 = 0;
    pub const LIGHT_SPOT: u32 = 1;
    pub const LIGHT_DIRECTIONAL: u32 = 2;
    pub const LIGHT_QUAD: u32 = 3;
    /// An emissive mesh triangle, both sides.
    pub const LIGHT_TRIANGLE: u32 = 4;
    pub const LIGHT_ENVIRONMENT: u32 = 5;

    #[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
    pub struct Light {
        /// Position, corner or first vertex, anchor-relative; w unused.
        pub position: [f32; 4],
        /// edge_u, or second minus first vertex, or unit direction of travel (spot: the axis); w: cos of the spot's inner angle.
        pub axis_u: [f32; 4],
        /// edge_v, or third minus first vertex; w: cos of the spot's outer angle.
        pub axis_v: [f32; 4],
        /// Quads and triangles: unit axis_u and axis_v; w: their lengths, metres.
        pub unit_u: [f32; 4],
        pub unit_v: [f32; 4],
        /// Quads and triangles: axis_u x axis_v; w: its length, at least 1e-30. Of other lights 0, 0, 0 and 1.
        pub normal: [f32; 4],
        /// Intensity, irradiance or radiance; w: area of quad or triangle.
        pub radiance: [f32; 4],
        /// `LIGHT_*`.
        pub kind: u32,
        /// `SIDE_REAL` or `SIDE_VIRTUAL`.
        pub side: u32,
        /// Probability that `light_select` draws this light.
        pub select_pdf: f32,
        /// Alias method (Walker 1977): threshold, and the light that is drawn above it.
        pub alias_threshold: f32,
        pub alias_light: u32,
        /// Global triangle id for LIGHT_TRIANGLE, else NONE.
        pub triangle: u32,
        /// Probability that a photon starts from this light, and that it starts from this or one before it in the list; all 0 where the
        /// eye's paths find what the light sends through smooth virtual objects.
        pub photon_pdf: f32,
        pub photon_cdf: f32,
    }

    /// The lens beam of this pixel may meet virtual geometry.
    pub const PIXEL_BEAM_MAY_MEET_VIRTUAL: u32 = 1;
    /// The proven bound on the virtual objects' influence is under half an 8-bit code: nothing is traced.
    pub const PIXEL_OUT_OF_REACH: u32 = 2;
    /// The pixel is known to be an edge: every sample's real radiance is wanted, even where the film has met one world alone. For backends'
    /// hosts; no shader reads it.
    pub const PIXEL_EDGE: u32 = 4;

    /// The pixel's samples share their second vertices with those of its sharing tile, whose pixels have one plan.
    pub const PIXEL_SHARES: u32 = 8;
    /// Its samples share, and some pixel of the sharing block may meet virtual geometry: all of them take the samples that this one needs. No
    /// shader reads it.
    pub const PIXEL_SHARES_NEAR: u32 = 16;

    /// What the pilot found out about a pixel before any sample is taken.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
    pub struct PixelInfo {
        /// Of the samples that miss virtual geometry one in this many, at least 1, evaluates its difference.
        pub difference_period: u32,
        /// Samples that this pixel takes for every ray per pixel asked for, at least 1.
        pub sample_factor: u32,
        pub flags: u32,
    }
}

/// The vector in a field that WGSL pads to four numbers.
pub fn xyz([x, y, z, _]: [f32; 4]) -> Vec3 {
    Vec3::new(x, y, z)
}

impl PixelInfo {
    /// One sample a ray, each evaluating everything.
    pub const fn uniform(flags: u32) -> Self {
        Self {
            difference_period: 1,
            sample_factor: 1,
            flags,
        }
    }
}
