//! Sample values: pure functions of pixel, sample index, total, seed and set. No state, no tables per pixel.
//!
//! A set is four numbers; set 0 is (pixel x, pixel y, lens u, lens v), every other set holds a pair that is spread over
//! its square and two single decisions. The three samplers differ in how the `total` samples of one pixel share the unit square of each pair:
//!
//! - `jittered`: one sample a cell of a grid; pixel and lens grids are permuted apart (Kan and Kaufmann 2012).
//! - `cmj`: the same, and each row and column of the grid is stratified too (Kensler, "Correlated Multi-Jittered Sampling", 2013).
//! - `sobol`: the first four Sobol dimensions with a hash-based Owen scramble (Laine and Karras 2011; Burley, "Practical Hash-based
//!   Owen Scrambling", 2020). Set 0 is four-dimensional; other sets draw their points in an order of their own. Does not depend on `total`.
//!
//! Everything up to the last conversion is integer arithmetic: the WGSL twin `shaders/camera/sampler.wgsl` agrees bit for bit.

use crate::math::{hash_combine, hash_u32, uniform_from_bits};
use crate::packed::{SAMPLER_CMJ, SAMPLER_JITTERED};
use crate::shared::shared;

shared! {
    /// Most rays per pixel that a stratified grid is laid out for.
    pub const MAX_TOTAL: u32 = 1 << 30;

    /// Sets the scrambles of a set's four numbers apart.
    const SOBOL_SEEDS: [u32; 4] = [0xbb67_ae85, 0x5be0_cd19, 0xcbbb_9d5d, 0x629a_292a];

    /// Direction numbers of dimension 2, bits reversed (Joe and Kuo 2008: polynomial x^2 + x + 1, m = 1 3).
    const SOBOL_2: [u32; 32] = [
        0x00000001, 0x00000003, 0x00000006, 0x00000009, 0x00000017, 0x0000003a, 0x00000071, 0x000000a3,
        0x00000116, 0x00000339, 0x00000677, 0x000009aa, 0x00001601, 0x00003903, 0x00007706, 0x0000aa09,
        0x00010117, 0x0003033a, 0x00060671, 0x000909a3, 0x00171616, 0x003a3939, 0x00717777, 0x00a3aaaa,
        0x01170001, 0x033a0003, 0x06710006, 0x09a30009, 0x16160017, 0x3939003a, 0x77770071, 0xaaaa00a3,
    ];

    /// Direction numbers of dimension 3, bits reversed (polynomial x^3 + x + 1, m = 1 3 1).
    const SOBOL_3: [u32; 32] = [
        0x00000001, 0x00000003, 0x00000004, 0x0000000a, 0x0000001f, 0x0000002e, 0x00000045, 0x000000c9,
        0x0000011b, 0x000002a4, 0x0000079a, 0x00000b67, 0x0000101e, 0x0000302d, 0x00004041, 0x0000a0c3,
        0x0001f104, 0x0002e28a, 0x000457df, 0x000c9bae, 0x0011a105, 0x002a7289, 0x0079e7db, 0x00b6dba4,
        0x0100011a, 0x030002a7, 0x0400079e, 0x0a000b6d, 0x1f001001, 0x2e003003, 0x45004004, 0xc900a00a,
    ];

    /// What a sample's values depend on, besides the set.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub value struct SampleKey {
        /// Row-major pixel index, or what stands for several pixels that draw from one sequence.
        pub pixel: u32,
        /// Sample of the pixel, 0..total, or its place in the sequence.
        pub index: u32,
        /// Rays per pixel that `jittered` and `cmj` are laid out for, 1..=[`MAX_TOTAL`].
        pub total: u32,
        pub seed: u32,
        /// `SAMPLER_*`; anything else is `sobol`.
        pub sampler: u32,
    }

    /// Cells that share the unit square among a pixel's samples.
    value struct Grid {
        columns: u32,
        rows: u32,
        /// Each row and column of cells is stratified too.
        correlated: bool,
    }
}

/// The four numbers of one set, each in [0, 1) and uniformly distributed over seeds, computed when they are asked for.
#[derive(Clone, Copy, Debug)]
pub struct SampleSet {
    key: SampleKey,
    stream: u32,
    /// `sobol`: the point's place in the sequence.
    point: u32,
    /// Set 0, whose numbers are the dimensions of the sequence in an order of their own.
    is_first: bool,
}

/// Dimensions of the sequence that set 0's numbers are.
const FIRST_SET_ORDER: [usize; 4] = [1, 3, 0, 2];

