// Twin of src/material/surface.rs: the same operations in the same order.

import package::gpu::buffers::{frame, materials, photo_albedo, texture_refs, triangles, vertices};
import package::packed::materials::Material;
import package::packed::records::{
    Vertex, TEXTURE_UV1, TRIANGLE_UNTINTED, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, MATERIAL_LAMBERTIAN, MATERIAL_PHOTO_ALBEDO,
    MATERIAL_QUAD_LIGHT, MATERIAL_TEXTURED, MATERIAL_THIN_WALLED, MATERIAL_UNLIT, PHOTO_PATCHES,
};
import package::shared::NONE;
@if(photo_albedo) import package::camera::lens::camera_project;
import package::math::dot3;
import package::material::facets::{TABLE_SIZE, kept_by_facets};
import package::material::ggx::{DELTA_ALPHA, transmits_unblurred};
import package::material::normal::{mapped_normal, tangent_from_uv, unit, valid_shading_normal};
import package::material::texture::{slot, slot_rgb, texture_sample};
import package::accel::trace::Hit;

fn blend2(b: vec3<f32>, v0: vec2<f32>, v1: vec2<f32>, v2: vec2<f32>) -> vec2<f32> {
    return v0 * b.x + v1 * b.y + v2 * b.z;
}

fn blend3(b: vec3<f32>, v0: vec3<f32>, v1: vec3<f32>, v2: vec3<f32>) -> vec3<f32> {
    return v0 * b.x + v1 * b.y + v2 * b.z;
}

fn blend4(b: vec3<f32>, v0: vec4<f32>, v1: vec4<f32>, v2: vec4<f32>) -> vec4<f32> {
    return v0 * b.x + v1 * b.y + v2 * b.z;
}

fn vertex_uv0(vertex: Vertex) -> vec2<f32> {
    return vec2<f32>(vertex.position_u0.w, vertex.normal_v0.w);
}

fn vertex_uv1(vertex: Vertex) -> vec2<f32> {
    return vertex.uv1.xy;
}

fn coverage_of(entry: Material, opacity: f32) -> f32 {
    if (entry.flags & MATERIAL_ALPHA_MASK) != 0u {
        return select(0.0, 1.0, opacity >= entry.alpha_cutoff);
    }
    if (entry.flags & MATERIAL_ALPHA_BLEND) != 0u {
        return clamp(opacity, 0.0, 1.0);
    }
    return 1.0;
}

@if(alpha)
fn surface_alpha(hit: Hit) -> f32 {
    let entry = materials[triangles[hit.triangle].material];
    if (entry.flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND)) == 0u {
        return 1.0;
    }
    let corners = triangles[hit.triangle].vertices;
    let v0 = vertices[corners.x];
    let v1 = vertices[corners.y];
    let v2 = vertices[corners.z];
    let b = vec3<f32>(1.0 - hit.u - hit.v, hit.u, hit.v);
    var opacity = entry.base_color.w * (v0.color.w * b.x + v1.color.w * b.y + v2.color.w * b.z);
    @if(textures) {
        if entry.base_color_texture != NONE {
            let uv0 = blend2(b, vertex_uv0(v0), vertex_uv0(v1), vertex_uv0(v2));
            let uv1 = blend2(b, vertex_uv1(v0), vertex_uv1(v1), vertex_uv1(v2));
            opacity *= slot(entry.base_color_texture, uv0, uv1).w;
        }
    }
    return coverage_of(entry, opacity);
}
@else
fn surface_alpha(hit: Hit) -> f32 {
    return 1.0;
}

@if(area_lights)
fn triangle_emission(triangle: u32, u: f32, v: f32) -> vec3<f32> {
    let entry = materials[triangles[triangle].material];
    var emission = entry.emissive;
    @if(textures) {
        if entry.emissive_texture != NONE {
            let corners = triangles[triangle].vertices;
            let v0 = vertices[corners.x];
            let v1 = vertices[corners.y];
            let v2 = vertices[corners.z];
            let b = vec3<f32>(1.0 - u - v, u, v);
            let uv0 = blend2(b, vertex_uv0(v0), vertex_uv0(v1), vertex_uv0(v2));
            let uv1 = blend2(b, vertex_uv1(v0), vertex_uv1(v1), vertex_uv1(v2));
            emission *= slot_rgb(entry.emissive_texture, uv0, uv1);
        }
    }
    return emission * surface_alpha(Hit(0.0, u, v, triangle));
}

