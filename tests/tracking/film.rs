//! Films of a printed board whose camera is known: a lens that distorts, blur by the pixel, the codes of a gamma, noise.

use glam::{DMat3, DVec2, DVec3};
use mixray::distortion::Distortion;
use mixray::tracking::{Family, Lens};

use crate::support::{Folder, Random};

/// Camera from board, OpenCV's axes.
#[derive(Clone, Copy)]
pub struct View {
    pub rotation: DMat3,
    pub translation: DVec3,
}

pub struct Film {
    pub lens: Lens,
    pub width: usize,
    pub height: usize,
    pub gamma: f64,
    /// Of a Gaussian besides the pixels' own, one standard deviation.
    pub blur_px: f64,
    /// Of the codes, one standard deviation.
    pub noise: f64,
    pub views: Vec<View>,
}

/// What is printed at a place of the board's plane: x and z, metres; reflectance.
pub type Print<'a> = &'a dyn Fn(DVec2) -> f64;

pub const PAPER: f64 = 0.85;
pub const INK: f64 = 0.06;
/// Of the table around the paper.
const TABLE: f64 = 0.25;

impl Film {
    /// Eight views from 0.4 to 0.6 m, tilted by 10 to 50 degrees.
    pub fn around() -> Self {
        let mut random = Random(3);
        let views = (0..8).map(|index| {
            let tilt = (10.0 + 40.0 * random.uniform()).to_radians();
            let around = f64::from(index) * 0.8;
            let distance = 0.4 + 0.2 * random.uniform();
            looking(around, tilt, distance, 0.3 * random.normal())
        });
        Self {
            lens: Lens {
                focal: DVec2::new(520.0, 519.0),
                centre: DVec2::new(236.0, 184.0),
                distortion: Distortion::opencv(&[-0.2, 0.1, 0.0, 0.0]).expect("four coefficients"),
            },
            width: 480,
            height: 360,
            gamma: 2.2,
            blur_px: 0.0,
            noise: 1.0,
            views: views.collect(),
        }
    }

    /// As Y4M of luma alone.
    pub fn save(&self, folder: &Folder, name: &str, print: Print) {
        let still = |frame: usize, _: f64| self.views[frame];
        self.save_rows(folder, name, print, self.views.len(), &still);
    }

    /// The same, each row from where the camera then is: `view_of` gets the frame's number and the row's place, from -0.5, the first, to 0.5, the last.
    pub fn save_rows(
        &self,
        folder: &Folder,
        name: &str,
        print: Print,
        frames: usize,
        view_of: &dyn Fn(usize, f64) -> View,
    ) {
        const SIDE: usize = 3;
        let across = SIDE * self.width;
        let mut rays = Vec::with_capacity(across * SIDE * self.height);
        for row in 0..SIDE * self.height {
            let mut near = None;
            for column in 0..across {
                let pixel = DVec2::new(column as f64 + 0.5, row as f64 + 0.5) / SIDE as f64;
                let ideal = match near {
                    Some(near) => self.lens.ideal_near(pixel, near),
                    None => self
                        .lens
                        .ideal_of(pixel)
                        .expect("a point that the lens sees"),
                };
                near = Some(ideal);
                rays.push(ideal.extend(1.0));
            }
        }
        let mut random = Random(11);
        let header = format!(
            "YUV4MPEG2 W{} H{} F25:1 Ip A1:1 C420jpeg XCOLORRANGE=FULL\n",
            self.width, self.height
        );
        let mut bytes = header.into_bytes();
        for frame in 0..frames {
            bytes.extend(b"FRAME\n");
            let mut lights = Vec::with_capacity(self.width * self.height);
            for row in 0..self.height {
                let view = view_of(frame, row as f64 / (self.height as f64 - 1.0) - 0.5);
                let back = view.rotation.transpose();
                let eye = -(back * view.translation);
                for column in 0..self.width {
                    let mut light = 0.0;
                    for j in 0..SIDE {
                        let first = (SIDE * row + j) * across + SIDE * column;
                        for ray in &rays[first..first + SIDE] {
                            let way = back * *ray;
                            let distance = -eye.y / way.y;
                            let at = eye + way * distance;
                            light += match distance > 0.0 {
                                true => print(DVec2::new(at.x, at.z)),
                                false => TABLE,
                            };
                        }
                    }
                    lights.push(0.9 * light / (SIDE * SIDE) as f64);
                }
            }
            for light in blurred(&lights, self.width, self.blur_px) {
                let code = 255.0 * light.powf(1.0 / self.gamma) + self.noise * random.normal();
                bytes.push(code.round().clamp(0.0, 255.0) as u8);
            }
            bytes.extend(vec![
                128;
                self.width.div_ceil(2) * self.height.div_ceil(2) * 2
            ]);
        }
        folder.write(name, bytes);
    }
}

