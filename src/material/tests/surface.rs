use bytemuck::Zeroable;
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::texture::random_texture;
use super::{Random, around, one_triangle, plain_material};
use crate::accel::Hit;
use crate::material::normal::{mapped_normal, tangent_from_uv, valid_shading_normal};
use crate::material::{bsdf_is_lambertian, surface_alpha, surface_at};
use crate::packed::{
    Frame, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, MATERIAL_LAMBERTIAN, MATERIAL_PHOTO_ALBEDO,
    MATERIAL_QUAD_LIGHT, MATERIAL_TEXTURED, MATERIAL_UNLIT, Material, NONE, PHOTO_PATCHES,
    PackedScene, TEXTURE_NEAREST, TEXTURE_UV1, TextureRef, Triangle, Vertex,
};

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn hit(u: f32, v: f32) -> Hit {
    Hit {
        t: 1.0,
        u,
        v,
        triangle: 0,
    }
}

fn texture(width: u32, height: u32) -> TextureRef {
    TextureRef {
        width,
        height,
        transform_u: [1.0, 0.0, 0.0, 0.0],
        transform_v: [0.0, 1.0, 0.0, 0.0],
        ..TextureRef::zeroed()
    }
}

fn textured(material: Material, texels: Vec<u32>, width: u32) -> PackedScene {
    let height = texels.len() as u32 / width;
    let mut scene = one_triangle(
        CORNERS,
        Material {
            flags: material.flags | MATERIAL_TEXTURED,
            ..material
        },
    );
    scene.texels = texels;
    scene.texture_refs = vec![texture(width, height)];
    scene
}

#[test]
fn the_position_error_is_bounded() {
    let mut random = Random::new(2);
    let mut tightest = 0.0f64;
    for _ in 0..20_000 {
        let scale = 10f32.powf(random.range(-4.0, 6.0));
        let centre = random.direction() * scale * random.range(0.0, 10.0);
        let corners: [[f32; 3]; 3] = std::array::from_fn(|_| {
            let spread = random.range(0.01, 2.0) * scale;
            (centre + random.direction() * spread).to_array()
        });
        let scene = one_triangle(corners, plain_material());
        let u = random.uniform();
        let v = random.uniform() * (1.0 - u);
        let surface = surface_at(&scene, hit(u, v), -Vec3::Z);
        let [a, b, c] = corners.map(|p| Vec3::from(p).as_dvec3());
        let exact: DVec3 =
            a * (1.0 - f64::from(u) - f64::from(v)) + b * f64::from(u) + c * f64::from(v);
        let error = surface.position.as_dvec3().distance(exact);
        tightest = tightest.max(error / f64::from(surface.error));
        assert!(
            error <= f64::from(surface.error),
            "{error} {}",
            surface.error
        );
    }
    // Negative control: the bound is no more than ten times too wide, so a tenth of it would fail.
    assert!(tightest > 0.1, "{tightest}");
}

#[test]
fn sides_and_normals_face_the_ray() {
    let scene = one_triangle(CORNERS, plain_material());
    let above = surface_at(&scene, hit(0.2, 0.3), -Vec3::Z);
    assert!(above.front && above.ng == Vec3::Z && above.ns == Vec3::Z);
    assert_eq!(above.object, 7);
    let below = surface_at(&scene, hit(0.2, 0.3), Vec3::Z);
    assert!(!below.front && below.ng == -Vec3::Z && below.ns == -Vec3::Z);

    // Vertex normals against the winding follow the geometry.
    let mut inverted = one_triangle(CORNERS, plain_material());
    for vertex in &mut inverted.vertices {
        vertex.normal_v0[2] = -1.0;
    }
    let surface = surface_at(&inverted, hit(0.2, 0.3), -Vec3::Z);
    assert!(surface.front && surface.ns == Vec3::Z);
}

#[test]
fn interpolated_normals_are_unit_and_blended() {
    let mut scene = one_triangle(CORNERS, plain_material());
    scene.materials[0].flags = MATERIAL_LAMBERTIAN;
    for (vertex, n) in scene.vertices.iter_mut().zip([
        Vec3::new(0.6, 0.0, 0.8),
        Vec3::new(0.0, 0.6, 0.8),
        Vec3::new(0.0, 0.0, 1.0),
    ]) {
        vertex.normal_v0[..3].copy_from_slice(&n.to_array());
    }
    let surface = surface_at(&scene, hit(0.25, 0.25), -Vec3::Z);
    let expected = DVec3::new(0.3, 0.15, 0.85).normalize().as_vec3();
    assert!(surface.ns.distance(expected) < 1e-6);
    assert_eq!(surface.ng, Vec3::Z);
}

