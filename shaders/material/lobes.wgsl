// Twin of src/material/lobes.rs: the same operations in the same order.

import package::packed::records::{MATERIAL_QUAD_LIGHT, MATERIAL_THIN_WALLED, MATERIAL_UNLIT};
import package::material::fresnel::{fresnel_dielectric, normal_reflectance, relative_index, schlick, RelativeIndex};
import package::material::ggx::MIN_COS;
import package::math::dot3;
import package::material::surface::Surface;

struct Lobes {
    coat: f32,
    interface_: Interface,
    interface_albedo: f32,
    sum: f32,
    p_diffuse: f32,
    p_interface: f32,
    p_coat: f32,
}

fn max3(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

fn scatters_nothing(s: Surface) -> bool {
    return (s.flags & (MATERIAL_UNLIT | MATERIAL_QUAD_LIGHT)) != 0u;
}

fn thin_walled(s: Surface) -> bool {
    return (s.flags & MATERIAL_THIN_WALLED) != 0u;
}

fn surface_index(s: Surface) -> RelativeIndex {
    return relative_index(s.ior, s.front || thin_walled(s));
}

fn reflects_delta(s: Surface) -> bool {
    return s.ggx_alpha < DELTA_ALPHA;
}

fn transmits_delta(s: Surface) -> bool {
    return reflects_delta(s) || (!thin_walled(s) && s.ggx_alpha * abs(s.ior - 1.0) < DELTA_BEND);
}

fn coat_delta(s: Surface) -> bool {
    return s.coat_alpha < DELTA_ALPHA;
}

fn cos_to(normal: vec3<f32>, wo: vec3<f32>) -> f32 {
    return clamp(dot3(normal, wo), MIN_COS, 1.0);
}

fn dielectric_f0(s: Surface) -> vec3<f32> {
    return min(s.specular_color * normal_reflectance(s.ior), vec3<f32>(1.0));
}

fn opaque_fresnel(s: Surface, cos: f32) -> vec3<f32> {
    return schlick(dielectric_f0(s), cos) * s.specular;
}

fn transmitting_fresnel(s: Surface, cos: f32) -> vec3<f32> {
    let exact = fresnel_dielectric(cos, surface_index(s));
    if exact.total {
        return vec3<f32>(1.0);
    }
    let f0 = normal_reflectance(s.ior);
    let rise = clamp((exact.reflectance - f0) / max(1.0 - f0, 1e-6), -1.0, 1.0);
    let low = dielectric_f0(s);
    let f = clamp((low + (vec3<f32>(1.0) - low) * rise) * s.specular, vec3<f32>(0.0), vec3<f32>(1.0));
    if thin_walled(s) {
        return f * 2.0 / (vec3<f32>(1.0) + f);
    }
    return f;
}

fn interface_at(s: Surface, cos: f32) -> Interface {
    let dielectric = 1.0 - s.metallic;
    var reflected = schlick(s.base_color, cos) * s.metallic
        + opaque_fresnel(s, cos) * (dielectric * (1.0 - s.transmission));
    var transmitted = vec3<f32>(0.0);
    @if(transmission) {
        if s.transmission > 0.0 {
            let share = dielectric * s.transmission;
            let f = transmitting_fresnel(s, cos);
            reflected += f * share;
            transmitted = s.base_color * (share * (1.0 - max3(f)));
        }
    }
    let total = max3(reflected) + max3(transmitted);
    var inv = 0.0;
    if total > NO_ALBEDO {
        inv = 1.0 / total;
    }
    return Interface(reflected, transmitted, max3(reflected) * inv, max3(transmitted) * inv, total);
}

fn grazing_albedo(s: Surface) -> f32 {
    let dielectric = 1.0 - s.metallic;
    return s.metallic + dielectric * (s.specular * (1.0 - s.transmission) + s.transmission);
}

fn diffuse_color(s: Surface) -> vec3<f32> {
    return s.base_color * ((1.0 - s.metallic) * (1.0 - s.transmission));
}

fn diffuse_albedo(s: Surface, cos: f32) -> vec3<f32> {
    let f = opaque_fresnel(s, sqrt(0.5 + 0.5 * cos));
    return diffuse_color(s) * (1.0 - max3(f));
}

fn coat_share(s: Surface, wo: vec3<f32>) -> f32 {
    @if(clearcoat) {
        if s.clearcoat > 0.0 {
            return s.clearcoat * schlick(vec3<f32>(COAT_F0), cos_to(s.coat_ns, wo)).x;
        }
    }
    return 0.0;
}

fn lobes_at(s: Surface, wo: vec3<f32>) -> Lobes {
    let cos = cos_to(s.ns, wo);
    let coat = coat_share(s, wo);
    let at_normal = interface_at(s, cos);
    let under = 1.0 - coat;
    let diffuse = under * max3(diffuse_albedo(s, cos));
    var interface_albedo = at_normal.total;
    if !reflects_delta(s) {
        interface_albedo = at_normal.total + (0.01 + 0.05 * s.ggx_alpha) * grazing_albedo(s);
    }
    let specular = under * interface_albedo;
    let sum = coat + diffuse + specular;
    var inv = 0.0;
    if sum > NO_ALBEDO {
        inv = 1.0 / sum;
    }
    return Lobes(coat, at_normal, interface_albedo, sum, diffuse * inv, specular * inv, coat * inv);
}

fn lambert_cos(s: Surface, wi: vec3<f32>) -> f32 {
    let height = dot3(s.ng, wi);
    if height <= 0.0 {
        return 0.0;
    }
    let direct = dot3(s.ns, wi);
    let mirrored = direct - 2.0 * height * dot3(s.ng, s.ns);
    return max(direct, 0.0) + max(mirrored, 0.0);
}
