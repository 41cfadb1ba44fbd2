//! Numbers of JSON.

use serde_json::Value;

use super::finite;

pub(super) type Problem<T> = std::result::Result<T, String>;

pub(super) fn number(value: &Value, what: &str) -> Problem<f64> {
    match value.as_f64() {
        Some(x) => finite(x, what),
        None => Err(format!(
            "{what} is {value}; expected a finite number; correct it"
        )),
    }
}
