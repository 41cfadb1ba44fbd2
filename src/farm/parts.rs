//! How numbers are shared among tasks.

use super::Part;

/// Runs of at most `size` of these numbers, which go up; no part has a gap.
pub fn in_chunks(numbers: impl IntoIterator<Item = u32>, size: u32) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    for number in numbers {
        match parts.last_mut() {
            Some((first, last)) if *last + 1 == number && *last - *first + 1 < size => {
                *last = number;
            }
            _ => parts.push((number, number)),
        }
    }
    parts
}

/// 0 to `total` - 1 in `count` parts that differ by one at most; fewer parts where there are not as many numbers.
pub fn even(total: u32, count: u32) -> Vec<Part> {
    let count = count.min(total);
    let end = |part: u32| (u64::from(total) * u64::from(part) / u64::from(count)) as u32;
    (0..count).map(|i| (end(i), end(i + 1) - 1)).collect()
}
