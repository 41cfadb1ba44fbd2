//! A folder with what a command needs, and the built program in it.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output};
use std::time::{Duration, Instant};

use image::{Rgb, RgbImage};
use mixray::scene::Scene;

/// Goes when the test ends.
pub struct Folder(tempfile::TempDir);

/// A command line: one text, split at white space, or its words.
pub trait CommandLine {
    fn words(&self) -> Vec<&str>;
}

impl CommandLine for str {
    fn words(&self) -> Vec<&str> {
        self.split_whitespace().collect()
    }
}

impl CommandLine for String {
    fn words(&self) -> Vec<&str> {
        self.as_str().words()
    }
}

impl CommandLine for [&str] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl<const N: usize> CommandLine for [&str; N] {
    fn words(&self) -> Vec<&str> {
        self.to_vec()
    }
}

impl CommandLine for Vec<&str> {
    fn words(&self) -> Vec<&str> {
        self.clone()
    }
}

impl Folder {
    /// An empty one.
    pub fn new() -> Self {
        let named = tempfile::Builder::new().prefix("mixray").tempdir();
        Self(named.expect("a temporary folder"))
    }

    /// `scene.toml` with this text, and a `photo.png` of 24 x 16 pixels.
    pub fn with_scene(text: &str) -> Self {
        let folder = Self::new();
        folder.save("photo.png", 24, 16, |x, y| {
            [x * 10, y * 15, x * y].map(|c| c as u8)
        });
        folder.write("scene.toml", text);
        folder
    }

    pub fn root(&self) -> &Path {
        self.0.path()
    }

    /// The folder's own name, which commands name pictures after.
    pub fn name(&self) -> String {
        self.root()
            .file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned()
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.root().join(name)
    }

    /// Names of all that is in it, sorted.
    pub fn entries(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.root())
            .expect("reads")
            .map(|entry| {
                entry
                    .expect("reads")
                    .file_name()
                    .into_string()
                    .expect("UTF-8")
            })
            .collect();
        names.sort();
        names
    }

    pub fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), contents).expect("writes");
    }

    pub fn create(&self, folder: &str) {
        std::fs::create_dir_all(self.path(folder)).expect("a writable folder");
    }

    pub fn remove(&self, name: &str) {
        std::fs::remove_file(self.path(name)).expect("removes");
    }

    pub fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.read(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Saves codes that `value` gives by column and row; where.
    pub fn save(
        &self,
        name: &str,
        width: u32,
        height: u32,
        value: impl Fn(u32, u32) -> [u8; 3],
    ) -> PathBuf {
        let path = self.path(name);
        RgbImage::from_fn(width, height, |x, y| Rgb(value(x, y)))
            .save(&path)
            .expect("saves");
        path
    }

    pub fn open(&self, name: &str) -> RgbImage {
        image::open(self.path(name))
            .unwrap_or_else(|error| panic!("{name}: {error}"))
            .into_rgb8()
    }

    /// The scene of `scene.toml`; a failure shows `text`.
    pub fn load(&self, text: &str) -> Scene {
        mixray::scene::load(&self.path("scene.toml"))
            .unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    /// The program with this folder as the current one.
    pub fn command(&self, line: &(impl CommandLine + ?Sized)) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mixray"));
        command.current_dir(self.root()).args(line.words());
        command
    }

    pub fn run(&self, line: &(impl CommandLine + ?Sized)) -> Output {
        self.command(line).output().expect("runs")
    }

    /// A command that must succeed; its stdout.
    pub fn succeed(&self, line: &(impl CommandLine + ?Sized)) -> String {
        let output = self.run(line);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{:?}: {}",
            line.words(),
            stderr(&output)
        );
        stdout(&output)
    }

    /// A command that must be refused, in one line that holds `part`.
    pub fn refuse(&self, line: &(impl CommandLine + ?Sized), part: &str) {
        assert_refused(&self.run(line), part);
    }
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Exit code 2, nothing on stdout, and one line that begins with "error:" and holds `part`.
pub fn assert_refused(output: &Output, part: &str) {
    let message = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{part}: {message}");
    assert!(message.starts_with("error:"), "{message}");
    assert!(message.contains(part), "{message} lacks {part}");
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert!(output.stdout.is_empty());
}

/// Sends what Ctrl-C sends, and waits for the end.
#[cfg(unix)]
pub fn interrupt(child: &mut Child) -> ExitStatus {
    let kill = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.expect("runs").success());
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("waits") {
            return status;
        }
        if start.elapsed() > Duration::from_secs(30) {
            child.kill().expect("is killed");
            panic!("did not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}
