// Twin of src/material/interface.rs: the same operations in the same order.

import package::packed::records::MATERIAL_THIN_WALLED;
import package::material::fresnel::{fresnel_dielectric, normal_reflectance, relative_index, schlick, RelativeIndex};
import package::material::ggx::{DELTA_ALPHA, MIN_COS, transmits_unblurred};
import package::math::dot3;
import package::material::surface::Surface;

fn max3(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
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
    return reflects_delta(s) || (!thin_walled(s) && transmits_unblurred(s.ggx_alpha, s.ior));
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
    let metal = schlick(s.base_color, cos) * (vec3<f32>(1.0) + s.base_color * s.metal_gain);
    var reflected = metal * s.metallic
        + opaque_fresnel(s, cos) * (dielectric * (1.0 - s.transmission));
    var transmitted = vec3<f32>(0.0);
    @if(transmission) {
        if s.transmission > 0.0 {
            let share = dielectric * s.transmission * s.glass_gain;
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
