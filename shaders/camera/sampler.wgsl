// Twin of src/camera/sampler.rs: integer arithmetic up to the last conversion, equal bit for bit.

import package::packed::records::{SAMPLER_CMJ, SAMPLER_JITTERED};
import package::math::{hash_combine, hash_u32, uniform_from_bits};

// The four numbers of one set, computed when they are asked for.
struct SampleSet {
    key: SampleKey,
    stream: u32,
    point: u32,
    order: vec4<u32>,
}

fn sample_set(key: SampleKey, set_id: u32) -> SampleSet {
    let stream = hash_combine(hash_combine(key.seed, key.pixel), set_id);
    if set_id == 0u {
        return SampleSet(key, stream, key.index, vec4<u32>(1u, 3u, 0u, 2u));
    }
    let seed = hash_u32(stream ^ 0x3c6ef372u);
    let shuffled = owen_scramble(reverseBits(key.index), seed);
    return SampleSet(key, stream, reverseBits(shuffled), vec4<u32>(0u, 1u, 2u, 3u));
}

fn pair(numbers: SampleSet) -> vec2<f32> {
    var bits: vec2<u32>;
    if is_grid(numbers) {
        bits = grid_pair(numbers, 0u);
    } else {
        bits = vec2<u32>(sobol(numbers, 0u), sobol(numbers, 1u));
    }
    return vec2<f32>(uniform_from_bits(bits.x), uniform_from_bits(bits.y));
}

fn second_pair(numbers: SampleSet) -> vec2<f32> {
    var bits: vec2<u32>;
    if is_grid(numbers) {
        bits = grid_pair(numbers, 1u);
    } else {
        bits = vec2<u32>(sobol(numbers, 2u), sobol(numbers, 3u));
    }
    return vec2<f32>(uniform_from_bits(bits.x), uniform_from_bits(bits.y));
}

fn third(numbers: SampleSet) -> f32 {
    if is_grid(numbers) {
        return uniform_from_bits(grid_pair(numbers, 1u).x);
    }
    return uniform_from_bits(sobol(numbers, 2u));
}

fn fourth(numbers: SampleSet) -> f32 {
    if is_grid(numbers) {
        return uniform_from_bits(grid_pair(numbers, 1u).y);
    }
    return uniform_from_bits(sobol(numbers, 3u));
}

fn is_grid(numbers: SampleSet) -> bool {
    return numbers.key.sampler == SAMPLER_JITTERED || numbers.key.sampler == SAMPLER_CMJ;
}

fn grid_pair(numbers: SampleSet, pair: u32) -> vec2<u32> {
    let samples = clamp(numbers.key.total, 1u, MAX_TOTAL);
    let columns = strata_columns(samples);
    let grid = Grid(columns, (samples + columns - 1u) / columns, numbers.key.sampler == SAMPLER_CMJ);
    let jitter = hash_combine(numbers.stream, numbers.key.index);
    if pair == 0u {
        return grid_point(grid, numbers.stream ^ 0x2c1b3c6du, numbers.key.index, jitter);
    }
    return grid_point(grid, numbers.stream ^ 0x297a2d39u, numbers.key.index, hash_u32(jitter ^ 0x6b43a9b5u));
}

fn sobol(numbers: SampleSet, number: u32) -> u32 {
    let seed = hash_u32(numbers.stream ^ SOBOL_SEEDS[number]);
    return reverseBits(owen_scramble(sobol_reversed(numbers.point, numbers.order[number]), seed));
}

fn sample_4d(key: SampleKey, set_id: u32) -> vec4<f32> {
    let numbers = sample_set(key, set_id);
    return vec4<f32>(pair(numbers), second_pair(numbers));
}

fn strata_columns(total: u32) -> u32 {
    let guess = u32(sqrt(f32(total)));
    var n = max(guess, 1u);
    if n * n < total {
        n += 1u;
    } else if (n - 1u) * (n - 1u) >= total {
        n -= 1u;
    }
    return n;
}

fn grid_point(grid: Grid, stream: u32, index: u32, jitter: u32) -> vec2<u32> {
    let columns = grid.columns;
    let rows = grid.rows;
    let cells = columns * rows;
    let cell = permute(index % cells, cells, hash_u32(stream ^ 0x8f7439b1u));
    let column = cell % columns;
    let row = cell / columns;
    var x = hash_u32(jitter ^ 0x1b56c4e9u);
    var y = hash_u32(jitter ^ 0xd2b74407u);
    if grid.correlated {
        x = in_stratum(permute(row, rows, hash_u32(stream ^ 0x51ed270bu)), rows, x);
        y = in_stratum(
            permute(column, columns, hash_u32(stream ^ 0x7d91f2c3u)),
            columns,
            y,
        );
    }
    return vec2<u32>(in_stratum(column, columns, x), in_stratum(row, rows, y));
}

fn in_stratum(stratum: u32, count: u32, fraction: u32) -> u32 {
    let high = (stratum << 16u) | (fraction >> 16u);
    let low = ((high % count) << 16u) | (fraction & 0xffffu);
    return ((high / count) << 16u) | (low / count);
}

fn permute(index: u32, count: u32, seed: u32) -> u32 {
    if count < 2u {
        return 0u;
    }
    let bits = 32u - countLeadingZeros(count - 1u);
    let mask = 0xffffffffu >> (32u - bits);
    let shift = (bits + 1u) / 2u;
    let key_a = hash_u32(seed ^ 0xa511e9b3u);
    let key_b = hash_u32(key_a ^ 0x63d83595u);
    let key_c = hash_u32(key_b ^ 0x9e6c63d1u);
    let rotation = hash_u32(key_c ^ 0x1f83d9abu);
    var i = index;
    loop {
        i = mix_masked(i, key_a, mask, shift);
        i = mix_masked(i, key_a >> 16u, mask, shift);
        i = mix_masked(i, key_b, mask, shift);
        i = mix_masked(i, key_b >> 16u, mask, shift);
        i = mix_masked(i, key_c, mask, shift);
        i = mix_masked(i, key_c >> 16u, mask, shift);
        if i < count {
            break;
        }
    }
    return (i + rotation % count) % count;
}

