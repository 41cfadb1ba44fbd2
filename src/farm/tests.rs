use super::*;

#[test]
fn parts_are_runs_of_at_most_their_size() {
    assert_eq!(in_chunks(0..10, 4), [(0, 3), (4, 7), (8, 9)]);
    assert_eq!(in_chunks([3, 4, 7, 8, 9], 2), [(3, 4), (7, 8), (9, 9)]);
    assert_eq!(in_chunks([5], u32::MAX), [(5, 5)]);
    assert_eq!(even(10, 4), [(0, 1), (2, 4), (5, 6), (7, 9)]);
    assert_eq!(even(2, 16), [(0, 0), (1, 1)]);
    let most = even(u32::MAX, 1000);
    assert_eq!((most[0].0, most[999].1), (0, u32::MAX - 1));
}

#[test]
fn a_shell_takes_any_name_for_one_word() {
    for (text, word) in [
        ("a/b-1.exr", "a/b-1.exr"),
        ("", "''"),
        ("a b", "'a b'"),
        ("it's $HOME", r"'it'\''s $HOME'"),
    ] {
        assert_eq!(quoted(text), word);
    }
}
