// The difference's samples in groups. Twin of src/film/groups.rs.

import package::film::sums::{is_unusable, sum3_add};

// Adds the difference of the evaluation with this number, which met nothing virtual.
fn group_add(sums: GroupSums, evaluation: u32, difference: vec3<f32>, zero: u32) -> GroupSums {
    var out = sums;
    let group = evaluation % GROUPS;
    if group < GROUPS - 1u && !is_unusable(difference) {
        out.diff[group] = sum3_add(out.diff[group], difference, zero);
    }
    return out;
}
