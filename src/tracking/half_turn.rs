//! A chessboard looks alike after half a turn: which end is first, the frame before says.

use std::collections::BTreeMap;

use glam::DVec2;

use super::detector::FrameSeen;
use super::frame_pose::Observation;

/// Numbers the corners of every frame from the end that is nearer to where the last frame had it; `count` corners are on the board.
pub fn keep_turn(frames: &mut [FrameSeen], count: usize) {
    let mut before: BTreeMap<usize, DVec2> = BTreeMap::new();
    for frame in frames {
        let FrameSeen::Corners(corners) = frame else {
            continue;
        };
        if corners.is_empty() {
            continue;
        }
        let turned: Vec<Observation> = corners
            .iter()
            .map(|corner| Observation {
                point: count - 1 - corner.point,
                ..*corner
            })
            .collect();
        if moved(&turned, &before) < moved(corners, &before) {
            *corners = turned;
        }
        before = corners
            .iter()
            .map(|corner| (corner.point, corner.pixel))
            .collect();
    }
}

/// Mean way of the corners from where they were, pixels.
fn moved(corners: &[Observation], before: &BTreeMap<usize, DVec2>) -> f64 {
    let ways = corners
        .iter()
        .filter_map(|c| Some(c.pixel.distance(*before.get(&c.point)?)));
    let (sum, count) = ways.fold((0.0, 0), |(sum, count), way| (sum + way, count + 1));
    sum / f64::from(count.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(shift: f64, is_turned: bool) -> FrameSeen {
        let each = (0..6_usize).map(|point| Observation {
            point: if is_turned { 5 - point } else { point },
            pixel: DVec2::new((point % 3) as f64 * 20.0 + shift, (point / 3) as f64 * 20.0),
        });
        FrameSeen::Corners(each.collect())
    }

    #[test]
    fn numbers_stay_with_their_corners() {
        let mut frames = [
            corners(0.0, false),
            FrameSeen::Corners(Vec::new()),
            corners(4.0, true),
            corners(9.0, false),
        ];
        keep_turn(&mut frames, 6);
        for (frame, shift) in frames.iter().zip([0.0, 0.0, 4.0, 9.0]) {
            let FrameSeen::Corners(found) = frame else {
                unreachable!()
            };
            for corner in found {
                let expected = DVec2::new(
                    (corner.point % 3) as f64 * 20.0 + shift,
                    (corner.point / 3) as f64 * 20.0,
                );
                assert_eq!(corner.pixel, expected);
            }
        }
    }
}
