//! What a run leaves: a trajectory that `mixray sequence` takes, a calibration as OpenCV writes it, and a report.

use serde_json::{Map, Value, json};

use super::board::BoardKind;
use super::bundle::Solution;
use super::code::Code;
use super::lens::LENS_PARAMETERS;
use super::session::Session;
use super::tracker::{FramePose, TrackedFrame};

const NAMES: [&str; LENS_PARAMETERS] = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"];

/// Order of the rows and columns of covariances.
const COVARIANCE_NOTE: &str = "of camera from world: turn about the camera's axes (x right, y down, z along the view; radians), then shift along them (metres)";

impl Session {
    /// The trajectory as JSON of this program: camera and frames, null where a frame has no pose.
    pub fn trajectory(&self) -> Value {
        let frames = self.names.iter().zip(&self.tracked.frames).enumerate().map(
            |(index, (name, frame))| {
                let mut entry = Map::new();
                entry.insert("frame".to_owned(), json!(name.number));
                if let Some(Some(moved)) = self.moved.get(index) {
                    entry.insert("smoothed_by_m".to_owned(), json!(moved.metres));
                    entry.insert("smoothed_by_rad".to_owned(), json!(moved.radians));
                }
                if let Some(time) = name.time_secs {
                    entry.insert("time_secs".to_owned(), json!(time));
                }
                describe(frame, &mut entry);
                Value::Object(entry)
            },
        );
        let mut root = Map::new();
        if let Some(rate) = self.frames_per_second {
            root.insert("frames_per_second".to_owned(), json!(rate));
        }
        root.insert("camera".to_owned(), self.camera());
        root.insert("covariance".to_owned(), json!(COVARIANCE_NOTE));
        root.insert("frames".to_owned(), frames.collect());
        Value::Object(root)
    }

