//! The text of a headless script: one step a line, `#` begins a comment.

use std::path::PathBuf;

use super::gizmo::Handle;
use super::material_form::MaterialNumber;
use super::placement_number::PlacementNumber;
use super::quantity::Quantity;
use super::view::View;
use crate::scene::Choice;

/// A step and its line, from 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub number: usize,
    pub step: Step,
}

/// Positions are of the photograph, pixels, corner origin. Files are relative to the current folder.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Of the window, points.
    Size([f32; 2]),
    /// Pixels of a screenshot for a point.
    Scale(f32),
    Light,
    /// Until the picture of the present state has so many rays per pixel at full size; `None`: all of them.
    Wait(Option<u32>),
    Click([f64; 2]),
    Drag([f64; 2], [f64; 2]),
    /// An object by its name or number.
    Select(String),
    /// A handle of the selected object's gizmo is dragged by so many pixels.
    Pull(Handle, [f64; 2]),
    Wheel([f64; 2], f32, Held),
    /// The pointer rests there.
    Hover([f64; 2]),
    /// As the window names it: `W`, `Delete`.
    Key(String, Held),
    /// A button or label of that name is clicked.
    Press(String),
    Set(Quantity, f64),
    /// Of the material that the scene file gives an object.
    Material(String, MaterialNumber, f64),
    /// Of an object, or `focus`, at the present time.
    SetKey(String),
    DeleteKey(String),
    /// From one time to another, seconds.
    MoveKey(f64, f64, String),
    View(View),
    /// A number of where an object stands.
    Place(String, PlacementNumber, f64),
    /// As if it were dropped on the window, at a position or beside the picture.
    Drop(PathBuf, Option<[f64; 2]>),
    /// Of the video behind the scene, by its number.
    Frame(u32),
    /// Renders these frames of the saved scene, the end not included, to a folder or film, and waits.
    Range(u32, u32, PathBuf),
    Undo,
    Redo,
    Save,
    Reload,
    Expect(Expectation),
    /// Of the whole window, PNG.
    Screenshot(PathBuf),
    /// Of the picture alone, PNG.
    Picture(PathBuf),
    /// So many edits of each kind; prints their latency as a table.
    Measure(u32),
}

/// Keys that are down meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Held {
    #[default]
    Nothing,
    Shift,
    Control,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Expectation {
    /// Within a share of the value.
    Value(Quantity, f64, f64),
    /// Within a hundred thousandth.
    Material(String, MaterialNumber, f64),
    /// An object's translation, within metres.
    Position(String, [f64; 3], f64),
    /// The object's lowest point touches the real surface under it, within metres.
    Rests(String, f64),
    /// The times of all keys of an object, or of `focus`, seconds.
    Keys(String, Vec<f64>),
    /// The frame shown, by its number.
    Frame(u32),
    Saved,
    Unsaved,
    Problem,
    NoProblem,
    /// The file, rendered anew, gives the picture that is shown, bit for bit.
    FileEqualsWindow,
    FileDiffersFromWindow,
}

/// Reads a script.
///
/// # Errors
/// The first line that cannot be used, from 1, and why.
pub fn parse(text: &str) -> Result<Vec<Line>, (usize, String)> {
    let mut steps = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or("").trim();
        if line.is_empty() {
            continue;
        }
        let number = index + 1;
        let step = parse_step(line).map_err(|problem| (number, problem))?;
        steps.push(Line { number, step });
    }
    Ok(steps)
}

