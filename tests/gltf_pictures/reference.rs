//! The reference for silhouettes, texture placement and normals: rays against every triangle that projects onto their pixel, in f64.

use std::sync::Arc;

use glam::{DVec2, DVec3};
use mixray::scene::{AlphaMode, Material, Scene, Texture, TextureRef, Wrap};

use super::{project, world_triangles};

/// Rays across a pixel's width.
const GRID: usize = 4;

struct Facet {
    corners: [DVec3; 3],
    normals: [DVec3; 3],
    uvs: [[DVec2; 3]; 2],
    material: Arc<Material>,
}

/// A point that a camera ray meets.
pub struct Met<'a> {
    pub material: &'a Material,
    /// Unit; interpolated between the vertices.
    pub normal: DVec3,
    uvs: [DVec2; 2],
}

impl Met<'_> {
    fn texel(&self, reference: &TextureRef) -> [f64; 4] {
        let uv = self.uvs[reference.uv_set as usize];
        let m = reference.transform.map(f64::from);
        let u = m[0] * uv.x + m[1] * uv.y + m[2];
        let v = m[3] * uv.x + m[4] * uv.y + m[5];
        bilinear(&reference.texture, u, v)
    }

    /// Linear, alpha included.
    pub fn base_color(&self) -> [f64; 4] {
        let mut color = self.material.base_color.map(f64::from);
        if let Some(texture) = &self.material.base_color_texture {
            let texel = self.texel(texture);
            for c in 0..3 {
                color[c] *= texel[c];
            }
            color[3] *= texel[3];
        }
        color
    }

    /// Opacity.
    pub fn coverage(&self) -> f64 {
        match self.material.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => f64::from(self.base_color()[3] >= f64::from(cutoff)),
            AlphaMode::Blend => self.base_color()[3],
        }
    }
}

fn wrapped(at: i64, size: i64, wrap: Wrap) -> usize {
    let index = match wrap {
        Wrap::Repeat => at.rem_euclid(size),
        Wrap::Mirror => {
            let at = at.rem_euclid(2 * size);
            at.min(2 * size - 1 - at)
        }
        Wrap::Clamp => at.clamp(0, size - 1),
    };
    index as usize
}

fn decoded(code: u8) -> f64 {
    let x = f64::from(code) / 255.0;
    if x <= 0.04045 {
        x / 12.92
    } else {
        ((x + 0.055) / 1.055).powf(2.4)
    }
}

/// RGB decoded from sRGB; v grows downwards.
fn bilinear(texture: &Texture, u: f64, v: f64) -> [f64; 4] {
    let (x, y) = (
        u * f64::from(texture.width) - 0.5,
        v * f64::from(texture.height) - 0.5,
    );
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let mut sum = [0.0; 4];
    for (dx, dy, weight) in [
        (0, 0, (1.0 - fx) * (1.0 - fy)),
        (1, 0, fx * (1.0 - fy)),
        (0, 1, (1.0 - fx) * fy),
        (1, 1, fx * fy),
    ] {
        let column = wrapped(x.floor() as i64 + dx, texture.width.into(), texture.wrap_u);
        let row = wrapped(y.floor() as i64 + dy, texture.height.into(), texture.wrap_v);
        let texel = texture.rgba8[row * texture.width as usize + column];
        for c in 0..3 {
            sum[c] += weight * decoded(texel[c]);
        }
        sum[3] += weight * f64::from(texel[3]) / 255.0;
    }
    sum
}

fn facets(scene: &Scene) -> Vec<Facet> {
    world_triangles(scene)
        .map(|(instance, triangle, corners)| {
            let primitive = &instance.primitive;
            let linear = scene.objects[0].world_from_object * instance.object_from_local;
            let normal_from_local = linear.inverse().transpose();
            let normals = triangle.map(|v| {
                let n = DVec3::from_array(primitive.normals[v as usize].map(f64::from));
                normal_from_local.transform_vector3(n).normalize()
            });
            let uvs = [0, 1].map(|set| {
                triangle.map(|v| {
                    primitive.uvs[set]
                        .get(v as usize)
                        .map_or(DVec2::ZERO, |uv| DVec2::from_array(uv.map(f64::from)))
                })
            });
            Facet {
                corners,
                normals,
                uvs,
                material: instance.material.clone(),
            }
        })
        .collect()
}