#[test]
fn degenerate_geometry_yields_finite_unit_normals() {
    for corners in [
        [[0.0; 3], [1e-20, 0.0, 0.0], [0.0, 1e-20, 0.0]],
        [[1e6, 0.0, 0.0], [1e6, 1e-1, 0.0], [1e6, 0.0, 1e-1]],
        [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1e-12, 0.0]],
        [[0.0; 3], [0.0; 3], [0.0; 3]],
    ] {
        let mut scene = one_triangle(corners, plain_material());
        for vertex in &mut scene.vertices {
            vertex.normal_v0[..3].copy_from_slice(&[0.0, 0.0, 1.0]);
        }
        let surface = surface_at(&scene, hit(0.3, 0.3), Vec3::new(0.0, 0.6, -0.8));
        assert!((surface.ng.length() - 1.0).abs() < 1e-6, "{surface:?}");
        assert!((surface.ns.length() - 1.0).abs() < 1e-6, "{surface:?}");
        assert!(surface.position.is_finite() && surface.error.is_finite());
    }
}

#[test]
fn mirror_directions_leave_the_surface() {
    let mut random = Random::new(3);
    let mut corrected = 0;
    let mut uncorrected_below = 0;
    for i in 0..200_000 {
        let ng = random.direction();
        // Down to a grazing angle of 1e-6.
        let grazing = 10f64.powf(f64::from(random.range(-6.0, 0.19)));
        let wo = around(
            ng,
            std::f64::consts::FRAC_PI_2 - grazing,
            f64::from(random.range(0.0, 6.2)),
        );
        let ns = around(
            ng,
            f64::from(random.range(0.0, if i % 2 == 0 { 0.1 } else { 1.8 })),
            f64::from(random.range(0.0, 6.2)),
        );
        if wo.dot(ng) <= 0.0 {
            continue;
        }
        let n = valid_shading_normal(ng, ns, wo);
        assert!((n.length() - 1.0).abs() < 1e-6 && n.dot(ng) > 0.0);
        assert!(n.dot(wo) > 0.0, "{ng} {ns} {wo}");
        let mirror = |n: Vec3| {
            let (n, wo, ng) = (n.as_dvec3(), wo.as_dvec3(), ng.as_dvec3());
            (n * (2.0 * n.dot(wo)) - wo).dot(ng)
        };
        assert!(mirror(n) > -2e-7, "{} {ng} {ns} {wo}", mirror(n));
        if n == ns {
            continue;
        }
        corrected += 1;
        uncorrected_below += u32::from(mirror(ns) < 0.0);
        // As little as needed: the mirror direction stays low, unless the surface's own normal had to do.
        assert!(n == ng || mirror(n) < 0.0101, "{}", mirror(n));
    }
    // Negative control: without the correction many would fall below.
    assert!(corrected > 1000 && uncorrected_below > 1000);
}

#[test]
fn normal_maps_tilt_along_the_tangents() {
    // u along +x, v along +y (glTF: down the image), so green tilts towards -y.
    let tangent = tangent_from_uv(Vec3::X, Vec3::Y, Vec2::X, Vec2::Y, Vec3::Z);
    assert_eq!(tangent, Vec4::new(1.0, 0.0, 0.0, -1.0));
    let mirrored = tangent_from_uv(Vec3::X, Vec3::Y, -Vec2::X, Vec2::Y, Vec3::Z);
    assert_eq!(mirrored, Vec4::new(-1.0, 0.0, 0.0, 1.0));
    assert_eq!(
        tangent_from_uv(Vec3::X, Vec3::Y, Vec2::X, Vec2::X, Vec3::Z),
        Vec4::ZERO
    );

    let red = mapped_normal(Vec3::Z, tangent, Vec3::new(1.0, 0.5, 0.5), 1.0);
    assert!(red.distance(Vec3::X) < 1e-6, "{red}");
    let green = mapped_normal(Vec3::Z, tangent, Vec3::new(0.5, 1.0, 1.0), 1.0);
    let expected = Vec3::new(0.0, -1.0, 1.0).normalize();
    assert!(green.distance(expected) < 1e-6, "{green}");
    let half = mapped_normal(Vec3::Z, tangent, Vec3::new(0.5, 1.0, 1.0), 0.5);
    let expected = Vec3::new(0.0, -0.5, 1.0).normalize();
    assert!(half.distance(expected) < 1e-6, "{half}");
    let flat = mapped_normal(Vec3::Z, tangent, Vec3::new(0.5, 0.5, 1.0), 1.0);
    assert_eq!(flat, Vec3::Z);
    assert_eq!(mapped_normal(Vec3::Z, Vec4::ZERO, Vec3::X, 1.0), Vec3::Z);
}

