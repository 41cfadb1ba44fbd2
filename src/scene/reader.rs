//! Typed reading of a parsed TOML document that never loses the place of a value.
//!
//! A [`Table`] refuses keys that it does not know when it is opened; a [`Node`] is one value with its place and name, and turns itself
//! into a number, vector, string or choice, or into an error that says where and what was expected.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Result, SceneError, Source};
use super::sandbox::Sandbox;
use crate::decode::split_layer;

/// Lengths and coordinates beyond this have no meaning in f32 arithmetic that squares them.
pub(crate) const MAX_MAGNITUDE: f64 = 1e15;

/// Radiance and the like: larger values overflow when they are summed.
pub(crate) const MAX_RADIANCE: f64 = 1e30;

/// A setting that is one of a few names, in the scene file and on the command line alike.
pub trait Choice: Copy + PartialEq + 'static {
    /// Every name with what it stands for.
    const CHOICES: &'static [(&'static str, Self)];

    /// The name of this choice.
    fn name(self) -> &'static str {
        Self::CHOICES
            .iter()
            .find(|(_, choice)| *choice == self)
            .map_or("", |(name, _)| name)
    }

    /// The choice of that name.
    fn from_name(name: &str) -> Option<Self> {
        Self::CHOICES
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, choice)| *choice)
    }
}

/// One value of the document.
#[derive(Clone)]
pub(crate) struct Node<'a> {
    source: &'a Source,
    value: &'a DeValue<'a>,
    offset: usize,
    label: String,
}

impl<'a> Node<'a> {
    fn new(source: &'a Source, value: &'a Spanned<DeValue<'a>>, label: String) -> Self {
        Self {
            source,
            value: value.get_ref(),
            offset: value.span().start,
            label,
        }
    }

    /// "problem; expected ...; mend", at this value.
    pub fn error(
        &self,
        problem: impl Display,
        expected: impl Display,
        mend: impl Display,
    ) -> SceneError {
        self.source.error(
            self.offset,
            format!("{problem}; expected {expected}; {mend}"),
        )
    }

    /// The value is of the right type and still impossible.
    pub fn impossible(&self, expected: impl Display) -> SceneError {
        let problem = format!("`{}` is {}", self.label, shown(self.value));
        self.error(problem, expected, "correct the value")
    }

    fn wrong_type(&self, expected: impl Display) -> SceneError {
        let problem = format!("`{}` is {}", self.label, type_name(self.value));
        self.error(problem, expected, "correct the value")
    }

    pub fn label(&self) -> &str {
        &self.label
    }

