//! Pictures of hard scenes against the oracle's, pixel by pixel.

use glam::{DMat4, DVec3};

use super::backend::{Backend, Shown, StressError};
use super::meshes::{Random, fan_of_slivers};
use super::oracle::{Expected, expected};
use super::scenes::{
    clear, contact, glowing, mirror, named, placed, point_light, size, square, triangle,
};
use super::{At, Measured};
use crate::bench::scenes::{camera, matt, object, place, scene};
use crate::scene::shape::{cuboid, quad};
use crate::scene::{Primitive, Scene, Side};

/// Sum of the absolute differences of all pixels over the sum of what they should show, and the mean difference of the masks.
fn difference(shown: &Shown, expected: &Expected) -> Measured {
    let (mut error, mut whole, mut mask) = (0.0, 0.0, 0.0);
    for (pixel, sums) in shown.film.pixels.iter().enumerate() {
        let is = DVec3::from(shown.picture.linear[pixel].map(f64::from));
        let should = expected.linear[pixel];
        error += (is - should).abs().element_sum();
        whole += should.abs().element_sum();
        let covered = f64::from(sums.m) / f64::from(sums.n.max(1));
        mask += (covered - expected.mask[pixel]).abs();
    }
    Measured {
        // Not a number, and so beyond any bound, where nothing should show: such a scene would prove nothing.
        figure: error / whole + mask / shown.film.pixels.len() as f64,
        ..Measured::of_film(&shown.film)
    }
}

/// How far the render of one scene is from what another must show.
fn against(
    backend: &mut Backend,
    rendered: &Scene,
    should_show: &Scene,
) -> Result<Measured, StressError> {
    let expected = expected(should_show);
    Ok(difference(&backend.render(rendered)?, &expected))
}

fn sign(index: usize) -> f64 {
    if index.is_multiple_of(2) { 1.0 } else { -1.0 }
}

/// Control: the objects' places are rounded to f32 before the camera's is taken off.
pub(super) fn translation(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scene = contact(at.effort);
    let offset = DVec3::new(1.0, 0.7, -0.3) * at.value;
    let mut moved = placed(&scene, 1.0, offset);
    if at.control {
        for object in &mut moved.objects {
            let place = &mut object.world_from_object.w_axis;
            *place = place.as_vec4().as_dvec4();
        }
    }
    against(backend, &moved, &scene)
}

/// Control: the aperture does not grow.
pub(super) fn scale(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scene = contact(at.effort);
    let mut scaled = placed(&scene, at.value, DVec3::ZERO);
    if at.control {
        scaled.lens.aperture_radius_m = scene.lens.aperture_radius_m;
    }
    against(backend, &scaled, &scene)
}

/// Control: the oracle is not told of the outliers.
pub(super) fn outlier(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scene = contact(at.effort);
    let far = 1e6;
    let mut with_outliers = scene.clone();
    let flat = [
        DVec3::new(-far, -3.0, far),
        DVec3::new(far, -3.0, far),
        DVec3::new(0.3 * far, -3.0, -far),
    ];
    let upright = [
        DVec3::new(-far, -0.5 * far, -far),
        DVec3::new(far, -0.5 * far, -far),
        DVec3::new(0.1 * far, far, -far),
    ];
    for (side, corners) in [(Side::Real, flat), (Side::Virtual, upright)] {
        let outlier = triangle(corners);
        let color = [0.5; 3];
        with_outliers.objects.push(object(
            side,
            "outlier",
            outlier,
            matt(color),
            DMat4::IDENTITY,
        ));
    }
    // Over the table's far edge, so that the outliers are seen.
    let lifted = |scene: &Scene| {
        let mut scene = scene.clone();
        scene.camera.cy += 0.3 * f64::from(scene.camera.height);
        scene
    };
    let rendered = placed(&lifted(&with_outliers), at.value, DVec3::ZERO);
    let should_show = if at.control { scene } else { with_outliers };
    against(backend, &rendered, &lifted(&should_show))
}

/// Control: four slivers are missing.
pub(super) fn slivers(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let mut scene = contact(at.effort);
    let sheet = |primitive: Primitive| {
        let tilt = place(DVec3::new(-0.2, 0.75, 0.3), 20.0) * DMat4::from_rotation_x(0.7);
        object(
            Side::Virtual,
            "sheet",
            primitive,
            matt([0.3, 0.7, 0.4]),
            tilt,
        )
    };
    let mut rendered = scene.clone();
    scene.objects.push(sheet(square(0.2)));
    let mut fan = fan_of_slivers(0.2, at.value);
    if at.control {
        let middle = fan.triangles.len() / 2;
        fan.triangles.drain(middle - 2..middle + 2);
    }
    rendered.objects.push(sheet(fan));
    if let Some(table) = named(&mut rendered, "table") {
        table.instances[0].primitive = fan_of_slivers(2.0, at.value).into();
    }
    against(backend, &rendered, &scene)
}

