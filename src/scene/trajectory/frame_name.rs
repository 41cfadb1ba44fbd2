//! Which frame is which: one rule for the files of a folder, the frames of a stream, and the names in a trajectory.
//!
//! The names of a folder are told apart together: all are time stamps, or all end in numbers, or all differ in one number alone, or they
//! have their order alone.

use super::EntryKey;

/// A frame as its source names it.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameName {
    /// "frame_0012.png", or "frame 12 of standard input".
    pub label: String,
    /// The file's path, `/` between folders; `None` in a stream.
    pub file: Option<String>,
    /// The number in the file's name; the place where names are time stamps or have no number, and in a stream.
    pub number: u32,
    /// From 0, among all frames of the source in their order.
    pub place: u32,
    /// The time stamp that is the file's name.
    pub time_secs: Option<f64>,
}

impl FrameName {
    /// The frame that an entry is of, as far as its key tells.
    pub(crate) fn of_key(key: &EntryKey) -> Self {
        let (label, file, number) = match key {
            EntryKey::Number(number) | EntryKey::Order(number) => {
                (format!("frame {number}"), None, *number)
            }
            EntryKey::Name(name) => (name.clone(), Some(name.clone()), 0),
        };
        Self {
            label,
            file,
            number,
            place: number,
            time_secs: None,
        }
    }

    /// Frame `number` of a stream.
    pub fn of_stream(number: u32, stream: &str) -> Self {
        Self {
            label: format!("frame {number} of {stream}"),
            file: None,
            number,
            place: number,
            time_secs: None,
        }
    }
}

/// What the names of one folder are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Naming {
    /// Times, so many a second.
    Stamps(f64),
    /// A number stands at the end of each.
    Numbers,
    /// They differ in this one of their numbers, from 0, and have nothing else but it in common.
    Inner(usize),
    /// Their order is all that they tell.
    Order,
}

/// Unix time from 2001 to 2096, seconds.
const EPOCH_SECS: std::ops::Range<f64> = 1e9..4e9;
/// Whole numbers that are this far apart or more are times, not numbers of frames.
const LEAST_STEP: u64 = 1000;
/// Steps from this on are nanoseconds, smaller ones microseconds: between a millisecond and a second either way.
const LEAST_STEP_NS: u64 = 1_000_000;

impl Naming {
    /// Of these file names.
    pub fn of<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Self {
        let stems = names.map(|name| stem(file_name(name)));
        let is_epoch = |stem| trailing_secs(stem).is_some_and(|t| EPOCH_SECS.contains(&t));
        let has_fraction = stems
            .clone()
            .any(|stem| is_fraction(&stem[before_secs(stem)..]));
        let are_secs = stems.clone().all(is_decimal) || stems.clone().all(is_epoch);
        if has_fraction && are_secs {
            return Self::Stamps(1.0);
        }
        let Some(mut numbers) = stems
            .clone()
            .map(trailing_digits)
            .collect::<Option<Vec<u64>>>()
        else {
            return Self::inner(stems);
        };
        let mut units = numbers.iter().map(|number| unit_of_epoch(*number));
        if let Some(Some(unit)) = units.next()
            && units.all(|other| other == Some(unit))
        {
            return Self::Stamps(unit);
        }
        numbers.sort_unstable();
        let least = numbers.windows(2).map(|pair| pair[1] - pair[0]).min();
        let are_whole = stems.clone().all(is_whole);
        match least.filter(|least| are_whole && *least >= LEAST_STEP) {
            Some(LEAST_STEP_NS..) => Self::Stamps(1e9),
            Some(_) => Self::Stamps(1e6),
            // They end alike, as with a size.
            None if least == Some(0) && Self::inner(stems.clone()) != Self::Order => {
                Self::inner(stems)
            }
            None if numbers.last().is_some_and(|n| u32::try_from(*n).is_ok()) => Self::Numbers,
            None => Self::Order,
        }
    }

    fn inner<'a>(mut stems: impl Iterator<Item = &'a str> + Clone) -> Self {
        let Some(first) = stems.next() else {
            return Self::Order;
        };
        let rest: Vec<&str> = stems.collect();
        let between = |stem: &'a str| {
            stem.split(|c: char| c.is_ascii_digit())
                .filter(|part| !part.is_empty())
        };
        if !rest.iter().all(|stem| between(stem).eq(between(first))) {
            return Self::Order;
        }
        let differs = |(place, run): &(usize, &str)| {
            rest.iter()
                .any(|stem| digit_runs(stem).nth(*place) != Some(run))
        };
        let mut different = digit_runs(first).enumerate().filter(differs);
        match (different.next(), different.next()) {
            (Some((place, _)), None) => Self::Inner(place),
            _ => Self::Order,
        }
    }

    /// Seconds, of a name that is a time stamp.
    pub fn time_secs(self, name: &str) -> Option<f64> {
        let Self::Stamps(unit) = self else {
            return None;
        };
        let stem = stem(file_name(name));
        match unit == 1.0 {
            true => trailing_secs(stem),
            false => Some(trailing_digits(stem)? as f64 / unit),
        }
    }

    /// The number in a name.
    pub fn number(self, name: &str) -> Option<u32> {
        match self {
            Self::Inner(place) => digit_runs(stem(file_name(name))).nth(place)?.parse().ok(),
            Self::Numbers => u32::try_from(trailing_digits(stem(file_name(name)))?).ok(),
            Self::Stamps(_) | Self::Order => None,
        }
    }

    /// These names in order: of time, of numbers, or of letters.
    pub fn sort<T>(self, named: &mut [(String, T)]) {
        named.sort_by(|(a, _), (b, _)| {
            let by_time = || {
                let (a, b) = (self.time_secs(a)?, self.time_secs(b)?);
                Some(a.total_cmp(&b))
            };
            let order = by_time().unwrap_or_else(|| self.number(a).cmp(&self.number(b)));
            order.then_with(|| a.cmp(b))
        });
    }
}

