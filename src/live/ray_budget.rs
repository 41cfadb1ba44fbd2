//! How coarse a frame's picture is, and how many rays its pixels get, so that it fits into a frame's time.

use super::report::LiveSeconds;

/// Share that a new frame has in the running means.
const NEWEST: f64 = 0.2;
/// Of the time of a frame that is planned: frames differ.
const FILLED: f64 = 0.9;
/// Of the time of a frame, what a finer picture may be expected to take: it does not come and go from frame to frame.
const ROOMY: f64 = 0.75;
/// The most that the samples grow by from one frame to the next.
const GROWTH: f64 = 1.5;
/// Of what the whole picture takes beside its rays, what a coarser one takes for being enlarged.
const ENLARGING: f64 = 0.1;

/// Seconds of a frame, running means.
#[derive(Clone, Copy, Debug)]
struct Costs {
    /// Decoding and tracking, ...
    before: f64,
    /// ... stages and writing, whatever the picture's size.
    after: f64,
    /// Camera and pilot, ...
    edit: f64,
    /// ... filter and composite, of the whole picture.
    composite: f64,
    /// Of a sample.
    sample: f64,
}

impl Costs {
    fn mixed(self, new: Self) -> Self {
        let mean = |mean: f64, new: f64| mean + NEWEST * (new - mean);
        Self {
            before: mean(self.before, new.before),
            after: mean(self.after, new.after),
            edit: mean(self.edit, new.edit),
            composite: mean(self.composite, new.composite),
            sample: mean(self.sample, new.sample),
        }
    }
}

/// Of what the whole picture takes beside its rays, the share of one whose sides are divided by this.
fn share_of(coarseness: u32) -> f64 {
    let pixels = f64::from(coarseness).powi(-2);
    match coarseness {
        1 => pixels,
        _ => pixels + ENLARGING,
    }
}

/// Fits the next frame to what those before it took, and to what its own view is known to cost.
#[derive(Clone, Debug)]
pub struct RayBudget {
    frame_secs: f64,
    most: u32,
    coarsest: u32,
    coarseness: u32,
    costs: Option<Costs>,
    /// What one ray per pixel of the whole picture would have taken in the last frame.
    whole_samples: f64,
    /// Those that the last frame took.
    taken: f64,
}

impl RayBudget {
    /// Seconds for all that a frame needs; rays per pixel at most; the most that the picture's sides are divided by.
    pub fn new(frame_secs: f64, most: u32, coarsest: u32) -> Self {
        Self {
            frame_secs,
            most,
            coarsest: coarsest.max(1),
            coarseness: 1,
            costs: None,
            whole_samples: 0.0,
            taken: 0.0,
        }
    }

    /// By what the sides of the next frame's picture are divided, so that there is time for a ray per pixel of it; 1 where the camera rests.
    pub fn coarseness(&mut self, rests: bool) -> u32 {
        let fits = |coarseness: &u32, share: f64| {
            self.costs.is_none_or(|costs| {
                let samples = self.whole_samples / f64::from(coarseness.pow(2));
                let beside = (costs.edit + costs.composite) * share_of(*coarseness);
                let secs = costs.before + beside + costs.sample * samples + costs.after;
                secs <= share * self.frame_secs
            })
        };
        let finer = (1..self.coarseness).find(|finer| fits(finer, ROOMY));
        let coarser = || (self.coarseness..self.coarsest).find(|other| fits(other, FILLED));
        self.coarseness = match rests {
            true => 1,
            false => finer.or_else(coarser).unwrap_or(self.coarsest),
        };
        self.coarseness
    }

    /// Rays per pixel of this frame, at least one: a ray per pixel takes so many samples in its view, and so many seconds have passed.
    pub fn rays(&mut self, samples: u64, spent_secs: f64) -> u32 {
        let samples = samples as f64;
        self.whole_samples = samples * f64::from(self.coarseness.pow(2));
        let rays = self.costs.map_or(1.0, |costs| {
            let to_come = costs.composite * share_of(self.coarseness) + costs.after;
            let left = FILLED * self.frame_secs - spent_secs - to_come;
            let fitting = left / (costs.sample * samples).max(1e-9);
            let reachable = (GROWTH * self.taken / samples.max(1.0)).ceil();
            fitting.min(reachable)
        });
        let rays = (rays as u32).clamp(1, self.most);
        self.taken = f64::from(rays) * samples;
        rays
    }

