//! The file of numbers beside a script.

use bytemuck::Pod;
use serde_json::{Value, json};

/// Arrays one after the other, each at a multiple of four bytes.
#[derive(Default)]
pub(super) struct Numbers {
    pub bytes: Vec<u8>,
}

impl Numbers {
    /// Appends an array; what names it in the script: its offset in bytes and its length.
    pub fn add<T: Pod>(&mut self, values: &[T]) -> Value {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytemuck::cast_slice(values));
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        json!([offset, values.len()])
    }
}