@if(photo_albedo)
fn photo_albedo_at(position: vec3<f32>, object: u32) -> vec3<f32> {
    let seen = camera_project(position);
    if seen.valid {
        let pixel = u32(seen.py) * frame.width + u32(seen.px);
        let entry = photo_albedo[pixel];
        if entry.w > 0.0 && abs(entry.w - seen.depth) <= PHOTO_DEPTH_TOLERANCE * seen.depth {
            return entry.xyz;
        }
    }
    let first = frame.width * frame.height + object * (2u * PHOTO_PATCHES);
    var sum = vec3<f32>(0.0);
    var weights = 0.0;
    for (var patch_ = 0u; patch_ < PHOTO_PATCHES; patch_++) {
        let albedo = photo_albedo[first + 2u * patch_];
        let place = photo_albedo[first + 2u * patch_ + 1u];
        let away = position - place.xyz;
        let nearness = 1.0 / max(dot3(away, away) + place.w, NO_DISTANCE2);
        let weight = albedo.w * (nearness * nearness);
        sum += albedo.xyz * weight;
        weights += weight;
    }
    return sum * (1.0 / max(weights, NO_DISTANCE2));
}

fn perturbed(map: u32, scale: f32, normal: vec3<f32>, v0: Vertex, v1: Vertex, v2: Vertex, b: vec3<f32>) -> vec3<f32> {
    if map == NONE {
        return normal;
    }
    let entry = texture_refs[map];
    let second = (entry.flags & TEXTURE_UV1) != 0u;
    let c0 = select(vertex_uv0(v0), vertex_uv1(v0), second);
    let c1 = select(vertex_uv0(v1), vertex_uv1(v1), second);
    let c2 = select(vertex_uv0(v2), vertex_uv1(v2), second);
    var tangent: vec4<f32>;
    if v0.tangent.w != 0.0 {
        tangent = vec4<f32>(blend3(b, v0.tangent.xyz, v1.tangent.xyz, v2.tangent.xyz), v0.tangent.w);
    } else {
        let p0 = v0.position_u0.xyz;
        let e1 = v1.position_u0.xyz - p0;
        let e2 = v2.position_u0.xyz - p0;
        tangent = tangent_from_uv(e1, e2, c1 - c0, c2 - c0, normal);
    }
    let texel = texture_sample(entry, blend2(b, c0, c1, c2));
    return mapped_normal(normal, tangent, texel.xyz, scale);
}