/// A virtual sheet in the plane of the tilted real one. Control: a millimetre under it.
pub(super) fn coplanar(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let mut scene = contact(at.effort);
    let tilt = DMat4::from_rotation_z(at.value.to_radians());
    for object in &mut scene.objects {
        object.world_from_object = tilt * object.world_from_object;
    }
    scene.objects.push(object(
        Side::Virtual,
        "sheet",
        square(0.45),
        matt([0.2, 0.8, 0.3]),
        tilt * place(DVec3::new(0.2, 0.0, 0.4), 33.0),
    ));
    let mut rendered = scene.clone();
    if at.control
        && let Some(sheet) = named(&mut rendered, "sheet")
    {
        sheet.world_from_object.w_axis.y -= 1e-3;
    }
    against(backend, &rendered, &scene)
}

/// Boxes through one another and through the table. Control: the oracle's are a hundredth larger.
pub(super) fn interpenetrating(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let boxes = |size: f64| {
        let mut scene = contact(at.effort);
        let mut random = Random(17);
        for i in 0..at.value as usize {
            let [a, b, c] = [0, 1, 2].map(|_| f64::from(random.unit()));
            let turned = DMat4::from_rotation_y(6.0 * a) * DMat4::from_rotation_x(3.0 * b);
            let middle = DVec3::new(0.3 * sign(i) * a, 0.35 * b, 0.3 * c);
            let side = if i % 3 == 2 {
                Side::Real
            } else {
                Side::Virtual
            };
            scene.objects.push(object(
                side,
                "crossing",
                cuboid(DVec3::new(0.7, 0.2, 0.3) * size),
                matt([0.3 + 0.5 * a as f32, 0.4, 0.6]),
                DMat4::from_translation(middle) * turned,
            ));
        }
        scene
    };
    let larger = if at.control { 1.01 } else { 1.0 };
    against(backend, &boxes(1.0), &boxes(larger))
}

/// A table seen at this angle, a box that rises from it and casts its shadow towards the camera. Control: a table lower by a tenth of the
/// camera's height over it.
pub(super) fn grazing(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let (pixels, rays_per_pixel) = size(at.effort);
    let angle = at.value;
    let camera = camera(
        pixels,
        0.5 * f64::from(pixels[1]) / angle,
        DVec3::new(0.0, 1.5 * angle, 1.5),
        DVec3::ZERO,
        DVec3::Y,
    );
    let table = |lowered: f64| {
        let mut scene = scene(
            camera.clone(),
            rays_per_pixel,
            vec![
                object(
                    Side::Real,
                    "table",
                    square(4.0),
                    matt([0.7, 0.6, 0.5]),
                    place(DVec3::new(0.0, -lowered, 0.0), 0.0),
                ),
                object(
                    Side::Virtual,
                    "box",
                    cuboid(DVec3::new(0.3, 0.3, 0.3)),
                    matt([0.8, 0.3, 0.2]),
                    place(DVec3::new(0.15 + 0.1 * angle, 0.15, 0.0), 0.0),
                ),
            ],
        );
        scene.lights = vec![point_light(DVec3::new(1.0, 1.5, -2.0), 12.0)];
        scene
    };
    let lowered = if at.control { 0.15 * angle } else { 0.0 };
    against(backend, &table(0.0), &table(lowered))
}

/// Control: the oracle's aperture is a tenth wider.
pub(super) fn aperture(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let mut scene = contact(at.effort);
    scene.lens.aperture_radius_m = at.value;
    let mut should_show = scene.clone();
    if at.control {
        should_show.lens.aperture_radius_m *= 1.1;
    }
    against(backend, &scene, &should_show)
}

/// Control: the oracle's focus is a tenth farther (of infinity: at 3 m).
pub(super) fn focus(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let mut scene = contact(at.effort);
    scene.lens.focus_distance_m = at.value;
    // Near focus with a wide lens would blur everything away.
    scene.lens.aperture_radius_m = (0.1 * at.value).min(0.02);
    let mut should_show = scene.clone();
    if at.control {
        let focus = &mut should_show.lens.focus_distance_m;
        *focus = (*focus * 1.1).min(3.0);
    }
    against(backend, &scene, &should_show)
}

/// A mirror for a floor, mirrors upon it, cards that glow. Control: the oracle's mirrors reflect a fiftieth less.
pub(super) fn roughness(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let (pixels, rays_per_pixel) = size(at.effort);
    let hall = |reflectance: f32| {
        let contact = contact(at.effort);
        let mirror = || mirror([reflectance, 0.9 * reflectance, 0.8], at.value as f32);
        let wall = |x: f64, color: [f32; 3]| {
            let card = quad(
                DVec3::new(x, 0.1, -1.0),
                DVec3::new(0.6, 0.0, 0.1),
                DVec3::new(0.0, 0.8, 0.2),
            );
            (card, glowing(color))
        };
        let mut objects = vec![
            object(Side::Real, "floor", square(2.0), mirror(), DMat4::IDENTITY),
            object(
                Side::Virtual,
                "box",
                cuboid(DVec3::new(0.4, 0.3, 0.4)),
                mirror(),
                place(DVec3::new(-0.2, 0.15, 0.0), 25.0),
            ),
        ];
        for (i, (x, side)) in [
            (-1.2, Side::Real),
            (-0.5, Side::Virtual),
            (0.2, Side::Real),
            (0.8, Side::Virtual),
        ]
        .into_iter()
        .enumerate()
        {
            let (card, material) = wall(x, [0.2 + 0.2 * i as f32, 0.9 - 0.2 * i as f32, 0.5]);
            objects.push(object(side, "card", card, material, DMat4::IDENTITY));
        }
        let mut scene = scene(contact.camera.clone(), rays_per_pixel, objects);
        scene.camera.width = pixels[0];
        scene.lens = contact.lens;
        scene.settings.max_bounces = 6;
        scene
    };
    let duller = if at.control { 0.98 } else { 1.0 };
    against(backend, &hall(0.95), &hall(0.95 * duller))
}

