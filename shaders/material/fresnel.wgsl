// Twin of src/material/fresnel.rs: the same operations in the same order.

fn schlick(f0: vec3<f32>, cos: f32) -> vec3<f32> {
    let m = 1.0 - clamp(cos, 0.0, 1.0);
    let m2 = m * m;
    let m5 = m2 * m2 * m;
    return f0 + (vec3<f32>(1.0) - f0) * m5;
}

fn normal_reflectance(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    return r * r;
}

fn relative_index(ior: f32, entering: bool) -> RelativeIndex {
    let n = max(ior, 1e-3);
    let n2_minus_1 = (n - 1.0) * (n + 1.0);
    if entering {
        return RelativeIndex(n, n2_minus_1);
    }
    return RelativeIndex(1.0 / n, -n2_minus_1 / (n * n));
}

fn fresnel_dielectric(cos: f32, index: RelativeIndex) -> DielectricFresnel {
    let c = clamp(cos, 0.0, 1.0);
    if index.eta2_minus_1 == 0.0 {
        return DielectricFresnel(0.0, c, false);
    }
    let g2 = index.eta2_minus_1 + c * c;
    if g2 <= 0.0 {
        return DielectricFresnel(1.0, 0.0, true);
    }
    let g = sqrt(g2);
    let sum = c + g;
    let rs = index.eta2_minus_1 / (sum * sum);
    let sin2 = (1.0 - c) * (1.0 + c);
    let ratio = (c * g - sin2) / (c * g + sin2);
    return DielectricFresnel(min(0.5 * rs * rs * (1.0 + ratio * ratio), 1.0), g, false);
}

fn refract_about(wo: vec3<f32>, h: vec3<f32>, cos: f32, index: RelativeIndex, g: f32) -> vec3<f32> {
    if index.eta2_minus_1 == 0.0 {
        return -wo;
    }
    let c_minus_g = -index.eta2_minus_1 / (cos + g);
    return (h * c_minus_g - wo) * (1.0 / index.eta);
}
