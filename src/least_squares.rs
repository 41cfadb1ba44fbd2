//! Levenberg's and Marquardt's method over whatever can be linearised and stepped.

/// A state whose cost is to be least.
pub trait Descending: Sized {
    type Linearised;

    fn cost(&self) -> f64;

    fn linearised(&self) -> Self::Linearised;

    /// The state one damped step on; `None`: the system is singular.
    fn stepped(&self, linearised: &Self::Linearised, damping: f64) -> Option<Self>;
}

/// How a descent goes, and when it ends.
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    pub steps: usize,
    pub first_damping: f64,
    pub least_damping: f64,
    /// Beyond it no step is found.
    pub most_damping: f64,
    /// A step that takes no larger share of the cost is the last.
    pub least_gain: f64,
}

impl Descent {
    /// The state at the minimum nearby, and its cost.
    pub fn from<T: Descending>(&self, start: T) -> (T, f64) {
        let mut state = start;
        let mut cost = state.cost();
        let mut damping = self.first_damping;
        for _ in 0..self.steps {
            let linearised = state.linearised();
            let is_done = loop {
                let trial = state.stepped(&linearised, damping);
                let trial_cost = trial.as_ref().map_or(f64::INFINITY, T::cost);
                if let Some(trial) = trial
                    && trial_cost < cost
                {
                    let is_done = cost - trial_cost < self.least_gain * cost;
                    state = trial;
                    cost = trial_cost;
                    damping = (damping * 0.1).max(self.least_damping);
                    break is_done;
                }
                damping *= 10.0;
                if damping > self.most_damping {
                    break true;
                }
            };
            if is_done {
                break;
            }
        }
        (state, cost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley: (1 - x)^2 + 100 (y - x^2)^2, least at (1, 1).
    #[derive(Clone, Copy)]
    struct Valley([f64; 2]);

    impl Descending for Valley {
        type Linearised = ([[f64; 2]; 2], [f64; 2]);

        fn cost(&self) -> f64 {
            let [x, y] = self.0;
            (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2)
        }

        fn linearised(&self) -> Self::Linearised {
            let [x, y] = self.0;
            let (errors, slopes) = (
                [1.0 - x, 10.0 * (y - x * x)],
                [[-1.0, 0.0], [-20.0 * x, 10.0]],
            );
            let sum = |i: usize, j: usize| (0..2).map(|k| slopes[k][i] * slopes[k][j]).sum();
            let right = |i: usize| -(0..2).map(|k| slopes[k][i] * errors[k]).sum::<f64>();
            (
                [[sum(0, 0), sum(0, 1)], [sum(1, 0), sum(1, 1)]],
                [right(0), right(1)],
            )
        }

        fn stepped(&self, (normal, right): &Self::Linearised, damping: f64) -> Option<Self> {
            let [a, d] = [0, 1].map(|k| normal[k][k] * (1.0 + damping));
            let b = normal[0][1];
            let determinant = a * d - b * b;
            (determinant != 0.0).then(|| {
                let x = (d * right[0] - b * right[1]) / determinant;
                let y = (a * right[1] - b * right[0]) / determinant;
                Self([self.0[0] + x, self.0[1] + y])
            })
        }
    }

    #[test]
    fn a_curved_valley_is_followed_to_its_end() {
        let descent = Descent {
            steps: 100,
            first_damping: 1e-3,
            least_damping: 1e-12,
            most_damping: 1e8,
            least_gain: 1e-12,
        };
        let (Valley([x, y]), cost) = descent.from(Valley([-1.2, 1.0]));
        assert!((x - 1.0).abs() < 1e-6 && (y - 1.0).abs() < 1e-6 && cost < 1e-12);
        let short = Descent {
            steps: 2,
            ..descent
        };
        assert!(short.from(Valley([-1.2, 1.0])).1 > 1e-3, "control");
    }
}
