//! What a decoder throws is caught, and is an error like any other.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder. A panic in it is not printed and comes back as its message.
///
/// Nothing that `work` changed may be used after an error.
pub(crate) fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    silence_guarded_threads();
    let outer = GUARDED.replace(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    GUARDED.set(outer);
    result.map_err(|payload| {
        let message = (payload.downcast_ref::<String>().map(String::as_str))
            .or(payload.downcast_ref::<&str>().copied());
        let first_line = message.and_then(|text| text.lines().next());
        format!("the decoder failed: {}", first_line.unwrap_or("no reason"))
    })
}

/// Panics are printed as before, only not those of guarded work.
fn silence_guarded_threads() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let print = take_hook();
        set_hook(Box::new(move |info| {
            if !GUARDED.get() {
                print(info);
            }
        }));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_with_its_message() {
        let thrown = guarded(|| [1, 2, 3][std::hint::black_box(3)]);
        assert_eq!(
            thrown,
            Err("the decoder failed: index out of bounds: the len is 3 but the index is 3".into())
        );
        assert_eq!(guarded(|| 7), Ok(7), "control");
        assert!(!GUARDED.get(), "panics elsewhere are printed again");
    }
}