    /// What the frame took.
    pub fn took(&mut self, seconds: &LiveSeconds) {
        let share = share_of(self.coarseness);
        let before = seconds.decode + seconds.track;
        let new = Costs {
            before,
            after: seconds.stages.total() + seconds.write,
            edit: seconds.edit / share,
            composite: seconds.composite / share,
            sample: match self.taken > 0.0 {
                true => seconds.render / self.taken,
                false => self.costs.map_or(0.0, |costs| costs.sample),
            },
        };
        self.costs = Some(self.costs.map_or(new, |costs| costs.mixed(new)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a frame takes: seconds of the whole picture beside its rays, and of a sample.
    #[derive(Clone, Copy)]
    struct Machine {
        picture: f64,
        sample: f64,
    }

    impl Machine {
        /// A frame in whose whole picture so many pixels change; coarseness, rays per pixel and seconds.
        fn frame(self, budget: &mut RayBudget, pixels: u64, rests: bool) -> (u32, u32, f64) {
            let coarseness = budget.coarseness(rests);
            let samples = pixels / u64::from(coarseness.pow(2));
            let share = share_of(coarseness);
            let mut seconds = LiveSeconds {
                decode: 0.005,
                edit: 0.4 * self.picture * share,
                composite: 0.6 * self.picture * share,
                ..LiveSeconds::default()
            };
            let rays = budget.rays(samples, seconds.decode + seconds.edit);
            seconds.render = self.sample * f64::from(rays) * samples as f64;
            budget.took(&seconds);
            (coarseness, rays, seconds.total())
        }

        /// The last of many.
        fn settled(self, budget: &mut RayBudget, pixels: u64) -> (u32, u32, f64) {
            for _ in 0..60 {
                self.frame(budget, pixels, false);
            }
            self.frame(budget, pixels, false)
        }
    }

    const PIXELS: u64 = 100_000;

    #[test]
    fn rays_fill_the_frame_and_no_more() {
        let quick = Machine {
            picture: 0.02,
            sample: 4e-8,
        };
        let settled = |frame_secs| quick.settled(&mut RayBudget::new(frame_secs, 64, 4), PIXELS);
        let (coarseness, rays, secs) = settled(0.066);
        assert_eq!((coarseness, rays), (1, 8));
        assert!(secs < 0.066, "{secs}");
        assert!(settled(0.132).1 > 2 * rays, "control: twice the time");
        let endless = Machine {
            picture: 0.0,
            sample: 1e-12,
        };
        assert_eq!(
            endless.settled(&mut RayBudget::new(0.066, 64, 4), PIXELS).1,
            64
        );
    }

    #[test]
    fn what_does_not_fit_is_coarser_and_no_coarser_than_it_may_be() {
        let slow = Machine {
            picture: 0.12,
            sample: 8e-7,
        };
        let settled = |coarsest| slow.settled(&mut RayBudget::new(0.066, 64, coarsest), PIXELS);
        let (coarseness, rays, secs) = settled(4);
        assert_eq!((coarseness, rays), (3, 3));
        assert!(secs < 0.066, "{secs}");
        let (coarseness, rays, secs) = settled(2);
        assert_eq!((coarseness, rays), (2, 1));
        assert!(secs > 0.066, "{secs}");
        assert!(settled(1).2 > 0.19, "control: the whole picture");
    }

    /// A view of which four times as much changes costs no more than its time from its second frame on; at rest the whole picture is shown.
    #[test]
    fn work_follows_the_view_and_rest_shows_the_whole_picture() {
        let machine = Machine {
            picture: 0.04,
            sample: 5e-7,
        };
        let mut budget = RayBudget::new(0.066, 64, 4);
        let (near, _, _) = machine.settled(&mut budget, PIXELS / 4);
        assert_eq!(near, 1);
        let (_, rays, late) = machine.frame(&mut budget, PIXELS, false);
        assert!(rays == 1 && late > 0.066, "{late}");
        let (coarseness, _, secs) = machine.frame(&mut budget, PIXELS, false);
        assert!(coarseness > 1 && secs < 0.066, "{coarseness} {secs}");
        assert_eq!(machine.frame(&mut budget, PIXELS, true).0, 1);
        assert_eq!(machine.frame(&mut budget, PIXELS, false).0, coarseness);
    }

    /// Where a finer picture nearly fits, its size does not change to and fro.
    #[test]
    fn the_size_stays_where_views_differ_a_little() {
        let machine = Machine {
            picture: 0.035,
            sample: 2e-7,
        };
        let mut budget = RayBudget::new(0.066, 64, 4);
        machine.settled(&mut budget, PIXELS);
        let sizes: Vec<u32> = (0..40)
            .map(|frame| {
                let pixels = PIXELS + PIXELS / 20 * (frame % 5);
                machine.frame(&mut budget, pixels, false).0
            })
            .collect();
        let changes = sizes.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(changes <= 1, "{sizes:?}");
    }
}
