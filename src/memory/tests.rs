use super::*;

#[test]
fn a_shortage_says_both_figures_and_what_sets_the_limit() {
    let free = |bytes, of_addresses| Free {
        bytes,
        limit: "of the limit of address space, ulimit -v",
        of_addresses,
    };
    let limits = [free(5_300_000_000, true), free(1_000_000_000, false)];
    let what = "a film of 20000 x 10000 pixels";
    let error = compare(28_800_000_000, 999_999_999, what, &limits).unwrap_err();
    assert_eq!(
        error.to_string(),
        "a film of 20000 x 10000 pixels needs 28.8 GB of memory; 5.3 GB are free (of the limit of address space, ulimit -v); use something smaller or more memory"
    );
    let fits = compare(5_300_000_000, 1_000_000_000, what, &limits);
    assert_eq!(fits, Ok(()), "control");
    assert!(compare(1_000_000_001, 1_000_000_001, what, &limits).is_err());
}

#[test]
fn what_no_machine_has_is_refused() {
    assert!(ensure(1 << 60, "nothing").is_err());
    assert_eq!(ensure(1 << 20, "little"), Ok(()), "control");
    assert_eq!(ensure(SMALL_BYTES + 1, "a picture"), Ok(()), "control");
}

#[cfg(target_os = "linux")]
#[test]
fn limits_leave_what_is_not_used() {
    let limits = "Limit Soft Hard Units\nMax address space         6442450944           unlimited            bytes\nMax data size   unlimited unlimited bytes\n";
    let status = "Name: x\nVmSize:\t 1048576 kB\nVmData:\t 1 kB\n";
    let left = |name, used| system::free_of_limit(limits, name, status, used);
    assert_eq!(left("Max address space", "VmSize:"), Some(5 << 30));
    assert_eq!(left("Max data size", "VmData:"), None, "control: unlimited");
    let memory = "MemTotal: 9 kB\nMemAvailable:  2048 kB\nSwapFree: 1024 kB\n";
    assert_eq!(system::free_of_machine(memory), Some(3 << 20));
}

#[cfg(target_os = "linux")]
#[test]
fn the_tightest_control_group_counts() {
    let root = tempfile::tempdir().unwrap();
    let write = |folder: &str, files: &[(&str, &str)]| {
        let folder = root.path().join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        for (name, text) in files {
            std::fs::write(folder.join(name), text).unwrap();
        }
    };
    let free = |groups: &str| system::free_of_groups(groups, root.path());
    assert_eq!(free("0::/a/b\n"), None, "control: nothing is there");
    write("", &[("memory.max", "max\n"), ("memory.current", "9\n")]);
    write(
        "a",
        &[("memory.max", "1000\n"), ("memory.current", "300\n")],
    );
    write(
        "a/b",
        &[
            ("memory.max", "5000\n"),
            ("memory.current", "100\n"),
            ("memory.stat", "anon 7\ninactive_file 60\n"),
        ],
    );
    assert_eq!(free("0::/a/b\n"), Some(700), "the group above is tighter");
    write("a", &[("memory.max", "9000\n")]);
    assert_eq!(free("0::/a/b\n"), Some(4960), "files' pages are no loss");
    write(
        "memory/c",
        &[
            ("memory.limit_in_bytes", "80\n"),
            ("memory.usage_in_bytes", "50\n"),
        ],
    );
    assert_eq!(free("4:cpu,memory:/c\n0::/a/b\n"), Some(30), "version 1");
    assert_eq!(free("4:cpu,pids:/c\n"), None, "control");
}
