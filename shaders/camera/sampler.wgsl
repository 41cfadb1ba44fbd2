// Twin of src/camera/sampler.rs: integer arithmetic up to the last conversion, equal bit for bit.

import package::packed::records::{SAMPLER_CMJ, SAMPLER_JITTERED};
import package::math::{hash_combine, hash_u32, uniform_from_bits};


struct SampleKey {
    pixel: u32,
    index: u32,
    total: u32,
    seed: u32,
    sampler: u32,
}

fn sample_4d(key: SampleKey, set_id: u32) -> vec4<f32> {
    let stream = hash_combine(hash_combine(key.seed, key.pixel), set_id);
    var bits: vec4<u32>;
    if key.sampler == SAMPLER_JITTERED {
        bits = stratified_4d(stream, key.index, key.total, false);
    } else if key.sampler == SAMPLER_CMJ {
        bits = stratified_4d(stream, key.index, key.total, true);
    } else {
        bits = sobol_4d(stream, key.index, set_id);
    }
    return vec4<f32>(
        uniform_from_bits(bits.x),
        uniform_from_bits(bits.y),
        uniform_from_bits(bits.z),
        uniform_from_bits(bits.w),
    );
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

fn stratified_4d(stream: u32, index: u32, total: u32, correlated: bool) -> vec4<u32> {
    let samples = clamp(total, 1u, MAX_TOTAL);
    let columns = strata_columns(samples);
    let rows = (samples + columns - 1u) / columns;
    let jitter = hash_combine(stream, index);
    let a = stratified_pair(stream ^ 0x2c1b3c6du, index, columns, rows, jitter, correlated);
    let b = stratified_pair(
        stream ^ 0x297a2d39u,
        index,
        columns,
        rows,
        hash_u32(jitter ^ 0x6b43a9b5u),
        correlated,
    );
    return vec4<u32>(a.x, a.y, b.x, b.y);
}

fn stratified_pair(
    stream: u32,
    index: u32,
    columns: u32,
    rows: u32,
    jitter: u32,
    correlated: bool,
) -> vec2<u32> {
    let cells = columns * rows;
    let cell = permute(index % cells, cells, hash_u32(stream ^ 0x8f7439b1u));
    let column = cell % columns;
    let row = cell / columns;
    var x = hash_u32(jitter ^ 0x1b56c4e9u);
    var y = hash_u32(jitter ^ 0xd2b74407u);
    if correlated {
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

fn sobol_4d(stream: u32, index: u32, set_id: u32) -> vec4<u32> {
    var point = index;
    if set_id != 0u {
        point = reverseBits(owen_scramble(reverseBits(index), hash_u32(stream ^ 0x3c6ef372u)));
    }
    var sobol = sobol_reversed(point);
    if set_id == 0u { sobol = sobol.ywxz; }
    return vec4<u32>(
        reverseBits(owen_scramble(sobol.x, hash_u32(stream ^ 0xbb67ae85u))),
        reverseBits(owen_scramble(sobol.y, hash_u32(stream ^ 0x5be0cd19u))),
        reverseBits(owen_scramble(sobol.z, hash_u32(stream ^ 0xcbbb9d5du))),
        reverseBits(owen_scramble(sobol.w, hash_u32(stream ^ 0x629a292au))),
    );
}

fn owen_scramble(x: u32, seed: u32) -> u32 {
    var v = x;
    v ^= v * 0x3d20adeau;
    v = v + seed;
    v = v * ((seed >> 16u) | 1u);
    v ^= v * 0x05526c56u;
    return v ^ (v * 0x53a22864u);
}

// Unrolled: a loop of 32 steps counts against the iteration cap of software devices.
fn sobol_reversed(point: u32) -> vec4<u32> {
    var pascal = point;
    pascal ^= (pascal & 0xaaaaaaaau) >> 1u;
    pascal ^= (pascal & 0xccccccccu) >> 2u;
    pascal ^= (pascal & 0xf0f0f0f0u) >> 4u;
    pascal ^= (pascal & 0xff00ff00u) >> 8u;
    pascal ^= pascal >> 16u;
    var third = 0u;
    var fourth = 0u;
    var m: u32;
    m = 0u - ((point >> 0u) & 1u);
    third ^= 0x00000001u & m;
    fourth ^= 0x00000001u & m;
    m = 0u - ((point >> 1u) & 1u);
    third ^= 0x00000003u & m;
    fourth ^= 0x00000003u & m;
    m = 0u - ((point >> 2u) & 1u);
    third ^= 0x00000006u & m;
    fourth ^= 0x00000004u & m;
    m = 0u - ((point >> 3u) & 1u);
    third ^= 0x00000009u & m;
    fourth ^= 0x0000000au & m;
    m = 0u - ((point >> 4u) & 1u);
    third ^= 0x00000017u & m;
    fourth ^= 0x0000001fu & m;
    m = 0u - ((point >> 5u) & 1u);
    third ^= 0x0000003au & m;
    fourth ^= 0x0000002eu & m;
    m = 0u - ((point >> 6u) & 1u);
    third ^= 0x00000071u & m;
    fourth ^= 0x00000045u & m;
    m = 0u - ((point >> 7u) & 1u);
    third ^= 0x000000a3u & m;
    fourth ^= 0x000000c9u & m;
    m = 0u - ((point >> 8u) & 1u);
    third ^= 0x00000116u & m;
    fourth ^= 0x0000011bu & m;
    m = 0u - ((point >> 9u) & 1u);
    third ^= 0x00000339u & m;
    fourth ^= 0x000002a4u & m;
    m = 0u - ((point >> 10u) & 1u);
    third ^= 0x00000677u & m;
    fourth ^= 0x0000079au & m;
    m = 0u - ((point >> 11u) & 1u);
    third ^= 0x000009aau & m;
    fourth ^= 0x00000b67u & m;
    m = 0u - ((point >> 12u) & 1u);
    third ^= 0x00001601u & m;
    fourth ^= 0x0000101eu & m;
    m = 0u - ((point >> 13u) & 1u);
    third ^= 0x00003903u & m;
    fourth ^= 0x0000302du & m;
    m = 0u - ((point >> 14u) & 1u);
    third ^= 0x00007706u & m;
    fourth ^= 0x00004041u & m;
    m = 0u - ((point >> 15u) & 1u);
    third ^= 0x0000aa09u & m;
    fourth ^= 0x0000a0c3u & m;
    m = 0u - ((point >> 16u) & 1u);
    third ^= 0x00010117u & m;
    fourth ^= 0x0001f104u & m;
    m = 0u - ((point >> 17u) & 1u);
    third ^= 0x0003033au & m;
    fourth ^= 0x0002e28au & m;
    m = 0u - ((point >> 18u) & 1u);
    third ^= 0x00060671u & m;
    fourth ^= 0x000457dfu & m;
    m = 0u - ((point >> 19u) & 1u);
    third ^= 0x000909a3u & m;
    fourth ^= 0x000c9baeu & m;
    m = 0u - ((point >> 20u) & 1u);
    third ^= 0x00171616u & m;
    fourth ^= 0x0011a105u & m;
    m = 0u - ((point >> 21u) & 1u);
    third ^= 0x003a3939u & m;
    fourth ^= 0x002a7289u & m;
    m = 0u - ((point >> 22u) & 1u);
    third ^= 0x00717777u & m;
    fourth ^= 0x0079e7dbu & m;
    m = 0u - ((point >> 23u) & 1u);
    third ^= 0x00a3aaaau & m;
    fourth ^= 0x00b6dba4u & m;
    m = 0u - ((point >> 24u) & 1u);
    third ^= 0x01170001u & m;
    fourth ^= 0x0100011au & m;
    m = 0u - ((point >> 25u) & 1u);
    third ^= 0x033a0003u & m;
    fourth ^= 0x030002a7u & m;
    m = 0u - ((point >> 26u) & 1u);
    third ^= 0x06710006u & m;
    fourth ^= 0x0400079eu & m;
    m = 0u - ((point >> 27u) & 1u);
    third ^= 0x09a30009u & m;
    fourth ^= 0x0a000b6du & m;
    m = 0u - ((point >> 28u) & 1u);
    third ^= 0x16160017u & m;
    fourth ^= 0x1f001001u & m;
    m = 0u - ((point >> 29u) & 1u);
    third ^= 0x3939003au & m;
    fourth ^= 0x2e003003u & m;
    m = 0u - ((point >> 30u) & 1u);
    third ^= 0x77770071u & m;
    fourth ^= 0x45004004u & m;
    m = 0u - ((point >> 31u) & 1u);
    third ^= 0xaaaa00a3u & m;
    fourth ^= 0xc900a00au & m;
    return vec4<u32>(point, pascal, third, fourth);
}
