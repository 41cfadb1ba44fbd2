//! The shading point: where a ray met a triangle, with every attribute interpolated and every texture read.

use glam::{Vec2, Vec3, Vec4};

use crate::accel::Hit;
use crate::camera::lens::camera_project;
use crate::math::dot3;
use crate::packed::{
    MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, MATERIAL_LAMBERTIAN, MATERIAL_PHOTO_ALBEDO,
    MATERIAL_QUAD_LIGHT, MATERIAL_TEXTURED, MATERIAL_THIN_WALLED, MATERIAL_UNLIT, Material, NONE,
    PHOTO_PATCHES, PackedScene, TEXTURE_UV1, TRIANGLE_UNTINTED, Vertex, xyz,
};
use crate::shared::shared;

use super::facets::{TABLE_SIZE, kept_by_facets};
use super::ggx::{DELTA_ALPHA, transmits_unblurred};
use super::normal::{mapped_normal, tangent_from_uv, unit, valid_shading_normal};
use super::texture::{slot, slot_rgb, texture_sample};

shared! {
    /// (7 u) / (1 - 7 u) with u = 2^-24: the bound on the relative error of a chain of seven roundings (Higham 2002, section 3.1).
    const GAMMA_7: f32 = 4.172_327e-7;
    /// Bound on the absolute error of 1 - u - v for barycentrics in 0..1: two roundings of numbers of at most 1.
    const BARYCENTRIC_ERROR: f32 = 1.192_092_9e-7;
    /// Relative difference up to which a depth in `photo_albedo` is the point's own.
    const PHOTO_DEPTH_TOLERANCE: f32 = 0.02;
    /// Squared distances and weights below it are none.
    const NO_DISTANCE2: f32 = 1e-12;

    /// What the scattering functions need to know about a point.
    #[derive(Clone, Copy, Debug)]
    pub value struct Surface {
        /// Anchor-relative, metres.
        pub position: Vec3,
        /// Bound on the distance of `position` from the exact point of the triangle, and on that at which a ray from there may meet the triangle
        /// again, metres.
        pub error: f32,
        /// Unit geometric normal on the side that the ray came from.
        pub ng: Vec3,
        /// Unit shading normal, on the same side as `ng`. Surfaces that mirror or refract have it turned so far that mirror directions
        /// leave the surface; that of Lambertian ones may face away from the ray, which changes nothing for them.
        pub ns: Vec3,
        /// Shading normal of the clearcoat.
        pub coat_ns: Vec3,
        /// Linear, 0..1.
        pub base_color: Vec3,
        pub metallic: f32,
        /// GGX alpha, the square of glTF's roughness.
        pub ggx_alpha: f32,
        pub ior: f32,
        pub specular: f32,
        pub specular_color: Vec3,
        pub transmission: f32,
        /// 0 where a ray leaves a volume: the coat lies outside.
        pub clearcoat: f32,
        pub coat_alpha: f32,
        /// Radiance that leaves towards the ray.
        pub emission: Vec3,
        /// Opacity in 0..1: the probability that the surface is met at all.
        pub coverage: f32,
        /// The ray came from the side on which the vertices run counter-clockwise.
        pub front: bool,
        /// `packed::MATERIAL_*`; MATERIAL_PHOTO_ALBEDO surfaces are always MATERIAL_LAMBERTIAN.
        pub flags: u32,
        pub material: u32,
        /// Index into the lights, or NONE.
        pub light: u32,
        /// Scene object, or NONE for quad lights.
        pub object: u32,
        /// What metal's facets send on by way of others, over what they send at once, for a colour of 1.
        pub metal_gain: f32,
        /// What glass sends in all over what its facets send at once.
        pub glass_gain: f32,
    }
}

/// Barycentric interpolation in the order that both backends use.
fn blend2(b: Vec3, v0: Vec2, v1: Vec2, v2: Vec2) -> Vec2 {
    v0 * b.x + v1 * b.y + v2 * b.z
}

fn blend3(b: Vec3, v0: Vec3, v1: Vec3, v2: Vec3) -> Vec3 {
    v0 * b.x + v1 * b.y + v2 * b.z
}

