//! Options that one command hands on to another, as they were typed.

use clap::parser::ValueSource;
use clap::{ArgAction, ArgMatches, Args, Command};

/// The options of `T` that were typed and whose field's name `takes` accepts, each as one word.
pub(super) fn typed<T: Args>(matches: &ArgMatches, takes: impl Fn(&str) -> bool) -> Vec<String> {
    let command = T::augment_args(Command::new(""));
    let mut words = Vec::new();
    for argument in command.get_arguments() {
        let id = argument.get_id().as_str();
        let Some(long) = argument.get_long().filter(|_| takes(id)) else {
            continue;
        };
        if matches.value_source(id) != Some(ValueSource::CommandLine) {
            continue;
        }
        if matches!(argument.get_action(), ArgAction::SetTrue) {
            words.push(format!("--{long}"));
            continue;
        }
        for value in matches.get_raw(id).into_iter().flatten() {
            words.push(format!("--{long}={}", value.to_string_lossy()));
        }
    }
    words
}