fn parse_step(line: &str) -> Result<Step, String> {
    let (verb, rest) = line.split_once(' ').unwrap_or((line, ""));
    let rest = rest.trim();
    let words: Vec<&str> = rest.split_whitespace().collect();
    Ok(match (verb, words.as_slice()) {
        ("size", [width, height]) => Step::Size([size(width)?, size(height)?]),
        ("scale", [scale]) => Step::Scale(number(scale)? as f32),
        ("light", []) => Step::Light,
        ("wait", ["complete"]) => Step::Wait(None),
        ("wait", ["rays", rays]) => Step::Wait(Some(count(rays)?)),
        ("click", [x, y]) => Step::Click([number(x)?, number(y)?]),
        ("hover", [x, y]) => Step::Hover([number(x)?, number(y)?]),
        ("drag", [x, y, "to", to_x, to_y]) => {
            Step::Drag([number(x)?, number(y)?], [number(to_x)?, number(to_y)?])
        }
        ("select", [_, ..]) => Step::Select(rest.to_owned()),
        ("pull", [handle, x, y]) => Step::Pull(choice(handle)?, [number(x)?, number(y)?]),
        ("wheel", [x, y, notches, keys @ ..]) => Step::Wheel(
            [number(x)?, number(y)?],
            number(notches)? as f32,
            held(keys)?,
        ),
        ("key", [name, keys @ ..]) => Step::Key((*name).to_owned(), held(keys)?),
        ("press", [_, ..]) => Step::Press(rest.to_owned()),
        ("set", [quantity, value]) => Step::Set(choice(quantity)?, number(value)?),
        ("material", [object, key, value]) => {
            Step::Material((*object).to_owned(), choice(key)?, number(value)?)
        }
        ("keyframe", ["set", _, ..]) => Step::SetKey(after(rest, 1)),
        ("keyframe", ["delete", _, ..]) => Step::DeleteKey(after(rest, 1)),
        ("keyframe", ["move", from, to, _, ..]) => {
            Step::MoveKey(number(from)?, number(to)?, after(rest, 3))
        }
        ("view", [view]) => Step::View(choice(view)?),
        ("object", [object, key, value]) => {
            Step::Place((*object).to_owned(), choice(key)?, number(value)?)
        }
        ("drop", [_, .., "at", x, y]) => {
            let file = rest.rsplitn(4, char::is_whitespace).last();
            let at = [number(x)?, number(y)?];
            Step::Drop(PathBuf::from(file.unwrap_or_default().trim_end()), Some(at))
        }
        ("drop", [_, ..]) => Step::Drop(PathBuf::from(rest), None),
        ("frame", [number]) => Step::Frame(whole(number)?),
        ("range", [from, to, _, ..]) => {
            Step::Range(whole(from)?, whole(to)?, PathBuf::from(after(rest, 2)))
        }
        ("undo", []) => Step::Undo,
        ("redo", []) => Step::Redo,
        ("save", []) => Step::Save,
        ("reload", []) => Step::Reload,
        ("expect", words) => Step::Expect(expectation(words)?),
        ("screenshot", [_, ..]) => Step::Screenshot(PathBuf::from(rest)),
        ("picture", [_, ..]) => Step::Picture(PathBuf::from(rest)),
        ("measure", [edits]) => Step::Measure(count(edits)?),
        _ => {
            return Err(format!(
                "`{line}`: no such step; expected one of those in docs/preview.md; correct the line"
            ));
        }
    })
}

fn expectation(words: &[&str]) -> Result<Expectation, String> {
    Ok(match words {
        ["rests", name, "within", distance] => {
            Expectation::Rests((*name).to_owned(), number(distance)?)
        }
        ["position", name, x, y, z, "within", distance] => {
            let point = [number(x)?, number(y)?, number(z)?];
            Expectation::Position((*name).to_owned(), point, number(distance)?)
        }
        ["material", object, key, value] => {
            Expectation::Material((*object).to_owned(), choice(key)?, number(value)?)
        }
        ["keyframes", name, times @ ..] => {
            let times = times.iter().map(|time| number(time));
            Expectation::Keys((*name).to_owned(), times.collect::<Result<_, _>>()?)
        }
        ["frame", number] => Expectation::Frame(whole(number)?),
        ["saved"] => Expectation::Saved,
        ["unsaved"] => Expectation::Unsaved,
        ["problem"] => Expectation::Problem,
        ["no-problem"] => Expectation::NoProblem,
        ["file-equals-window"] => Expectation::FileEqualsWindow,
        ["file-differs-from-window"] => Expectation::FileDiffersFromWindow,
        [quantity, value] => Expectation::Value(choice(quantity)?, number(value)?, 0.0),
        [quantity, value, "within", share] => {
            let percent = share.strip_suffix('%').ok_or_else(|| {
                format!("`{share}` has no unit; expected a share of the value; write 1%")
            })?;
            Expectation::Value(choice(quantity)?, number(value)?, number(percent)? / 100.0)
        }
        _ => {
            return Err(format!(
                "`expect {}`: no such expectation; expected one of those in docs/preview.md; correct the line",
                words.join(" ")
            ));
        }
    })
}

