//! What was read and what is written so far.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::paths::Identity;

/// An output that is a file which the run reads, or another output.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Conflict {
    #[error(
        "{output}: is an input of this run{} and would be overwritten; give the output another name",
        also(input, output)
    )]
    Input { output: String, input: String },
    #[error(
        "{output}: named for two outputs{}; give each a name of its own",
        also(other, output)
    )]
    Twice { output: String, other: String },
}

/// The other name, where it is another.
fn also(name: &str, than: &str) -> String {
    match name == than {
        true => String::new(),
        false => format!(" ({name})"),
    }
}

#[derive(Debug)]
struct Output {
    name: String,
    /// The run reads it too.
    own: bool,
}

/// Files by resolved path and by identity.
#[derive(Debug, Default)]
struct Files {
    by_path: HashMap<PathBuf, usize>,
    by_identity: HashMap<Identity, usize>,
}

impl Files {
    fn find(&self, path: Option<&Path>, identity: Option<Identity>) -> Option<usize> {
        let by_path = path.and_then(|path| self.by_path.get(path));
        by_path
            .or_else(|| self.by_identity.get(&identity?))
            .copied()
    }

    fn insert(&mut self, path: Option<PathBuf>, identity: Option<Identity>, index: usize) {
        self.by_path.extend(path.map(|path| (path, index)));
        self.by_identity
            .extend(identity.map(|identity| (identity, index)));
    }
}

#[derive(Debug, Default)]
pub(super) struct Registry {
    inputs: Files,
    /// As they were called first.
    input_names: Vec<String>,
    /// Only by path once they are written: a file that replaces another has an identity of its own.
    outputs: Files,
    output_notes: Vec<Output>,
    conflict: Option<Conflict>,
}

impl Registry {
    #[cfg(feature = "cli")]
    pub(super) fn conflict(&self) -> Option<Conflict> {
        self.conflict.clone()
    }

    fn refuse(&mut self, conflict: Conflict) -> Result<(), Conflict> {
        self.conflict.get_or_insert(conflict.clone());
        Err(conflict)
    }

    pub(super) fn input(
        &mut self,
        name: &str,
        path: Option<PathBuf>,
        identity: Option<Identity>,
    ) -> Result<(), Conflict> {
        if let Some(index) = self.outputs.find(path.as_deref(), identity) {
            let output = &self.output_notes[index];
            if output.own {
                return Ok(());
            }
            return self.refuse(Conflict::Input {
                output: output.name.clone(),
                input: name.to_owned(),
            });
        }
        let known = self.inputs.find(path.as_deref(), identity);
        let index = known.unwrap_or_else(|| {
            self.input_names.push(name.to_owned());
            self.input_names.len() - 1
        });
        self.inputs.insert(path, identity, index);
        Ok(())
    }

    pub(super) fn output(
        &mut self,
        name: &str,
        path: Option<PathBuf>,
        identity: Option<Identity>,
    ) -> Result<(), Conflict> {
        self.check_output(name, path.as_deref(), identity)?;
        self.outputs.insert(path, identity, self.output_notes.len());
        self.output_notes.push(Output {
            name: name.to_owned(),
            own: false,
        });
        Ok(())
    }

    #[cfg(any(feature = "bench", feature = "start"))]
    pub(super) fn own(&mut self, path: &Path) {
        if let Some(index) = self.outputs.find(Some(path), None) {
            self.output_notes[index].own = true;
        }
    }

    pub(super) fn check_output(
        &mut self,
        name: &str,
        path: Option<&Path>,
        identity: Option<Identity>,
    ) -> Result<(), Conflict> {
        self.refuse_input(name, path, identity)?;
        if let Some(index) = self.outputs.find(path, identity) {
            return self.refuse(Conflict::Twice {
                output: name.to_owned(),
                other: self.output_notes[index].name.clone(),
            });
        }
        Ok(())
    }

    pub(super) fn before_write(
        &mut self,
        name: &str,
        path: Option<&Path>,
        identity: Option<Identity>,
    ) -> Result<(), Conflict> {
        self.refuse_input(name, path, identity)?;
        // The file that is replaced goes, and another may get its identity.
        if let Some(identity) = identity {
            self.outputs.by_identity.remove(&identity);
        }
        Ok(())
    }

    fn refuse_input(
        &mut self,
        name: &str,
        path: Option<&Path>,
        identity: Option<Identity>,
    ) -> Result<(), Conflict> {
        match self.inputs.find(path, identity) {
            Some(index) => self.refuse(Conflict::Input {
                output: name.to_owned(),
                input: self.input_names[index].clone(),
            }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