fn blend4(b: Vec3, v0: Vec4, v1: Vec4, v2: Vec4) -> Vec4 {
    v0 * b.x + v1 * b.y + v2 * b.z
}

fn vertex_uv0(vertex: &Vertex) -> Vec2 {
    Vec2::new(vertex.position_u0[3], vertex.normal_v0[3])
}

fn vertex_uv1(vertex: &Vertex) -> Vec2 {
    Vec2::new(vertex.uv1[0], vertex.uv1[1])
}

/// Opacity of a base colour alpha under the material's alpha mode.
fn coverage_of(material: &Material, alpha: f32) -> f32 {
    if material.flags & MATERIAL_ALPHA_MASK != 0 {
        if alpha >= material.alpha_cutoff {
            1.0
        } else {
            0.0
        }
    } else if material.flags & MATERIAL_ALPHA_BLEND != 0 {
        alpha.clamp(0.0, 1.0)
    } else {
        1.0
    }
}

/// Opacity at a hit, in 0..1, without the rest of the shading point: what a shadow ray asks.
pub fn surface_alpha(scene: &PackedScene, hit: Hit) -> f32 {
    let triangle = &scene.triangles[hit.triangle as usize];
    let material = &scene.materials[triangle.material as usize];
    if material.flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND) == 0 {
        return 1.0;
    }
    let [v0, v1, v2] = triangle.vertices.map(|v| &scene.vertices[v as usize]);
    let b = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let mut alpha =
        material.base_color[3] * (v0.color[3] * b.x + v1.color[3] * b.y + v2.color[3] * b.z);
    if material.base_color_texture != NONE {
        let uv0 = blend2(b, vertex_uv0(v0), vertex_uv0(v1), vertex_uv0(v2));
        let uv1 = blend2(b, vertex_uv1(v0), vertex_uv1(v1), vertex_uv1(v2));
        alpha *= slot(scene, material.base_color_texture, uv0, uv1).w;
    }
    coverage_of(material, alpha)
}

/// Radiance times opacity of an emissive triangle at barycentrics (u, v), without the rest of the shading point: what light sampling asks.
pub fn triangle_emission(scene: &PackedScene, triangle: u32, u: f32, v: f32) -> Vec3 {
    let record = &scene.triangles[triangle as usize];
    let material = &scene.materials[record.material as usize];
    let mut emission = Vec3::from(material.emissive);
    if material.emissive_texture != NONE {
        let [v0, v1, v2] = record.vertices.map(|v| &scene.vertices[v as usize]);
        let b = Vec3::new(1.0 - u - v, u, v);
        let uv0 = blend2(b, vertex_uv0(v0), vertex_uv0(v1), vertex_uv0(v2));
        let uv1 = blend2(b, vertex_uv1(v0), vertex_uv1(v1), vertex_uv1(v2));
        emission *= slot_rgb(scene, material.emissive_texture, uv0, uv1);
    }
    let hit = Hit {
        t: 0.0,
        u,
        v,
        triangle,
    };
    emission * surface_alpha(scene, hit)
}

/// Albedo that the photograph's pixel over `position` was found to have. Where the camera does not see the point, the mean over what it sees of
/// the object, nearer parts before farther ones.
fn photo_albedo_at(scene: &PackedScene, position: Vec3, object: u32) -> Vec3 {
    let frame = &scene.frame;
    let seen = camera_project(frame, position);
    if seen.valid {
        let pixel = seen.py as u32 * frame.width + seen.px as u32;
        let [r, g, b, depth] = scene.photo_albedo[pixel as usize];
        if depth > 0.0 && (depth - seen.depth).abs() <= PHOTO_DEPTH_TOLERANCE * seen.depth {
            return Vec3::new(r, g, b);
        }
    }
    let first = frame.width * frame.height + object * (2 * PHOTO_PATCHES);
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for patch in 0..PHOTO_PATCHES {
        let albedo = scene.photo_albedo[(first + 2 * patch) as usize];
        let place = scene.photo_albedo[(first + 2 * patch + 1) as usize];
        let away = position - xyz(place);
        let nearness = 1.0 / (dot3(away, away) + place[3]).max(NO_DISTANCE2);
        let weight = albedo[3] * (nearness * nearness);
        sum += xyz(albedo) * weight;
        weights += weight;
    }
    sum * (1.0 / weights.max(NO_DISTANCE2))
}

