//! The few lines that a render ends with.

use crate::output::Target;
use crate::renderer::{Filter, Renderer, SCRAMBLES, Stated, Stats};

/// `to_goal`: the render could end before its rays were spent. `moved`: by the robust combination.
pub(super) fn text(
    renderer: &mut Renderer,
    stats: &Stats,
    targets: &[Target],
    to_goal: bool,
    moved: Option<f64>,
) -> String {
    let backdrop_share = renderer.backdrop_share();
    let film = renderer.film();
    let rays = match renderer.stated() {
        Some(stated) => format!(
            "{:.1} rays per pixel on average",
            stated.mean_rays_per_pixel
        ),
        None => format!("{} rays per pixel", renderer.samples()),
    };
    let mut out = String::new();
    for target in targets {
        out += &format!(
            "picture {} ({} x {}, {rays})\n",
            target.path().display(),
            film.width,
            film.height,
        );
    }
    let error = match renderer.stated() {
        Some(stated) => from_scrambles(stated, to_goal),
        None => format!(
            "{:.2e} RMS, linear: an upper estimate, from the variance of the samples",
            stats.error.rms
        ),
    };
    out += &lines(stats, &error);
    if let Some(share) = backdrop_share {
        out += &format!(
            "photo   {:.0}% of the light of virtual pixels is the photograph's, seen where nothing is modelled ([photo] backdrop)\n",
            100.0 * share
        );
    }
    out += &moved.map(combination).unwrap_or_default();
    out += match renderer.filter() {
        Some(Filter::Preview) => {
            "filter  the difference on diffuse real surfaces is smoothed, a bias; the error is that before the filter\n"
        }
        Some(Filter::Final) => {
            "filter  the difference in real pixels is filtered, a bias; the error is that before the filter\n"
        }
        None => "",
    };
    out
}

/// How much light the robust combination took.
pub(super) fn combination(moved: f64) -> String {
    format!(
        "combine {:.2}% of the change in real pixels was noise, and is spread over their neighbourhood (--combine mean leaves it)\n",
        100.0 * moved
    )
}

fn from_scrambles(stated: &Stated, to_goal: bool) -> String {
    let short = if stated.scrambles < SCRAMBLES {
        " (ended early: too few to trust)"
    } else {
        ""
    };
    let above = match to_goal {
        true => format!(
            "; {} of {} tiles stay above the goal",
            stated.tiles_above_goal, stated.tiles
        ),
        false => String::new(),
    };
    format!(
        "{:.2e} RMS, linear: a standard error, from {} independent scrambles{short}{above}",
        stated.rms(),
        stated.scrambles
    )
}

fn lines(stats: &Stats, error: &str) -> String {
    let s = &stats.seconds;
    let r = &stats.rays;
    let p = &stats.pixels;
    let pixels = (p.background + p.edge + p.virtual_ + p.skipped).max(1) as f64;
    let share = |count: u64| format!("{:.1}%", 100.0 * count as f64 / pixels);
    let traced = r.mixed + r.real + r.mixed_shadow + r.real_shadow;
    let rate = if s.render > 0.0 {
        traced as f64 / s.render / 1e6
    } else {
        0.0
    };
    format!(
        "time    {:.2} s: load {:.2}, build {:.2}, compile {:.2}, look ahead {:.2}, render {:.2}, write {:.2}\n\
         rays    {} primary, {} in all: mixed {}, real {}, mixed shadow {}, real shadow {}; {rate:.2} Mrays/s on {} ({})\n\
         pixels  {} skipped, {} background, {} edge, {} virtual\n\
         error   {error}\n",
        s.load + s.build + s.compile + s.look_ahead + s.render + s.write,
        s.load,
        s.build,
        s.compile,
        s.look_ahead,
        s.render,
        s.write,
        short(r.primary),
        short(traced),
        short(r.mixed),
        short(r.real),
        short(r.mixed_shadow),
        short(r.real_shadow),
        stats.device,
        stats.backend,
        share(p.skipped),
        share(p.background),
        share(p.edge),
        share(p.virtual_),
    )
}

/// 1234567 as "1.23 M".
fn short(count: u64) -> String {
    match count {
        0..10_000 => count.to_string(),
        10_000..10_000_000 => format!("{:.2} M", count as f64 / 1e6),
        10_000_000..10_000_000_000 => format!("{:.1} M", count as f64 / 1e6),
        _ => format!("{:.1} G", count as f64 / 1e9),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_short() {
        assert_eq!(short(9999), "9999");
        assert_eq!(short(1_234_567), "1.23 M");
        assert_eq!(short(123_456_789), "123.5 M");
        assert_eq!(short(12_345_678_901), "12.3 G");
    }
}
