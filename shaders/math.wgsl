// Twin of src/math.rs: the same operations in the same order.


struct SinCos {
    sin: f32,
    cos: f32,
}

fn sincos_2pi(x: f32) -> SinCos {
    let quarter = floor(x * 4.0 + 0.5);
    let r = x - quarter * 0.25;
    let z = r * r;
    let p = ((-75.39356 * z + 81.592354) * z - 41.341663) * z + TAU;
    let s = r * p;
    let c = 1.0 + z * (((59.250042 * z - 85.44387) * z + 64.93933) * z - 19.739208);
    let quadrant = i32(quarter) & 3;
    let swap = (quadrant & 1) != 0;
    let sine = select(s, c, swap);
    let cosine = select(c, s, swap);
    return SinCos(
        select(sine, -sine, quadrant >= 2),
        select(cosine, -cosine, quadrant == 1 || quadrant == 2),
    );
}

fn acos_(x: f32) -> f32 {
    let a = min(abs(x), 1.0);
    let outer = a > 0.5;
    let z = select(a * a, (1.0 - a) * 0.5, outer);
    let y = select(a, sqrt(z), outer);
    let p = ((((0.037513852 * z + 0.014440975) * z + 0.0318069) * z + 0.044517085) * z
        + 0.07500503) * z + 0.1666666;
    let asin = y + y * z * p;
    let acos = asin * 2.0;
    let outer_angle = select(acos, PI - acos, x < 0.0);
    let inner_angle = select(FRAC_PI_2 - asin, FRAC_PI_2 + asin, x < 0.0);
    return select(inner_angle, outer_angle, outer);
}

fn atan2_(y: f32, x: f32) -> f32 {
    let ax = abs(x);
    let ay = abs(y);
    let large = max(ax, ay);
    let small = min(ax, ay);
    if large == 0.0 {
        return 0.0;
    }
    let t = small / large;
    let upper = t > TAN_PI_8;
    var u = t;
    if upper {
        u = (small - large) / (small + large);
    }
    let z = u * u;
    let p = (((-0.06084236 * z + 0.10596365) * z - 0.14243908) * z + 0.19998494) * z - 0.33333316;
    var angle = u + u * z * p;
    if upper {
        angle += FRAC_PI_4;
    }
    if ay > ax {
        angle = FRAC_PI_2 - angle;
    }
    if x < 0.0 {
        angle = PI - angle;
    }
    return select(angle, -angle, y < 0.0);
}

fn exp_(x: f32) -> f32 {
    if x < -87.0 {
        return 0.0;
    }
    let bounded = min(x, 88.0);
    let n = floor(bounded * LOG2_E + 0.5);
    let r = max(bounded - n * LN_2_HI, -1.0) - n * LN_2_LO;
    let p = (((0.0013814597 * r + 0.008368729) * r + 0.04166839) * r + 0.16666521) * r + 0.49999994;
    let e = (p * r + 1.0) * r + 1.0;
    return e * bitcast<f32>(u32(i32(n) + 127) << 23u);
}

fn log_(x: f32) -> f32 {
    let bits = bitcast<u32>(max(x, MIN_NORMAL));
    let exponent = f32(i32(bits >> 23u) - 127);
    let mantissa = bitcast<f32>((bits & 0x007fffffu) | 0x3f800000u);
    let upper = mantissa > SQRT_2;
    let m = select(mantissa, mantissa * 0.5, upper);
    let e = select(exponent, exponent + 1.0, upper);
    let f = m - 1.0;
    let p = (((((((0.06741048 * f - 0.11582882) * f + 0.11837326) * f - 0.12419113) * f
        + 0.14229332) * f - 0.16667485) * f + 0.20001526) * f - 0.25000012) * f + 0.33333322;
    let z = f * f;
    let log1p = f + z * (f * p - 0.5);
    return e * LN_2 + log1p;
}

fn is_non_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) >= 0x7f800000u;
}

fn hash_u32(x: u32) -> u32 {
    var h = x;
    h ^= h >> 16u;
    h = h * 0x7feb352du;
    h ^= h >> 15u;
    h = h * 0x846ca68bu;
    return h ^ (h >> 16u);
}

fn hash_combine(a: u32, b: u32) -> u32 {
    return hash_u32(hash_u32(a + 0x9e3779b9u) ^ b);
}

fn uniform_from_bits(bits: u32) -> f32 {
    return f32(bits >> 8u) * (1.0 / 16777216.0);
}

struct Basis {
    t: vec3<f32>,
    b: vec3<f32>,
}

fn orthonormal_basis(n: vec3<f32>) -> Basis {
    let sign = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    return Basis(
        vec3<f32>(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        vec3<f32>(b, sign + n.y * n.y * a, -n.y),
    );
}

fn luminance(rgb: vec3<f32>) -> f32 {
    return rgb.x * 0.2126 + rgb.y * 0.7152 + rgb.z * 0.0722;
}

fn safe_sqrt(x: f32) -> f32 {
    return sqrt(max(x, 0.0));
}

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

fn cross3(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        a.y * b.z - a.z * b.y,
        a.z * b.x - a.x * b.z,
        a.x * b.y - a.y * b.x,
    );
}

fn length3(v: vec3<f32>) -> f32 {
    return sqrt(dot3(v, v));
}

fn normalize3(v: vec3<f32>) -> vec3<f32> {
    return v / length3(v);
}