/// A clear box, turned, before a wall of glowing strips. Control: the oracle's box is of index 1.01 more.
pub(super) fn index_of_refraction(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let (_, rays_per_pixel) = size(at.effort);
    let box_of = |ior: f64| {
        let contact = contact(at.effort);
        let mut objects = vec![object(
            Side::Virtual,
            "box",
            cuboid(DVec3::new(0.6, 0.5, 0.5)),
            clear(ior as f32),
            place(DVec3::new(0.0, 0.25, 0.0), 25.0) * DMat4::from_rotation_x(0.3),
        )];
        for i in 0..24 {
            let strip = quad(
                DVec3::new(-2.4 + 0.2 * f64::from(i), -2.0, -1.0),
                DVec3::new(0.2, 0.0, 0.0),
                DVec3::new(0.0, 4.0, 0.0),
            );
            let bright = if i % 2 == 0 { 0.9 } else { 0.2 };
            objects.push(object(
                Side::Real,
                "strip",
                strip,
                glowing([bright, 0.5, 1.0 - bright]),
                DMat4::IDENTITY,
            ));
        }
        let mut scene = scene(contact.camera, rays_per_pixel, objects);
        scene.lens = contact.lens;
        scene.settings.max_bounces = 8;
        scene
    };
    let denser = if at.control { 0.01 } else { 0.0 };
    against(backend, &box_of(at.value), &box_of(at.value + denser))
}

/// Worlds of one triangle: 0, the real one; 1, the virtual one; 2, both. Control: the oracle's triangles are a hundredth larger.
pub(super) fn one_triangle(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let worlds = |size: f64| {
        let mut scene = contact(at.effort);
        let corners = |lift: f64, reach: f64| {
            [(-1.0, 0.5), (1.0, 0.4), (0.1, -1.0)]
                .map(|(x, z)| DVec3::new(x * reach * size, lift, z * reach * size))
        };
        if at.value != 1.0 {
            scene.objects.retain(|object| object.side != Side::Real);
            scene.objects.push(object(
                Side::Real,
                "one",
                triangle(corners(0.0, 1.0)),
                matt([0.7; 3]),
                DMat4::IDENTITY,
            ));
        }
        if at.value != 0.0 {
            scene.objects.retain(|object| object.side != Side::Virtual);
            scene.objects.push(object(
                Side::Virtual,
                "one",
                triangle(corners(0.3, 0.4)),
                matt([0.8, 0.3, 0.2]),
                DMat4::IDENTITY,
            ));
        }
        scene
    };
    let larger = if at.control { 1.01 } else { 1.0 };
    against(backend, &worlds(1.0), &worlds(larger))
}

/// A virtual triangle as often as this at one place; the oracle has it once. Control: a hundredth larger.
pub(super) fn identical(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let stack = |count: usize, size: f64| {
        let mut scene = contact(at.effort);
        (scene.camera.width, scene.camera.height) = (20, 15);
        (scene.camera.fx, scene.camera.fy) = (30.0, 30.0);
        (scene.camera.cx, scene.camera.cy) = (10.0, 7.5);
        scene.settings.rays_per_pixel = 4;
        let mut one = triangle([
            DVec3::new(-0.4, 0.5, 0.2) * size,
            DVec3::new(0.4, 0.5, 0.1) * size,
            DVec3::new(0.05, 0.6, -0.4) * size,
        ]);
        one.triangles = vec![[0, 1, 2]; count];
        scene.objects.retain(|object| object.side == Side::Real);
        scene.objects.push(object(
            Side::Virtual,
            "stack",
            one,
            matt([0.8, 0.3, 0.2]),
            DMat4::IDENTITY,
        ));
        scene
    };
    let larger = if at.control { 1.02 } else { 1.0 };
    against(backend, &stack(at.value as usize, 1.0), &stack(1, larger))
}

/// No real geometry. Control: the oracle has a table.
pub(super) fn nothing_real(backend: &mut Backend, at: At) -> Result<Measured, StressError> {
    let scene = contact(at.effort);
    let mut without = scene.clone();
    without
        .objects
        .retain(|object| object.side == Side::Virtual);
    against(
        backend,
        &without,
        if at.control { &scene } else { &without },
    )
}