fn mix_masked(i: u32, key: u32, mask: u32, shift: u32) -> u32 {
    let affine = (i * (key | 1u) + (key >> 5u)) & mask;
    return affine ^ (affine >> shift);
}

fn owen_scramble(x: u32, seed: u32) -> u32 {
    var v = x;
    v ^= v * 0x3d20adeau;
    v = v + seed;
    v = v * ((seed >> 16u) | 1u);
    v ^= v * 0x05526c56u;
    return v ^ (v * 0x53a22864u);
}

fn sobol_reversed(point: u32, dimension: u32) -> u32 {
    if dimension == 0u {
        return point;
    }
    if dimension == 1u {
        var pascal = point;
        pascal ^= (pascal & 0xaaaaaaaau) >> 1u;
        pascal ^= (pascal & 0xccccccccu) >> 2u;
        pascal ^= (pascal & 0xf0f0f0f0u) >> 4u;
        pascal ^= (pascal & 0xff00ff00u) >> 8u;
        return pascal ^ (pascal >> 16u);
    }
    // Unrolled: a loop of 32 steps counts against the iteration cap of software devices, and constants want constant indices.
    let second = dimension == 2u;
    var sum = 0u;
    sum ^= select(SOBOL_3[0], SOBOL_2[0], second) & (0u - ((point >> 0u) & 1u));
    sum ^= select(SOBOL_3[1], SOBOL_2[1], second) & (0u - ((point >> 1u) & 1u));
    sum ^= select(SOBOL_3[2], SOBOL_2[2], second) & (0u - ((point >> 2u) & 1u));
    sum ^= select(SOBOL_3[3], SOBOL_2[3], second) & (0u - ((point >> 3u) & 1u));
    sum ^= select(SOBOL_3[4], SOBOL_2[4], second) & (0u - ((point >> 4u) & 1u));
    sum ^= select(SOBOL_3[5], SOBOL_2[5], second) & (0u - ((point >> 5u) & 1u));
    sum ^= select(SOBOL_3[6], SOBOL_2[6], second) & (0u - ((point >> 6u) & 1u));
    sum ^= select(SOBOL_3[7], SOBOL_2[7], second) & (0u - ((point >> 7u) & 1u));
    sum ^= select(SOBOL_3[8], SOBOL_2[8], second) & (0u - ((point >> 8u) & 1u));
    sum ^= select(SOBOL_3[9], SOBOL_2[9], second) & (0u - ((point >> 9u) & 1u));
    sum ^= select(SOBOL_3[10], SOBOL_2[10], second) & (0u - ((point >> 10u) & 1u));
    sum ^= select(SOBOL_3[11], SOBOL_2[11], second) & (0u - ((point >> 11u) & 1u));
    sum ^= select(SOBOL_3[12], SOBOL_2[12], second) & (0u - ((point >> 12u) & 1u));
    sum ^= select(SOBOL_3[13], SOBOL_2[13], second) & (0u - ((point >> 13u) & 1u));
    sum ^= select(SOBOL_3[14], SOBOL_2[14], second) & (0u - ((point >> 14u) & 1u));
    sum ^= select(SOBOL_3[15], SOBOL_2[15], second) & (0u - ((point >> 15u) & 1u));
    sum ^= select(SOBOL_3[16], SOBOL_2[16], second) & (0u - ((point >> 16u) & 1u));
    sum ^= select(SOBOL_3[17], SOBOL_2[17], second) & (0u - ((point >> 17u) & 1u));
    sum ^= select(SOBOL_3[18], SOBOL_2[18], second) & (0u - ((point >> 18u) & 1u));
    sum ^= select(SOBOL_3[19], SOBOL_2[19], second) & (0u - ((point >> 19u) & 1u));
    sum ^= select(SOBOL_3[20], SOBOL_2[20], second) & (0u - ((point >> 20u) & 1u));
    sum ^= select(SOBOL_3[21], SOBOL_2[21], second) & (0u - ((point >> 21u) & 1u));
    sum ^= select(SOBOL_3[22], SOBOL_2[22], second) & (0u - ((point >> 22u) & 1u));
    sum ^= select(SOBOL_3[23], SOBOL_2[23], second) & (0u - ((point >> 23u) & 1u));
    sum ^= select(SOBOL_3[24], SOBOL_2[24], second) & (0u - ((point >> 24u) & 1u));
    sum ^= select(SOBOL_3[25], SOBOL_2[25], second) & (0u - ((point >> 25u) & 1u));
    sum ^= select(SOBOL_3[26], SOBOL_2[26], second) & (0u - ((point >> 26u) & 1u));
    sum ^= select(SOBOL_3[27], SOBOL_2[27], second) & (0u - ((point >> 27u) & 1u));
    sum ^= select(SOBOL_3[28], SOBOL_2[28], second) & (0u - ((point >> 28u) & 1u));
    sum ^= select(SOBOL_3[29], SOBOL_2[29], second) & (0u - ((point >> 29u) & 1u));
    sum ^= select(SOBOL_3[30], SOBOL_2[30], second) & (0u - ((point >> 30u) & 1u));
    sum ^= select(SOBOL_3[31], SOBOL_2[31], second) & (0u - ((point >> 31u) & 1u));
    return sum;
}