    pub fn string(&self) -> Result<&'a str> {
        self.value
            .as_str()
            .ok_or_else(|| self.wrong_type("a string in quotes"))
    }

    pub fn boolean(&self) -> Result<bool> {
        self.value
            .as_bool()
            .ok_or_else(|| self.wrong_type("true or false"))
    }

    pub fn is_string(&self) -> bool {
        self.value.is_str()
    }

    pub fn is_array(&self) -> bool {
        self.value.is_array()
    }

    /// Number of elements, of an array.
    pub fn len(&self) -> Option<usize> {
        self.value.as_array().map(|array| array.len())
    }

    /// A number that `accept` takes; `accept` must refuse NaN.
    pub fn number(&self, expected: &str, accept: impl Fn(f64) -> bool) -> Result<f64> {
        let number = match self.value {
            DeValue::Integer(integer) => i128::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|integer| integer as f64),
            DeValue::Float(float) => float.as_str().parse::<f64>().ok(),
            _ => return Err(self.wrong_type(expected)),
        };
        number
            .filter(|number| accept(*number))
            .ok_or_else(|| self.impossible(expected))
    }

    pub fn finite(&self) -> Result<f64> {
        self.number("a finite number of at most 1e15", is_finite)
    }

    pub fn positive(&self) -> Result<f64> {
        self.number("a finite number above 0", is_positive)
    }

    pub fn positive_or_infinite(&self) -> Result<f64> {
        self.number("a number above 0, or inf", |x| x > 0.0)
    }

    pub fn not_negative(&self) -> Result<f64> {
        self.number("a finite number of at least 0", is_not_negative)
    }

    /// From 0 to 1.
    pub fn unit(&self) -> Result<f32> {
        Ok(self.number("a number from 0 to 1", is_unit)? as f32)
    }

    pub fn integer(&self, least: u32, most: u32) -> Result<u32> {
        self.integer_described(
            least,
            most,
            &format!("a whole number from {least} to {most}"),
        )
    }

    pub fn integer_described(&self, least: u32, most: u32, expected: &str) -> Result<u32> {
        let DeValue::Integer(integer) = self.value else {
            return Err(self.wrong_type(expected));
        };
        u32::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .filter(|number| (least..=most).contains(number))
            .ok_or_else(|| self.impossible(expected))
    }

    /// The elements of an array of exactly N.
    pub fn elements<const N: usize>(&self, expected: &str) -> Result<[Node<'a>; N]> {
        let array = self
            .value
            .as_array()
            .ok_or_else(|| self.wrong_type(expected))?;
        let nodes: Vec<Node> = self.children(array.iter());
        let count = nodes.len();
        nodes.try_into().map_err(|_| {
            let problem = format!("`{}` has {count} elements", self.label);
            self.error(problem, expected, "correct the value")
        })
    }

    fn children(&self, values: impl Iterator<Item = &'a Spanned<DeValue<'a>>>) -> Vec<Node<'a>> {
        values
            .enumerate()
            .map(|(index, value)| Node::new(self.source, value, format!("{}[{index}]", self.label)))
            .collect()
    }

    /// N numbers, each of which `accept` takes.
    pub fn numbers<const N: usize>(
        &self,
        expected: &str,
        accept: impl Fn(f64) -> bool,
    ) -> Result<[f64; N]> {
        let elements = self.elements::<N>(&format!("{N} numbers in brackets"))?;
        let mut numbers = [0.0; N];
        for (number, element) in numbers.iter_mut().zip(&elements) {
            *number = element.number(expected, &accept)?;
        }
        Ok(numbers)
    }

    /// Finite numbers within [`MAX_MAGNITUDE`].
    pub fn vector<const N: usize>(&self) -> Result<[f64; N]> {
        self.numbers("a finite number of at most 1e15", is_finite)
    }

    /// A vector with a direction.
    pub fn nonzero_vector(&self) -> Result<[f64; 3]> {
        let vector = self.vector::<3>()?;
        // Squares of shorter vectors underflow in f32.
        if glam::DVec3::from(vector).length() < 1e-15 {
            return Err(self.error(
                format!("`{}` has no length", self.label),
                "a vector other than zero",
                "correct the value",
            ));
        }
        Ok(vector)
    }

    /// Linear RGB of at least 0.
    pub fn radiance(&self) -> Result<[f32; 3]> {
        let rgb = self.numbers::<3>("a number from 0 to 1e30", |x| {
            (0.0..=MAX_RADIANCE).contains(&x)
        })?;
        Ok(rgb.map(|channel| channel as f32))
    }

    pub fn choice<T: Choice>(&self) -> Result<T> {
        let names = T::CHOICES.iter().map(|(name, _)| *name);
        let name = self.string()?;
        T::from_name(name).ok_or_else(|| {
            self.error(
                format!("`{}` is {}", self.label, shown(self.value)),
                one_of(names.clone(), '"'),
                mend_name(name, names),
            )
        })
    }

    /// The file that this string names, relative to the scene file's folder, with the layer after it if one is named.
    pub fn existing_file(&self) -> Result<PathBuf> {
        let path = self.named_path()?;
        let (file, _) = split_layer(&path);
        if file.is_file() {
            self.source.files.borrow_mut().push(file);
            return Ok(path);
        }
        Err(self.error(
            format!("`{}` names no file: {}", self.label, path.display()),
            "a file, its path relative to the scene file's folder",
            "correct the path",
        ))
    }

    /// Where the files have to lie that a file which this string names may name itself.
    pub fn sandbox(&self) -> Option<&'a Sandbox> {
        self.source.sandbox.as_ref()
    }

    fn named_path(&self) -> Result<PathBuf> {
        let path = self.source.resolve(self.string()?);
        let (file, _) = split_layer(&path);
        match self.sandbox().and_then(|sandbox| sandbox.refusal(&file)) {
            Some(refusal) => {
                let message = format!("`{}` {refusal}", self.label);
                Err(self.source.error(self.offset, message))
            }
            None => Ok(path),
        }
    }

    /// Notes the file that this string names, if there is one: it is not read, but belongs to the scene.
    pub fn note_file(&self) -> Result<()> {
        let path = self.named_path()?;
        if path.is_file() {
            self.source.files.borrow_mut().push(path);
        }
        Ok(())
    }

    /// An error of a file that this string names; `problem` reads "problem; expected ...; how to mend".
    pub fn file_error(&self, path: &Path, problem: impl Display) -> SceneError {
        let message = format!("`{}` {}: {problem}", self.label, path.display());
        self.source.error(self.offset, message)
    }

    /// Warnings about a file that this string names, with its name before each.
    pub fn file_warnings(&self, notes: Vec<String>) -> impl Iterator<Item = String> {
        let name = self.value.as_str().unwrap_or_default();
        notes.into_iter().map(move |note| format!("{name}: {note}"))
    }

    /// This value as a table with these keys only.
    pub fn table(&self, title: &str, known: &'static [&'static str]) -> Result<Table<'a>> {
        let table = self.any_table(title)?;
        table.refuse_unknown(known)?;
        Ok(table)
    }

    /// This value as a table whose keys are checked later.
    pub fn any_table(&self, title: &str) -> Result<Table<'a>> {
        let entries = self
            .value
            .as_table()
            .ok_or_else(|| self.wrong_type(format!("a table: {title}")))?;
        Ok(Table {
            source: self.source,
            entries,
            offset: self.offset,
            title: title.to_owned(),
        })
    }
}

/// A table of the document.
pub(crate) struct Table<'a> {
    source: &'a Source,
    entries: &'a DeTable<'a>,
    offset: usize,
    title: String,
}

