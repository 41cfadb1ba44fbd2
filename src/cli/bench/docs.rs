//! A page with a section for a table.

use std::path::{Path, PathBuf};

use crate::bench::replace_section;
use crate::cli::Failure;
use crate::output::{check_writable_as, write_text};

/// A page with a section for this table.
pub(super) struct Docs {
    path: PathBuf,
    page: String,
    section: &'static str,
}

impl Docs {
    pub(super) fn open(path: &Path, section: &'static str) -> Result<Self, Failure> {
        check_writable_as(path, "md")?;
        // Not as an input: the page is only read to be written again.
        let page = std::fs::read_to_string(path)
            .map_err(|error| Failure(format!("{}: {error}", path.display())))?;
        if replace_section(&page, section, "").is_none() {
            return Err(Failure(format!(
                "{}: has no section <!-- {section} --> ... <!-- end -->",
                path.display()
            )));
        }
        Ok(Self {
            path: path.to_owned(),
            page,
            section,
        })
    }

    pub(super) fn write(&self, content: &str) -> Result<(), Failure> {
        if let Some(page) = replace_section(&self.page, self.section, content) {
            write_text(&self.path, &page)?;
        }
        Ok(())
    }
}
