//! What is known of the points that are tracked: where markers or a chessboard's corners lie in the world, and how well.
//!
//! Of boards in a plane the world's origin is their middle, x runs to the right, z down the page and y up out of it; metres.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::bundle::Prior;
use super::code::Code;

/// Points whose places are known or being found.
#[derive(Clone, Debug)]
pub struct Board {
    /// World, metres.
    pub points: Vec<DVec3>,
    /// Of square markers: their first point by id; the other three follow clockwise from their top left.
    pub markers: BTreeMap<u32, usize>,
    /// Of square markers.
    pub code: Option<Code>,
    pub kind: BoardKind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BoardKind {
    /// Markers where a file says.
    Markers,
    /// Markers of this side, metres, put together from the frames.
    Found { side_m: f64 },
    /// Markers in the light squares of a chessboard of so many squares; its inner corners follow them as points, row by row.
    Charuco {
        columns: usize,
        rows: usize,
        square_m: f64,
        is_legacy: bool,
    },
    /// Inner corners row by row.
    Chessboard {
        columns: usize,
        rows: usize,
        square_m: f64,
    },
}

/// How far points may be from where a board's file has them, one standard deviation in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flatness {
    /// Along the surface: a printer is true.
    pub along_m: f64,
    /// Out of it: paper bends. 0: the board is rigid, as its file has it.
    pub out_m: f64,
}

impl Flatness {
    pub const RIGID: Self = Self {
        along_m: 0.0,
        out_m: 0.0,
    };

    /// Of paper that lies within this of a plane.
    pub fn of_paper(out_m: f64) -> Self {
        Self {
            along_m: 0.1 * out_m,
            out_m,
        }
    }

    pub fn is_rigid(self) -> bool {
        self.out_m == 0.0
    }
}

impl Board {
    /// Markers row by row, spaces between them.
    pub fn grid(
        (columns, rows): (usize, usize),
        ids: &[u32],
        (side_m, gap_m): (f64, f64),
        turn: usize,
    ) -> Self {
        let pitch = side_m + gap_m;
        let first = -0.5 * DVec2::new(columns as f64, rows as f64) * pitch + 0.5 * gap_m;
        let mut board = Self::empty(BoardKind::Markers);
        for (index, id) in ids.iter().enumerate() {
            let cell = DVec2::new((index % columns) as f64, (index / columns) as f64);
            let corner = first + cell * pitch;
            board.add(*id, square(corner, side_m, turn));
        }
        board
    }

    pub fn chessboard(columns: usize, rows: usize, square_m: f64) -> Self {
        let middle = 0.5 * DVec2::new(columns as f64 - 1.0, rows as f64 - 1.0);
        let cells = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        let mut board = Self::empty(BoardKind::Chessboard {
            columns,
            rows,
            square_m,
        });
        board.points.extend(cells.map(|(x, y)| {
            let place = (DVec2::new(x as f64, y as f64) - middle) * square_m;
            DVec3::new(place.x, 0.0, place.y)
        }));
        board
    }

    /// OpenCV's ChArUco board: ids row by row over the light squares, the upper left square dark; in OpenCV's legacy layout it is light where the number of
    /// rows is even.
    pub fn charuco(
        (columns, rows): (usize, usize),
        (square_m, side_m): (f64, f64),
        is_legacy: bool,
    ) -> Self {
        let mut board = Self::empty(BoardKind::Charuco {
            columns,
            rows,
            square_m,
            is_legacy,
        });
        let middle = 0.5 * square_m * DVec2::new(columns as f64, rows as f64);
        let inset = 0.5 * (square_m - side_m);
        let cells = (0..rows).flat_map(|y| (0..columns).map(move |x| (x, y)));
        let light = cells.filter(|(x, y)| !is_dark((*x, *y), rows, is_legacy));
        for (id, (x, y)) in (0..).zip(light) {
            let corner = square_m * DVec2::new(x as f64, y as f64) + inset - middle;
            board.add(id, square(corner, side_m, 0));
        }
        let inner = (1..rows).flat_map(|y| (1..columns).map(move |x| (x, y)));
        board.points.extend(inner.map(|(x, y)| {
            let place = square_m * DVec2::new(x as f64, y as f64) - middle;
            DVec3::new(place.x, 0.0, place.y)
        }));
        board
    }