/// How many to a second, of a whole number that is Unix time in milli-, micro- or nanoseconds.
pub(super) fn unit_of_epoch(number: u64) -> Option<f64> {
    let units = [1e9, 1e6, 1e3];
    (units.into_iter()).find(|unit| EPOCH_SECS.contains(&(number as f64 / unit)))
}

pub(super) fn file_name(path: &str) -> &str {
    path.rsplit_once('/').map_or(path, |(_, name)| name)
}

/// Without the extension; what follows the point of a fraction is none.
pub(super) fn stem(file: &str) -> &str {
    match file.rsplit_once('.') {
        Some((stem, extension)) if !extension.bytes().all(|b| b.is_ascii_digit()) => stem,
        _ => file,
    }
}

fn is_whole(stem: &str) -> bool {
    !stem.is_empty() && stem.bytes().all(|b| b.is_ascii_digit())
}

fn is_fraction(stem: &str) -> bool {
    (stem.split_once('.')).is_some_and(|(whole, fraction)| is_whole(whole) && is_whole(fraction))
}

/// Of names of seconds some may be whole.
fn is_decimal(stem: &str) -> bool {
    is_whole(stem) || is_fraction(stem)
}

/// Where the number at the end of a name begins.
fn before_secs(stem: &str) -> usize {
    stem.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.')
        .len()
}

/// Seconds at the end of a name.
fn trailing_secs(stem: &str) -> Option<f64> {
    let number = &stem[before_secs(stem)..];
    is_decimal(number).then(|| number.parse().ok())?
}

fn digit_runs(stem: &str) -> impl Iterator<Item = &str> {
    let runs = stem.split(|c: char| !c.is_ascii_digit());
    runs.filter(|run| !run.is_empty())
}

fn trailing_digits(stem: &str) -> Option<u64> {
    let before = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    stem[before.len()..].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_times_numbers_or_in_order() {
        let naming = |names: &[&str]| Naming::of(names.iter().copied());
        assert_eq!(
            naming(&["0.000000.png", "0.033300.png"]),
            Naming::Stamps(1.0)
        );
        let some_whole = ["0.png", "0.0333.png", "0.0667.png", "1.png"];
        assert_eq!(naming(&some_whole), Naming::Stamps(1.0));
        assert_eq!(Naming::Stamps(1.0).time_secs("1.png"), Some(1.0));
        let ns = ["1403636579763555584.png", "1403636579813555456.png"];
        assert_eq!(naming(&ns), Naming::Stamps(1e9));
        let secs = naming(&ns).time_secs(ns[1]).expect("a stamp");
        assert!((secs - 1_403_636_579.813_555_5).abs() < 1e-6, "{secs}");
        assert_eq!(naming(&["left_1403636579763555.jpg"]), Naming::Stamps(1e6));
        assert_eq!(naming(&["1403636579763.jpg"]), Naming::Stamps(1e3));
        assert_eq!(
            naming(&["000000.png", "033300.png", "066700.png"]),
            Naming::Stamps(1e6)
        );
        assert_eq!(naming(&["0.png", "33300000.png"]), Naming::Stamps(1e9));
        assert_eq!(naming(&["0.png", "10.png", "20.png"]), Naming::Numbers);
        assert_eq!(
            naming(&["shot1.0001.exr", "shot1.0002.exr"]),
            Naming::Numbers
        );
        assert_eq!(
            naming(&["f_0000.png", "f_5000.png"]),
            Naming::Numbers,
            "not whole"
        );
        assert_eq!(naming(&["IMG_20260101123456.jpg"]), Naming::Order, "a date");
        assert_eq!(naming(&["a.png", "b.png"]), Naming::Order);
        assert_eq!(naming(&["9_rgb.png", "10_rgb.png"]), Naming::Inner(0));
        assert_eq!(
            naming(&["cam2 (1)-64x48.png", "cam2 (10)-64x48.png"]),
            Naming::Inner(1)
        );
        assert_eq!(
            naming(&["1_a2.png", "2_a1.png", "3_a1.png"]),
            Naming::Numbers,
            "two numbers differ"
        );
        assert_eq!(
            naming(&["1_a.png", "2_b.png"]),
            Naming::Order,
            "of two kinds"
        );
        let epoch = ["rgb_1403636579.963.png", "rgb_1403636580.013.png"];
        assert_eq!(naming(&epoch), Naming::Stamps(1.0));
        assert_eq!(naming(&epoch).time_secs(epoch[1]), Some(1_403_636_580.013));
    }

    #[test]
    fn numbers_without_leading_zeros_are_in_order() {
        let mut names = ["f_10.png", "f_9.png"].map(|name| (name.to_owned(), ()));
        Naming::Numbers.sort(&mut names);
        assert_eq!(names[0].0, "f_9.png");
        Naming::Order.sort(&mut names);
        assert_eq!(names[0].0, "f_10.png", "control");
    }
}
