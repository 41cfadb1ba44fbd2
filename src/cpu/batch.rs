//! Samples in flight together: generate, trace and advance, one step of all of them at a time. What `shaders/gpu/kernels.wgsl` is to the GPU.
//!
//! A step traces the rays of all samples, then advances them stage by stage, so that code and branches stay warm. A sample's result does not
//! depend on what else is in flight.

use super::estimator::{advance, begin_sample};
use super::request::answer;
use super::state::{PathState, STAGE_COUNT, STAGE_DONE};
use crate::packed::PackedScene;

/// Places of samples in a batch, by the stage that they are in.
type Queues = [Vec<u16>; STAGE_COUNT as usize];

/// Takes one sample to its end by itself: the order of steps that a batch leaves results independent of.
pub fn run_alone(scene: &PackedScene, state: &mut PathState) {
    while state.path.stage != STAGE_DONE {
        answer(scene, state);
        advance(scene, state);
    }
}

/// Samples in flight.
#[derive(Default)]
pub struct Batch {
    samples: Vec<InFlight>,
    waiting: Queues,
    /// Empty between two steps.
    advanced: Queues,
}

/// One of them.
pub struct InFlight {
    /// Among the pixel's samples: not [`super::state::Path::index`] where the pixel's differences take turns.
    pub index: u32,
    pub state: PathState,
}

impl Batch {
    /// Samples in flight that are worth a run: their states fit the second-level cache.
    pub const WORTH: usize = 64;

    /// Begins a sample, as [`begin_sample`].
    pub fn generate(&mut self, scene: &PackedScene, pixel: u32, index: u32, real_pass: bool) {
        let slot = self.samples.len() as u16;
        let state = begin_sample(scene, pixel, index, real_pass);
        self.waiting[state.path.stage as usize].push(slot);
        self.samples.push(InFlight { index, state });
    }

    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Takes all samples to their end.
    pub fn run(&mut self, scene: &PackedScene) {
        self.waiting[STAGE_DONE as usize].clear();
        while self.waiting.iter().any(|queue| !queue.is_empty()) {
            self.step(scene);
        }
    }

    /// One ray of each sample that is not done, and what follows from it.
    fn step(&mut self, scene: &PackedScene) {
        let samples = &mut self.samples;
        for &slot in self.waiting.iter().flatten() {
            answer(scene, &mut samples[usize::from(slot)].state);
        }
        for queue in &mut self.waiting {
            for slot in queue.drain(..) {
                let state = &mut samples[usize::from(slot)].state;
                advance(scene, state);
                if state.path.stage != STAGE_DONE {
                    self.advanced[state.path.stage as usize].push(slot);
                }
            }
        }
        std::mem::swap(&mut self.waiting, &mut self.advanced);
    }

    /// In the order in which they were begun.
    pub fn samples(&self) -> &[InFlight] {
        &self.samples
    }

    /// Makes room for others, once all are at their end.
    pub fn clear(&mut self) {
        self.samples.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::render::test_scene;
    use crate::packed::{FRAME_AOVS, SAMPLER_SOBOL};

    /// Another seed, and another answer: a sample that took its neighbour's would be noticed.
    #[test]
    fn a_batch_gives_the_bits_of_samples_taken_alone() {
        let mut scene = test_scene();
        scene.frame.flags |= FRAME_AOVS;
        assert_eq!(scene.frame.sampler, SAMPLER_SOBOL);
        let found = |state: &PathState| {
            let radiance = state.result.radiance.to_array().map(f32::to_bits);
            let depth = state.first_hit.depth_m.to_bits();
            (radiance, state.result.mask, depth, state.rays)
        };
        for real_pass in [false, true] {
            let mut batch = Batch::default();
            let wanted = (0..300).map(|i| (i * 10, i % 3));
            for (pixel, index) in wanted.clone() {
                batch.generate(&scene, pixel, index, real_pass);
            }
            batch.run(&scene);
            let alone: Vec<_> = wanted
                .map(|(pixel, index)| {
                    let mut state = begin_sample(&scene, pixel, index, real_pass);
                    run_alone(&scene, &mut state);
                    found(&state)
                })
                .collect();
            let together: Vec<_> = (batch.samples().iter())
                .map(|sample| found(&sample.state))
                .collect();
            assert_eq!(together, alone);
            let first = alone[0];
            assert!(alone.iter().any(|&other| other != first), "control");
        }
    }
}