#[test]
fn a_mapped_normal_turns_over_with_its_surface() {
    // Texel (255, 128, 255): tilted by 45 degrees towards +u.
    let material = Material {
        normal_texture: 0,
        flags: MATERIAL_LAMBERTIAN,
        ..plain_material()
    };
    let scene = textured(material, vec![0xffff_80ff], 1);
    let above = surface_at(&scene, hit(0.3, 0.3), -Vec3::Z);
    assert!(above.ns.distance(Vec3::new(1.0, 0.0, 1.0).normalize()) < 5e-3);
    assert!(above.coat_ns == Vec3::Z);
    let below = surface_at(&scene, hit(0.3, 0.3), Vec3::Z);
    assert!(below.ns.distance(-above.ns) < 1e-6);
    // Negative control: without the texture there is no tilt.
    let plain = surface_at(
        &textured(plain_material(), vec![0xffff_80ff], 1),
        hit(0.3, 0.3),
        -Vec3::Z,
    );
    assert_eq!(plain.ns, Vec3::Z);
}

#[test]
fn every_slot_reads_its_own_channels() {
    // Stored r, g, b, a.
    let texel = u32::from_le_bytes([51, 102, 153, 204]);
    let (r, g, b, a) = (0.2f32, 0.4f32, 0.6f32, 0.8f32);
    let near = |x: f32, y: f32| (x - y).abs() < 1e-6;
    let at = |change: &dyn Fn(&mut Material)| {
        let mut material = Material {
            emissive: [2.0; 3],
            metallic: 1.0,
            transmission: 1.0,
            clearcoat: 1.0,
            clearcoat_roughness: 1.0,
            ..plain_material()
        };
        change(&mut material);
        surface_at(&textured(material, vec![texel], 1), hit(0.3, 0.3), -Vec3::Z)
    };
    let s = at(&|m| m.base_color_texture = 0);
    assert!(s.base_color.distance(Vec3::new(r, g, b)) < 1e-6 && s.coverage == 1.0);
    let s = at(&|m| m.metallic_roughness_texture = 0);
    assert!(near(s.metallic, b) && near(s.ggx_alpha, g * g));
    let s = at(&|m| m.emissive_texture = 0);
    assert!(s.emission.distance(2.0 * Vec3::new(r, g, b)) < 1e-6);
    let s = at(&|m| m.specular_texture = 0);
    assert!(near(s.specular, a));
    let s = at(&|m| m.specular_color_texture = 0);
    assert!(s.specular_color.distance(Vec3::new(r, g, b)) < 1e-6);
    let s = at(&|m| m.transmission_texture = 0);
    assert!(near(s.transmission, r));
    let s = at(&|m| m.clearcoat_texture = 0);
    assert!(near(s.clearcoat, r));
    let s = at(&|m| m.clearcoat_roughness_texture = 0);
    assert!(near(s.coat_alpha, g * g));
    // Negative control: no slot, no texture.
    let s = at(&|_| ());
    assert!(s.base_color == Vec3::ONE && s.transmission == 1.0 && s.clearcoat == 1.0);
}

#[test]
fn opacity_follows_the_alpha_mode() {
    // Alpha 0 on the left, 1 on the right texel.
    let texels = vec![0x00ff_ffff, 0xffff_ffff];
    let at = |flags: u32, u: f32| {
        let material = Material {
            flags,
            alpha_cutoff: 0.5,
            base_color_texture: 0,
            ..plain_material()
        };
        let mut scene = textured(material, texels.clone(), 2);
        for vertex in &mut scene.vertices {
            vertex.color = [0.5, 1.0, 1.0, 0.9];
        }
        scene.triangles = vec![Triangle::new([0, 1, 2], &scene.vertices, 0, 7)];
        let alpha = surface_alpha(&scene, hit(u, 0.1));
        let surface = surface_at(&scene, hit(u, 0.1), -Vec3::Z);
        assert!((surface.coverage - alpha).abs() < 1e-6);
        assert!((surface.base_color.x - 0.5).abs() < 1e-6);
        alpha
    };
    assert_eq!(at(0, 0.5), 1.0);
    assert!((at(MATERIAL_ALPHA_BLEND, 0.5) - 0.45).abs() < 1e-6);
    assert_eq!(at(MATERIAL_ALPHA_MASK, 0.5), 0.0);
    assert_eq!(at(MATERIAL_ALPHA_MASK, 0.6), 1.0);
}

