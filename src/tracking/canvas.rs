//! Lines and crosses over a frame's codes.

use glam::DVec2;

pub type Colour = [u8; 3];

/// sRGB codes, row-major from the top left.
#[derive(Clone, Debug)]
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    pub codes: Vec<Colour>,
}

impl Canvas {
    fn set(&mut self, at: DVec2, colour: Colour) {
        let inside =
            at.cmpge(DVec2::ZERO).all() && at.x < self.width as f64 && at.y < self.height as f64;
        if inside {
            self.codes[at.y as usize * self.width + at.x as usize] = colour;
        }
    }

    /// One pixel wide. Places are pixels, corner origin.
    pub fn line(&mut self, from: DVec2, to: DVec2, colour: Colour) {
        // What is this far outside of the picture is drawn by no line that matters.
        let steps = (from.distance(to).min(1e4) * 1.5).ceil().max(1.0);
        for step in 0..=steps as usize {
            self.set(from.lerp(to, step as f64 / steps), colour);
        }
    }

    pub fn cross(&mut self, at: DVec2, arm: f64, colour: Colour) {
        self.line(at - DVec2::X * arm, at + DVec2::X * arm, colour);
        self.line(at - DVec2::Y * arm, at + DVec2::Y * arm, colour);
    }

    pub fn frame(&mut self, thickness: usize, colour: Colour) {
        let (width, height) = (self.width, self.height);
        for (index, code) in self.codes.iter_mut().enumerate() {
            let (x, y) = (index % width, index / width);
            if x.min(width - 1 - x).min(y).min(height - 1 - y) < thickness {
                *code = colour;
            }
        }
    }

    /// Means of blocks of `by` x `by` pixels.
    pub fn reduced(&self, by: usize) -> Self {
        let (width, height) = (self.width / by, self.height / by);
        let mean = |x: usize, y: usize, channel: usize| {
            let rows = (y * by..(y + 1) * by)
                .flat_map(|row| &self.codes[row * self.width + x * by..][..by]);
            let sum: usize = rows.map(|code| usize::from(code[channel])).sum();
            (sum / (by * by)) as u8
        };
        let cells = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Self {
            width,
            height,
            codes: cells
                .map(|(x, y)| [0, 1, 2].map(|channel| mean(x, y, channel)))
                .collect(),
        }
    }

    /// Copies `other` to where its top left corner is at `left`, `top`; it has to fit.
    pub fn paste(&mut self, other: &Self, left: usize, top: usize) {
        for (row, codes) in other.codes.chunks_exact(other.width).enumerate() {
            self.codes[(top + row) * self.width + left..][..other.width].copy_from_slice(codes);
        }
    }
}
