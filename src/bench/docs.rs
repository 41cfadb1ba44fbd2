//! Sections of a page that the tool writes itself.

/// Replaces what stands between `<!-- NAME -->` and the next `<!-- end -->`; `None` if the page has no such section.
pub fn replace_section(page: &str, name: &str, content: &str) -> Option<String> {
    let head = format!("<!-- {name} -->");
    let start = page.find(&head)? + head.len();
    let end = start + page[start..].find("<!-- end -->")?;
    Some(format!(
        "{}\n{}\n{}",
        &page[..start],
        content.trim_end(),
        &page[end..]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_named_section_changes() {
        let page = "a\n<!-- one -->\nold\n<!-- end -->\nb\n<!-- two -->\nkeep\n<!-- end -->\n";
        let changed = replace_section(page, "one", "new\n").unwrap();
        assert_eq!(changed, page.replace("old", "new"));
        assert_eq!(replace_section(&changed, "one", "new").unwrap(), changed);
        assert_eq!(replace_section(page, "three", "new"), None);
        assert_eq!(replace_section("<!-- one -->", "one", "new"), None);
    }
}
