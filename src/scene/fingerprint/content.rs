//! A hash of values by their bytes: the same between runs and machines, whatever their addresses, names or order in memory.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3, DVec4};

/// Collects what is added, in its order, into a BLAKE3 hash.
#[derive(Default)]
pub struct ContentHash {
    bytes: blake3::Hasher,
    /// Hashes of what several owners share, by address: each is read once. Only valid while the owners are borrowed.
    shared: HashMap<usize, blake3::Hash>,
}

impl ContentHash {
    /// The fingerprint of one value.
    pub fn of(content: &impl Content) -> String {
        let mut hash = Self::default();
        content.add_to(&mut hash);
        hash.finish()
    }

    /// 32 hexadecimal digits: 128 of the hash's 256 bits.
    pub fn finish(self) -> String {
        self.bytes.finalize().to_hex()[..32].to_owned()
    }

    fn add_bytes(&mut self, bytes: &[u8]) {
        self.bytes.update(bytes);
    }
}

/// What can be hashed by content. Lengths and choices go in too, so that no two different values give the same bytes.
pub trait Content {
    fn add_to(&self, hash: &mut ContentHash);

    /// The values one after the other, without their number.
    fn add_all(values: &[Self], hash: &mut ContentHash)
    where
        Self: Sized,
    {
        for value in values {
            value.add_to(hash);
        }
    }
}

/// Numbers as their little-endian bytes; slices of them at once.
macro_rules! numbers {
    ($($number:ty)*) => {$(
        impl Content for $number {
            fn add_to(&self, hash: &mut ContentHash) {
                hash.add_bytes(&self.to_le_bytes());
            }

            fn add_all(values: &[Self], hash: &mut ContentHash) {
                if cfg!(target_endian = "little") {
                    hash.add_bytes(bytemuck::cast_slice(values));
                } else {
                    values.iter().for_each(|value| value.add_to(hash));
                }
            }
        }
    )*};
}

numbers! { u8 u32 u64 f32 f64 }

impl Content for usize {
    fn add_to(&self, hash: &mut ContentHash) {
        (*self as u64).add_to(hash);
    }
}

impl Content for bool {
    fn add_to(&self, hash: &mut ContentHash) {
        u8::from(*self).add_to(hash);
    }
}

impl Content for str {
    fn add_to(&self, hash: &mut ContentHash) {
        self.len().add_to(hash);
        hash.add_bytes(self.as_bytes());
    }
}

impl Content for String {
    fn add_to(&self, hash: &mut ContentHash) {
        self.as_str().add_to(hash);
    }
}

impl<T: Content + ?Sized> Content for &T {
    fn add_to(&self, hash: &mut ContentHash) {
        (**self).add_to(hash);
    }
}

impl<T: Content, const N: usize> Content for [T; N] {
    fn add_to(&self, hash: &mut ContentHash) {
        T::add_all(self, hash);
    }

    fn add_all(values: &[Self], hash: &mut ContentHash) {
        T::add_all(values.as_flattened(), hash);
    }
}

impl<T: Content> Content for Vec<T> {
    fn add_to(&self, hash: &mut ContentHash) {
        self.len().add_to(hash);
        T::add_all(self, hash);
    }
}

impl<T: Content> Content for Option<T> {
    fn add_to(&self, hash: &mut ContentHash) {
        self.is_some().add_to(hash);
        if let Some(value) = self {
            value.add_to(hash);
        }
    }
}

impl<A: Content, B: Content> Content for (A, B) {
    fn add_to(&self, hash: &mut ContentHash) {
        self.0.add_to(hash);
        self.1.add_to(hash);
    }
}

/// As its own hash, taken once however many share it.
impl<T: Content> Content for Arc<T> {
    fn add_to(&self, hash: &mut ContentHash) {
        let address = Arc::as_ptr(self).addr();
        let own = match hash.shared.get(&address) {
            Some(own) => *own,
            None => {
                let mut inner = ContentHash {
                    bytes: blake3::Hasher::new(),
                    shared: std::mem::take(&mut hash.shared),
                };
                (**self).add_to(&mut inner);
                let own = inner.bytes.finalize();
                hash.shared = inner.shared;
                hash.shared.insert(address, own);
                own
            }
        };
        hash.add_bytes(own.as_bytes());
    }
}

impl Content for DMat4 {
    fn add_to(&self, hash: &mut ContentHash) {
        self.to_cols_array().add_to(hash);
    }
}

impl Content for DVec3 {
    fn add_to(&self, hash: &mut ContentHash) {
        self.to_array().add_to(hash);
    }
}

impl Content for DVec4 {
    fn add_to(&self, hash: &mut ContentHash) {
        self.to_array().add_to(hash);
    }
}

impl Content for DQuat {
    fn add_to(&self, hash: &mut ContentHash) {
        self.to_array().add_to(hash);
    }
}

/// [`Content`] of structs, field by field; those after the semicolon are left out. A field that is named nowhere does not compile.
macro_rules! content {
    ($($type:ident { $($field:ident),* $(,)? $(; $($left_out:ident),*)? })*) => {$(
        impl $crate::scene::fingerprint::Content for $type {
            fn add_to(&self, hash: &mut $crate::scene::fingerprint::ContentHash) {
                let Self { $($field,)* $($($left_out: _,)*)? } = self;
                $($crate::scene::fingerprint::Content::add_to($field, hash);)*
            }
        }
    )*};
}
pub(crate) use content;

/// [`Content`] of choices: their names.
macro_rules! content_by_name {
    ($($type:ty)*) => {$(
        impl $crate::scene::fingerprint::Content for $type {
            fn add_to(&self, hash: &mut $crate::scene::fingerprint::ContentHash) {
                $crate::scene::fingerprint::Content::add_to(
                    $crate::scene::reader::Choice::name(*self),
                    hash,
                );
            }
        }
    )*};
}
pub(crate) use content_by_name;