/// The numbers of set `set_id` of a sample.
#[inline]
pub fn sample_set(key: SampleKey, set_id: u32) -> SampleSet {
    let stream = hash_combine(hash_combine(key.seed, key.pixel), set_id);
    // Set 0 needs both its pairs: dimensions 2 and 3 make the poorest plane of the four (10 to 25% more error at 8 to 25 samples of a
    // blurred edge), so no pair holds both. The other sets have one pair that matters, and dimensions 0 and 1 make the best plane. An
    // order of its own keeps the sets of one sample independent of each other.
    let is_first = set_id == 0;
    let point = if is_first {
        key.index
    } else {
        let seed = hash_u32(stream ^ 0x3c6e_f372);
        owen_scramble(key.index.reverse_bits(), seed).reverse_bits()
    };
    SampleSet {
        key,
        stream,
        point,
        is_first,
    }
}

impl SampleSet {
    /// The first two: a point spread over the unit square.
    #[inline]
    pub fn pair(&self) -> [f32; 2] {
        let bits = if self.is_grid() {
            self.grid_pair(0)
        } else {
            [self.sobol(0), self.sobol(1)]
        };
        bits.map(uniform_from_bits)
    }

    /// The last two.
    #[inline]
    pub fn second_pair(&self) -> [f32; 2] {
        let bits = if self.is_grid() {
            self.grid_pair(1)
        } else {
            [self.sobol(2), self.sobol(3)]
        };
        bits.map(uniform_from_bits)
    }

    /// The third.
    #[inline]
    pub fn third(&self) -> f32 {
        uniform_from_bits(if self.is_grid() {
            self.grid_pair(1)[0]
        } else {
            self.sobol(2)
        })
    }

    /// The fourth.
    #[inline]
    pub fn fourth(&self) -> f32 {
        uniform_from_bits(if self.is_grid() {
            self.grid_pair(1)[1]
        } else {
            self.sobol(3)
        })
    }

    fn is_grid(&self) -> bool {
        matches!(self.key.sampler, SAMPLER_JITTERED | SAMPLER_CMJ)
    }

    /// One of the two pairs on a grid of at least `total` cells. Where the grid has more cells than samples, a permutation chooses which
    /// stay empty, so that each sample alone is uniform over the whole square.
    fn grid_pair(&self, pair: usize) -> [u32; 2] {
        let samples = self.key.total.clamp(1, MAX_TOTAL);
        let columns = strata_columns(samples);
        let grid = Grid {
            columns,
            rows: samples.div_ceil(columns),
            correlated: self.key.sampler == SAMPLER_CMJ,
        };
        let jitter = hash_combine(self.stream, self.key.index);
        if pair == 0 {
            grid.grid_point(self.stream ^ 0x2c1b_3c6d, self.key.index, jitter)
        } else {
            let jitter = hash_u32(jitter ^ 0x6b43_a9b5);
            grid.grid_point(self.stream ^ 0x297a_2d39, self.key.index, jitter)
        }
    }

    /// Inlined for each constant `number`: two of the dimensions are a few operations.
    #[inline(always)]
    fn sobol(&self, number: usize) -> u32 {
        let seed = hash_u32(self.stream ^ SOBOL_SEEDS[number]);
        let reversed = if self.is_first {
            sobol_reversed(self.point, FIRST_SET_ORDER[number])
        } else {
            sobol_reversed(self.point, number)
        };
        owen_scramble(reversed, seed).reverse_bits()
    }
}

/// All four numbers of a set.
pub fn sample_4d(key: SampleKey, set_id: u32) -> [f32; 4] {
    let set = sample_set(key, set_id);
    let ([x, y], [z, w]) = (set.pair(), set.second_pair());
    [x, y, z, w]
}

/// Columns of a grid of at least `total` cells, as square as possible: the smallest n with n * n >= total.
pub fn strata_columns(total: u32) -> u32 {
    let guess = (total as f32).sqrt() as u32;
    // The square root of a rounded number may be off by one either way.
    let mut n = guess.max(1);
    if n * n < total {
        n += 1;
    } else if (n - 1) * (n - 1) >= total {
        n -= 1;
    }
    n
}

impl Grid {
    fn grid_point(&self, stream: u32, index: u32, jitter: u32) -> [u32; 2] {
        let &Grid { columns, rows, .. } = self;
        let cells = columns * rows;
        let cell = permute(index % cells, cells, hash_u32(stream ^ 0x8f74_39b1));
        let column = cell % columns;
        let row = cell / columns;
        let mut x = hash_u32(jitter ^ 0x1b56_c4e9);
        let mut y = hash_u32(jitter ^ 0xd2b7_4407);
        if self.correlated {
            x = in_stratum(permute(row, rows, hash_u32(stream ^ 0x51ed_270b)), rows, x);
            y = in_stratum(
                permute(column, columns, hash_u32(stream ^ 0x7d91_f2c3)),
                columns,
                y,
            );
        }
        [in_stratum(column, columns, x), in_stratum(row, rows, y)]
    }
}

