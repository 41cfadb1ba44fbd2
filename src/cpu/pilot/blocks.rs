//! The picture in square blocks of pixels, the pilot's resolution.

/// Pixels along a block's side.
pub const SIDE_PX: usize = 4;

pub struct Blocks {
    width: usize,
    height: usize,
    columns: usize,
    rows: usize,
}

impl Blocks {
    pub fn of(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            columns: width.div_ceil(SIDE_PX),
            rows: height.div_ceil(SIDE_PX),
        }
    }

    pub fn count(&self) -> usize {
        self.columns * self.rows
    }

    /// Block of a pixel.
    pub fn of_pixel(&self, pixel: usize) -> usize {
        (pixel / self.width / SIDE_PX) * self.columns + pixel % self.width / SIDE_PX
    }

    /// Blocks of all pixels, row by row.
    pub fn of_pixels(&self) -> impl Iterator<Item = usize> + use<> {
        let (width, height, columns) = (self.width, self.height, self.columns);
        let of_row = move |y: usize| (0..width).map(move |x| y / SIDE_PX * columns + x / SIDE_PX);
        (0..height).flat_map(of_row)
    }

    /// Pixels of a block, those outside the picture left out.
    pub fn pixels(&self, block: usize) -> impl Iterator<Item = usize> + use<> {
        let (x0, y0) = self.corner(block);
        let width = self.width;
        let (x1, y1) = (
            (x0 + SIDE_PX).min(self.width),
            (y0 + SIDE_PX).min(self.height),
        );
        (y0..y1).flat_map(move |y| (x0..x1).map(move |x| y * width + x))
    }

    /// The blocks of the square that the pixel lies in; `side_px`: a multiple of a block's side.
    pub fn of_square(&self, pixel: usize, side_px: usize) -> impl Iterator<Item = usize> + use<> {
        let columns = self.columns;
        let side = side_px / SIDE_PX;
        let (x, y) = (
            pixel % self.width / side_px * side,
            pixel / self.width / side_px * side,
        );
        let (right, below) = ((x + side).min(columns), (y + side).min(self.rows));
        (y..below).flat_map(move |row| (x..right).map(move |column| row * columns + column))
    }

    /// The pixels of each square of `side_px` pixels, row by row.
    pub fn squares(&self, side_px: usize) -> Vec<Vec<usize>> {
        let (width, height) = (self.width, self.height);
        let square = |x: usize, y: usize| {
            let columns = x..(x + side_px).min(width);
            let rows = y..(y + side_px).min(height);
            rows.flat_map(|y| columns.clone().map(move |x| y * width + x))
                .collect()
        };
        let corners = (0..height)
            .step_by(side_px)
            .flat_map(|y| (0..width).step_by(side_px).map(move |x| (x, y)));
        corners.map(|(x, y)| square(x, y)).collect()
    }

    fn corner(&self, block: usize) -> (usize, usize) {
        (
            block % self.columns * SIDE_PX,
            block / self.columns * SIDE_PX,
        )
    }

    /// Folds the values of the blocks at most `radius` blocks away in either direction.
    pub fn gather<T: Copy, A>(
        &self,
        values: &[T],
        block: usize,
        radius: usize,
        start: A,
        fold: impl Fn(A, T) -> A,
    ) -> A {
        let (column, row) = (block % self.columns, block / self.columns);
        let mut sum = start;
        for r in row.saturating_sub(radius)..(row + radius + 1).min(self.rows) {
            for c in column.saturating_sub(radius)..(column + radius + 1).min(self.columns) {
                sum = fold(sum, values[r * self.columns + c]);
            }
        }
        sum
    }
}