/// Along rows, then along columns; the edge's value beyond.
fn blurred(lights: &[f64], width: usize, sigma_px: f64) -> Vec<f64> {
    if sigma_px == 0.0 {
        return lights.to_vec();
    }
    let reach = (3.0 * sigma_px).ceil() as isize;
    let weights: Vec<f64> = (-reach..=reach)
        .map(|k| (-0.5 * (k as f64 / sigma_px).powi(2)).exp())
        .collect();
    let total: f64 = weights.iter().sum();
    let height = lights.len() / width;
    let along = |from: &[f64], step: (isize, isize)| -> Vec<f64> {
        let places = (0..height as isize).flat_map(|y| (0..width as isize).map(move |x| (x, y)));
        let sum = |(x, y): (isize, isize)| {
            let each = weights.iter().zip(-reach..).map(|(weight, k)| {
                let column = (x + k * step.0).clamp(0, width as isize - 1);
                let row = (y + k * step.1).clamp(0, height as isize - 1);
                weight * from[row as usize * width + column as usize]
            });
            each.sum::<f64>() / total
        };
        places.map(sum).collect()
    };
    along(&along(lights, (1, 0)), (0, 1))
}

/// From above the board's middle, gone aside.
pub fn looking(around: f64, tilt: f64, distance: f64, roll: f64) -> View {
    let eye = distance
        * DVec3::new(
            tilt.sin() * around.cos(),
            tilt.cos(),
            tilt.sin() * around.sin(),
        );
    let z = -eye.normalize();
    let x = z.cross(DVec3::new(0.3, 0.9, 0.1)).normalize();
    let y = z.cross(x);
    let (sin, cos) = roll.sin_cos();
    let rotation = DMat3::from_cols(cos * x + sin * y, cos * y - sin * x, z).transpose();
    View {
        rotation,
        translation: -(rotation * eye),
    }
}

/// A grid of markers with their middle at the origin, rows down the page.
pub fn markers(
    family: &'static Family,
    columns: usize,
    rows: usize,
    side_m: f64,
    gap_m: f64,
) -> impl Fn(DVec2) -> f64 {
    squares((columns, rows), (side_m, gap_m), move |id, inside| {
        let bit = inside * family.side_cells() - family.border;
        let n = family.cells as f64;
        if bit.cmplt(DVec2::ZERO).any() || bit.cmpge(DVec2::splat(n)).any() {
            return INK;
        }
        match family.is_white(id as u32, bit.x as usize, bit.y as usize) {
            true => PAPER,
            false => INK,
        }
    })
}

/// A grid of squares of which `inside` tells the reflectance, by their numbers and places from 0 to 1.
pub fn squares(
    (columns, rows): (usize, usize),
    (side_m, gap_m): (f64, f64),
    inside: impl Fn(usize, DVec2) -> f64,
) -> impl Fn(DVec2) -> f64 {
    move |at| {
        let pitch = side_m + gap_m;
        let size = DVec2::new(columns as f64, rows as f64) * pitch;
        let place = at + 0.5 * size - 0.5 * gap_m;
        if at.abs().cmpgt(0.5 * size + gap_m).any() {
            return TABLE;
        }
        let cell = (place / pitch).floor();
        let within = (place - cell * pitch) / side_m;
        let is_marker = cell.cmpge(DVec2::ZERO).all()
            && cell.x < columns as f64
            && cell.y < rows as f64
            && within.cmplt(DVec2::ONE).all();
        if !is_marker {
            return PAPER;
        }
        inside(cell.y as usize * columns + cell.x as usize, within)
    }
}
