//! The metres of poses that know none: from the distance between two points that were seen in several frames.

use glam::{DMat3, DVec2, DVec3};

use super::SequenceError;
use super::table::{frame_key, read_table};
use crate::distortion::undistort;
use crate::scene::trajectory::{EntryKey, FrameName, FrameView, Intrinsics, Views};

/// A known distance.
#[derive(Clone, Debug)]
pub struct ScaleFrom {
    /// Names of its ends.
    pub ends: [String; 2],
    pub metres: f64,
    /// Where the ends were seen.
    pub sightings: Vec<Sighting>,
}

/// A point in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sighting {
    pub point: String,
    pub frame: EntryKey,
    /// Corner origin.
    pub pixel: DVec2,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// By which the poses' positions are multiplied.
    pub factor: f64,
    /// How far the points, put back into their frames, are from where they were seen: root mean square, radians.
    pub off_radians: f64,
}

/// Lines of sight have to cross at this angle at least, radians.
const LEAST_ANGLE: f64 = 0.02;
/// Beyond this they do not meet, radians.
const FARTHEST_OFF: f64 = 0.02;

/// Reads `point,frame,x_px,y_px` a line; the frame is a number or a file name.
///
/// # Errors
/// A line that is none.
pub fn read_clicks(path: &std::path::Path) -> Result<Vec<Sighting>, SequenceError> {
    let failure = |line: u64, problem: String| {
        SequenceError::Unfit(format!(
            "{}:{line}: {problem}; expected point,frame,x_px,y_px; correct the line",
            path.display()
        ))
    };
    let mut sightings = Vec::new();
    for (line, words) in read_table(path, "clicks", "point", &failure)? {
        let [point, frame, x, y] = words.as_slice() else {
            return Err(failure(line, format!("it has {} columns", words.len())));
        };
        let number = |word: &str| match word.parse::<f64>() {
            Ok(x) if x.abs() <= 1e6 => Ok(x),
            _ => Err(failure(line, format!("{word:?} is no pixel"))),
        };
        sightings.push(Sighting {
            point: point.clone(),
            frame: frame_key(frame),
            pixel: DVec2::new(number(x)?, number(y)?),
        });
    }
    Ok(sightings)
}

/// The scale at which the two ends are as far apart as is known.
pub(super) fn measure(
    views: &Views<'_>,
    intrinsics_of: &dyn Fn(&FrameView) -> Option<Intrinsics>,
    known: &ScaleFrom,
) -> Result<Scale, SequenceError> {
    let mut places = [DVec3::ZERO; 2];
    let mut off = 0.0_f64;
    for (name, place) in known.ends.iter().zip(&mut places) {
        let mut sights = Vec::new();
        for sighting in known.sightings.iter().filter(|s| s.point == *name) {
            let view = views.of(&FrameName::of_key(&sighting.frame))?;
            let Some(pose) = view.world_from_camera else {
                continue;
            };
            let Some(intrinsics) = intrinsics_of(&view) else {
                return Err(SequenceError::Unfit("--scale-from: the poses bring no intrinsics; expected them to know where a pixel looks; give --intrinsics".to_owned()));
            };
            let size = intrinsics.size.unwrap_or_default();
            let camera = intrinsics.camera_of_any_size(size, pose);
            let centre = DVec2::new(camera.cx, camera.cy);
            let on_plane = (sighting.pixel - centre) / DVec2::new(camera.fx, camera.fy);
            let Some([x, y]) = undistort(&camera.distortion, on_plane.to_array()) else {
                continue;
            };
            sights.push(Sight {
                from: pose.w_axis.truncate(),
                along: pose.transform_vector3(DVec3::new(x, -y, -1.0)).normalize(),
            });
        }
        let (met, met_off) = meeting(&sights)
            .map_err(|problem| SequenceError::Unfit(format!("--scale-from: {name} {problem}")))?;
        *place = met;
        off = off.max(met_off);
    }
    let distance = places[0].distance(places[1]);
    if !(distance > 0.0) {
        return Err(SequenceError::Unfit(format!(
            "--scale-from: {} and {} are one point; expected two; name others",
            known.ends[0], known.ends[1]
        )));
    }
    Ok(Scale {
        factor: known.metres / distance,
        off_radians: off,
    })
}

/// A line of sight.
#[derive(Clone, Copy, Debug)]
struct Sight {
    from: DVec3,
    /// Unit.
    along: DVec3,
}

/// The point nearest to all, and how far it is off them as seen from their beginnings, root mean square in radians.
fn meeting(sights: &[Sight]) -> Result<(DVec3, f64), String> {
    let widest = sights.iter().flat_map(|a| {
        let others = sights.iter();
        others.map(|b| a.along.angle_between(b.along))
    });
    let widest = widest.fold(0.0, f64::max);
    if widest < LEAST_ANGLE {
        return Err(format!(
            "is seen in {} frames with a pose, from directions that differ by {:.1} degrees; expected two frames or more, {:.1} degrees apart; add frames from further aside",
            sights.len(),
            widest.to_degrees(),
            LEAST_ANGLE.to_degrees()
        ));
    }
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for sight in sights {
        let d = sight.along;
        let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        matrix += across;
        right += across * sight.from;
    }
    let place = matrix.inverse() * right;
    let squares = sights.iter().map(|sight| {
        let angle = sight.along.angle_between(place - sight.from);
        angle * angle
    });
    let off = (squares.sum::<f64>() / sights.len() as f64).sqrt();
    if !(off < FARTHEST_OFF) {
        return Err(format!(
            "is not one point: lines of sight pass it by {:.1} degrees; expected the same point in every frame; correct the clicks",
            off.to_degrees()
        ));
    }
    Ok((place, off))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(from: [f64; 3], to: [f64; 3]) -> Sight {
        let from = DVec3::from(from);
        Sight {
            from,
            along: (DVec3::from(to) - from).normalize(),
        }
    }

    #[test]
    fn lines_of_sight_meet_where_they_were_aimed() {
        let at = [0.3, 0.1, -2.0];
        let sights =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.2], [0.0, 1.0, 0.1]].map(|from| sight(from, at));
        let (met, off) = meeting(&sights).unwrap();
        assert!(met.distance(at.into()) < 1e-12 && off < 1e-9);
        let narrow = [[0.0, 0.0, 0.0], [0.001, 0.0, 0.0]].map(|from| sight(from, at));
        assert!(meeting(&narrow).unwrap_err().contains("further aside"));
        let wrong = [
            sights[0],
            sights[1],
            sight([0.0, 1.0, 0.1], [1.3, 0.1, -2.0]),
        ];
        assert!(meeting(&wrong).unwrap_err().contains("is not one point"));
        assert!(meeting(&sights[..1]).is_err());
    }
}