/// `normal` as the normal map of slot `map` perturbs it; unchanged without a map.
fn perturbed(
    scene: &PackedScene,
    map: u32,
    scale: f32,
    normal: Vec3,
    [v0, v1, v2]: [&Vertex; 3],
    b: Vec3,
) -> Vec3 {
    let Some(texture) = scene.texture_refs.get(map as usize) else {
        return normal;
    };
    let second = texture.flags & TEXTURE_UV1 != 0;
    let uv = |v: &Vertex| {
        if second { vertex_uv1(v) } else { vertex_uv0(v) }
    };
    let (c0, c1, c2) = (uv(v0), uv(v1), uv(v2));
    let tangent = if v0.tangent[3] != 0.0 {
        let blended = blend4(
            b,
            Vec4::from(v0.tangent),
            Vec4::from(v1.tangent),
            Vec4::from(v2.tangent),
        );
        blended.truncate().extend(v0.tangent[3])
    } else {
        let p0 = xyz(v0.position_u0);
        let e1 = xyz(v1.position_u0) - p0;
        let e2 = xyz(v2.position_u0) - p0;
        tangent_from_uv(e1, e2, c1 - c0, c2 - c0, normal)
    };
    let sample = texture_sample(&scene.texels, texture, blend2(b, c0, c1, c2));
    mapped_normal(normal, tangent, sample.truncate(), scale)
}

