//! Patterns of ARToolKit: pictures in black frames, known by files that the tests write themselves.

use glam::DVec2;
use serde_json::Value;

use super::commands::{LENS_OF_THE_FILM, off, pose};
use super::film::{Film, INK, PAPER, looking, squares};
use crate::support::Folder;

/// A picture: whether a place from 0 to 1 is dark.
type Picture = fn(DVec2) -> bool;

fn is_within(at: DVec2, from: (f64, f64), to: (f64, f64)) -> bool {
    at.cmpge(from.into()).all() && at.cmplt(to.into()).all()
}

/// An F with a full stop.
fn letter(at: DVec2) -> bool {
    is_within(at, (0.15, 0.1), (0.32, 0.9))
        || is_within(at, (0.15, 0.1), (0.8, 0.26))
        || is_within(at, (0.15, 0.42), (0.65, 0.57))
        || at.distance(DVec2::new(0.75, 0.8)) < 0.11
}

/// A ring, cut on the left, with a bar above it.
fn ring(at: DVec2) -> bool {
    let from_middle = at.distance(DVec2::new(0.5, 0.6));
    is_within(at, (0.1, 0.05), (0.6, 0.16))
        || (0.18..0.34).contains(&from_middle) && !is_within(at, (0.0, 0.5), (0.4, 0.68))
}

/// Three steps and a dot.
fn steps(at: DVec2) -> bool {
    is_within(at, (0.1, 0.65), (0.35, 0.9))
        || is_within(at, (0.35, 0.4), (0.6, 0.65))
        || is_within(at, (0.6, 0.1), (0.9, 0.4))
        || at.distance(DVec2::new(0.2, 0.2)) < 0.12
}

/// Diagonal strokes.
fn strokes(at: DVec2) -> bool {
    let along = at.x + 0.7 * at.y;
    (0.3..0.45).contains(&along)
        || (0.7..0.8).contains(&along) && at.x < 0.6
        || (1.1..1.4).contains(&along) && at.x > 0.5
}

/// As `mk_patt` writes it: four turns, counter-clockwise, of three colours, 16 x 16 cells.
fn pattern_file(picture: Picture) -> String {
    const SIDE: usize = 16;
    const PARTS: usize = 8;
    let code = |x: usize, y: usize| {
        let places = (0..PARTS * PARTS).map(|k| {
            let part = DVec2::new((k % PARTS) as f64 + 0.5, (k / PARTS) as f64 + 0.5);
            (DVec2::new(x as f64, y as f64) + part / PARTS as f64) / SIDE as f64
        });
        let dark = places.filter(|at| picture(*at)).count();
        240 - 200 * dark / (PARTS * PARTS)
    };
    let mut text = String::new();
    for turn in 0..4 {
        for _colour in 0..3 {
            for row in 0..SIDE {
                for column in 0..SIDE {
                    let (mut x, mut y) = (column, row);
                    for _ in 0..turn {
                        (x, y) = (SIDE - 1 - y, x);
                    }
                    text += &format!("{:4}", code(x, y));
                }
                text.push('\n');
            }
        }
        text.push('\n');
    }
    text
}

/// Two markers of 80 mm side by side.
fn print(pictures: [Picture; 2]) -> impl Fn(DVec2) -> f64 {
    squares((2, 1), (0.08, 0.04), move |id, at| {
        let inside = 2.0 * at - 0.5;
        let is_frame = inside.cmplt(DVec2::ZERO).any() || inside.cmpge(DVec2::ONE).any();
        if is_frame || pictures[id](inside) {
            INK
        } else {
            PAPER
        }
    })
}

const BOARD: &str = "patterns = [\"f.patt\", \"ring.patt\"]\n[grid]\ncolumns = 2\nrows = 1\nside_m = 0.08\ngap_m = 0.04\n";

pub fn prepared() -> Folder {
    let folder = Folder::new();
    let files: [(&str, Picture); 4] = [
        ("f.patt", letter),
        ("ring.patt", ring),
        ("steps.patt", steps),
        ("strokes.patt", strokes),
    ];
    for (name, picture) in files {
        folder.write(name, pattern_file(picture));
    }
    folder.write("board.toml", BOARD);
    folder.write("lens.yaml", LENS_OF_THE_FILM);
    folder
}

