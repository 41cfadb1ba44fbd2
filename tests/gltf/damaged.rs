//! Files damaged at random: an error of one line or a clean scene, and never a panic or a hang.

use serde_json::{Value, json};

use super::bad_inputs::{check_outcome, load_guarded};
use crate::support::{Random, shared_data};

fn json_end(glb: &[u8]) -> usize {
    20 + u32::from_le_bytes([glb[12], glb[13], glb[14], glb[15]]) as usize
}

/// Up to four bytes, digits of the JSON half of the time: there the counts, offsets and indices stand.
fn with_other_bytes(glb: &[u8], noise: &mut Random) -> Vec<u8> {
    let mut bytes = glb.to_vec();
    let anywhere = noise.below(2) == 0;
    for _ in 0..=noise.below(4) {
        let at = if anywhere {
            noise.below(bytes.len())
        } else {
            20 + noise.below(json_end(glb) - 20)
        };
        if bytes[at].is_ascii_digit() {
            bytes[at] = b'0' + noise.below(10) as u8;
        } else if anywhere {
            bytes[at] = noise.bits() as u8;
        }
    }
    if noise.below(50) == 0 {
        bytes.truncate(noise.below(bytes.len()));
    }
    bytes
}

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(fields) => fields.values().map(count).sum(),
        _ => 0,
    }
}

/// The `index`-th value of a walk through `value`, parents first.
fn at<'v>(value: &'v mut Value, index: &mut usize) -> Option<&'v mut Value> {
    if *index == 0 {
        return Some(value);
    }
    *index -= 1;
    match value {
        Value::Array(items) => items.iter_mut().find_map(|item| at(item, index)),
        Value::Object(fields) => fields.values_mut().find_map(|field| at(field, index)),
        _ => None,
    }
}

/// One value of the JSON replaced, scaled, or robbed of a part: still well-formed, so that the damage reaches what interprets it.
fn with_another_value(glb: &[u8], noise: &mut Random) -> Vec<u8> {
    let odd = json!([
        null,
        -1,
        0,
        1,
        3,
        255,
        5121,
        5125,
        5126,
        4294967295_u64,
        9007199254740993_u64,
        0.5,
        1e-38,
        1e20,
        -1e300,
        "",
        "x",
        "VEC2",
        "SCALAR",
        "BLEND",
        "data:,a",
        "/dev/zero",
        true,
        [],
        [1, 2, 3],
        [0, 0, 0, 0],
        {}
    ]);
    let end = json_end(glb);
    let mut json: Value = serde_json::from_slice(&glb[20..end]).expect("a sample model");
    let mut index = 1 + noise.below(count(&json) - 1);
    let choice = noise.below(6);
    if let Some(value) = at(&mut json, &mut index) {
        match value {
            Value::Array(items) if choice == 0 && !items.is_empty() => {
                items.remove(noise.below(items.len()));
            }
            Value::Array(items) if choice == 1 && !items.is_empty() => {
                items.push(items[noise.below(items.len())].clone());
            }
            Value::Object(fields) if choice < 2 && !fields.is_empty() => {
                let name = fields.keys().nth(noise.below(fields.len())).cloned();
                fields.remove(&name.unwrap_or_default());
            }
            Value::Number(number) if choice < 3 => {
                let factor = [-1.0, 0.5, 2.0, 1e6, 1e18][noise.below(5)];
                *value = json!(number.as_f64().unwrap_or(1.0) * factor);
            }
            _ => *value = odd[noise.below(27)].clone(),
        }
    }
    let mut text = serde_json::to_vec(&json).expect("JSON");
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 20 + text.len() + glb.len() - end;
    let word = |n: usize| (n as u32).to_le_bytes();
    [
        &glb[..8],
        &word(total),
        &word(text.len()),
        b"JSON",
        &text,
        &glb[end..],
    ]
    .concat()
}

#[test]
fn damaged_files_never_panic() {
    let Some(root) = shared_data("gltf_models") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.glb");
    for (kind, damage) in [
        (
            "bytes",
            with_other_bytes as fn(&[u8], &mut Random) -> Vec<u8>,
        ),
        ("values", with_another_value),
    ] {
        let mut noise = Random(1);
        let (mut loaded, mut refused) = (0, 0);
        for name in ["BoxInterleaved.glb", "BoxTextured.glb", "box_sparse.glb"] {
            let whole = std::fs::read(root.join(name)).unwrap();
            for round in 0..700 {
                std::fs::write(&path, damage(&whole, &mut noise)).unwrap();
                let outcome = load_guarded(&path);
                check_outcome(&path, &outcome)
                    .unwrap_or_else(|reason| panic!("{name}, {kind}, round {round}: {reason}"));
                match outcome {
                    Ok(_) => loaded += 1,
                    Err(_) => refused += 1,
                }
            }
        }
        assert!(
            loaded > 100 && refused > 100,
            "{kind}: {loaded} loaded, {refused} refused"
        );
    }
}
