//! The stages of a scene file, on films.

use super::spread;
use crate::support::{Folder, Random, stderr};

const WIDTH: u32 = 160;
const HEIGHT: u32 = 240;
const SIGMA: f64 = 2.5;
const LEVEL: f64 = 90.0;

/// A defocused grey card over half of a noisy grey photograph; a constant environment, so that the card has one brightness.
fn card(folder: &Folder, more: &str) {
    let mut rng = Random(3);
    let values: Vec<u8> = (0..3 * WIDTH * HEIGHT)
        .map(|_| (LEVEL + SIGMA * rng.normal()).round() as u8)
        .collect();
    folder.save("photo.png", WIDTH, HEIGHT, |x, y| {
        let i = 3 * (y * WIDTH + x) as usize;
        [values[i], values[i + 1], values[i + 2]]
    });
    folder.succeed(&[
        "noise",
        "calibrate",
        "--from",
        &format!("0,{}", SIGMA * SIGMA),
        "-o",
        "noise.toml",
    ]);
    let scene = "[photo]\nimage = \"photo.png\"\n[camera]\nvertical_fov_deg = 45\n[lens]\naperture_radius_m = 0.08\nfocus_distance_m = 4.0\n\
         [environment]\nradiance = [0.5, 0.5, 0.5]\n[[virtual]]\nshape = \"quad\"\ncorner = [0, -3, -2]\nedge_u = [3, 0, 0]\nedge_v = [0, 6, 0]\n\
         material = { base_color = [0.4, 0.4, 0.4], specular = 0.0 }\n[render]\nbackend = \"cpu\"\n";
    folder.write("scene.toml", format!("{scene}{more}"));
}

/// Noise level by column, DN, rounding to codes taken out.
fn levels(picture: &image::RgbImage) -> Vec<f64> {
    (0..WIDTH)
        .map(|x| {
            let variance = (0..3)
                .map(|c| {
                    let column: Vec<f64> = (0..HEIGHT)
                        .map(|y| f64::from(picture.get_pixel(x, y).0[c]))
                        .collect();
                    spread(&column).powi(2)
                })
                .sum::<f64>()
                / 3.0;
            (variance - 1.0 / 12.0).max(0.0).sqrt()
        })
        .collect()
}