/// Distance and barycentrics (Moller and Trumbore 1997).
fn meet(facet: &Facet, origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 3])> {
    let [a, b, c] = facet.corners;
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = (origin - a) / determinant;
    let u = s.dot(p);
    let q = s.cross(e1);
    let v = direction.dot(q);
    let t = e2.dot(q);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, [1.0 - u - v, u, v]))
}

/// For each pixel, the facets whose bounds in the picture touch it. All of them lie before the camera.
fn by_pixel<'a>(scene: &Scene, facets: &'a [Facet]) -> Vec<Vec<&'a Facet>> {
    let camera = &scene.camera;
    let mut buckets = vec![Vec::new(); (camera.width * camera.height) as usize];
    for facet in facets {
        let at = facet.corners.map(|corner| project(scene, corner));
        let range = |c: usize, size: u32| {
            let low = at.iter().map(|p| p[c]).fold(f64::INFINITY, f64::min) - 1e-3;
            let high = at.iter().map(|p| p[c]).fold(0.0, f64::max) + 1e-3;
            (low.max(0.0) as u32)..(high.ceil().max(0.0) as u32).min(size)
        };
        for y in range(1, camera.height) {
            for x in range(0, camera.width) {
                buckets[(y * camera.width + x) as usize].push(facet);
            }
        }
    }
    buckets
}

/// For each pixel of the picture, the mean over a grid of rays of `value` times opacity, and of opacity itself. Only the nearest
/// surface counts: for models whose transparent surfaces do not lie behind each other.
pub fn picture(scene: &Scene, value: impl Fn(&Met, DVec3) -> DVec3) -> Vec<(DVec3, f64)> {
    let facets = facets(scene);
    let buckets = by_pixel(scene, &facets);
    let camera = &scene.camera;
    let pose = camera.world_from_camera;
    let origin = pose.w_axis.truncate();
    let share = 1.0 / (GRID * GRID) as f64;
    let mut pixels = Vec::new();
    for index in 0..camera.width * camera.height {
        let (mut sum, mut coverage) = (DVec3::ZERO, 0.0);
        for ray in 0..GRID * GRID {
            let at = |i: usize| (i as f64 + 0.5) / GRID as f64;
            let x = f64::from(index % camera.width) + at(ray % GRID);
            let y = f64::from(index / camera.width) + at(ray / GRID);
            let local = DVec3::new(
                (x - camera.cx) / camera.fx,
                (camera.cy - y) / camera.fy,
                -1.0,
            );
            let direction = pose.transform_vector3(local).normalize();
            let nearest = buckets[index as usize]
                .iter()
                .filter_map(|facet| meet(facet, origin, direction).map(|met| (facet, met)))
                .min_by(|a, b| a.1.0.total_cmp(&b.1.0));
            if let Some((facet, (_, [w0, w1, w2]))) = nearest {
                let [n0, n1, n2] = facet.normals;
                let met = Met {
                    material: &facet.material,
                    normal: (n0 * w0 + n1 * w1 + n2 * w2).normalize(),
                    uvs: facet.uvs.map(|[a, b, c]| a * w0 + b * w1 + c * w2),
                };
                sum += value(&met, direction) * (met.coverage() * share);
                coverage += met.coverage() * share;
            }
        }
        pixels.push((sum, coverage));
    }
    pixels
}

/// Root of the mean square difference.
pub fn rms(a: impl Iterator<Item = f64>, b: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (a, b) in a.zip(b) {
        sum += (a - b) * (a - b);
        count += 1.0;
    }
    f64::sqrt(sum / count)
}
