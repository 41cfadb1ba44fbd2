// Twin of the f32 half of src/distortion.rs: the same operations in the same order. Coefficients: k1 k2 p1 p2 k3.

fn distort(k: array<f32, 5>, ideal: vec2<f32>) -> vec2<f32> {
    let x = ideal.x;
    let y = ideal.y;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    return vec2<f32>(
        x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x),
        y * radial + k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y,
    );
}

fn jacobian(k: array<f32, 5>, ideal: vec2<f32>) -> vec3<f32> {
    let x = ideal.x;
    let y = ideal.y;
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    let slope = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]);
    return vec3<f32>(
        radial + 2.0 * x * x * slope + 2.0 * k[2] * y + 6.0 * k[3] * x,
        2.0 * x * y * slope + 2.0 * k[2] * x + 2.0 * k[3] * y,
        radial + 2.0 * y * y * slope + 6.0 * k[2] * y + 2.0 * k[3] * x,
    );
}

fn distortion_area(k: array<f32, 5>, ideal: vec2<f32>) -> f32 {
    let j = jacobian(k, ideal);
    return abs(j.x * j.z - j.y * j.y);
}

fn undistort_fast(k: array<f32, 5>, distorted: vec2<f32>) -> vec2<f32> {
    if k[0] == 0.0 && k[1] == 0.0 && k[2] == 0.0 && k[3] == 0.0 && k[4] == 0.0 {
        return distorted;
    }
    var x = distorted.x;
    var y = distorted.y;
    for (var i = 0u; i < UNDISTORT_STEPS; i++) {
        let at = distort(k, vec2<f32>(x, y));
        let ex = at.x - distorted.x;
        let ey = at.y - distorted.y;
        let j = jacobian(k, vec2<f32>(x, y));
        let determinant = j.x * j.z - j.y * j.y;
        let inverse = 1.0 / max(determinant, 1e-4);
        x -= clamp((j.z * ex - j.y * ey) * inverse, -0.5, 0.5);
        y -= clamp((j.x * ey - j.y * ex) * inverse, -0.5, 0.5);
    }
    return vec2<f32>(x, y);
}
