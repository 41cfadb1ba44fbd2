// The packed scene: bind group 0 of every kernel. Host: src/gpu/buffers.rs.

import package::packed::materials::Material;
import package::packed::records::{Frame, Light, PixelInfo, TextureRef, Triangle, Vertex};

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
@group(0) @binding(10) var<storage, read> guide: array<vec4<f32>>;
@group(0) @binding(11) var<storage, read> backdrop: array<f32>;
@group(0) @binding(12) var<storage, read> facet_tables: array<f32>;
@group(0) @binding(13) var<storage, read> pixels: array<PixelInfo>;
@group(0) @binding(14) var<storage, read> bvh_nodes: array<vec4<u32>>;
@group(0) @binding(15) var<storage, read> bvh_leaves: array<vec4<f32>>;

// Told by the radius, which the last place has not: some drivers compile a kernel anew before each dispatch where a uniform bounds a loop (Mesa's
// lavapipe), and a constant bound would unroll it.
fn has_photon_sphere(i: u32) -> bool {
    return frame.photon_spheres[i].w > 0.0;
}