fn surface_at(hit: Hit, ray_direction: vec3<f32>) -> Surface {
    let triangle = triangles[hit.triangle];
    let entry = materials[triangle.material];
    let v0 = vertices[triangle.vertices.x];
    let v1 = vertices[triangle.vertices.y];
    let v2 = vertices[triangle.vertices.z];
    let b = vec3<f32>(1.0 - hit.u - hit.v, hit.u, hit.v);
    let p0 = v0.position_u0.xyz;
    let p1 = v1.position_u0.xyz;
    let p2 = v2.position_u0.xyz;
    let position = blend3(b, p0, p1, p2);
    let a0 = abs(p0);
    let magnitude = blend3(abs(b), a0, abs(p1), abs(p2));
    let position_error = GAMMA_7 * (magnitude.x + magnitude.y + magnitude.z)
        + BARYCENTRIC_ERROR * (a0.x + a0.y + a0.z);
    let error = max(position_error, triangle.plane_error);

    let blended = unit(blend3(b, v0.normal_v0.xyz, v1.normal_v0.xyz, v2.normal_v0.xyz));
    var outward = triangle.normal;
    if all(outward == vec3<f32>(0.0)) { outward = blended; }
    let wo = -ray_direction;
    let front = dot3(wo, outward) >= 0.0;
    let facing = select(-1.0, 1.0, front);
    let ng = outward * facing;
    let interpolated = select(blended, -blended, dot3(blended, outward) < 0.0);

    var color = vec4<f32>(b.x + b.y + b.z);
    if (triangle.flags & TRIANGLE_UNTINTED) == 0u { color = blend4(b, v0.color, v1.color, v2.color); }
    var base = entry.base_color * color;
    var metallic = entry.metallic;
    var roughness = entry.roughness;
    var emission = entry.emissive;
    var specular = entry.specular;
    var specular_color = entry.specular_color;
    var transmission = entry.transmission;
    var clearcoat = entry.clearcoat;
    var coat_roughness = entry.clearcoat_roughness;
    var ns = interpolated;
    var coat_ns = interpolated;
    @if(textures) {
        if (entry.flags & MATERIAL_TEXTURED) != 0u {
            let uv0 = blend2(b, vertex_uv0(v0), vertex_uv0(v1), vertex_uv0(v2));
            let uv1 = blend2(b, vertex_uv1(v0), vertex_uv1(v1), vertex_uv1(v2));
            base *= slot(entry.base_color_texture, uv0, uv1);
            emission *= slot_rgb(entry.emissive_texture, uv0, uv1);
            @if(rough_specular) {
                let metallic_roughness = slot(entry.metallic_roughness_texture, uv0, uv1);
                metallic *= metallic_roughness.z;
                roughness *= metallic_roughness.y;
                specular *= slot(entry.specular_texture, uv0, uv1).w;
                specular_color *= slot_rgb(entry.specular_color_texture, uv0, uv1);
            }
            @if(transmission) {
                transmission *= slot(entry.transmission_texture, uv0, uv1).x;
            }
            @if(clearcoat) {
                clearcoat *= slot(entry.clearcoat_texture, uv0, uv1).x;
                coat_roughness *= slot(entry.clearcoat_roughness_texture, uv0, uv1).y;
            }
            @if(normal_maps) {
                ns = perturbed(entry.normal_texture, entry.normal_scale, interpolated, v0, v1, v2, b);
            }
            @if(normal_maps && clearcoat) {
                coat_ns = perturbed(entry.clearcoat_normal_texture, entry.clearcoat_normal_scale, interpolated, v0, v1, v2, b);
            }
        }
    }
    var base_color = clamp(base.xyz, vec3<f32>(0.0), vec3<f32>(1.0));
    var coverage = 1.0;
    @if(alpha) {
        coverage = coverage_of(entry, base.w);
    }
    var flags = entry.flags;
    @if(photo_albedo) {
        if (flags & MATERIAL_PHOTO_ALBEDO) != 0u {
            base_color = photo_albedo_at(position, triangle.object);
            flags |= MATERIAL_LAMBERTIAN;
        }
    }
    if (flags & MATERIAL_UNLIT) != 0u {
        emission = base_color;
    }
    if (flags & MATERIAL_QUAD_LIGHT) != 0u && !front {
        emission = vec3<f32>(0.0);
    }
    if !front && transmission > 0.0 && (flags & MATERIAL_THIN_WALLED) == 0u {
        clearcoat = 0.0;
    }
    ns *= facing;
    coat_ns *= facing;
    @if(rough_specular) {
        if (flags & MATERIAL_LAMBERTIAN) == 0u {
            ns = valid_shading_normal(ng, ns, wo);
            @if(clearcoat) {
                coat_ns = valid_shading_normal(ng, coat_ns, wo);
            }
        }
    }
    roughness = clamp(roughness, 0.0, 1.0);
    let alpha = roughness * roughness;
    var metal_gain = 0.0;
    var glass_gain = 1.0;
    @if(facets) {
        if entry.facet_table != NONE && alpha >= DELTA_ALPHA {
            let cos = clamp(dot3(wo, ns), 0.0, 1.0);
            metal_gain = 1.0 / kept_by_facets(0u, alpha, cos) - 1.0;
            let is_thin = (flags & MATERIAL_THIN_WALLED) != 0u;
            if transmission > 0.0 && (is_thin || !transmits_unblurred(alpha, entry.ior)) {
                var first = entry.facet_table;
                if !is_thin && !front { first += TABLE_SIZE; }
                glass_gain = 1.0 / kept_by_facets(first, alpha, cos);
            }
        }
    }
    coat_roughness = clamp(coat_roughness, 0.0, 1.0);
    return Surface(
        position,
        error,
        ng,
        ns,
        coat_ns,
        base_color,
        clamp(metallic, 0.0, 1.0),
        alpha,
        entry.ior,
        clamp(specular, 0.0, 1.0),
        max(specular_color, vec3<f32>(0.0)),
        clamp(transmission, 0.0, 1.0),
        clamp(clearcoat, 0.0, 1.0),
        coat_roughness * coat_roughness,
        emission,
        coverage,
        front,
        flags,
        triangle.material,
        triangle.light,
        triangle.object,
        metal_gain,
        glass_gain,
    );
}
