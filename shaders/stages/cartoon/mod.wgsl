// Twin of src/stages/cartoon/{mod,planes,simplify,edges}.rs: one thread a pixel of the shrunk or of the full picture.

const LUMA: vec3<f32> = vec3<f32>(0.299, 0.587, 0.114);
const U_MAX: f32 = 0.436;
const V_MAX: f32 = 0.615;
const REACH: i32 = 2;
const LEAST_EXPONENT: f32 = -80.0;
const LOG2_E: f32 = 1.44269504;
const LN_2: f32 = 0.693147181;

struct CartoonParams {
    width: u32,
    height: u32,
    small_width: u32,
    small_height: u32,
    // -1 / (2 sigma_p^2)
    factor: f32,
    alpha: f32,
    beta: f32,
    s0: f32,
    s1: f32,
    a0: f32,
    a1: f32,
    // 1: `lines` hold the silhouettes.
    flow: u32,
}

@group(0) @binding(0) var<uniform> params: CartoonParams;
// Encoded, clamped to 0..=1, three words a pixel.
@group(0) @binding(1) var<storage, read> image: array<f32>;
// Y, U, V and the response of the simplified picture.
@group(0) @binding(2) var<storage, read> simplified: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> next: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> lines: array<f32>;
// Three words a pixel, then three planes: responses of the simplified and of the original picture, silhouettes.
@group(0) @binding(5) var<storage, read_write> result: array<f32>;

fn yuv_from_rgb(rgb: vec3<f32>) -> vec3<f32> {
    let y = LUMA.x * rgb.x + LUMA.y * rgb.y + LUMA.z * rgb.z;
    return vec3<f32>(
        y,
        (rgb.z - y) * (U_MAX / (1.0 - LUMA.z)),
        (rgb.x - y) * (V_MAX / (1.0 - LUMA.x)),
    );
}

fn rgb_from_yuv(yuv: vec3<f32>) -> vec3<f32> {
    let r = yuv.x + yuv.z * ((1.0 - LUMA.x) / V_MAX);
    let b = yuv.x + yuv.y * ((1.0 - LUMA.z) / U_MAX);
    return vec3<f32>(r, (yuv.x - LUMA.x * r - LUMA.z * b) / LUMA.y, b);
}

fn rgb_at(index: u32) -> vec3<f32> {
    return vec3<f32>(image[3u * index], image[3u * index + 1u], image[3u * index + 2u]);
}

fn overlap(part: u32, pixel: u32, large: u32, small: u32) -> f32 {
    let covered = min((part + 1u) * large, (pixel + 1u) * small) - max(part * large, pixel * small);
    return f32(covered) / f32(large);
}

@compute @workgroup_size(8, 8)
fn stage_shrink(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.small_width || id.y >= params.small_height {
        return;
    }
    let left = id.x * params.width / params.small_width;
    let right = ((id.x + 1u) * params.width + params.small_width - 1u) / params.small_width;
    let top = id.y * params.height / params.small_height;
    let bottom = ((id.y + 1u) * params.height + params.small_height - 1u) / params.small_height;
    var rgb = vec3<f32>(0.0);
    for (var x = left; x < right; x++) {
        var sum = vec3<f32>(0.0);
        for (var y = top; y < bottom; y++) {
            sum += overlap(id.y, y, params.height, params.small_height) * rgb_at(y * params.width + x);
        }
        rgb += overlap(id.x, x, params.width, params.small_width) * sum;
    }
    next[id.y * params.small_width + id.x] = vec4<f32>(yuv_from_rgb(rgb), 0.0);
}

// e^x for x <= 0.
fn gaussian(x: f32) -> f32 {
    let t = max(x, LEAST_EXPONENT) * LOG2_E;
    let whole = i32(t - 0.5);
    let r = t - f32(whole);
    let p = (((((1.540353e-4 * r + 1.3333558e-3) * r + 9.618129e-3) * r + 0.05550411) * r + 0.2402265) * r
        + LN_2) * r + 1.0;
    return p * bitcast<f32>(u32(whole + 127) << 23u);
}

fn simplified_at(x: i32, y: i32) -> vec4<f32> {
    let column = u32(clamp(x, 0, i32(params.small_width) - 1));
    let row = u32(clamp(y, 0, i32(params.small_height) - 1));
    return simplified[row * params.small_width + column];
}

