//! What real files bring, each kind by the name that `docs/files.md` gives it.

mod frames;
mod intrinsics;
mod layers;
mod messages;
mod models;
mod noise;
mod pictures;
mod streams;
mod support;

use crate::support::root;

/// Names in the last column of the table.
fn rows(table: &str) -> Vec<&str> {
    let cells = table
        .lines()
        .filter_map(|line| line.strip_suffix(" |")?.rsplit_once("| "));
    cells
        .filter_map(|(_, name)| name.strip_prefix('`')?.strip_suffix('`'))
        .collect()
}

#[test]
fn every_row_of_the_table_is_a_test() {
    let table = std::fs::read_to_string(root().join("docs/files.md")).expect("reads");
    let mut sources = String::new();
    for entry in std::fs::read_dir(root().join("tests/files")).expect("reads") {
        sources += &std::fs::read_to_string(entry.expect("reads").path()).expect("reads");
    }
    let missing = |table: &str| {
        let rows = rows(table);
        let is_test = |name: &&str| sources.contains(&format!("#[test]\nfn {name}()"));
        rows.into_iter()
            .filter(|name| !is_test(name))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert!(!rows(&table).is_empty());
    assert_eq!(missing(&table), Vec::<String>::new());
    assert_eq!(missing("| a | b | `not_there` |"), ["not_there"], "control");
}
