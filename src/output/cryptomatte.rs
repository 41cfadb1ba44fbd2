//! Cryptomatte 1.2.0 (Friedman and Jones 2015; Psyop's specification): objects by the hashes of their names, with how much of a pixel each covers.

use std::collections::HashMap;

use exr::prelude::Text;
use exr::prelude::attribute::AttributeValue;

use super::channels::{Channels, push_channel};
use super::exr_text::text_value;
use crate::renderer::Mattes;

/// Of the kind of things that have ids.
const NAME: &str = "CryptoObject";
/// Ids and coverages in turns: two of the ranks in each layer.
const CHANNELS: [&str; 4] = ["red", "green", "blue", "alpha"];

/// One layer for every two ranks: ids in red and blue, how much of the pixel they cover in green and alpha.
pub(super) fn push_mattes(channels: &mut Channels, mattes: &Mattes) {
    let ids: Vec<f32> = mattes.names.iter().map(|name| id(name)).collect();
    for (layer, pair) in mattes.ranks.chunks(2).enumerate() {
        let no_rank = vec![(0, 0.0); pair[0].len()];
        let second = pair.get(1).unwrap_or(&no_rank);
        let (mut planes, ranks) = (CHANNELS.iter(), [&pair[0], second]);
        for rank in ranks {
            let ids = rank.iter().map(|(object, coverage)| match *coverage > 0.0 {
                true => ids[*object as usize],
                false => 0.0,
            });
            let coverages = rank.iter().map(|(_, coverage)| *coverage);
            for values in [ids.collect(), coverages.collect::<Vec<f32>>()] {
                let Some(plane) = planes.next() else { break };
                push_channel(channels, &format!("{NAME}{layer:02}.{plane}"), values);
            }
        }
    }
}

/// What the header says of them: how ids are made, and the manifest, names with their hashes as JSON.
pub(super) fn attributes(mattes: &Mattes) -> HashMap<Text, AttributeValue> {
    let hashes = mattes.names.iter().map(|name| {
        let hash = id(name).to_bits();
        (name.clone(), serde_json::json!(format!("{hash:08x}")))
    });
    let manifest = serde_json::Value::Object(hashes.collect()).to_string();
    let key = format!("{:08x}", murmur3(NAME.as_bytes()));
    let said = [
        ("name", NAME),
        ("hash", "MurmurHash3_32"),
        ("conversion", "uint32_to_float32"),
        ("manifest", &manifest),
    ];
    said.into_iter()
        .map(|(name, value)| {
            let name = format!("cryptomatte/{}/{name}", &key[..7]);
            (Text::from(name.as_str()), text_value(value))
        })
        .collect()
}

/// The hash of a name as a float that is neither subnormal, infinite nor NaN: those exponents lose their lowest bit.
fn id(name: &str) -> f32 {
    let hash = murmur3(name.as_bytes());
    let is_odd = matches!(hash >> 23 & 0xff, 0 | 0xff);
    f32::from_bits(hash ^ u32::from(is_odd) << 23)
}

/// MurmurHash3, x86, 32 bits, seed 0 (Appleby 2011, public domain).
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |block: u32| {
        let mixed = block.wrapping_mul(0xcc9e_2d51).rotate_left(15);
        mixed.wrapping_mul(0x1b87_3593)
    };
    let mut blocks = bytes.chunks_exact(4);
    let mut hash = 0u32;
    for block in &mut blocks {
        hash ^= scramble(u32::from_le_bytes([block[0], block[1], block[2], block[3]]));
        hash = hash
            .rotate_left(13)
            .wrapping_mul(5)
            .wrapping_add(0xe654_6b64);
    }
    let tail = blocks.remainder().iter().rev();
    hash ^= scramble(tail.fold(0, |block, byte| block << 8 | u32::from(*byte)));
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the reference implementation (SMHasher).
    #[test]
    fn the_hash_is_the_published_one() {
        assert_eq!(murmur3(b""), 0);
        assert_eq!(murmur3(b"test"), 0xba6b_d213);
        assert_eq!(murmur3(b"Hello, world!"), 0xc036_3e43);
        let fox = b"The quick brown fox jumps over the lazy dog";
        assert_eq!(murmur3(fox), 0x2e4f_f723);
        assert_ne!(murmur3(&fox[1..]), 0x2e4f_f723, "control");
    }

    #[test]
    fn every_id_is_a_normal_number() {
        for number in 0..4000 {
            assert!(id(&format!("object {number}")).is_normal());
        }
        // A name of the specification's own example.
        assert_eq!(id("hello").to_bits(), murmur3(b"hello"));
    }

    #[test]
    fn ids_and_coverages_take_turns() {
        let mattes = Mattes {
            names: vec!["a".to_owned(), "b".to_owned(), "c".to_owned()],
            ranks: vec![
                vec![(1, 0.75), (0, 1.0)],
                vec![(0, 0.25), (0, 0.0)],
                vec![(2, 0.125), (0, 0.0)],
            ],
        };
        let mut channels = Channels::new();
        push_mattes(&mut channels, &mattes);
        let plane = |name: &str| {
            let channel = channels.iter().find(|channel| channel.name.eq(name));
            let values = channel.expect("there").sample_data.values_as_f32();
            values.collect::<Vec<f32>>()
        };
        assert_eq!(plane("CryptoObject00.red"), [id("b"), id("a")]);
        assert_eq!(plane("CryptoObject00.green"), [0.75, 1.0]);
        assert_eq!(plane("CryptoObject00.blue"), [id("a"), 0.0]);
        assert_eq!(plane("CryptoObject01.red"), [id("c"), 0.0]);
        assert_eq!(plane("CryptoObject01.alpha"), [0.0, 0.0]);
        assert_eq!(channels.len(), 8);
    }
}
