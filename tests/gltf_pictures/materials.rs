//! What each material model was made to show.

use glam::DVec3;

use super::*;

/// Six rows of dielectrics and six of metals, from white to black; in each row eleven spheres, from smooth to rough.
#[test]
fn the_ramps_of_spheres_fall() {
    let Some(scene) = model("PBR_Spheres.glb", WHITE_SKY) else {
        return;
    };
    let row = |material: String| {
        let mut row = scene.clone();
        keep(&mut row, |i| i.material.name == material);
        frame(&mut row, [0.0, 0.0, 1.0]);
        row.camera.fx *= 1.3;
        row.camera.fy *= 1.3;
        row.settings.max_bounces = 1;
        row.settings.rays_per_pixel = 64;
        let [low, high] = bounds(&row);
        let radius = (high.y - low.y) / 2.0;
        let places: [_; 11] = std::array::from_fn(|number| {
            let x = low.x + radius + 0.1 * number as f64 * (high.x - low.x - 2.0 * radius);
            project(&row, DVec3::new(x, low.y + radius, high.z))
        });
        let shot = shoot(row);
        places.map(|at| shot.mean_around(at, 0.75).x)
    };
    let [dielectrics, metals] = ["", "_Metal"].map(|kind| {
        [0, 20, 40, 60, 80, 100].map(|percent| row(format!("Black_{percent:02}{kind}")))
    });
    for rows in [&dielectrics, &metals] {
        for (lighter, darker) in rows.iter().zip(&rows[1..]) {
            assert!(
                lighter.iter().zip(darker).all(|(l, d)| d < l),
                "{lighter:?} {darker:?}"
            );
        }
    }
    let [white, .., black] = dielectrics;
    assert!(white.iter().all(|x| (x - 1.0).abs() < 0.15), "{white:?}");
    // A black dielectric still reflects 4%; a black metal nothing but its grazing edge.
    assert!(black.iter().all(|x| *x > 0.01 && *x < 0.05), "{black:?}");
    let [white, .., black] = metals;
    assert!(black.iter().all(|x| *x < 0.02), "{black:?}");
    // A white metal mirrors the white sky, and its facets lose nothing, however rough they are.
    assert!(white.iter().all(|x| (x - 1.0).abs() < 0.02), "{white:?}");
}

/// With the light of its lamps and without; in the dark only they are seen.
#[test]
fn the_helmet_glows() {
    let Some(mut scene) = model("DamagedHelmet.glb", DARK) else {
        return;
    };
    frame(&mut scene, [0.55, 0.35, 1.0]);
    let mut off = scene.clone();
    repaint(&mut off, |m| m.emissive = [0.0; 3]);
    let shot = shoot(scene);
    let glow = shot.mean();
    // The lamps are cyan.
    assert!(
        glow.y > 1e-3 && glow.z > 1e-3 && glow.x < 0.8 * glow.y,
        "{glow}"
    );
    let brightest = shot.picture.linear.iter().map(|p| p[1]).fold(0.0, f32::max);
    assert!(brightest > 0.2, "{brightest}");
    assert_eq!(shoot(off).mean(), DVec3::ZERO, "negative control");
}

/// In each row the middle body is the left one under the coat that the right one shows alone: coated = 0.96 * base + coat.
#[test]
fn a_coat_adds_its_reflection_to_the_base() {
    let Some(root) = shared_data("hdr_environments") else {
        return;
    };
    let sky = format!(
        "[environment]\nimage = \"{}\"\n",
        root.join("brown_photostudio_02_1k.hdr").display()
    );
    let Some(scene) = model("ClearcoatTest.glb", &sky) else {
        return;
    };
    for row in [
        "Simple",
        "RoughVariations",
        "BaseNorm",
        "CoatNorm",
        "SharedNorm",
    ] {
        let [base, coated, coat] = ["Base", "Coated", "Coating"].map(|part| {
            let mut scene = scene.clone();
            keep(&mut scene, |i| i.material.name == format!("{row}_{part}"));
            let [low, high] = bounds(&scene);
            let centre = (low + high) / 2.0;
            // From afar, so that the coat is met at right angles nearly everywhere that counts.
            scene.camera.fx *= 60.0;
            scene.camera.fy *= 60.0;
            look(&mut scene, centre + DVec3::Z * 300.0, centre);
            scene.settings.rays_per_pixel = 64;
            scene.settings.max_bounces = 1;
            let shot = shoot(scene);
            shot.mean_around([32.0, 24.0], 10.0)
        });
        let expected = base * 0.96 + coat;
        for c in 0..3 {
            assert!(
                (coated[c] / expected[c] - 1.0).abs() < 0.1,
                "{row}: {coated} for {expected}"
            );
        }
        assert!(coated.z / base.z - 1.0 > 0.15, "{row}: negative control");
    }
}

/// A green wall behind the glass cover: seen through it, and hidden once the cover transmits nothing.
#[test]
fn the_glass_cover_shows_what_is_behind_it() {
    let wall = "[[light]]\nkind = \"quad\"\ncorner = [-3, -4, -4]\nedge_u = [0, 8, 0]\nedge_v = [0, 0, 8]\nradiance = [0, 1, 0]\n";
    let Some(mut scene) = model("IridescentDishWithOlives.glb", wall) else {
        return;
    };
    keep(&mut scene, |i| i.material.name == "glassCover");
    frame(&mut scene, [1.0, 0.2, 0.0]);
    scene.settings.max_bounces = 12;
    let mut opaque = scene.clone();
    repaint(&mut opaque, |m| m.transmission = 0.0);
    let through = |scene: Scene| {
        let shot = shoot(scene);
        let (mut sum, mut covered) = (DVec3::ZERO, 0.0);
        for (pixel, mask) in shot.picture.linear.iter().zip(&shot.mask) {
            if *mask == 1.0 {
                sum += DVec3::from_array(pixel.map(f64::from));
                covered += 1.0;
            }
        }
        sum / covered
    };
    let glass = through(scene);
    assert!(glass.y > 0.4 && glass.y < 1.0 && glass.x < 0.05, "{glass}");
    let control = through(opaque);
    assert!(control.y < 0.3 * glass.y, "negative control: {control}");
}
