//! Poses that know no metres get them from a known distance.

use mixray::tracking::Family;
use serde_json::{Value, json};

use super::film::{Film, markers};
use crate::support::{Folder, stderr};

/// Poses of the film, seven times as far away as they are, and points of the board in metres.
fn prepared() -> Folder {
    let folder = Folder::new();
    let tags = Family::named("apriltag-36h11").unwrap();
    let film = Film::around();
    film.save(&folder, "film.y4m", &markers(tags, 4, 3, 0.04, 0.02));
    folder
        .succeed("track film.y4m --marker-size 40mm --gamma 2.2 -o poses.json --report track.json");
    let mut poses = folder.json("poses.json");
    for frame in poses["frames"].as_array_mut().unwrap() {
        for row in 0..3 {
            let far = &mut frame["world_from_camera"][row][3];
            *far = json!(7.0 * far.as_f64().unwrap());
        }
    }
    folder.write("far.json", poses.to_string());
    let report = folder.json("track.json");
    let (corners, points) = (&report["frames"], &report["board"]["points_m"]);
    let mut table = String::from("frame,x_px,y_px,x_m,y_m,z_m\n");
    for (frame, seen) in corners.as_array().unwrap().iter().enumerate() {
        for corner in seen["corners_px"].as_array().unwrap().iter().step_by(5) {
            let point = &points[corner[0].as_u64().unwrap() as usize];
            table += &format!(
                "{frame},{},{},{},{},{}\n",
                corner[1], corner[2], point[0], point[1], point[2]
            );
        }
    }
    folder.write("points.csv", table);
    folder.write(
        "scene.toml",
        "[[virtual]]\nshape = \"box\"\nscale = 0.02\n[environment]\nradiance = [1.0, 1.0, 1.0]\n",
    );
    folder
}

const CHECK: &str =
    "sequence scene.toml --frames film.y4m --trajectory far.json --check points.csv --max-error 1";

#[test]
fn a_distance_between_two_markers_brings_metres() {
    let folder = prepared();
    assert_eq!(
        folder.run(CHECK).status.code(),
        Some(1),
        "control: not scaled"
    );
    // Markers 0 and 11 lie three columns and two rows of 60 mm apart.
    let far = 0.06 * f64::hypot(3.0, 2.0);
    let output = folder.run(&format!("{CHECK} --scale-from 0,11,{far:.5}m"));
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let said = stderr(&output);
    assert!(
        said.contains("multiplied by 0.142") || said.contains("multiplied by 0.143"),
        "{said}"
    );
    let twice = folder.run(&format!("{CHECK} --scale-from 0,11,{:.5}m", 2.0 * far));
    assert_eq!(twice.status.code(), Some(1), "control: another distance");
    folder.refuse(
        &format!("{CHECK} --scale-from 0,99,0.2m"),
        "99 is seen in 0 frames",
    );
    let output = folder.run(&format!("{CHECK} --scale-from 0,11"));
    assert!(stderr(&output).contains("expected two different points"));
}

#[test]
fn a_distance_between_two_clicked_points_brings_metres() {
    let folder = prepared();
    let report: Value = folder.json("track.json");
    let mut clicks = String::from("point,frame,x_px,y_px\n");
    for (frame, seen) in report["frames"].as_array().unwrap().iter().enumerate() {
        for corner in seen["corners_px"].as_array().unwrap() {
            let name = match corner[0].as_u64().unwrap() {
                0 => "left",
                1 => "right",
                _ => continue,
            };
            clicks += &format!("{name},{frame},{},{}\n", corner[1], corner[2]);
        }
    }
    folder.write("clicks.csv", clicks);
    // Two corners of one marker: 40 mm.
    let line = format!("{CHECK} --clicks clicks.csv --scale-from left,right,40mm");
    let output = folder.run(&line);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    folder.write("clicks.csv", "left,0,100\n");
    folder.refuse(&line, "clicks.csv:1: it has 3 columns");
}
