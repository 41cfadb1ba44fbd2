//! Scans as a generator writes them, by the documented layouts.

use std::path::Path;

use glam::DVec3;

use super::*;
use crate::scene::trajectory::Trajectory;

const NAMES: [&str; 2] = ["1650000000000000", "1650000000100000"];

/// ARKit poses: rows of world-from-camera, Y up.
fn rows(index: usize) -> [[f64; 4]; 3] {
    let (sin, cos) = (0.3 + 0.2 * index as f64).sin_cos();
    let x = 0.5 * index as f64;
    [
        [cos, 0.0, sin, x],
        [0.0, 1.0, 0.0, 1.4],
        [-sin, 0.0, cos, 2.0],
    ]
}

fn write_picture(path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_pixel(8, 6, image::Rgb([90, 90, 90]))
        .save(path)
        .unwrap();
}

fn write_depth(path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let depth = image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(4, 3, image::Luma([1250]));
    depth.save(path).unwrap();
}

fn polycam(folder: &Path, cameras: &str, images: &str) {
    let keyframes = folder.join("keyframes");
    std::fs::create_dir_all(keyframes.join(cameras)).unwrap();
    for (index, name) in NAMES.iter().enumerate() {
        write_picture(&keyframes.join(images).join(format!("{name}.png")));
        write_depth(&keyframes.join("depth").join(format!("{name}.png")));
        let mut camera = json!({
            "fx": 7.0, "fy": 7.1, "cx": 4.0, "cy": 3.0, "width": 8, "height": 6, "blur_score": 120.0,
        });
        for (i, row) in rows(index).iter().enumerate() {
            for (j, element) in row.iter().enumerate() {
                camera[format!("t_{i}{j}")] = json!(element);
            }
        }
        let file = keyframes.join(cameras).join(format!("{name}.json"));
        std::fs::write(file, camera.to_string()).unwrap();
    }
}

/// Of the same cameras, as nerfstudio's converter turns them: the rows one place on, so that Z is up.
fn transforms(folder: &Path) {
    let frames: Vec<Value> = (0..NAMES.len())
        .map(|index| {
            let [x, y, z] = rows(index);
            write_picture(&folder.join(format!("images/frame_{index:05}.png")));
            write_depth(&folder.join(format!("depth/frame_{index:05}.png")));
            json!({
                "file_path": format!("./images/frame_{index:05}.png"),
                "depth_file_path": format!("./depth/frame_{index:05}.png"),
                "fl_x": 7.0, "fl_y": 7.1, "cx": 4.0, "cy": 3.0, "w": 8, "h": 6,
                "transform_matrix": [z, x, y, [0.0, 0.0, 0.0, 1.0]],
            })
        })
        .collect();
    let document = json!({ "camera_model": "OPENCV", "frames": frames });
    std::fs::write(folder.join("transforms.json"), document.to_string()).unwrap();
}

#[test]
fn a_raw_export_brings_cameras_depth_and_a_mesh() {
    let folder = tempfile::tempdir().unwrap();
    polycam(folder.path(), "cameras", "images");
    let scan = Scan::read(folder.path()).unwrap();
    assert_eq!(scan.frames.len(), 2);
    assert!(scan.basis.contains("tracking") && scan.mesh.is_none());
    let frame = scan.frame(Some(NAMES[1])).unwrap();
    let pose = frame.world_from_camera;
    assert_eq!(pose.w_axis.truncate(), DVec3::new(0.5, 1.4, 2.0));
    assert!((pose.row(0).z - 0.5_f64.sin()).abs() < 1e-12);
    assert_eq!(frame.intrinsics.focal, Focal::Pixels([7.0, 7.1]));
    assert!(
        frame
            .depth
            .as_ref()
            .unwrap()
            .ends_with(format!("depth/{}.png", NAMES[1]))
    );
    assert!(scan.frame(Some("7")).is_err() && scan.frame(Some("1")).is_ok());

    // Optimised cameras win.
    polycam(folder.path(), "corrected_cameras", "corrected_images");
    std::fs::write(folder.path().join("raw.glb"), "").unwrap();
    // Columns: a quarter turn about X, and a way.
    let aligned = json!([1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 5, 6, 7, 1]);
    let info = json!({ "alignmentTransform": aligned });
    std::fs::write(folder.path().join("mesh_info.json"), info.to_string()).unwrap();
    let scan = Scan::read(folder.path()).unwrap();
    assert!(
        scan.frames[0]
            .photo
            .ends_with(format!("corrected_images/{}.png", NAMES[0]))
    );
    let (_, world_from_mesh) = scan.mesh.as_ref().unwrap();
    let point = world_from_mesh.transform_point3(DVec3::new(5.0, 5.0, 7.0));
    assert!(point.distance(DVec3::new(0.0, 0.0, 1.0)) < 1e-12, "{point}");
}

#[test]
fn transforms_become_the_same_scan() {
    let folder = tempfile::tempdir().unwrap();
    transforms(folder.path());
    polycam(folder.path(), "cameras", "images");
    let raw = Scan::read(folder.path()).unwrap();
    let turned = Scan::read(&folder.path().join("transforms.json")).unwrap();
    let place = |scan: &Scan, index: usize| scan.frames[index].world_from_camera;
    let ways = [&raw, &turned].map(|scan| {
        let [a, b] = [0, 1].map(|index| place(scan, index));
        a.inverse() * b
    });
    assert!(ways[0].abs_diff_eq(ways[1], 1e-9), "{ways:?}");
    for index in 0..2 {
        let [a, b] = [&raw, &turned].map(|scan| place(scan, index));
        assert!((a.w_axis.y - b.w_axis.y).abs() < 1e-9, "the same height");
        assert!((a.y_axis.y - b.y_axis.y).abs() < 1e-9, "the same up");
    }
    assert!(turned.frames[0].depth.is_some());

    // Its poses are read back.
    let poses = folder.path().join("poses.json");
    std::fs::write(&poses, turned.trajectory()).unwrap();
    let read = Trajectory::read(&poses).unwrap();
    let pose = read.entries[1].world_from_camera.unwrap();
    assert!(pose.abs_diff_eq(place(&turned, 1), 1e-9));
    assert_eq!(
        read.entries[1].intrinsics.unwrap().focal,
        Focal::Pixels([7.0, 7.1])
    );
}

#[test]
fn what_is_missing_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |folder: &Path| Scan::read(folder).unwrap_err().to_string();
    assert!(refused(folder.path()).contains("no scan"));
    polycam(folder.path(), "cameras", "images");
    let photo = format!("keyframes/images/{}.png", NAMES[0]);
    std::fs::remove_file(folder.path().join(photo)).unwrap();
    assert!(refused(folder.path()).contains("photograph"));
    let camera = format!("keyframes/cameras/{}.json", NAMES[0]);
    std::fs::write(folder.path().join(camera), "{}").unwrap();
    let other = folder
        .path()
        .join(format!("keyframes/images/{}.jpg", NAMES[0]));
    std::fs::write(other, "").unwrap();
    assert!(refused(folder.path()).contains("t_00"));
}