    /// Of a ChArUco board: the point of the corner to the left of and above square (`x`, `y`).
    pub fn between(&self, x: usize, y: usize) -> Option<usize> {
        match self.kind {
            BoardKind::Charuco { columns, rows, .. }
                if (1..columns).contains(&x) && (1..rows).contains(&y) =>
            {
                Some(4 * self.markers.len() + (y - 1) * (columns - 1) + x - 1)
            }
            _ => None,
        }
    }

    pub fn empty(kind: BoardKind) -> Self {
        Self {
            points: Vec::new(),
            markers: BTreeMap::new(),
            code: None,
            kind,
        }
    }

    /// A marker by its corners, clockwise from its top left.
    pub fn add(&mut self, id: u32, corners: [DVec3; 4]) {
        self.markers.insert(id, self.points.len());
        self.points.extend(corners);
    }

    /// What is known of the points besides the frames.
    pub fn priors(&self, flatness: Flatness) -> Vec<Prior> {
        match self.kind {
            BoardKind::Found { side_m } => self.square_priors(side_m, flatness),
            BoardKind::Markers | BoardKind::Charuco { .. } | BoardKind::Chessboard { .. } => {
                let places = self.points.iter().enumerate();
                let sigmas = [flatness.along_m, flatness.out_m, flatness.along_m];
                places
                    .flat_map(|(index, place)| {
                        let axes = place.to_array().into_iter().zip(sigmas).enumerate();
                        axes.map(move |(axis, (target, sigma))| {
                            Prior::place(index, axis, target, sigma)
                        })
                    })
                    .collect()
            }
        }
    }

    /// Each marker is a square of its side, flat but for the paper; the first one rests where it is.
    fn square_priors(&self, side_m: f64, flatness: Flatness) -> Vec<Prior> {
        let mut priors = Vec::new();
        let along = flatness.along_m.max(1e-6);
        for first in self.markers.values() {
            for k in 0..4 {
                priors.push(Prior::Distance {
                    points: [first + k, first + (k + 1) % 4],
                    metres: side_m,
                    sigma: along,
                });
            }
            for k in 0..2 {
                priors.push(Prior::Distance {
                    points: [first + k, first + k + 2],
                    metres: side_m * std::f64::consts::SQRT_2,
                    sigma: along,
                });
            }
            // Both diagonals share their middle: along the surface as true as the printer, out of it as flat as so little paper.
            for axis in 0..3 {
                priors.push(Prior::closure(*first, axis, 2.0 * along));
            }
        }
        if let Some(first) = self.markers.values().next() {
            for k in 0..4 {
                for (axis, target) in self.points[first + k].to_array().into_iter().enumerate() {
                    priors.push(Prior::place(first + k, axis, target, along));
                }
            }
        }
        priors
    }

    pub fn middle(&self) -> DVec3 {
        self.points.iter().sum::<DVec3>() / self.points.len().max(1) as f64
    }
}

/// A square of a ChArUco board of so many rows.
pub fn is_dark((x, y): (usize, usize), rows: usize, is_legacy: bool) -> bool {
    let first_is_light = is_legacy && rows.is_multiple_of(2);
    (x + y).is_multiple_of(2) != first_is_light
}

/// Corners of a square in the plane y = 0 whose upper left corner on the page is at `corner`, from the marker's own top left, which quarter turns
/// clockwise move on.
pub fn square(corner: DVec2, side_m: f64, turn: usize) -> [DVec3; 4] {
    let mut corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, z)| {
        let place = corner + side_m * DVec2::new(x, z);
        DVec3::new(place.x, 0.0, place.y)
    });
    corners.rotate_left(turn % 4);
    corners
}
