//! Why an input cannot be used.

/// One line, "problem; expected ...; how to mend", for whoever wrote the input. Names the file only where the function that returns it says
/// so.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Refusal(String);

impl From<String> for Refusal {
    fn from(line: String) -> Self {
        Self(line)
    }
}

impl From<&str> for Refusal {
    fn from(line: &str) -> Self {
        Self(line.to_owned())
    }
}

/// For a message that it is a part of.
impl From<Refusal> for String {
    fn from(refusal: Refusal) -> Self {
        refusal.0
    }
}
