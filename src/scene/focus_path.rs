//! `[[lens.motion]]`: where the lens is focused at times.

use super::error::Result;
use super::fingerprint::content;
use super::reader::Table;
use super::shutter::read_time;
use super::{EXPECTED_FOCUS, Lens, Scene};

/// Focus distances at times. Between two of them the dioptre, 1 / distance, goes at a constant rate; before the first and after the last the
/// focus rests. It stands still while the shutter is open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FocusPath {
    /// Seconds, rising, with metres along the view axis; infinity is legal.
    keys: Vec<(f64, f64)>,
}

content! {
    FocusPath { keys }
}

impl FocusPath {
    /// `keys` in any order.
    pub fn new(mut keys: Vec<(f64, f64)>) -> Self {
        keys.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self { keys }
    }

    /// The focus stays where `[lens]` says.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Metres; `None` without any key.
    pub fn distance_m(&self, time_secs: f64) -> Option<f64> {
        let after = self.keys.partition_point(|key| key.0 <= time_secs);
        let before = after.checked_sub(1).map(|i| self.keys[i]);
        match (before, self.keys.get(after)) {
            (None, None) => None,
            (None, Some(key)) => Some(key.1),
            (Some(key), None) => Some(key.1),
            (Some(a), Some(b)) if a.0 == time_secs || a.1 == b.1 => Some(a.1),
            (Some(a), Some(b)) => {
                let share = (time_secs - a.0) / (b.0 - a.0);
                Some(1.0 / ((1.0 - share) / a.1 + share / b.1))
            }
        }
    }
}

impl Scene {
    /// The lens as it is focused at a time.
    pub fn lens_at(&self, time_secs: f64) -> Lens {
        let focused = self.focus_path.distance_m(time_secs);
        Lens {
            focus_distance_m: focused.unwrap_or(self.lens.focus_distance_m),
            ..self.lens
        }
    }
}

/// The keys of `[lens]`, whose focal length is known.
pub(super) fn read_focus_path(root: &Table, lens: &Lens) -> Result<FocusPath> {
    let Some(table) = root.get("lens") else {
        return Ok(FocusPath::default());
    };
    let nodes = table.any_table("[lens]")?.list("motion")?;
    let keys = nodes.iter().map(|node| {
        let table = node.table("[[lens.motion]]", &["time_secs", "focus_distance_m"])?;
        let example = "focus_distance_m = 1.2";
        let distance_m = table.required("focus_distance_m", example, |node| {
            let distance_m = node.positive_or_infinite()?;
            match lens.focus_problem(distance_m) {
                Some(problem) => Err(node.error(problem, EXPECTED_FOCUS, "correct one of them")),
                None => Ok(distance_m),
            }
        })?;
        Ok((read_time(&table)?, distance_m))
    });
    Ok(FocusPath::new(keys.collect::<Result<_>>()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dioptre_goes_at_a_constant_rate_between_keys() {
        let path = FocusPath::new(vec![(2.0, 4.0), (1.0, 1.0), (3.0, f64::INFINITY)]);
        assert_eq!(path.distance_m(0.0), Some(1.0), "before the first");
        assert_eq!(path.distance_m(1.0), Some(1.0));
        // Halfway from 1 to a quarter.
        let between = path.distance_m(1.5).unwrap();
        assert!((between - 1.6).abs() < 1e-12, "{between}");
        assert_eq!(path.distance_m(2.5), Some(8.0), "on the way to infinity");
        assert_eq!(path.distance_m(9.0), Some(f64::INFINITY));
        assert_eq!(FocusPath::default().distance_m(1.0), None, "control");
    }
}
