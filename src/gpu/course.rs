//! How many steps batches take, and how many of their lanes are alive at each, learnt from those before.

use super::lanes::BatchRecord;

/// Steps of the first batches, of which nothing is known.
const FIRST_STEPS: usize = 8;
/// Share of the lanes alive that go on, where nothing is known.
const GO_ON: f64 = 0.7;

/// What batches of one kind came to.
#[derive(Debug)]
pub struct Course {
    /// Steps until all lanes of any batch were at their end.
    steps: usize,
    /// Share of the lanes that are alive at each step.
    alive: Vec<f64>,
}

impl Default for Course {
    fn default() -> Self {
        Self {
            steps: FIRST_STEPS,
            alive: Vec::new(),
        }
    }
}

impl Course {
    /// Steps to record for the next batch: one more than was needed lately, so that a frame seldom needs a second recording.
    pub fn steps(&self) -> usize {
        self.steps + 1
    }

    /// Steps of lanes that one step of `lanes` takes, `at` steps after they began.
    pub fn lane_steps(&self, lanes: f64, at: usize) -> f64 {
        let known = self.alive.len().saturating_sub(1);
        let share = self.alive.get(at.min(known)).copied().unwrap_or(1.0);
        lanes * share * GO_ON.powi(at.saturating_sub(known) as i32)
    }

    /// Learns from batches of so many lanes each; what was longer before is forgotten step by step.
    pub fn learn(&mut self, batches: impl Iterator<Item = (u32, BatchRecord)>) {
        let mut lanes = 0.0;
        let mut steps = 0;
        let mut alive = Vec::new();
        for (lane_count, record) in batches {
            lanes += f64::from(lane_count);
            steps = steps.max(record.steps as usize);
            let counted = record.alive.iter().take(record.steps as usize);
            for (at, &count) in counted.enumerate() {
                if at == alive.len() {
                    alive.push(0.0);
                }
                alive[at] += f64::from(count);
            }
        }
        if lanes == 0.0 {
            return;
        }
        alive.iter_mut().for_each(|count| *count /= lanes);
        let forgotten = match self.alive.is_empty() {
            true => 0,
            false => self.steps.saturating_sub(1),
        };
        self.steps = steps.max(forgotten);
        self.alive = alive;
        if self.alive.is_empty() {
            self.alive.push(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(alive: &[u32]) -> BatchRecord {
        let mut record = BatchRecord {
            steps: alive.len() as u32,
            ..BatchRecord::default()
        };
        record.alive[..alive.len()].copy_from_slice(alive);
        record
    }

    #[test]
    fn the_longest_batch_is_remembered_for_a_while() {
        let mut course = Course::default();
        assert_eq!(course.steps(), FIRST_STEPS + 1);
        course.learn([(100, record(&[80, 40])), (100, record(&[40, 20, 10]))].into_iter());
        assert_eq!(course.steps(), 4);
        let shares = [0, 1, 2].map(|at| course.lane_steps(200.0, at));
        assert_eq!(shares, [120.0, 60.0, 10.0]);
        assert!(course.lane_steps(200.0, 5) < 10.0);
        course.learn(std::iter::once((100, record(&[10]))));
        assert_eq!(course.steps(), 3, "one step shorter");
        course.learn(std::iter::empty());
        assert_eq!(course.steps(), 3, "nothing was learnt");
        course.learn(std::iter::once((100, record(&[]))));
        assert_eq!(course.lane_steps(200.0, 0), 0.0, "all ended at birth");
    }
}