    /// Keys of a scene's `[camera]`.
    fn camera(&self) -> Value {
        let lens = &self.tracked.solution.lens;
        let [fx, fy, cx, cy, ..] = lens.parameters();
        let [k1, k2, p1, p2, k3, ..] = lens.distortion.coefficients;
        let mut distortion = json!({ "k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3 });
        if lens.distortion.model != crate::distortion::LENS_RADIAL {
            distortion = json!(lens.distortion.coefficients);
        }
        let mut camera = json!({
            "width": self.tracked.width, "height": self.tracked.height,
            "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": distortion,
        });
        if lens.distortion.model == crate::distortion::LENS_FISHEYE {
            camera["distortion"] = json!(lens.distortion.coefficients[..4]);
            camera["camera_model"] = json!("OPENCV_FISHEYE");
        }
        camera
    }

    /// OpenCV's YAML; its pixel centres count from 0.
    pub fn calibration(&self) -> String {
        let tracked = &self.tracked;
        let [fx, fy, cx, cy, ..] = tracked.solution.lens.parameters();
        let lens = &tracked.solution.lens.distortion;
        let (count, model) = match lens.model {
            crate::distortion::LENS_FISHEYE => (4, "fisheye"),
            crate::distortion::LENS_RADIAL => (5, "plumb_bob"),
            _ => (12, "rational_polynomial"),
        };
        let numbers: Vec<String> = lens.coefficients[..count]
            .iter()
            .map(|k| format!("{k:?}"))
            .collect();
        format!(
            "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ {fx:?}, 0., {:?}, 0., {fy:?}, {:?}, 0., 0., 1. ]\ndistortion_model: {model}\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: {count}\n   dt: d\n   data: [ {} ]\navg_reprojection_error: {:?}\n",
            tracked.width,
            tracked.height,
            cx - 0.5,
            cy - 0.5,
            numbers.join(", "),
            self.rms_px(),
        )
    }

    /// Over all posed frames: root mean square of the errors' lengths, pixels.
    pub fn rms_px(&self) -> f64 {
        let posed = self.tracked.frames.iter().filter_map(|frame| {
            let pose = frame.pose.as_ref().ok()?;
            Some((pose.rms_px, frame.sighting.observations.len() as f64))
        });
        let (sum, count) = posed.fold((0.0, 0.0), |(sum, count), (rms, n)| {
            (sum + rms * rms * n, count + n)
        });
        (sum / f64::max(count, 1.0)).sqrt()
    }

    /// All that was found, frame by frame.
    pub fn report(&self) -> Value {
        let tracked = &self.tracked;
        let solution = &tracked.solution;
        let frames: Vec<Value> = self
            .names
            .iter()
            .zip(&tracked.frames)
            .map(|(name, frame)| {
                let mut entry = Map::new();
                entry.insert("frame".to_owned(), json!(name.number));
                entry.insert("label".to_owned(), json!(name.label));
                describe(frame, &mut entry);
                let corners = frame.sighting.observations.iter();
                let corners: Vec<Value> = corners
                    .map(|o| json!([o.point, o.pixel.x, o.pixel.y]))
                    .collect();
                entry.insert("ids".to_owned(), json!(frame.ids));
                entry.insert("corners_px".to_owned(), json!(corners));
                Value::Object(entry)
            })
            .collect();
        json!({
            "frames_posed": tracked.posed(),
            "rms_px": self.rms_px(),
            "corner_sigma_px": solution.noise_px,
            "gamma": tracked.tone.to_string(),
            "family": tracked.choice.as_ref().map(|choice| json!({
                "name": choice.code.name(), "ids": choice.ids, "bits": choice.bits,
                "patterns": match &choice.code {
                    Code::Family(_) => Value::Null,
                    Code::Patterns(patterns) => {
                        json!({ "list": patterns.list(), "share": patterns.share() })
                    }
                },
            })),
            "learnt_from_frames": tracked.learnt_from,
            "rows": self.rows.as_ref().map(|rows| json!({
                "readout_secs": rows.readout_secs, "sigma_secs": rows.sigma_secs,
                "frames_as_they_came": rows.frames_as_they_came,
            })),
            "camera": self.camera(),
            "camera_sigma": lens_sigmas(solution),
            "board": {
                "kind": match tracked.board.kind {
                    BoardKind::Markers => "markers",
                    BoardKind::Charuco { .. } => "charuco",
                    BoardKind::Found { .. } => "found",
                    BoardKind::Chessboard { .. } => "chessboard",
                },
                "chessboard": match tracked.board.kind {
                    BoardKind::Chessboard { columns, rows, square_m } => {
                        json!({ "columns": columns, "rows": rows, "square_m": square_m })
                    }
                    _ => Value::Null,
                },
                "charuco": match tracked.board.kind {
                    BoardKind::Charuco { columns, rows, square_m, is_legacy } => {
                        json!({ "columns": columns, "rows": rows, "square_m": square_m, "legacy": is_legacy })
                    }
                    _ => Value::Null,
                },
                "first_point_of_marker": tracked.board.markers,
                "points_m": solution.points.iter().map(|p| p.to_array()).collect::<Vec<_>>(),
            },
            "covariance": COVARIANCE_NOTE,
            "frames": frames,
        })
    }

    /// A few lines for people.
    pub fn summary(&self) -> String {
        let tracked = &self.tracked;
        let solution = &tracked.solution;
        let mut lines = Vec::new();
        match &tracked.choice {
            Some(choice) => lines.push(format!(
                "markers: {}, {} ids, by {:.0} bits beyond chance",
                choice.code.name(),
                choice.ids,
                choice.bits
            )),
            None => lines.push("markers: a chessboard's corners".to_owned()),
        }
        let by_neighbours = tracked
            .frames
            .iter()
            .filter(|frame| frame.pose.as_ref().is_ok_and(|p| p.by_neighbours));
        lines.push(format!(
            "frames:  {} of {} with a pose, {} of them told from its mirror by their neighbours",
            tracked.posed(),
            tracked.frames.len(),
            by_neighbours.count()
        ));
        let share = lens_sigmas(solution)[NAMES[0]].as_f64().unwrap_or_default();
        lines.push(format!(
            "lens:    fx {:.2} +- {share:.2} px, fy {:.2}, centre {:.2} {:.2}, learnt from {} frames",
            solution.lens.focal.x, solution.lens.focal.y, solution.lens.centre.x, solution.lens.centre.y, tracked.learnt_from
        ));
        lines.push(format!(
            "corners: {:.3} px rms, {:.3} px standard deviation along an axis; codes are light to the power {}",
            self.rms_px(),
            solution.noise_px,
            tracked.tone
        ));
        lines.extend(self.rows_text());
        lines.extend(self.moved_text());
        let mut reasons = std::collections::BTreeMap::<&str, usize>::new();
        for why in tracked
            .frames
            .iter()
            .filter_map(|frame| frame.pose.as_ref().err())
        {
            *reasons.entry(why).or_default() += 1;
        }
        lines.extend(
            reasons
                .iter()
                .map(|(why, count)| format!("no pose: {count} frames: {why}")),
        );
        lines.join("\n") + "\n"
    }
}

impl Session {
    /// How rows were read, in one line.
    fn rows_text(&self) -> Option<String> {
        let rows = self.rows.as_ref()?;
        let sigma = rows
            .sigma_secs
            .map_or(String::new(), |sigma| format!(" +- {:.2}", 1e3 * sigma));
        Some(format!(
            "rows:    read in {:.2}{sigma} ms; poses and corners are those of the middle row's time; {} frames, whose motion no neighbour tells, stand as they came",
            1e3 * rows.readout_secs,
            rows.frames_as_they_came
        ))
    }

    /// What was smoothed, in one line.
    fn moved_text(&self) -> Option<String> {
        let moved = self.moved.iter().zip(&self.names);
        let mut moved: Vec<(f64, f64, u32)> = moved
            .filter_map(|(moved, name)| {
                let moved = moved.as_ref()?;
                let (mm, degrees) = (1e3 * moved.metres, moved.radians.to_degrees());
                Some((mm, degrees, name.number))
            })
            .collect();
        moved.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (middle, most) = (moved.get(moved.len() / 2)?, moved.last()?);
        Some(format!(
            "smooth:  {} poses moved, by {:.3} mm and {:.4} degrees in the middle, by {:.3} mm and {:.4} degrees at most (frame {}); covariances are those before",
            moved.len(),
            middle.0,
            middle.1,
            most.0,
            moved.iter().map(|moved| moved.1).fold(0.0, f64::max),
            most.2
        ))
    }
}

fn lens_sigmas(solution: &Solution) -> Value {
    let sigmas = NAMES.into_iter().enumerate();
    let named =
        sigmas.map(|(k, name)| (name.to_owned(), json!(solution.covariance[(k, k)].sqrt())));
    Value::Object(named.collect())
}

fn describe(frame: &TrackedFrame, entry: &mut Map<String, Value>) {
    match &frame.pose {
        Err(why) => {
            entry.insert("world_from_camera".to_owned(), Value::Null);
            entry.insert("why".to_owned(), json!(why));
        }
        Ok(pose) => describe_pose(pose, entry),
    }
}

fn describe_pose(pose: &FramePose, entry: &mut Map<String, Value>) {
    let matrix = pose.fit.pose.world_from_camera();
    let rows: Vec<[f64; 4]> = (0..4).map(|row| matrix.row(row).to_array()).collect();
    entry.insert("world_from_camera".to_owned(), json!(rows));
    entry.insert("rms_px".to_owned(), json!(pose.rms_px));
    if pose.by_neighbours {
        entry.insert("told_by_neighbours".to_owned(), json!(true));
    }
    for (name, covariance) in [
        ("own_covariance", &pose.own_covariance),
        ("shared_covariance", &pose.shared_covariance),
    ] {
        let rows: Vec<Vec<f64>> = covariance
            .row_iter()
            .map(|row| row.iter().copied().collect())
            .collect();
        entry.insert(name.to_owned(), json!(rows));
    }
}
