//! Files to open: a folder's, of the kinds that the window takes.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use eframe::egui::{self, Context, Ui};

use crate::preview::session::TAKEN_ENDINGS;

/// What a folder holds.
#[derive(Default)]
struct Listing {
    folders: Vec<PathBuf>,
    files: Vec<PathBuf>,
}

/// A window with the files of a folder.
pub(super) struct FileList {
    pub is_open: bool,
    folder: PathBuf,
    /// Nothing outside is entered.
    bounds: Option<PathBuf>,
    /// Read when the folder is entered.
    listing: Result<Listing, String>,
}

impl FileList {
    /// Closed, at the folder of a file.
    pub fn beside(file: &Path) -> Self {
        let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_path_buf());
        Self {
            is_open: false,
            folder: absolute.parent().unwrap_or(Path::new("/")).to_path_buf(),
            bounds: None,
            listing: Ok(Listing::default()),
        }
    }

    /// Shows the present folder and what lies in it from now on, and nothing else.
    pub fn keep_to_folder(&mut self) {
        self.bounds = Some(self.folder.clone());
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn open(&mut self) {
        self.is_open = true;
        self.enter(self.folder.clone());
    }

    fn enter(&mut self, folder: PathBuf) {
        let bounds = self.bounds.as_ref();
        if bounds.is_some_and(|bounds| !folder.starts_with(bounds)) {
            return;
        }
        self.listing = list(&folder).map_err(|error| format!("it cannot be read ({error})"));
        self.folder = folder;
    }

    /// The file that was chosen.
    pub fn show(&mut self, context: &Context) -> Option<PathBuf> {
        let mut is_open = self.is_open;
        let shown = egui::Window::new("Open a file")
            .open(&mut is_open)
            .default_width(360.0)
            .show(context, |ui| self.contents(ui));
        let chosen = shown.and_then(|shown| shown.inner).flatten();
        self.is_open = is_open && chosen.is_none();
        chosen
    }

    fn contents(&mut self, ui: &mut Ui) -> Option<PathBuf> {
        let mut entered = None;
        ui.horizontal(|ui| {
            if ui.button("Up").clicked() {
                entered = self.folder.parent().map(Path::to_path_buf);
            }
            ui.label(self.folder.display().to_string());
        });
        let mut chosen = None;
        match &self.listing {
            Err(problem) => {
                ui.colored_label(ui.visuals().error_fg_color, problem);
            }
            Ok(listing) => {
                egui::ScrollArea::vertical()
                    .max_height(360.0)
                    .auto_shrink([false, true])
                    .show(ui, |ui| {
                        for folder in &listing.folders {
                            let name = format!("{}/", name(folder));
                            if ui.selectable_label(false, name).clicked() {
                                entered = Some(folder.clone());
                            }
                        }
                        for file in &listing.files {
                            if ui.selectable_label(false, name(file)).clicked() {
                                chosen = Some(file.clone());
                            }
                        }
                    });
            }
        }
        if let Some(folder) = entered {
            self.enter(folder);
        }
        chosen
    }
}

fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// In the order of their names; hidden ones are left out.
fn list(folder: &Path) -> std::io::Result<Listing> {
    let mut listing = Listing::default();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let is_taken = path
            .extension()
            .and_then(OsStr::to_str)
            .is_some_and(|e| TAKEN_ENDINGS.contains(&&*e.to_lowercase()));
        if name(&path).starts_with('.') {
            continue;
        } else if path.is_dir() {
            listing.folders.push(path);
        } else if is_taken {
            listing.files.push(path);
        }
    }
    listing.folders.sort();
    listing.files.sort();
    Ok(listing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_can_be_opened_is_listed() {
        let folder = tempfile::tempdir().unwrap();
        for file in [
            "b.GLB",
            "a.toml",
            "notes.txt",
            ".hidden.png",
            "scene.toml.unsaved",
        ] {
            std::fs::write(folder.path().join(file), "").unwrap();
        }
        std::fs::create_dir(folder.path().join("models")).unwrap();
        let listing = list(folder.path()).unwrap();
        let names = |paths: &[PathBuf]| paths.iter().map(|path| name(path)).collect::<Vec<_>>();
        assert_eq!(names(&listing.files), ["a.toml", "b.GLB"]);
        assert_eq!(names(&listing.folders), ["models"]);
        assert!(list(&folder.path().join("nowhere")).is_err());
    }

    #[test]
    fn a_list_that_is_kept_to_its_folder_stays_there() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("models")).unwrap();
        let mut files = FileList::beside(&folder.path().join("scene.toml"));
        let enters = |files: &mut FileList, path: &Path| {
            files.enter(path.to_path_buf());
            files.folder == path
        };
        let above = folder.path().parent().unwrap();
        assert!(enters(&mut files, above), "control");
        assert!(enters(&mut files, folder.path()));
        files.keep_to_folder();
        assert!(!enters(&mut files, above));
        assert!(enters(&mut files, &folder.path().join("models")));
    }
}