#[test]
fn emitters_shine_as_their_kind_says() {
    let at = |flags: u32, from_below: bool| {
        let material = Material {
            emissive: [3.0; 3],
            base_color: [0.25, 0.5, 0.75, 1.0],
            flags,
            ..plain_material()
        };
        let direction = if from_below { Vec3::Z } else { -Vec3::Z };
        surface_at(&one_triangle(CORNERS, material), hit(0.3, 0.3), direction).emission
    };
    assert_eq!(at(0, false), Vec3::splat(3.0));
    assert_eq!(at(0, true), Vec3::splat(3.0));
    assert_eq!(at(MATERIAL_QUAD_LIGHT, false), Vec3::splat(3.0));
    assert_eq!(at(MATERIAL_QUAD_LIGHT, true), Vec3::ZERO);
    assert_eq!(at(MATERIAL_UNLIT, false), Vec3::new(0.25, 0.5, 0.75));
}

/// An object's patches, all of one albedo.
fn patches(albedo: f32) -> impl Iterator<Item = [f32; 4]> {
    (0..PHOTO_PATCHES).flat_map(move |i| [[albedo, albedo, albedo, 1.0], [i as f32, 0.0, 0.0, 0.1]])
}

#[test]
fn photo_albedo_is_read_where_the_camera_sees_the_point() {
    let material = Material {
        flags: MATERIAL_PHOTO_ALBEDO,
        ..plain_material()
    };
    // In front of a camera at the origin that looks along -Z; the point is (0.5, 0.25, -2).
    let corners = [[-1.0, -1.0, -2.0], [2.0, -1.0, -2.0], [-1.0, 4.0, -2.0]];
    let mut scene = one_triangle(corners, material);
    let (width, height) = (8u32, 6u32);
    scene.frame = Frame {
        camera_right: [1.0, 0.0, 0.0, 0.0],
        camera_up: [0.0, 1.0, 0.0, 0.0],
        camera_back: [0.0, 0.0, 1.0, 0.0],
        intrinsics: [8.0, 8.0, 4.0, 3.0],
        width,
        height,
        ..Frame::zeroed()
    };
    scene.photo_albedo = (0..width * height)
        .map(|i| [i as f32 / 100.0, 0.5, 0.5, 2.02])
        .chain(patches(0.8))
        .chain(patches(0.9))
        .collect();
    scene.triangles[0].object = 1;
    let point = hit(0.5, 0.25);
    // x = 4 + 8 * 0.25 = 6, y = 3 - 8 * 0.125 = 2.
    let at =
        |scene: &PackedScene| surface_at(scene, point, Vec3::new(0.24, 0.12, -0.96).normalize());
    let seen = at(&scene);
    assert_eq!(seen.base_color.x, (2 * width + 6) as f32 / 100.0);
    assert!(bsdf_is_lambertian(&seen));
    // Radial distortion moves the pixel: r^2 = 0.078125, radial = 1.78125, x = 7.56, y = 1.22.
    scene.frame.distortion = [10.0, 0.0, 0.0, 0.0];
    assert_eq!(at(&scene).base_color.x, (width + 7) as f32 / 100.0);
    scene.frame.distortion = [0.0; 4];
    // Negative controls: something else is in front, no data, out of the picture, behind the camera. Another object has another mean.
    let pixels = (width * height) as usize;
    for depth in [1.9, 2.1, 0.0, -1.0] {
        (scene.photo_albedo[..pixels].iter_mut()).for_each(|p| p[3] = depth);
        assert!((at(&scene).base_color.x - 0.9).abs() < 1e-6);
    }
    scene.triangles[0].object = 0;
    assert!((at(&scene).base_color.x - 0.8).abs() < 1e-6);
    scene.triangles[0].object = 1;
    (scene.photo_albedo[..pixels].iter_mut()).for_each(|p| p[3] = 2.0);
    scene.frame.intrinsics = [80.0, 80.0, 4.0, 3.0];
    assert!((at(&scene).base_color.x - 0.9).abs() < 1e-6);
    scene.frame.camera_back = [0.0, 0.0, -1.0, 0.0];
    assert!((at(&scene).base_color.x - 0.9).abs() < 1e-6);
}

