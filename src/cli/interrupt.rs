//! Signals. Ctrl-C: the first asks the render to end, the second ends the program at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::{Failure, say};

#[derive(Clone)]
pub(super) struct Interrupted(Arc<AtomicBool>);

impl Interrupted {
    pub(super) fn is_set(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Watches from now on. Called when rendering begins: before that there is nothing worth writing, and Ctrl-C simply ends the program.
pub(super) fn watch() -> Result<Interrupted, Failure> {
    let flag = Interrupted(Arc::new(AtomicBool::new(false)));
    let seen = flag.clone();
    let handler = ctrlc::set_handler(move || {
        if seen.0.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
    match handler {
        // A thread to wait on cannot be made.
        Err(ctrlc::Error::System(_)) => {
            let message = "Ctrl-C will end the program without its picture: the system lets it have no thread to wait for that";
            say("warning", message);
        }
        other => other?,
    }
    Ok(flag)
}

/// From now on a file that outgrows its limit (`ulimit -f`) is a write that fails, and no end of the program without a word.
pub(super) fn survive_file_limits() {
    // SAFETY: no code of ours runs in a handler, and nothing else sets this signal.
    #[cfg(unix)]
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}
