//! One benchmark against an earlier one, row by row.

use super::{Report, Row};

/// A fall of the efficiency counts once it is this many standard errors below what the spread between runs explains.
const STANDARD_ERRORS: f64 = 3.0;
/// Relative standard deviation between runs where no row was run twice.
const ASSUMED_SPREAD: f64 = 0.1;

/// How a row changed: new over old.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    pub key: String,
    /// Of 1 / (seconds x mean squared error).
    pub efficiency: f64,
    /// Of the seconds that the efficiency counts.
    pub secs: f64,
    pub rmse: f64,
    /// The least `efficiency` that is not a regression.
    pub least: f64,
}

impl Change {
    pub fn is_regression(&self) -> bool {
        self.efficiency < self.least
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    pub changes: Vec<Change>,
    /// Rows that only one of the two has, or whose error is lost in the reference's.
    pub not_compared: Vec<String>,
    /// Relative standard deviation of seconds x mean squared error between runs of a row, pooled over all rows of both.
    pub spread: f64,
    /// True: no row was run twice, so `spread` is an assumption.
    pub spread_assumed: bool,
}

/// Compares the rows that both have. A regression is a fall of the efficiency by more than `tolerance` (0.05: 5%) and three standard
/// errors of the difference together; the standard error comes from the spread between runs, pooled over the rows of both reports.
pub fn against(new: &Report, old: &Report, tolerance: f64) -> Verdict {
    let measured = pooled_spread(new.rows.iter().chain(&old.rows));
    let spread = measured.unwrap_or(ASSUMED_SPREAD);
    let mut changes = Vec::new();
    let mut not_compared = Vec::new();
    for row in &new.rows {
        let key = row.key();
        let before = old.rows.iter().find(|r| r.key() == key);
        let pair = before.and_then(|b| Some((b, row.efficiency?, b.efficiency?)));
        let Some((before, now, then)) = pair else {
            not_compared.push(key);
            continue;
        };
        let runs = |row: &Row| 1.0 / row.runs.len().max(1) as f64;
        let noise = STANDARD_ERRORS * spread * (runs(row) + runs(before)).sqrt();
        changes.push(Change {
            key,
            efficiency: now / then,
            secs: row.cost_secs() / before.cost_secs(),
            rmse: row.errors.all.rmse / before.errors.all.rmse,
            least: (-noise).exp() / (1.0 + tolerance),
        });
    }
    for row in &old.rows {
        let key = row.key();
        if !new.rows.iter().any(|r| r.key() == key) {
            not_compared.push(key);
        }
    }
    Verdict {
        changes,
        not_compared,
        spread,
        spread_assumed: measured.is_none(),
    }
}

/// Standard deviation of log(seconds x mean squared error) within rows; `None` if no row has two runs.
fn pooled_spread<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<f64> {
    let (mut squares, mut freedom) = (0.0, 0usize);
    for row in rows {
        let logs: Vec<f64> = row
            .runs
            .iter()
            .map(|run| {
                let secs = if row.cost == "wall" {
                    run.wall_secs
                } else {
                    run.cpu_secs
                };
                secs * run.mse
            })
            .filter(|product| *product > 0.0)
            .map(f64::ln)
            .collect();
        if logs.len() > 1 {
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            squares += logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>();
            freedom += logs.len() - 1;
        }
    }
    (freedom > 0).then(|| (squares / freedom as f64).sqrt())
}

#[cfg(test)]
mod tests;
