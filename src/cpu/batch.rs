//! Samples in flight together: generate, trace and advance, one step of all of them at a time. What `shaders/gpu/kernels.wgsl` is to the GPU.
//!
//! A step traces the rays of all samples, then advances them stage by stage, so that code and branches stay warm. A sample's result does not
//! depend on what else is in flight.

use super::estimator::{advance, begin_sample};
use super::fetch::{fetch_triangles, fetch_vertices};
use super::in_flight::{InFlight, Member};
use super::request::answer;
use super::sharing::{gather, link_points};
use super::sharing_tile::{TILE_STRIDE, member_of, tile_of};
use super::state::{FIRST_NONE, PathState, STAGE_COUNT, STAGE_DONE, path_state};
use crate::packed::PackedScene;
use crate::work::SampleRays;

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
pub struct Batch {
    /// The first `len` are in flight; what comes after them has been, and is used again.
    samples: Vec<InFlight>,
    len: usize,
    waiting: Queues,
    /// Empty between two steps.
    advanced: Queues,
    /// Traces for what samples share.
    probe: PathState,
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            len: 0,
            waiting: Queues::default(),
            advanced: Queues::default(),
            probe: path_state(0, 0),
        }
    }
}

impl Batch {
    /// Samples in flight that are worth a run: their states fit the second-level cache.
    pub const WORTH: usize = 64;

    /// Begins a sample, as [`begin_sample`].
    pub fn generate(&mut self, scene: &PackedScene, pixel: u32, index: u32, real_pass: bool) {
        if self.len == self.samples.len() {
            let state = path_state(pixel, index);
            self.samples.push(InFlight { index, state });
        }
        let sample = &mut self.samples[self.len];
        sample.index = index;
        begin_sample(scene, &mut sample.state, pixel, index, real_pass);
        self.waiting[sample.state.path.stage as usize].push(self.len as u16);
        self.len += 1;
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// Takes all samples to their end.
    pub fn run(&mut self, scene: &PackedScene) {
        self.waiting[STAGE_DONE as usize].clear();
        while self.waiting.iter().any(|queue| !queue.is_empty()) {
            self.step(scene);
        }
        self.share(scene);
    }

    /// One ray of each sample that is not done, and what follows from it.
    fn step(&mut self, scene: &PackedScene) {
        let samples = &mut self.samples;
        for &slot in self.waiting.iter().flatten() {
            let state = &mut samples[usize::from(slot)].state;
            answer(scene, state);
            fetch_triangles(scene, state);
        }
        for queue in &mut self.waiting {
            for &slot in queue.iter() {
                fetch_vertices(scene, &samples[usize::from(slot)].state);
            }
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

    /// Shares second vertices between the samples of equal number in a tile. Samples of one number stand together, in
    /// ascending order of pixels.
    fn share(&mut self, scene: &PackedScene) {
        let width = scene.frame.width;
        let probe = &mut self.probe;
        let mut tiles = [const { Vec::new() }; (TILE_STRIDE * TILE_STRIDE) as usize];
        for samples in self.samples[..self.len].chunk_by_mut(|a, b| a.index == b.index) {
            for (slot, sample) in samples.iter().enumerate() {
                let state = &sample.state;
                if state.first.kept != FIRST_NONE {
                    let pixel = state.path.pixel;
                    let number = member_of(width, pixel);
                    let tile = tile_of(width, pixel) % (TILE_STRIDE * TILE_STRIDE);
                    tiles[tile as usize].push(Member { slot, number });
                }
            }
            for members in &mut tiles {
                let linked: Vec<_> = (members.iter())
                    .filter_map(|&from| {
                        Some((from, link_points(scene, samples, members, from, probe)?))
                    })
                    .collect();
                if !linked.is_empty() {
                    for &to in members.iter() {
                        let light = gather(samples, &linked, to);
                        samples[to.slot].state.result.radiance += light;
                    }
                }
                members.clear();
            }
        }
    }

    /// Rays that were traced for samples in common, since the last time.
    pub fn take_shared_rays(&mut self) -> SampleRays {
        std::mem::take(&mut self.probe.rays)
    }

    /// In the order in which they were begun.
    pub fn samples(&self) -> &[InFlight] {
        &self.samples[..self.len]
    }

    /// Makes room for others, once all are at their end.
    pub fn clear(&mut self) {
        self.len = 0;
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
        let mut batch = Batch::default();
        for real_pass in [false, true] {
            batch.clear();
            let wanted = (0..300).map(|i| (i * 10, i % 3));
            for (pixel, index) in wanted.clone() {
                batch.generate(&scene, pixel, index, real_pass);
            }
            batch.run(&scene);
            let alone: Vec<_> = wanted
                .map(|(pixel, index)| {
                    let mut state = path_state(pixel, index);
                    begin_sample(&scene, &mut state, pixel, index, real_pass);
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
