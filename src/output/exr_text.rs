//! Text in an OpenEXR header.

use exr::prelude::attribute::AttributeValue;
use exr::prelude::{SmallVec, Text};

/// As OpenEXR wants it, UTF-8; the crate's own conversion knows Latin-1 alone and panics beyond.
pub(super) fn text_value(text: &str) -> AttributeValue {
    AttributeValue::Text(Text::from_bytes_unchecked(SmallVec::from_slice(
        text.as_bytes(),
    )))
}