/// Root mean square over each of the parts of a row: photograph, darker and lighter half of the soft edge, card.
fn parts(picture: &image::RgbImage, reference: &image::RgbImage) -> [f64; 4] {
    let mean = |x: u32| {
        (0..HEIGHT)
            .map(|y| f64::from(reference.get_pixel(x, y).0[1]))
            .sum::<f64>()
            / f64::from(HEIGHT)
    };
    let (low, high) = (mean(0), mean(WIDTH - 1));
    let levels = levels(picture);
    let part = |from: f64, to: f64| {
        let inside = (0..WIDTH).filter(|x| (from..to).contains(&((mean(*x) - low) / (high - low))));
        let squares: Vec<f64> = inside.map(|x| levels[x as usize].powi(2)).collect();
        assert!(
            squares.len() >= 4,
            "{from} to {to}: {} columns",
            squares.len()
        );
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    [
        part(-1.0, 0.02),
        part(0.02, 0.5),
        part(0.5, 0.98),
        part(0.98, 2.0),
    ]
}

#[test]
fn the_noise_level_is_one_across_a_soft_edge() {
    let folder = Folder::new();
    card(&folder, "rays_per_pixel = 256\n");
    folder.succeed("render scene.toml -o off.png");
    card(
        &folder,
        "rays_per_pixel = 256\n[noise]\nprofile = \"noise.toml\"\n",
    );
    folder.succeed("render scene.toml -o on.png");
    folder.succeed("render scene.toml -o next.png --frame 1");
    let (off, on) = (folder.open("off.png"), folder.open("on.png"));
    let (without, with) = (parts(&off, &off), parts(&on, &off));
    eprintln!(
        "photograph, darker half, lighter half of the edge, card: {without:.2?} DN without the stage, {with:.2?} DN with it"
    );
    for level in with {
        assert!((level / with[0] - 1.0).abs() < 0.05, "{with:.3?}");
    }
    assert!(without[3] < 0.3 * without[0], "control: {without:.3?}");
    assert_ne!(
        on,
        folder.open("next.png"),
        "frames have noise of their own"
    );
    for x in 0..20 {
        assert!(
            (0..HEIGHT).all(|y| on.get_pixel(x, y) == off.get_pixel(x, y)),
            "the photograph stays"
        );
    }
}

/// A shadow over the whole of a noisy grey photograph, from a lid behind the camera; the quotient composite does not depend on the exposure, and
/// neither may its noise.
#[test]
fn the_quotients_noise_does_not_depend_on_the_exposure() {
    let folder = Folder::new();
    card(&folder, "");
    let level = |exposure_ev: f64, noise: &str| {
        let scene = format!(
            "[photo]\nimage = \"photo.png\"\nexposure_ev = {exposure_ev:?}\n[camera]\nvertical_fov_deg = 30\nposition = [0, 1, 0]\n\
             look_at = [0, 0, 0]\nup = [0, 0, -1]\n[environment]\nradiance = [0.5, 0.5, 0.5]\n[[real]]\nshape = \"quad\"\ncorner = [-5, 0, 5]\n\
             edge_u = [10, 0, 0]\nedge_v = [0, 0, -10]\nmaterial = {{ base_color = [0.5, 0.5, 0.5], specular = 0.0 }}\n[[virtual]]\nshape = \"quad\"\n\
             corner = [-3, 1.5, 3]\nedge_u = [6, 0, 0]\nedge_v = [0, 0, -6]\nmaterial = {{ base_color = [0, 0, 0], specular = 0.0 }}\n[render]\n\
             backend = \"cpu\"\nrays_per_pixel = 64\nmax_bounces = 1\ncomposite = \"quotient\"\n{noise}"
        );
        folder.write("scene.toml", &scene);
        folder.succeed("render scene.toml -o out.png");
        let picture = folder.open("out.png");
        // Of neighbours: the shadow is smooth.
        let differences: Vec<f64> = (0..HEIGHT)
            .flat_map(|y| (1..WIDTH).map(move |x| (x, y)))
            .map(|(x, y)| {
                f64::from(picture.get_pixel(x, y).0[1])
                    - f64::from(picture.get_pixel(x - 1, y).0[1])
            })
            .collect();
        (spread(&differences).powi(2) / 2.0 - 1.0 / 12.0)
            .max(0.0)
            .sqrt()
    };
    let noise = "[noise]\nprofile = \"noise.toml\"\n";
    let levels = [-1.0, -3.0].map(|exposure_ev| level(exposure_ev, noise));
    let without = level(-1.0, "");
    eprintln!("{levels:.2?} DN at two exposures, {without:.2} DN without the stage");
    for level in levels {
        assert!((level / SIGMA - 1.0).abs() < 0.05, "{level:.3} DN");
    }
    assert!(without < 0.85 * SIGMA, "control: {without:.3} DN");
}

#[test]
fn antialiasing_works_on_one_ray_and_is_off_on_many() {
    let folder = Folder::new();
    let sharp = "rays_per_pixel = 1\n";
    card(&folder, sharp);
    folder.succeed("render scene.toml -o hard.png");
    card(&folder, &format!("{sharp}[antialias]\nbeta = 0.8\n"));
    folder.succeed("render scene.toml -o blended.png");
    assert_ne!(folder.open("hard.png"), folder.open("blended.png"));
    card(&folder, "rays_per_pixel = 16\n[antialias]\n");
    let output = folder.run("render scene.toml -o soft.png");
    assert!(stderr(&output).contains("[antialias] is off"));
    card(&folder, "rays_per_pixel = 16\n");
    folder.succeed("render scene.toml -o plain.png");
    assert_eq!(folder.open("soft.png"), folder.open("plain.png"));
}

#[test]
fn the_cartoon_takes_photograph_and_virtual_things_alike() {
    let folder = Folder::new();
    card(
        &folder,
        "rays_per_pixel = 4\n[cartoon]\nshrunk_width = 80\nshrunk_height = 120\n",
    );
    folder.succeed("render scene.toml -o render.png");
    card(&folder, "rays_per_pixel = 4\n");
    folder.succeed("render scene.toml -o plain.png --png-bits 16");
    folder.succeed("cartoon plain.png after.png --shrunk 80x120");
    let (render, after) = (
        folder.open("render.png"),
        image::open(folder.path("after.png")).unwrap().into_rgb8(),
    );
    let apart = render
        .pixels()
        .zip(after.pixels())
        .flat_map(|(a, b)| (0..3).map(move |c| a.0[c].abs_diff(b.0[c])))
        .max();
    assert!(apart <= Some(1), "{apart:?}");
    assert_ne!(render, folder.open("plain.png"), "control");
}

#[test]
fn tables_that_cannot_be_meant_are_refused() {
    let folder = Folder::new();
    for (table, part) in [
        ("[cartoon]\nstyl = \"flow\"\n", "did you mean `style`"),
        ("[cartoon]\nsigma_p = 0\n", "sigma_p"),
        ("[cartoon]\ns0 = 0.07\n", "`s1` above `s0`"),
        ("[cartoon]\nshrunk_width = 0\n", "shrunk_width"),
        (
            "[cartoon]\n[noise]\nprofile = \"noise.toml\"\n",
            "`cartoon` and `noise` are both given",
        ),
        ("[noise]\n", "lacks `profile`"),
        ("[noise]\nprofile = \"none.toml\"\n", "names no file"),
        ("[noise]\nprofile = \"photo.png\"\n", "photo.png"),
        (
            "[noise]\nprofile = \"noise.toml\"\ntexture_size = 500\n",
            "power of two",
        ),
        (
            "[noise]\nprofile = \"noise.toml\"\nmethod = \"paper\"\n",
            "\"missing\" or \"textures\"",
        ),
        (
            "[noise]\nprofile = \"noise.toml\"\nupdate_delay_frames = 0\n",
            "update_delay_frames",
        ),
        ("[antialias]\nbeta = 2\n", "beta"),
    ] {
        card(&folder, &format!("rays_per_pixel = 1\n{table}"));
        folder.refuse("render scene.toml", part);
        folder.refuse("render scene.toml", "scene.toml:");
    }
}
