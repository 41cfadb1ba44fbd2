//! How a stage's table of a scene file is read.

use crate::scene::error::Result;
use crate::scene::reader::{Node, Table};

/// Settings of a stage, one table of a scene file.
pub(crate) trait StageSettings: Sized {
    /// Every key of the table.
    const KEYS: &'static [&'static str];
    /// The stage is never beside another one.
    const ALONE: bool = false;

    /// # Errors
    /// A value that the stage cannot use.
    fn read(table: &Table) -> Result<Self>;
}

/// Replaces `value` if the key is there.
pub(super) fn read_into<'a, T>(
    table: &Table<'a>,
    key: &str,
    value: &mut T,
    read: impl FnOnce(&Node<'a>) -> Result<T>,
) -> Result<()> {
    if let Some(given) = table.optional(key, read)? {
        *value = given;
    }
    Ok(())
}