/// What follows so many words, spaces within it kept.
fn after(rest: &str, words: usize) -> String {
    let left = (0..words).fold(rest, |left, _| {
        let (_, left) = left.split_once(char::is_whitespace).unwrap_or_default();
        left.trim_start()
    });
    left.to_owned()
}

fn held(words: &[&str]) -> Result<Held, String> {
    match words {
        [] => Ok(Held::Nothing),
        ["shift"] => Ok(Held::Shift),
        ["ctrl"] => Ok(Held::Control),
        _ => Err(format!(
            "`{}`: no such key to hold; expected shift or ctrl; correct it",
            words.join(" ")
        )),
    }
}

fn choice<T: Choice + 'static>(word: &str) -> Result<T, String> {
    let found = T::CHOICES.iter().find(|(name, _)| *name == word);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = T::CHOICES.iter().map(|(name, _)| *name).collect();
        format!("`{word}`; expected one of {}; choose one", names.join(", "))
    })
}

fn number(word: &str) -> Result<f64, String> {
    let number = word.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| format!("`{word}`; expected a number; correct it"))
}

fn count(word: &str) -> Result<u32, String> {
    let number = word.parse().ok().filter(|number| *number > 0);
    number.ok_or_else(|| format!("`{word}`; expected a whole number above 0; correct it"))
}

fn whole(word: &str) -> Result<u32, String> {
    let number = word.parse().ok();
    number.ok_or_else(|| format!("`{word}`; expected a whole number; correct it"))
}

fn size(word: &str) -> Result<f32, String> {
    let points = number(word)?;
    match (64.0..=16384.0).contains(&points) {
        true => Ok(points as f32),
        false => Err(format!("`{word}`; expected 64 to 16384 points; correct it")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_read_with_their_lines() {
        let text = "# a walk\nclick 12 34.5\n\nset f_number 2.8 # wider\nexpect rests knot within 0.001\nwheel 1 2 -3 shift\nkeyframe move 0 1.5 the ball\ndrop a b.glb at 3 4\nexpect keyframes focus 0 2\n";
        let steps = parse(text).unwrap();
        let of = |number, step| Line { number, step };
        assert_eq!(
            steps,
            [
                of(2, Step::Click([12.0, 34.5])),
                of(4, Step::Set(Quantity::FNumber, 2.8)),
                of(
                    5,
                    Step::Expect(Expectation::Rests("knot".to_owned(), 0.001))
                ),
                of(6, Step::Wheel([1.0, 2.0], -3.0, Held::Shift)),
                of(7, Step::MoveKey(0.0, 1.5, "the ball".to_owned())),
                of(8, Step::Drop(PathBuf::from("a b.glb"), Some([3.0, 4.0]))),
                of(
                    9,
                    Step::Expect(Expectation::Keys("focus".to_owned(), vec![0.0, 2.0]))
                ),
            ]
        );
    }

    #[test]
    fn what_is_no_step_is_refused_with_its_line() {
        for (text, line) in [
            ("undo\njump", 2),
            ("click 1", 1),
            ("set f_number wide", 1),
            ("set depth 3", 1),
            ("expect f_number 2 within 1", 1),
            ("size 1 1", 1),
            ("wheel 1 2 3 alt", 1),
            ("keyframe move 1 ball", 1),
            ("expect keyframes ball soon", 1),
        ] {
            let (number, problem) = parse(text).unwrap_err();
            assert_eq!(number, line, "{text}");
            assert!(problem.contains("expected"), "{problem}");
        }
    }
}
