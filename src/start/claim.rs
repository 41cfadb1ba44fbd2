//! What is said of a photograph, and how sure it is.

/// A value and where it comes from: a line for the scene file, such as "guessed: +- 30%".
#[derive(Clone, Debug, PartialEq)]
pub struct Claim<T> {
    pub value: T,
    pub basis: String,
}

impl<T> Claim<T> {
    pub fn new(value: T, basis: impl Into<String>) -> Self {
        Self {
            value,
            basis: basis.into(),
        }
    }
}
