//! How much memory there is to take: what a picture or a scene will need is compared with it before it is taken.
//!
//! On Linux the least of what the machine has left, what the control groups of this process leave it, and its limits of address space
//! and data; elsewhere a plain limit. Numbers that cannot be read limit nothing.

mod allocator;

pub use allocator::EndWhenShort;

use std::fmt;

/// Less than this is not worth a look at the system's numbers.
const SMALL_BYTES: u64 = 32 << 20;

/// More memory is asked for than there is.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{what} needs {} of memory; {} are free ({limit}); use something smaller or more memory",
    Bytes(*.needed),
    Bytes(*.free)
)]
pub struct Shortage {
    /// Names what it is for.
    pub what: String,
    pub needed: u64,
    pub free: u64,
    /// What sets the limit.
    pub limit: &'static str,
}

/// That `bytes` more can be taken for `what`.
///
/// # Errors
/// They cannot.
pub fn ensure(bytes: u64, what: &str) -> Result<(), Shortage> {
    ensure_lazy(bytes, bytes, what)
}

/// That `mapped` bytes more can be taken for `what`, of which no more than `touched` are ever written.
///
/// # Errors
/// They cannot.
pub fn ensure_lazy(mapped: u64, touched: u64, what: &str) -> Result<(), Shortage> {
    if mapped.max(touched) <= SMALL_BYTES {
        return Ok(());
    }
    compare(mapped, touched, what, &system::limits())
}

/// Kilobytes of the stacks that threads of C libraries get, where those are too small for compilers such as graphics drivers have.
pub(crate) fn small_stacks() -> Option<u64> {
    const LEAST_KILOBYTES: u64 = 1024;
    let kilobytes = system::stack_limit()? / 1024;
    (kilobytes < LEAST_KILOBYTES).then_some(kilobytes)
}

/// Under a limit of addresses or data all threads take their memory from one heap, and large pieces from the system alone, which gets them
/// back: each heap more sets aside 64 MiB of addresses, and twice as many for a moment, when a thread asks for its first memory, which may be
/// between a look at what is left and taking it; and a heap keeps what was freed in it. To be called while there is one thread.
pub fn keep_heap_small_under_limits() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if system::limits_addresses() {
        // SAFETY: they take two numbers. A C library that refuses them goes on as before.
        unsafe {
            libc::mallopt(libc::M_ARENA_MAX, 1);
            libc::mallopt(libc::M_MMAP_THRESHOLD, LARGE_PIECE_BYTES);
        }
    }
}

/// The C library's own threshold at the start, which it otherwise raises to 32 MiB as it goes.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const LARGE_PIECE_BYTES: i32 = 128 << 10;

/// What is left under one limit.
struct Free {
    bytes: u64,
    limit: &'static str,
    /// Pages that were never written count too.
    of_addresses: bool,
}

fn compare(mapped: u64, touched: u64, what: &str, limits: &[Free]) -> Result<(), Shortage> {
    let short = limits.iter().filter_map(|free| {
        let needed = if free.of_addresses { mapped } else { touched };
        (needed > free.bytes).then_some((needed, free))
    });
    match short.min_by_key(|(_, free)| free.bytes) {
        None => Ok(()),
        Some((needed, free)) => Err(Shortage {
            what: what.to_owned(),
            needed,
            free: free.bytes,
            limit: free.limit,
        }),
    }
}

/// A number of bytes for people: "12.9 GB".
pub(crate) struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        match self.0 {
            0..1_000_000 => write!(f, "{:.0} kB", bytes / 1e3),
            1_000_000..1_000_000_000 => write!(f, "{:.0} MB", bytes / 1e6),
            _ => write!(f, "{:.1} GB", bytes / 1e9),
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use super::Free;

    pub fn stack_limit() -> Option<u64> {
        None
    }

    /// Without numbers of the system: what a machine of today has.
    pub fn limits() -> Vec<Free> {
        vec![Free {
            bytes: 64 << 30,
            limit: "the limit of this program on this system",
            of_addresses: false,
        }]
    }
}

#[cfg(target_os = "linux")]
mod system {
    use std::fs::read_to_string;
    use std::path::Path;

    use super::Free;