impl<'a> Table<'a> {
    pub fn root(source: &'a Source, entries: &'a DeTable<'a>) -> Self {
        Self {
            source,
            entries,
            offset: 0,
            title: "the scene file".to_owned(),
        }
    }

    /// Refuses the first key of the file that is not among `known`.
    pub fn refuse_unknown(&self, known: &[&'static str]) -> Result<()> {
        let unknown = self
            .entries
            .keys()
            .filter(|key| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        let Some(key) = unknown else { return Ok(()) };
        let name = key.get_ref();
        Err(self.source.error(
            key.span().start,
            format!(
                "unknown key `{name}` in {}; expected {}; {}",
                self.title,
                one_of(known.iter().copied(), '`'),
                mend_name(name, known.iter().copied()),
            ),
        ))
    }

    pub fn get(&self, key: &str) -> Option<Node<'a>> {
        self.entries
            .get(key)
            .map(|value| Node::new(self.source, value, key.to_owned()))
    }

    /// The place of a key (not of its value), for tables that must not be there.
    pub fn key_error(&self, key: &str, message: &str) -> Option<SceneError> {
        let (key, _) = self.entries.get_key_value(key)?;
        Some(self.source.error(key.span().start, message))
    }

    /// An error of the table as a whole, at its header.
    pub fn error(
        &self,
        problem: impl Display,
        expected: impl Display,
        mend: impl Display,
    ) -> SceneError {
        self.source.error(
            self.offset,
            format!("{problem}; expected {expected}; {mend}"),
        )
    }

    /// Reads a key if it is there.
    pub fn optional<T>(
        &self,
        key: &str,
        read: impl FnOnce(&Node<'a>) -> Result<T>,
    ) -> Result<Option<T>> {
        self.get(key).as_ref().map(read).transpose()
    }

    /// Reads a key that must be there; `example` shows it.
    pub fn required<T>(
        &self,
        key: &str,
        example: &str,
        read: impl FnOnce(&Node<'a>) -> Result<T>,
    ) -> Result<T> {
        match self.get(key) {
            Some(node) => read(&node),
            None => Err(self.error(
                format!("{} lacks `{key}`", self.title),
                format!("`{example}`"),
                "add it",
            )),
        }
    }

    /// Refuses two keys that say the same thing in two ways.
    pub fn refuse_both(&self, one: &str, other: &str) -> Result<()> {
        match (self.get(one), self.get(other)) {
            (Some(a), Some(b)) => {
                let later = if a.offset > b.offset { a } else { b };
                Err(later.error(
                    format!("`{one}` and `{other}` are both given"),
                    "one of them",
                    "remove one",
                ))
            }
            _ => Ok(()),
        }
    }

    /// A sub-table, if it is there.
    pub fn table(
        &self,
        key: &str,
        title: &str,
        known: &'static [&'static str],
    ) -> Result<Option<Table<'a>>> {
        self.optional(key, |node| node.table(title, known))
    }

    /// The entries of `[[key]]`, in order; empty if there is none.
    pub fn list(&self, key: &str) -> Result<Vec<Node<'a>>> {
        let Some(node) = self.get(key) else {
            return Ok(Vec::new());
        };
        let array = node
            .value
            .as_array()
            .ok_or_else(|| node.wrong_type(format!("a list of tables: [[{key}]]")))?;
        Ok(node.children(array.iter()))
    }
}

pub(crate) fn is_finite(x: f64) -> bool {
    x.abs() <= MAX_MAGNITUDE
}

pub(crate) fn is_positive(x: f64) -> bool {
    x > 0.0 && x <= MAX_MAGNITUDE
}

pub(crate) fn is_not_negative(x: f64) -> bool {
    (0.0..=MAX_MAGNITUDE).contains(&x)
}

pub(crate) fn is_unit(x: f64) -> bool {
    (0.0..=1.0).contains(&x)
}

fn type_name(value: &DeValue) -> &'static str {
    match value {
        DeValue::String(_) => "a string",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number with a fraction",
        DeValue::Boolean(_) => "a truth value",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "an array",
        DeValue::Table(_) => "a table",
    }
}

fn shown(value: &DeValue) -> String {
    let text = match value {
        DeValue::String(text) => format!("\"{text}\""),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.as_str().to_owned(),
        DeValue::Boolean(boolean) => boolean.to_string(),
        other => type_name(other).to_owned(),
    };
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}

/// "`a`, `b` or `c`".
fn one_of<'n>(names: impl Iterator<Item = &'n str>, quote: char) -> String {
    let quoted: Vec<String> = names.map(|name| format!("{quote}{name}{quote}")).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
        None => String::new(),
    }
}

/// Names the nearest known name where one is near enough to be meant.
fn mend_name<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> String {
    let nearest = known
        .map(|candidate| (strsim::damerau_levenshtein(name, candidate), candidate))
        .min();
    match nearest {
        Some((distance, candidate)) if distance <= 1 + candidate.len() / 3 => {
            format!("did you mean `{candidate}`?")
        }
        _ => "remove or rename it".to_owned(),
    }
}