@compute @workgroup_size(8, 8)
fn stage_filter(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.small_width || id.y >= params.small_height {
        return;
    }
    let x = i32(id.x);
    let y = i32(id.y);
    let center = simplified_at(x, y);
    var sum = vec3<f32>(0.0);
    var norm = 0.0;
    for (var dy = -REACH; dy <= REACH; dy++) {
        for (var dx = -REACH; dx <= REACH; dx++) {
            let near = simplified_at(x + dx, y + dy).xyz;
            let du = near.y - center.y;
            let dv = near.z - center.z;
            let weight = gaussian((du * du + dv * dv) * params.factor);
            norm += weight;
            sum += weight * near;
        }
    }
    next[id.y * params.small_width + id.x] = vec4<f32>(sum * (1.0 / norm), 0.0);
}

struct Gradients {
    x: vec3<f32>,
    y: vec3<f32>,
}

fn response(g: Gradients) -> f32 {
    let m = sqrt(g.x * g.x + g.y * g.y);
    return (1.0 - params.alpha) * m.x + 0.5 * params.alpha * m.y + 0.5 * params.alpha * m.z;
}

fn simplified_yuv(x: i32, y: i32) -> vec3<f32> {
    return simplified_at(x, y).xyz;
}

fn sobel(
    a0: vec3<f32>, a1: vec3<f32>, a2: vec3<f32>,
    h0: vec3<f32>, h2: vec3<f32>,
    b0: vec3<f32>, b1: vec3<f32>, b2: vec3<f32>,
) -> Gradients {
    let gx = (a2 - a0) + 2.0 * (h2 - h0) + (b2 - b0);
    let gy = (b0 - a0) + 2.0 * (b1 - a1) + (b2 - a2);
    return Gradients(gx * 0.25, gy * 0.25);
}

@compute @workgroup_size(8, 8)
fn stage_respond(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.small_width || id.y >= params.small_height {
        return;
    }
    let x = i32(id.x);
    let y = i32(id.y);
    let g = sobel(
        simplified_yuv(x - 1, y - 1), simplified_yuv(x, y - 1), simplified_yuv(x + 1, y - 1),
        simplified_yuv(x - 1, y), simplified_yuv(x + 1, y),
        simplified_yuv(x - 1, y + 1), simplified_yuv(x, y + 1), simplified_yuv(x + 1, y + 1),
    );
    next[id.y * params.small_width + id.x] = vec4<f32>(simplified_yuv(x, y), response(g));
}

fn yuv_at(x: i32, y: i32) -> vec3<f32> {
    let column = u32(clamp(x, 0, i32(params.width) - 1));
    let row = u32(clamp(y, 0, i32(params.height) - 1));
    return yuv_from_rgb(rgb_at(row * params.width + column));
}

fn image_gradients(x: i32, y: i32) -> Gradients {
    return sobel(
        yuv_at(x - 1, y - 1), yuv_at(x, y - 1), yuv_at(x + 1, y - 1),
        yuv_at(x - 1, y), yuv_at(x + 1, y),
        yuv_at(x - 1, y + 1), yuv_at(x, y + 1), yuv_at(x + 1, y + 1),
    );
}

fn smoothstep_(low: f32, high: f32, x: f32) -> f32 {
    let t = clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

// Where a pixel of the full picture lies among the shrunk one's.
fn tap(index: u32, large: u32, small: u32) -> f32 {
    let scale = f32(small) / f32(large);
    return clamp((f32(index) + 0.5) * scale - 0.5, 0.0, f32(small - 1u));
}

@compute @workgroup_size(8, 8)
fn stage_compose(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let index = id.y * params.width + id.x;
    let at_x = tap(id.x, params.width, params.small_width);
    let at_y = tap(id.y, params.height, params.small_height);
    let x = i32(at_x);
    let y = i32(at_y);
    let weight_x = at_x - f32(x);
    let weight_y = at_y - f32(y);
    let left = simplified_at(x, y) + (simplified_at(x, y + 1) - simplified_at(x, y)) * weight_y;
    let right = simplified_at(x + 1, y) + (simplified_at(x + 1, y + 1) - simplified_at(x + 1, y)) * weight_y;
    let color = left + (right - left) * weight_x;
    let original = response(image_gradients(i32(id.x), i32(id.y)));
    var silhouette = (1.0 - params.beta) * smoothstep_(params.s0, params.s1, color.w)
        + params.beta * smoothstep_(params.a0, params.a1, original);
    if params.flow != 0u {
        silhouette = lines[index];
    }
    let rgb = rgb_from_yuv(color.xyz) * (1.0 - silhouette);
    result[3u * index] = rgb.x;
    result[3u * index + 1u] = rgb.y;
    result[3u * index + 2u] = rgb.z;
    let count = params.width * params.height;
    result[3u * count + index] = color.w;
    result[4u * count + index] = original;
    result[5u * count + index] = silhouette;
}