#[test]
fn markers_are_known_by_their_patterns_under_noise_and_blur() {
    let folder = prepared();
    // Markers of about 90 px and sharp, then of 40 px under blur and noise.
    for (blur_px, noise, far, most_mm) in [(0.0, 1.0, 1.0, 1.0), (1.0, 3.0, 2.2, 8.0)] {
        let mut film = Film::around();
        (film.blur_px, film.noise) = (blur_px, noise);
        film.views = (0..8)
            .map(|k| {
                let k = f64::from(k);
                looking(0.8 * k, 0.15 + 0.08 * k, far * (0.42 + 0.01 * k), 0.7 * k)
            })
            .collect();
        film.save(&folder, "film.y4m", &print([letter, ring]));
        folder.succeed("track film.y4m --board board.toml --intrinsics lens.yaml --fix-intrinsics --gamma 2.2 --board-flatness rigid -o poses.json --report track.json");
        let report = folder.json("track.json");
        assert_eq!(report["family"]["name"], "patterns");
        let poses = folder.json("poses.json");
        let frames = poses["frames"].as_array().unwrap();
        for (index, (frame, view)) in frames.iter().zip(&film.views).enumerate() {
            let mut ids: Vec<u64> =
                serde_json::from_value(report["frames"][index]["ids"].clone()).unwrap();
            ids.sort_unstable();
            assert_eq!(ids, [0, 1], "frame {index}");
            let (mm, degrees) = off(&pose(frame), view);
            assert!(
                mm < most_mm && degrees < 0.5 * most_mm,
                "frame {index}: {mm} mm, {degrees}"
            );
        }
    }
    // The flags in place of the file, and one marker without a board.
    let said = folder.succeed("track film.y4m --marker-size 80mm --pattern ring.patt --intrinsics lens.yaml --fix-intrinsics --gamma 2.2 -o poses.json");
    assert!(said.contains("patterns, 1 ids"), "{said}");
}

#[test]
fn other_patterns_and_mirrors_are_refused() {
    let folder = prepared();
    let film = Film::around();
    let print = print([letter, ring]);
    film.save(&folder, "film.y4m", &print);
    film.save(&folder, "mirrored.y4m", &|at| {
        print(DVec2::new(-at.x, at.y))
    });
    let others = "--pattern steps.patt --pattern strokes.patt --marker-size 80mm -o poses.json";
    folder.refuse(&format!("track film.y4m {others}"), "no marker is seen");
    folder.refuse(
        "track mirrored.y4m --pattern f.patt --pattern ring.patt --marker-size 80mm -o poses.json",
        "ffmpeg -vf hflip",
    );
    folder.refuse(
        "track film.y4m --marker-size 80mm -o poses.json",
        "expected black squares",
    );
    folder.write(
        "dot.patt",
        pattern_file(|at| at.distance(DVec2::splat(0.5)) < 0.3),
    );
    for (flags, part) in [
        ("--pattern f.patt --pattern f.patt", "look alike"),
        ("--pattern dot.patt", "looks alike after"),
        ("--pattern board.toml", "is no code"),
        ("--pattern none.patt", "cannot be read"),
    ] {
        folder.refuse(
            &format!("track film.y4m {flags} --marker-size 80mm -o poses.json"),
            part,
        );
    }
    assert!(!folder.path("poses.json").exists());
}

#[test]
fn a_report_carries_its_patterns() {
    let folder = prepared();
    let film = Film::around();
    film.save(&folder, "film.y4m", &print([letter, ring]));
    folder.succeed("track film.y4m --board board.toml --intrinsics lens.yaml --fix-intrinsics --gamma 2.2 -o poses.json --report track.json");
    folder.write("scene.toml", "[camera]\n[[virtual]]\nshape = \"box\"\nscale = 0.02\n[environment]\nradiance = [1.0, 1.0, 1.0]\n");
    std::fs::remove_file(folder.path("f.patt")).unwrap();
    let line = "live scene.toml --board track.json --intrinsics poses.yaml --input film.y4m --fps 1 --rpp 1 --hold 0 --overwrite";
    folder.succeed(&format!("{line} -o live.y4m --stats stats.json"));
    let stats: Value = folder.json("stats.json");
    assert!(stats.to_string().contains("frames"), "{stats}");
    let mut report = folder.json("track.json");
    report["family"]["patterns"]["list"][0]["side"] = 15.into();
    folder.write("track.json", report.to_string());
    folder.refuse(&format!("{line} -o other.y4m"), "patterns are not whole");
}
