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
/// Of the time of a frame, what a picture that grows gets at least.
const REFINING: f64 = 0.2;
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
    /// Seconds of a composite over a photograph, running mean.
    composite: Option<f64>,
    /// Seconds that rays of a growing picture are given at least.
    least_secs: f64,
    /// Seconds that rays of a growing picture took beyond those that they were given, running mean.
    overrun: f64,
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
            composite: None,
            least_secs: REFINING * frame_secs,
            overrun: 0.0,
        }
    }

    /// By what the sides of the next frame's picture are divided, so that there is time for a ray per pixel of it.
    pub fn coarseness(&mut self) -> u32 {
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
        self.coarseness = finer.or_else(coarser).unwrap_or(self.coarsest);
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

    /// A composite over a photograph took so long.
    pub fn composited(&mut self, secs: f64) {
        let mean = self.composite.unwrap_or(secs);
        self.composite = Some(mean + NEWEST * (secs - mean));
    }

    /// Seconds for the rays of a picture that grows over frames, where so many of this frame have passed.
    pub fn left_at_rest(&self, spent_secs: f64) -> f64 {
        let after = self.costs.map_or(0.0, |costs| costs.after);
        let to_come = self.composite.unwrap_or(0.0) + after + self.overrun;
        let left = FILLED * self.frame_secs - spent_secs - to_come;
        left.max(self.least_secs)
    }

    /// Rays of a growing picture that were given so many seconds took so many. Where the time was over before the first of them, the next get more.
    pub fn refined(&mut self, given_secs: f64, secs: f64, any: bool) {
        if !any {
            self.least_secs *= 2.0;
        }
        self.overrun += NEWEST * ((secs - given_secs).max(0.0) - self.overrun);
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
        fn frame(self, budget: &mut RayBudget, pixels: u64) -> (u32, u32, f64) {
            let coarseness = budget.coarseness();
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
                self.frame(budget, pixels);
            }
            self.frame(budget, pixels)
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

    /// A view of which four times as much changes costs no more than its time from its second frame on.
    #[test]
    fn work_follows_the_view() {
        let machine = Machine {
            picture: 0.04,
            sample: 5e-7,
        };
        let mut budget = RayBudget::new(0.066, 64, 4);
        let (near, _, _) = machine.settled(&mut budget, PIXELS / 4);
        assert_eq!(near, 1);
        let (_, rays, late) = machine.frame(&mut budget, PIXELS);
        assert!(rays == 1 && late > 0.066, "{late}");
        let (coarseness, _, secs) = machine.frame(&mut budget, PIXELS);
        assert!(coarseness > 1 && secs < 0.066, "{coarseness} {secs}");
        assert_eq!(machine.frame(&mut budget, PIXELS).0, coarseness);
    }

    #[test]
    fn a_picture_that_grows_gets_what_is_left_of_a_frame_and_a_fifth_at_least() {
        let mut budget = RayBudget::new(0.1, 64, 4);
        assert!((budget.left_at_rest(0.02) - 0.07).abs() < 1e-9);
        budget.composited(0.03);
        assert!((budget.left_at_rest(0.02) - 0.04).abs() < 1e-9);
        budget.took(&LiveSeconds {
            write: 0.01,
            ..LiveSeconds::default()
        });
        assert!((budget.left_at_rest(0.02) - 0.03).abs() < 1e-9);
        assert!((budget.left_at_rest(0.2) - 0.02).abs() < 1e-9);
        (0..50).for_each(|_| budget.refined(0.02, 0.035, true));
        assert!((budget.left_at_rest(0.01) - 0.025).abs() < 1e-6, "overrun");
        budget.refined(0.02, 0.02, false);
        assert!((budget.left_at_rest(0.2) - 0.04).abs() < 1e-9, "none came");
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
                machine.frame(&mut budget, pixels).0
            })
            .collect();
        let changes = sizes.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(changes <= 1, "{sizes:?}");
    }
}
