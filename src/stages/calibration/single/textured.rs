//! Levels at which even the flattest blocks hold texture.
//!
//! A camera's noise changes slowly with the level: its tone curve stretches dark levels and squeezes bright ones by degrees. A level whose blocks are far
//! more uneven than two levels near by allow has no flat block.

/// How much sigma may change over [`STEP_DN`] of the level and less: 1.1 to 1.25 in the averages of bursts of three cameras.
const CHANGE: f64 = 1.2;
const STEP_DN: f64 = 16.0;
/// How far above that a level's sigma has texture in all of its blocks.
const ABOVE: f64 = 1.4;

/// The levels of `sigmas` (by level, None: not measured) that are textured.
pub(super) fn levels(sigmas: &[Option<f64>]) -> Vec<usize> {
    let mut left = sigmas.to_vec();
    let mut textured = Vec::new();
    loop {
        // Once textured levels are left out, their neighbours may stand out.
        let found = standing_out(&left);
        if found.is_empty() {
            textured.sort_unstable();
            return textured;
        }
        for level in found {
            left[level] = None;
            textured.push(level);
        }
    }
}

fn standing_out(sigmas: &[Option<f64>]) -> Vec<usize> {
    let measured: Vec<(usize, f64)> = (sigmas.iter().enumerate())
        .filter_map(|(level, sigma)| Some((level, (*sigma)?)))
        .collect();
    let steps = 256.0 / sigmas.len() as f64 / STEP_DN;
    let bound = |level: usize| {
        let others: Vec<(usize, f64)> = (measured.iter().copied())
            .filter(|(other, _)| *other != level)
            .collect();
        // One level alone may be too smooth: JPEG flattens whole levels. Two neighbours hardly.
        let bounds = others.windows(2).map(|pair| {
            let away = pair[0].0.abs_diff(level).min(pair[1].0.abs_diff(level));
            pair[0].1.max(pair[1].1) * CHANGE.powf((steps * away as f64).max(1.0))
        });
        ABOVE * bounds.fold(f64::INFINITY, f64::min)
    };
    (measured.iter())
        .filter(|(level, sigma)| *sigma > bound(*level))
        .map(|(level, _)| *level)
        .collect()
}

/// Names textured levels of `count`.
pub(super) fn note(textured: &[usize], count: usize) -> Option<String> {
    let runs = textured.chunk_by(|a, b| a + 1 == *b);
    let names: Vec<String> = runs
        .map(|run| {
            let (first, last) = (run[0], run[run.len() - 1]);
            format!("{} to {}", first * 256 / count, (last + 1) * 256 / count)
        })
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "at intensity {} the photograph has texture in all of its parts; their noise is taken from other levels",
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn textured(sigmas: &[f64]) -> Vec<usize> {
        let sigmas: Vec<Option<f64>> = sigmas.iter().map(|s| (*s > 0.0).then_some(*s)).collect();
        levels(&sigmas)
    }

    /// Rows of sigma at sixteen levels; 0: not measured.
    #[test]
    fn runs_of_texture_stand_out_from_noise() {
        // A board of chips whose middle levels are dusty metal and print.
        let board = [
            1.6, 1.9, 5.7, 11.7, 15.7, 12.5, 8.3, 6.4, 1.8, 2.0, 1.9, 2.0, 2.2, 3.4, 0.0, 0.0,
        ];
        assert_eq!(textured(&board), [2, 3, 4, 5, 6, 7]);
        assert!(
            note(&textured(&board), 16).is_some_and(|text| text.contains("intensity 32 to 128 "))
        );
        // A burst's own sigma: nothing.
        let burst = [
            1.5, 0.0, 0.0, 0.0, 2.5, 0.0, 2.2, 1.9, 1.7, 1.5, 1.2, 1.0, 0.0, 0.0, 0.0, 0.0,
        ];
        assert!(textured(&burst).is_empty(), "control");
        // One level that JPEG has flattened does not make texture of its neighbours.
        let flattened = [
            0.0, 0.0, 0.0, 3.4, 3.6, 3.5, 3.0, 2.9, 0.6, 2.6, 2.4, 2.2, 2.0, 1.8, 0.4, 0.0,
        ];
        assert!(textured(&flattened).is_empty());
        // Texture beside texture does not hide in it.
        let toys = [
            0.0, 5.6, 2.5, 6.0, 2.8, 2.7, 7.1, 7.8, 7.4, 7.6, 6.4, 6.2, 1.2, 1.5, 1.8, 0.0,
        ];
        assert_eq!(textured(&toys), [1, 3, 6, 7, 8, 9, 10, 11]);
        // Four finer levels in place of each: the same.
        let fine: Vec<f64> = board.iter().flat_map(|s| [*s; 4]).collect();
        assert_eq!(textured(&fine), (8..32).collect::<Vec<_>>());
        assert!(note(&[], 16).is_none());
    }
}
