//! The threads that the program works on. Where the system gives fewer than asked for, it works on those.

use std::io;
use std::panic::resume_unwind;
use std::sync::{Arc, Mutex, OnceLock, mpsc};
use std::thread;

use rayon::{ThreadBuilder, ThreadPoolBuilder};

use super::{Failure, say};

/// Of the thread that a command runs on. The main thread's own stack is as small as the shell's limit says.
pub(super) const STACK_BYTES: usize = 8 << 20;

/// Runs a command on a stack of our own; on the caller's where no thread can be made.
pub(super) fn on_large_stack<T: Send + 'static>(work: fn() -> T) -> T {
    let thread = thread::Builder::new().stack_size(STACK_BYTES).spawn(work);
    match thread.map(thread::JoinHandle::join) {
        Ok(Ok(result)) => result,
        Ok(Err(thrown)) => resume_unwind(thrown),
        Err(_) => work(),
    }
}

/// Starts that many threads for the CPU's work, or one for each core; only the first call does anything.
///
/// rayon gives up for good where it cannot make all of its threads: they are made first, and the pool is as large as they are many.
pub(super) fn start(threads: Option<u16>) -> Result<(), Failure> {
    static STARTED: OnceLock<()> = OnceLock::new();
    if STARTED.set(()).is_err() {
        return Ok(());
    }
    let wanted = threads.map_or_else(
        || thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    );
    let (sender, receiver) = mpsc::channel::<ThreadBuilder>();
    let receiver = Arc::new(Mutex::new(receiver));
    let work = |receiver: Arc<Mutex<mpsc::Receiver<ThreadBuilder>>>| {
        move || {
            let received = receiver.lock().ok().and_then(|queue| queue.recv().ok());
            if let Some(worker) = received {
                worker.run();
            }
        }
    };
    let made = (0..wanted)
        .take_while(|_| {
            let spawned = thread::Builder::new().spawn(work(receiver.clone()));
            spawned.is_ok()
        })
        .count();
    if made < wanted {
        say(
            "warning",
            &format!(
                "the system lets this program have {made} of {wanted} threads for its work (ulimit -u, ulimit -v): it goes on with {}",
                made.max(1)
            ),
        );
    }
    if made == 0 {
        let pool = ThreadPoolBuilder::new().num_threads(1).use_current_thread();
        return Ok(pool.build_global()?);
    }
    ThreadPoolBuilder::new()
        .num_threads(made)
        .spawn_handler(|worker| {
            sender
                .send(worker)
                .map_err(|_| io::Error::other("no thread is left for a worker"))
        })
        .build_global()?;
    Ok(())
}

/// That one more thread can be made just now: for what would panic where it cannot.
pub(super) fn can_spawn() -> bool {
    thread::Builder::new().spawn(|| ()).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_runs_on_a_thread_of_its_own() {
        let own = on_large_stack(|| thread::current().id());
        assert_ne!(own, thread::current().id());
        assert_eq!(on_large_stack(|| 7), 7, "control");
    }
}
