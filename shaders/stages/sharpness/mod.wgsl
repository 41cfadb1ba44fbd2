// Twin of src/stages/sharpness/mod.rs.

import package::math::exp_;
import package::stages::sharpness::gpu::{params, photo, planes};

fn sharpened(column: u32, row: u32) -> vec3<f32> {
    let width = params.width;
    let height = params.height;
    let reach = params.reach;
    let from_centre = vec2<f32>(
        f32(column) + 0.5 - 0.5 * f32(width),
        f32(row) + 0.5 - 0.5 * f32(height),
    );
    let half_diagonal = 0.5 * sqrt(f32(width * width + height * height));
    let out = from_centre / half_diagonal;
    let distance2 = out.x * out.x + out.y * out.y;
    let here = 3u * (row * width + column);
    var value = vec3<f32>(photo[here], photo[here + 1u], photo[here + 2u]);
    for (var c = 0u; c < 3u; c++) {
        let sigma2 = variance_at(params.sigma_px[c], params.corner_sigma_px[c], distance2);
        let wide2 = sigma2 + params.radius_px * params.radius_px;
        let shift = params.lateral_px[c] * out;
        var core_x = taps(sigma2, shift.x, reach);
        var core_y = taps(sigma2, shift.y, reach);
        var halo_x = taps(wide2, shift.x, reach);
        var halo_y = taps(wide2, shift.y, reach);
        var gain = 0.0;
        var light = 0.0;
        for (var j = 0u; j <= 2u * reach; j++) {
            let y = clamp(row + j, reach, height - 1u + reach) - reach;
            var core_gain = 0.0;
            var core_light = 0.0;
            var halo_gain = 0.0;
            var halo_light = 0.0;
            for (var i = 0u; i <= 2u * reach; i++) {
                let x = clamp(column + i, reach, width - 1u + reach) - reach;
                let plane = 6u * (y * width + x) + c;
                core_gain += core_x[i] * planes[plane];
                core_light += core_x[i] * planes[plane + 3u];
                halo_gain += halo_x[i] * planes[plane];
                halo_light += halo_x[i] * planes[plane + 3u];
            }
            let core = (1.0 + params.sharpening) * core_y[j];
            let halo = params.sharpening * halo_y[j];
            gain += core * core_gain - halo * halo_gain;
            light += core * core_light - halo * halo_light;
        }
        if gain != 0.0 || light != 0.0 {
            value[c] = value[c] * (1.0 + gain) + light;
        }
    }
    return value;
}

fn variance_at(centre: f32, corner: f32, distance2: f32) -> f32 {
    return centre * centre + (corner * corner - centre * centre) * distance2;
}

fn taps(variance: f32, shift: f32, reach: u32) -> array<f32, TAPS> {
    let scale = -0.5 / max(variance, 0.04);
    var taps: array<f32, TAPS>;
    var sum = 0.0;
    for (var i = 0u; i <= 2u * reach; i++) {
        let x = f32(i) - f32(reach) + shift;
        let weight = exp_(x * x * scale);
        taps[i] = weight;
        sum += weight;
    }
    for (var i = 0u; i <= 2u * reach; i++) {
        taps[i] /= sum;
    }
    return taps;
}
