//! `--against`: what became slower or worse.

use crate::bench::{Report, Verdict, against};
use crate::cli::{Failure, print, say};

/// Prints the comparison; true if something regressed.
pub(super) fn compare(report: &Report, earlier: &Report, tolerance: f64) -> Result<bool, Failure> {
    if report.machine != earlier.machine {
        say(
            "warning",
            "the two were measured on different machines or devices: their times say little of each other",
        );
    }
    let verdict = against(report, earlier, tolerance);
    if verdict.changes.is_empty() {
        return Err(Failure(
            "the two have no row in common: same scenes, sizes, methods and rays per pixel are compared"
                .to_owned(),
        ));
    }
    print(&comparison(&verdict, tolerance))?;
    let regressions: Vec<&str> = verdict
        .changes
        .iter()
        .filter(|change| change.is_regression())
        .map(|change| change.key.as_str())
        .collect();
    if regressions.is_empty() {
        return Ok(false);
    }
    say(
        "check failed",
        &format!("regression in {}", regressions.join("; ")),
    );
    Ok(true)
}

fn comparison(verdict: &Verdict, tolerance: f64) -> String {
    let mut out = String::from("\nnew over old:\n");
    for change in &verdict.changes {
        out += &format!(
            "{:7.3} x efficiency (at least {:.3})  {:7.3} x seconds  {:7.3} x RMSE  {}{}\n",
            change.efficiency,
            change.least,
            change.secs,
            change.rmse,
            change.key,
            if change.is_regression() {
                "  REGRESSION"
            } else {
                ""
            }
        );
    }
    for key in &verdict.not_compared {
        out += &format!("not compared: {key}\n");
    }
    out += &format!(
        "A regression is a fall of the efficiency, 1/(seconds x MSE), by more than 3 standard errors and {:.0}%; \
         the standard error comes from the standard deviation between runs, pooled over all rows: {:.1}%{}.\n",
        100.0 * tolerance,
        100.0 * verdict.spread,
        if verdict.spread_assumed {
            ", assumed: no row was run twice"
        } else {
            ""
        }
    );
    out
}