/// Random triangles of random materials that use every slot, flag and attribute.
pub fn gallery(random: &mut Random) -> PackedScene {
    let mut scene = one_triangle(CORNERS, plain_material());
    scene.vertices.clear();
    scene.triangles.clear();
    scene.materials.clear();
    scene.texture_refs = (0..12)
        .map(|i| {
            let mut texture = random_texture(random, &mut scene.texels);
            texture.flags &= !TEXTURE_NEAREST;
            texture.flags |= if i % 2 == 0 { TEXTURE_UV1 } else { 0 };
            texture
        })
        .collect();
    for id in 0..60u32 {
        let slot = |random: &mut Random| [NONE, random.bits() % 12][random.bits() as usize & 1];
        let kinds = [
            0,
            0,
            MATERIAL_LAMBERTIAN,
            MATERIAL_UNLIT,
            MATERIAL_QUAD_LIGHT,
            MATERIAL_PHOTO_ALBEDO,
            MATERIAL_ALPHA_BLEND,
            MATERIAL_ALPHA_MASK,
        ];
        scene.materials.push(Material {
            base_color: [random.uniform(), random.uniform(), random.uniform(), 0.9],
            emissive: random.triple(),
            normal_scale: random.range(0.1, 1.5),
            metallic: random.uniform(),
            roughness: random.uniform(),
            ior: random.range(1.0, 2.0),
            specular: random.uniform(),
            specular_color: random.triple(),
            transmission: random.uniform(),
            clearcoat: random.uniform(),
            clearcoat_roughness: random.uniform(),
            clearcoat_normal_scale: random.range(0.1, 1.5),
            alpha_cutoff: 0.4,
            flags: kinds[random.bits() as usize % kinds.len()] | MATERIAL_TEXTURED,
            base_color_texture: slot(random),
            metallic_roughness_texture: slot(random),
            normal_texture: slot(random),
            emissive_texture: slot(random),
            specular_texture: slot(random),
            specular_color_texture: slot(random),
            transmission_texture: slot(random),
            clearcoat_texture: slot(random),
            clearcoat_roughness_texture: slot(random),
            clearcoat_normal_texture: slot(random),
            ..plain_material()
        });
        let normal = random.direction();
        let with_tangents = random.bits() & 1 == 0;
        for _ in 0..3 {
            let p = random.direction() * random.range(0.5, 2.0);
            let n = (normal + random.direction() * 0.3).normalize();
            let t = random.direction();
            scene.vertices.push(Vertex {
                position_u0: [p.x, p.y, p.z, random.uniform()],
                normal_v0: [n.x, n.y, n.z, random.uniform()],
                tangent: if with_tangents {
                    [t.x, t.y, t.z, 1.0]
                } else {
                    [0.0; 4]
                },
                color: [random.uniform(), random.uniform(), random.uniform(), 1.0],
                uv1: [random.uniform(), random.uniform(), 0.0, 0.0],
            });
        }
        let vertices = [3 * id, 3 * id + 1, 3 * id + 2];
        let triangle = Triangle::new(vertices, &scene.vertices, id, id % 5);
        scene.triangles.push(triangle);
    }
    let (width, height) = (16, 12);
    scene.frame = Frame {
        camera_position: [0.0, 0.0, 6.0, 0.0],
        camera_right: [1.0, 0.0, 0.0, 0.0],
        camera_up: [0.0, 1.0, 0.0, 0.0],
        camera_back: [0.0, 0.0, 1.0, 0.0],
        intrinsics: [20.0, 20.0, 8.0, 6.0],
        distortion: [0.1, -0.05, 0.01, 0.02],
        distortion_k3: 0.01,
        width,
        height,
        ..Frame::zeroed()
    };
    scene.photo_albedo = (0..width * height + 5 * 2 * PHOTO_PATCHES)
        .map(|_| {
            [
                random.uniform(),
                random.uniform(),
                random.uniform(),
                random.range(5.0, 7.0),
            ]
        })
        .collect();
    scene
}
