//! Little memory, no threads, small stacks, files without an end, odd paths.

use super::{RENDER, SMALL, assert_done, assert_refused, folder_of, shell};

#[test]
fn a_picture_that_needs_more_memory_than_there_is_is_refused_with_the_figures() {
    let folder = folder_of(None, "width = 20000\nheight = 10000");
    let limited = format!("ulimit -v 6291456; {RENDER}");
    assert_refused(
        &shell(folder.path(), &limited),
        &["20000 x 10000", "GB of memory", "ulimit -v"],
    );
    let folder = folder_of(None, SMALL);
    assert_done(&shell(folder.path(), &limited));
}

/// Whatever the limit, the end is a picture or one line.
#[test]
fn memory_that_runs_out_anywhere_ends_with_one_line() {
    let folder = folder_of(None, "width = 1600\nheight = 1200");
    let mut refused = 0;
    for megabytes in [60, 120, 200, 260, 320, 380, 450, 600] {
        let script = format!("ulimit -v {}; {RENDER} --threads 2", megabytes * 1000);
        let output = shell(folder.path(), &script);
        if output.status.code() != Some(0) {
            assert_refused(&output, &["memory"]);
            refused += 1;
        }
    }
    assert!(refused > 0, "control: some limits are too tight");
    assert_done(&shell(folder.path(), RENDER));
}

#[test]
fn threads_that_cannot_be_made_are_done_without() {
    let folder = folder_of(None, SMALL);
    // Each thread wants a stack of two gigabytes, of which the limit leaves none, or one.
    for (kilobytes, threads) in [(1_500_000, "0 of 4"), (3_500_000, "1 of 4")] {
        let script = format!(
            "export RUST_MIN_STACK=2000000000; ulimit -v {kilobytes}; {RENDER} --threads 4"
        );
        let output = shell(folder.path(), &script);
        assert_done(&output);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(threads), "{said}");
    }
    let script = format!("{RENDER} --threads 4");
    let said = String::from_utf8(shell(folder.path(), &script).stderr).expect("text");
    assert!(!said.contains("threads"), "control: {said}");
}

/// The limit on a user's processes. It does not hold for root, who takes the number of a user without any.
#[cfg(target_os = "linux")]
#[test]
fn processes_that_may_not_be_made_are_done_without() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;
    use std::process::Command;

    const NOBODY_ELSE: u32 = 64_987;
    let folder = folder_of(None, SMALL);
    let everyone = std::fs::Permissions::from_mode(0o777);
    std::fs::set_permissions(folder.path(), everyone).expect("is ours");
    let program = folder.path().join("mixray");
    std::fs::copy(env!("CARGO_BIN_EXE_mixray"), &program).expect("a writable folder");
    let is_root = std::fs::metadata("/proc/self").expect("procfs").uid() == 0;
    let run = |limit: &str| {
        let script = format!(
            "{limit} exec ./mixray render scene.toml --rpp 1 --backend cpu --threads 4 -o out.png"
        );
        let mut shell = Command::new("bash");
        shell.args(["-c", &script]).current_dir(folder.path());
        if is_root {
            shell.uid(NOBODY_ELSE);
        }
        shell.output().expect("bash")
    };
    let limited = run("ulimit -u 1;");
    assert_done(&limited);
    let said = String::from_utf8_lossy(&limited.stderr);
    assert!(said.contains("0 of 4 threads"), "{said}");
    let free = run("");
    assert_done(&free);
    let said = String::from_utf8_lossy(&free.stderr);
    assert!(!said.contains("threads for its work"), "control: {said}");
}

#[test]
fn a_small_stack_of_the_shell_is_enough() {
    let folder = folder_of(None, SMALL);
    for kilobytes in [64, 128, 256] {
        assert_done(&shell(
            folder.path(),
            &format!("ulimit -s {kilobytes}; {RENDER}"),
        ));
        // Drivers are refused before they are asked, and `auto` goes on without.
        let on = |backend: &str| {
            let render = RENDER.replace("cpu", backend);
            shell(folder.path(), &format!("ulimit -s {kilobytes}; {render}"))
        };
        let limit = format!("stacks of {kilobytes} kB");
        assert_refused(&on("gpu"), &[&limit, "ulimit -s"]);
        assert_done(&on("auto"));
    }
}

#[test]
fn texts_without_an_end_are_refused() {
    let folder = folder_of(None, SMALL);
    for command in [
        "$MIXRAY render /dev/zero -o o.png",
        "$MIXRAY render <(yes) -o o.png",
        "$MIXRAY sequence scene.toml --frames . --trajectory /dev/zero -o o.y4m",
    ] {
        assert_refused(&shell(folder.path(), command), &["at most"]);
    }
    assert_done(&shell(
        folder.path(),
        "$MIXRAY render <(cat scene.toml) --rpp 1 --backend cpu -o o.png",
    ));
}

#[cfg(unix)]
#[test]
fn films_in_folders_of_any_name_can_be_merged() {
    use std::os::unix::ffi::OsStrExt;

    for name in [
        "плёнка 映画 🎞".as_bytes(),
        "caf\u{e9}".as_bytes(),
        b"not \xff\xfe UTF-8",
    ] {
        let parent = folder_of(None, SMALL);
        let folder = parent.path().join(std::ffi::OsStr::from_bytes(name));
        std::fs::create_dir(&folder).expect("a writable folder");
        std::fs::rename(parent.path().join("scene.toml"), folder.join("scene.toml"))
            .expect("a writable folder");
        for (range, film) in [("0..1", "a.exr"), ("1..2", "b.exr")] {
            let script = format!(
                "$MIXRAY render scene.toml --rpp 2 --backend cpu --range {range} -o {film}"
            );
            assert_done(&shell(&folder, &script));
        }
        assert_done(&shell(
            &folder,
            "$MIXRAY merge a.exr b.exr --scene scene.toml -o o.png",
        ));
        if std::str::from_utf8(name).is_ok() {
            assert_done(&shell(&folder, "$MIXRAY merge a.exr b.exr -o o.png"));
        }
    }
}
