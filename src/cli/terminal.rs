//! What reaches the terminal: names and texts of files may hold anything, so that nothing is written but through here.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use super::Failure;

/// A word, which may be a path, is cut in its middle if it is longer.
const MAX_WORD_CHARS: usize = 300;
/// So is a message.
const MAX_MESSAGE_CHARS: usize = 4000;

/// `--quiet`: nothing is heard but errors, failed checks and results that were asked for.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

pub(super) fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// Progress is shown: somebody looks.
pub(super) fn shows_progress() -> bool {
    !is_quiet() && std::io::stderr().is_terminal()
}

/// A message to the user, one line. A note of a renderer that is a warning says so itself.
pub(super) fn say(kind: &str, message: &str) {
    let (kind, message) = match message.strip_prefix("warning: ") {
        Some(warning) => ("warning", warning),
        None => (kind, message),
    };
    if is_quiet() && matches!(kind, "note" | "warning") {
        return;
    }
    // Without a stderr there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "{kind}: {}", one_line(message));
}

/// A result to stdout. A reader that has heard enough (a closed pipe) is no failure.
pub(super) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = std::io::stdout();
    let written = stdout
        .write_all(escaped(text).as_bytes())
        .and_then(|()| stdout.flush());
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure(format!(
            "the result cannot be written to standard output: {error}"
        ))),
        _ => Ok(()),
    }
}

/// What became of a command that writes files, to stdout.
pub(super) fn summarize(text: &str) -> Result<(), Failure> {
    match is_quiet() {
        true => Ok(()),
        false => print(text),
    }
}

/// The same to stderr, where stdout has a file.
pub(super) fn summarize_aside(text: &str) {
    if is_quiet() {
        return;
    }
    // Without a stderr there is nobody to tell.
    let _ = std::io::stderr().write_all(escaped(text).as_bytes());
}

/// A message as it is shown: nothing in it moves the cursor, ends the line, or is longer than anybody reads.
pub(super) fn one_line(message: &str) -> String {
    let line = message.trim().replace(['\r', '\n', '\t'], " ");
    let words: Vec<String> = (line.split(' '))
        .map(|word| shortened(word, MAX_WORD_CHARS))
        .collect();
    escaped(&shortened(&words.join(" "), MAX_MESSAGE_CHARS))
}

/// Line ends stay; every other control character, and what turns the direction of text, becomes `\u{1b}` and the like.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\n' => out.push(c),
            '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => {
                let _ = write!(out, "{}", c.escape_unicode());
            }
            _ if c.is_control() => {
                let _ = write!(out, "{}", c.escape_unicode());
            }
            _ => out.push(c),
        }
    }
    out
}

fn shortened(text: &str, most: usize) -> String {
    let count = text.chars().count();
    if count <= most {
        return text.to_owned();
    }
    let half = (most - 3) / 2;
    let head: String = text.chars().take(half).collect();
    let tail: String = text.chars().skip(count - half).collect();
    format!("{head}...{tail}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_a_message_commands_the_terminal() {
        let shown = one_line("a\u{1b}[31m\0b\u{9b}\u{202e}c\nd\u{7f}");
        assert_eq!(shown, "a\\u{1b}[31m\\u{0}b\\u{9b}\\u{202e}c d\\u{7f}");
        let plain = "frame 3 of \u{e4}\u{6f22}.png: it ends";
        assert_eq!(one_line(plain), plain, "control");
        assert_eq!(escaped("a\nb\n"), "a\nb\n");
    }

    #[test]
    fn long_names_are_cut_in_the_middle() {
        let name = format!("/{}/end.png", "x".repeat(5000));
        let shown = one_line(&format!("{name}: cannot be read; correct the path"));
        assert!(shown.len() < 400, "{}", shown.len());
        assert!(shown.starts_with("/xxx") && shown.contains("..."));
        assert!(shown.ends_with("xx/end.png: cannot be read; correct the path"));
        let spaced = one_line(&"word ".repeat(5000));
        assert!(spaced.chars().count() <= MAX_MESSAGE_CHARS);
    }
}