/// The shading point of a hit (not a miss) by a ray of unit direction `ray_direction`.
pub fn surface_at(scene: &PackedScene, hit: Hit, ray_direction: Vec3) -> Surface {
    let triangle = &scene.triangles[hit.triangle as usize];
    let material = &scene.materials[triangle.material as usize];
    let [v0, v1, v2] = triangle.vertices.map(|v| &scene.vertices[v as usize]);
    let b = Vec3::new(1.0 - hit.u - hit.v, hit.u, hit.v);
    let (p0, p1, p2) = (
        xyz(v0.position_u0),
        xyz(v1.position_u0),
        xyz(v2.position_u0),
    );
    let position = blend3(b, p0, p1, p2);
    let a0 = p0.abs();
    let magnitude = blend3(b.abs(), a0, p1.abs(), p2.abs());
    let position_error = GAMMA_7 * (magnitude.x + magnitude.y + magnitude.z)
        + BARYCENTRIC_ERROR * (a0.x + a0.y + a0.z);

    let error = position_error.max(triangle.plane_error);
    let blended = unit(blend3(
        b,
        xyz(v0.normal_v0),
        xyz(v1.normal_v0),
        xyz(v2.normal_v0),
    ));
    let mut outward = Vec3::from(triangle.normal);
    if outward == Vec3::ZERO {
        outward = blended;
    }
    let wo = -ray_direction;
    let front = wo.dot(outward) >= 0.0;
    let facing = if front { 1.0 } else { -1.0 };
    let ng = outward * facing;
    // Vertex normals that contradict the winding follow it.
    let smooth = if blended.dot(outward) < 0.0 {
        -blended
    } else {
        blended
    };

    let flags = material.flags;
    // What most triangles need not read, to the bit.
    let mut color = Vec4::splat(b.x + b.y + b.z);
    if triangle.flags & TRIANGLE_UNTINTED == 0 {
        color = blend4(
            b,
            Vec4::from(v0.color),
            Vec4::from(v1.color),
            Vec4::from(v2.color),
        );
    }
    let mut base = Vec4::from(material.base_color) * color;
    let mut metallic = material.metallic;
    let mut roughness = material.roughness;
    let mut emission = Vec3::from(material.emissive);
    let mut specular = material.specular;
    let mut specular_color = Vec3::from(material.specular_color);
    let mut transmission = material.transmission;
    let mut clearcoat = material.clearcoat;
    let mut coat_roughness = material.clearcoat_roughness;
    let mut ns = smooth;
    let mut coat_ns = smooth;
    if flags & MATERIAL_TEXTURED != 0 {
        let uv0 = blend2(b, vertex_uv0(v0), vertex_uv0(v1), vertex_uv0(v2));
        let uv1 = blend2(b, vertex_uv1(v0), vertex_uv1(v1), vertex_uv1(v2));
        base *= slot(scene, material.base_color_texture, uv0, uv1);
        let metallic_roughness = slot(scene, material.metallic_roughness_texture, uv0, uv1);
        metallic *= metallic_roughness.z;
        roughness *= metallic_roughness.y;
        emission *= slot_rgb(scene, material.emissive_texture, uv0, uv1);
        specular *= slot(scene, material.specular_texture, uv0, uv1).w;
        specular_color *= slot_rgb(scene, material.specular_color_texture, uv0, uv1);
        transmission *= slot(scene, material.transmission_texture, uv0, uv1).x;
        clearcoat *= slot(scene, material.clearcoat_texture, uv0, uv1).x;
        coat_roughness *= slot(scene, material.clearcoat_roughness_texture, uv0, uv1).y;
        ns = perturbed(
            scene,
            material.normal_texture,
            material.normal_scale,
            smooth,
            [v0, v1, v2],
            b,
        );
        coat_ns = perturbed(
            scene,
            material.clearcoat_normal_texture,
            material.clearcoat_normal_scale,
            smooth,
            [v0, v1, v2],
            b,
        );
    }
    let mut base_color = base.truncate().clamp(Vec3::ZERO, Vec3::ONE);
    let coverage = coverage_of(material, base.w);
    let mut surface_flags = flags;
    if flags & MATERIAL_PHOTO_ALBEDO != 0 {
        base_color = photo_albedo_at(scene, position, triangle.object);
        surface_flags |= MATERIAL_LAMBERTIAN;
    }
    if flags & MATERIAL_UNLIT != 0 {
        emission = base_color;
    }
    if flags & MATERIAL_QUAD_LIGHT != 0 && !front {
        emission = Vec3::ZERO;
    }
    let leaves_volume = !front && transmission > 0.0 && flags & MATERIAL_THIN_WALLED == 0;
    if leaves_volume {
        clearcoat = 0.0;
    }
    ns *= facing;
    coat_ns *= facing;
    if surface_flags & MATERIAL_LAMBERTIAN == 0 {
        ns = valid_shading_normal(ng, ns, wo);
        coat_ns = valid_shading_normal(ng, coat_ns, wo);
    }
    roughness = roughness.clamp(0.0, 1.0);
    let alpha = roughness * roughness;
    let (mut metal_gain, mut glass_gain) = (0.0, 1.0);
    if material.facet_table != NONE && alpha >= DELTA_ALPHA {
        let cos = wo.dot(ns).clamp(0.0, 1.0);
        metal_gain = 1.0 / kept_by_facets(scene, 0, alpha, cos) - 1.0;
        let is_thin = flags & MATERIAL_THIN_WALLED != 0;
        if transmission > 0.0 && (is_thin || !transmits_unblurred(alpha, material.ior)) {
            let mut first = material.facet_table;
            if !is_thin && !front {
                first += TABLE_SIZE;
            }
            glass_gain = 1.0 / kept_by_facets(scene, first, alpha, cos);
        }
    }
    coat_roughness = coat_roughness.clamp(0.0, 1.0);
    Surface {
        position,
        error,
        ng,
        ns,
        coat_ns,
        base_color,
        metallic: metallic.clamp(0.0, 1.0),
        ggx_alpha: alpha,
        ior: material.ior,
        specular: specular.clamp(0.0, 1.0),
        specular_color: specular_color.max(Vec3::ZERO),
        transmission: transmission.clamp(0.0, 1.0),
        clearcoat: clearcoat.clamp(0.0, 1.0),
        coat_alpha: coat_roughness * coat_roughness,
        emission,
        coverage,
        front,
        flags: surface_flags,
        material: triangle.material,
        light: triangle.light,
        object: triangle.object,
        metal_gain,
        glass_gain,
    }
}