/// (stratum + fraction / 2^32) / count in units of 2^-32, rounded down, by long division: float division may round differently on a
/// GPU. stratum < count < 2^16.
fn in_stratum(stratum: u32, count: u32, fraction: u32) -> u32 {
    let high = (stratum << 16) | (fraction >> 16);
    let low = ((high % count) << 16) | (fraction & 0xffff);
    ((high / count) << 16) | (low / count)
}

/// Element `index` of a pseudo-random permutation of 0..count, chosen by `seed`: a bijection of the next power of two, walked until it
/// falls below `count`, then rotated so that each place is exactly equally likely.
fn permute(index: u32, count: u32, seed: u32) -> u32 {
    if count < 2 {
        return 0;
    }
    let bits = 32 - (count - 1).leading_zeros();
    let mask = u32::MAX >> (32 - bits);
    let shift = bits.div_ceil(2);
    let key_a = hash_u32(seed ^ 0xa511_e9b3);
    let key_b = hash_u32(key_a ^ 0x63d8_3595);
    let key_c = hash_u32(key_b ^ 0x9e6c_63d1);
    let rotation = hash_u32(key_c ^ 0x1f83_d9ab);
    let mut i = index;
    loop {
        i = mix_masked(i, key_a, mask, shift);
        i = mix_masked(i, key_a >> 16, mask, shift);
        i = mix_masked(i, key_b, mask, shift);
        i = mix_masked(i, key_b >> 16, mask, shift);
        i = mix_masked(i, key_c, mask, shift);
        i = mix_masked(i, key_c >> 16, mask, shift);
        if i < count {
            break;
        }
    }
    (i + rotation % count) % count
}

/// A bijection of the numbers under a mask: affine with an odd factor, then an xor with the upper half.
fn mix_masked(i: u32, key: u32, mask: u32, shift: u32) -> u32 {
    let affine = (i.wrapping_mul(key | 1).wrapping_add(key >> 5)) & mask;
    affine ^ (affine >> shift)
}

/// Nested uniform scramble of a number whose most significant digit is bit 0: a bit is flipped by a hash of the seed and of the bits
/// below it alone. Only xor with an even multiple, odd factors and sums carry upwards, so every step keeps that property
/// (construction of Laine and Karras; constants by Vegdahl 2021).
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut v = x;
    v ^= v.wrapping_mul(0x3d20_adea);
    v = v.wrapping_add(seed);
    v = v.wrapping_mul((seed >> 16) | 1);
    v ^= v.wrapping_mul(0x0552_6c56);
    v ^ v.wrapping_mul(0x53a2_2864)
}

/// One of the first four Sobol dimensions of a point, its most significant bit in bit 0.
#[inline(always)]
fn sobol_reversed(point: u32, dimension: usize) -> u32 {
    match dimension {
        0 => point,
        // Pascal's triangle mod 2, a Kronecker power: five steps instead of 32 columns.
        1 => {
            let mut pascal = point;
            pascal ^= (pascal & 0xaaaa_aaaa) >> 1;
            pascal ^= (pascal & 0xcccc_cccc) >> 2;
            pascal ^= (pascal & 0xf0f0_f0f0) >> 4;
            pascal ^= (pascal & 0xff00_ff00) >> 8;
            pascal ^ (pascal >> 16)
        }
        _ => {
            let sums = &SOBOL_23_DIGITS[dimension - 2];
            (0..8).fold(0, |sum, digit| {
                sum ^ sums[digit][(point >> (4 * digit)) as usize & 15]
            })
        }
    }
}

/// Sums of the direction numbers of dimensions 2 and 3 over the bits of each hexadecimal digit: eight steps instead of 32.
static SOBOL_23_DIGITS: [[[u32; 16]; 8]; 2] = {
    let mut sums = [[[0; 16]; 8]; 2];
    let mut i = 0;
    while i < 8 * 16 * 4 {
        let (digit, value, bit) = (i / 64, i / 4 % 16, i % 4);
        if (value >> bit) & 1 == 1 {
            sums[0][digit][value] ^= SOBOL_2[4 * digit + bit];
            sums[1][digit][value] ^= SOBOL_3[4 * digit + bit];
        }
        i += 1;
    }
    sums
};

#[cfg(test)]
mod tests;