    pub fn limits() -> Vec<Free> {
        let memory = read_to_string("/proc/meminfo").unwrap_or_default();
        let limits = read_to_string("/proc/self/limits").unwrap_or_default();
        let status = read_to_string("/proc/self/status").unwrap_or_default();
        let groups = read_to_string("/proc/self/cgroup").unwrap_or_default();
        let free = |bytes: Option<u64>, limit, of_addresses| {
            bytes.map(|bytes| Free {
                bytes,
                limit,
                of_addresses,
            })
        };
        let left = |name, used| free_of_limit(&limits, name, &status, used);
        [
            free(free_of_machine(&memory), "of this machine's memory", false),
            free(
                free_of_groups(&groups, Path::new("/sys/fs/cgroup")),
                "of the control group's memory",
                false,
            ),
            free(
                left("Max address space", "VmSize:"),
                "of the limit of address space, ulimit -v",
                true,
            ),
            free(
                left("Max data size", "VmData:"),
                "of the limit of data, ulimit -d",
                true,
            ),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    #[cfg(target_env = "gnu")]
    pub fn limits_addresses() -> bool {
        let limits = read_to_string("/proc/self/limits").unwrap_or_default();
        ["Max address space", "Max data size"]
            .into_iter()
            .any(|name| limit_of(&limits, name).is_some())
    }

    pub fn stack_limit() -> Option<u64> {
        limit_of(&read_to_string("/proc/self/limits").ok()?, "Max stack size")
    }

    /// A soft limit; `None` for "unlimited".
    fn limit_of(limits: &str, name: &str) -> Option<u64> {
        let line = limits.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_ascii_whitespace().next()?.parse().ok()
    }

    /// "VmSize:   123 kB" as bytes.
    fn kilobytes(text: &str, key: &str) -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        let number = line.split_ascii_whitespace().next()?;
        Some(number.parse::<u64>().ok()?.saturating_mul(1024))
    }

    /// With the swap: what does not fit stays usable, only slower.
    pub(super) fn free_of_machine(memory: &str) -> Option<u64> {
        let available = kilobytes(memory, "MemAvailable:")?;
        Some(available + kilobytes(memory, "SwapFree:").unwrap_or(0))
    }

    /// What a soft limit leaves; `None` for "unlimited".
    pub(super) fn free_of_limit(limits: &str, name: &str, status: &str, used: &str) -> Option<u64> {
        let limit = limit_of(limits, name)?;
        Some(limit.saturating_sub(kilobytes(status, used)?))
    }

    /// The least that a control group of this process or one above it leaves, version 1 or 2.
    pub(super) fn free_of_groups(groups: &str, root: &Path) -> Option<u64> {
        let mut least = None;
        for line in groups.lines() {
            let mut parts = line.splitn(3, ':').skip(1);
            let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else {
                continue;
            };
            let (base, files) = match controllers {
                "" => (root.to_path_buf(), ["memory.max", "memory.current"]),
                _ if controllers.split(',').any(|c| c == "memory") => (
                    root.join("memory"),
                    ["memory.limit_in_bytes", "memory.usage_in_bytes"],
                ),
                _ => continue,
            };
            // In a container the path may be the host's, of which only the root is there to be seen.
            for group in Path::new(path.trim_start_matches('/')).ancestors() {
                let free = free_of_group(&base.join(group), files);
                least = [least, free].into_iter().flatten().min();
            }
        }
        least
    }

    fn free_of_group(folder: &Path, [limit, used]: [&str; 2]) -> Option<u64> {
        let number = |name: &str| -> Option<u64> {
            read_to_string(folder.join(name)).ok()?.trim().parse().ok()
        };
        let (limit, used) = (number(limit)?, number(used)?);
        // Pages of files that the kernel would give up count as used.
        let stat = read_to_string(folder.join("memory.stat")).unwrap_or_default();
        let cache = ["total_inactive_file ", "inactive_file "]
            .iter()
            .find_map(|key| stat.lines().find_map(|line| line.strip_prefix(key)))
            .and_then(|number| number.trim().parse().ok())
            .unwrap_or(0);
        Some(limit.saturating_sub(used.saturating_sub(cache)))
    }
}

#[cfg(test)]
mod tests;
