// The packed scene: structs of the same names and field order as src/packed/records.rs, and the buffers that hold them.

const NONE: u32 = 0xffffffffu;
const MAX_SPHERES: u32 = 16u;
const SHUTTER_POSES: u32 = 9u;

struct Frame {
    camera_position: vec4<f32>,
    camera_right: vec4<f32>,
    camera_up: vec4<f32>,
    camera_back: vec4<f32>,
    intrinsics: vec4<f32>,
    distortion: vec4<f32>,
    distortion_k3: f32,
    aperture_radius: f32,
    inv_focus_distance: f32,
    blade_rotation: f32,
    aperture_shape: u32,
    width: u32,
    height: u32,
    seed: u32,
    sampler: u32,
    rays_total: u32,
    max_bounces: u32,
    estimator: u32,
    real_triangle_count: u32,
    light_count: u32,
    sphere_count: u32,
    flags: u32,
    env_cos: f32,
    env_sin: f32,
    env_width: u32,
    env_height: u32,
    env_radiance: vec4<f32>,
    env_light: u32,
    exposure_scale: f32,
    virtual_node_base: u32,
    virtual_leaf_base: u32,
    clamp_indirect: f32,
    shutter_row: f32,
    shutter_open: f32,
    pad: f32,
    spheres: array<vec4<f32>, 16>,
    shutter_poses: array<vec4<f32>, 18>,
}

const FRAME_ENV_DRAWN: u32 = 1u;
const FRAME_AOVS: u32 = 2u;
const FRAME_ALPHA: u32 = 4u;
const FRAME_LIGHTS_SUFFICE: u32 = 8u;
const FRAME_SHUTTER: u32 = 16u;
const FRAME_SHUTTER_ORDERED: u32 = 32u;
const FRAME_BOTH_SHADOWS: u32 = 64u;
const FRAME_NO_CONES: u32 = 128u;
const FRAME_NO_LAST_VERTEX: u32 = 256u;

struct Vertex {
    position_u0: vec4<f32>,
    normal_v0: vec4<f32>,
    tangent: vec4<f32>,
    color: vec4<f32>,
    uv1: vec4<f32>,
}

struct Triangle {
    vertices: vec3<u32>,
    material: u32,
    light: u32,
    object: u32,
    pad: vec2<u32>,
}

const MATERIAL_LAMBERTIAN: u32 = 1u;
const MATERIAL_ALPHA_MASK: u32 = 2u;
const MATERIAL_ALPHA_BLEND: u32 = 4u;
const MATERIAL_UNLIT: u32 = 8u;
const MATERIAL_THIN_WALLED: u32 = 16u;
const MATERIAL_PHOTO_ALBEDO: u32 = 32u;
const MATERIAL_QUAD_LIGHT: u32 = 64u;
const MATERIAL_TEXTURED: u32 = 128u;

struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    normal_scale: f32,
    metallic: f32,
    roughness: f32,
    ior: f32,
    specular: f32,
    specular_color: vec3<f32>,
    transmission: f32,
    sigma_a: vec3<f32>,
    clearcoat: f32,
    clearcoat_roughness: f32,
    clearcoat_normal_scale: f32,
    alpha_cutoff: f32,
    self_shadow_bias: f32,
    flags: u32,
    base_color_texture: u32,
    metallic_roughness_texture: u32,
    normal_texture: u32,
    emissive_texture: u32,
    specular_texture: u32,
    specular_color_texture: u32,
    transmission_texture: u32,
    clearcoat_texture: u32,
    clearcoat_roughness_texture: u32,
    clearcoat_normal_texture: u32,
    pad: u32,
}

const TEXTURE_SRGB: u32 = 1u;
const TEXTURE_NEAREST: u32 = 2u;
const TEXTURE_UV1: u32 = 4u;
const TEXTURE_WRAP_U_SHIFT: u32 = 4u;
const TEXTURE_WRAP_V_SHIFT: u32 = 6u;

struct TextureRef {
    offset: u32,
    width: u32,
    height: u32,
    flags: u32,
    transform_u: vec4<f32>,
    transform_v: vec4<f32>,
}

const LIGHT_POINT: u32 = 0u;
const LIGHT_SPOT: u32 = 1u;
const LIGHT_DIRECTIONAL: u32 = 2u;
const LIGHT_QUAD: u32 = 3u;
const LIGHT_TRIANGLE: u32 = 4u;
const LIGHT_ENVIRONMENT: u32 = 5u;

struct Light {
    position: vec4<f32>,
    axis_u: vec4<f32>,
    axis_v: vec4<f32>,
    radiance: vec4<f32>,
    kind: u32,
    side: u32,
    select_pdf: f32,
    alias_threshold: f32,
    alias_: u32,
    triangle: u32,
    pad: vec2<u32>,
}

const PIXEL_BEAM_MAY_MEET_VIRTUAL: u32 = 1u;
const PIXEL_OUT_OF_REACH: u32 = 2u;

struct PixelInfo {
    difference_period: u32,
    sample_factor: u32,
    flags: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> materials: array<Material>;
@group(0) @binding(4) var<storage, read> texture_refs: array<TextureRef>;
@group(0) @binding(5) var<storage, read> texels: array<u32>;
@group(0) @binding(6) var<storage, read> lights: array<Light>;
@group(0) @binding(7) var<storage, read> env_texels: array<f32>;
@group(0) @binding(8) var<storage, read> env_cdf: array<f32>;
@group(0) @binding(9) var<storage, read> photo_albedo: array<vec4<f32>>;
@group(0) @binding(10) var<storage, read> pixels: array<PixelInfo>;
@group(0) @binding(11) var<storage, read> bvh_nodes: array<vec4<u32>>;
@group(0) @binding(12) var<storage, read> bvh_leaves: array<vec4<f32>>;
