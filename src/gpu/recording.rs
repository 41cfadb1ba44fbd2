//! Dispatches on their way to the device: recorded until a submission has its time full, and submitted without waiting for the one before.

use std::collections::VecDeque;
use std::time::Instant;

use super::kernel::{BindGroups, Kernel};
use super::pacer::{Load, Pacer};
use super::profile::{KERNELS, Profiler};
use super::{GpuDevice, GpuError};
use crate::work::{Place, Places};

/// Submissions that the device has beside the one that it works on.
const AHEAD: usize = 1;

/// Workgroups of a dispatch.
#[derive(Clone, Copy, Debug)]
pub enum Workgroups {
    One,
    /// As many as a kernel has written there, in words of the buffer of indirect arguments.
    At(u32),
}

/// One dispatch of a submission.
#[derive(Clone, Copy, Debug)]
pub struct Dispatch {
    pub kernel: usize,
    pub parity: usize,
    pub workgroups: Workgroups,
}

/// What a recording runs on.
pub struct Stage<'a> {
    pub gpu: &'a GpuDevice,
    pub kernels: &'a [Kernel],
    /// By kernel and parity.
    pub groups: &'a [[BindGroups; 2]],
    pub indirect: &'a wgpu::Buffer,
    pub pacer: &'a mut Pacer,
    pub profiler: &'a mut Option<Profiler>,
    pub places: &'a mut Places,
    /// What is measured says something about speed: kernels are compiled.
    pub warm: bool,
}

struct Submitted {
    index: wgpu::SubmissionIndex,
    at: Instant,
    load: Load,
    samples: u64,
}

/// Commands that are not submitted yet, and submissions that are not known to have ended.
pub struct Recording {
    encoder: wgpu::CommandEncoder,
    dispatches: Vec<Dispatch>,
    load: Load,
    /// Samples that are at their end once these commands are.
    samples: u64,
    under_way: VecDeque<Submitted>,
    /// When the last submission ended that is known to have.
    free_since: Instant,
}

impl Recording {
    /// Goes on from commands that come before.
    pub fn new(encoder: wgpu::CommandEncoder) -> Self {
        Self {
            encoder,
            dispatches: Vec::new(),
            load: Load::default(),
            samples: 0,
            under_way: VecDeque::new(),
            free_since: Instant::now(),
        }
    }

    /// Dispatches that stay together, of so many steps of lanes. Submits what came before where there is no time for both; returns how many
    /// samples have come to their end meanwhile.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn add(
        &mut self,
        stage: &mut Stage<'_>,
        dispatches: &[Dispatch],
        lane_steps: f64,
    ) -> Result<u64, GpuError> {
        let more = Load {
            lane_steps,
            dispatches: dispatches.len(),
        };
        let mut ended = 0;
        if stage.pacer.is_full(self.load, more) {
            let next = stage.gpu.device.create_command_encoder(&Default::default());
            let full = std::mem::replace(&mut self.encoder, next);
            self.submit(stage, full)?;
            // While nothing is known of speed, nothing is submitted on trust.
            let ahead = match stage.pacer.is_cold() || stage.profiler.is_some() {
                true => 0,
                false => AHEAD,
            };
            while self.under_way.len() > ahead {
                ended += self.wait_for_first(stage)?;
            }
        }
        self.dispatches.extend_from_slice(dispatches);
        self.load = self.load + more;
        Ok(ended)
    }

    /// So many more samples are at their end after what was recorded.
    pub fn end_samples(&mut self, samples: u64) {
        self.samples += samples;
    }

    /// Submits the rest, with what `finish` adds to it, and waits for its end by `wait`; returns how many samples have come to their end
    /// since they were told the last time.
    ///
    /// # Errors
    /// [`GpuError::Lost`].
    pub fn finish(
        mut self,
        stage: &mut Stage<'_>,
        finish: impl FnOnce(&mut wgpu::CommandEncoder),
        wait: impl FnOnce() -> Result<(), GpuError>,
    ) -> Result<u64, GpuError> {
        let next = stage.gpu.device.create_command_encoder(&Default::default());
        let mut encoder = std::mem::replace(&mut self.encoder, next);
        let begun = stage.places.begin();
        self.encode(stage, &mut encoder);
        finish(&mut encoder);
        stage.gpu.count_recording();
        self.send(stage, encoder)?;
        let begun = stage.places.end(Place::Record, begun);
        wait()?;
        let mut ended = 0;
        let (mut at, mut load) = (Instant::now(), Load::default());
        for rest in self.under_way.drain(..) {
            ended += rest.samples;
            (at, load) = (at.min(rest.at), load + rest.load);
        }
        self.learn(stage, at, load);
        Self::take_times(stage)?;
        stage.places.end(Place::Wait, begun);
        Ok(ended)
    }

    fn submit(
        &mut self,
        stage: &mut Stage<'_>,
        mut encoder: wgpu::CommandEncoder,
    ) -> Result<(), GpuError> {
        let begun = stage.places.begin();
        self.encode(stage, &mut encoder);
        self.send(stage, encoder)?;
        stage.places.end(Place::Record, begun);
        Ok(())
    }

    fn send(&mut self, stage: &Stage<'_>, encoder: wgpu::CommandEncoder) -> Result<(), GpuError> {
        let at = Instant::now();
        let index = stage.gpu.submit(encoder, self.dispatches.len() as u64)?;
        self.dispatches.clear();
        self.under_way.push_back(Submitted {
            index,
            at,
            load: std::mem::take(&mut self.load),
            samples: std::mem::take(&mut self.samples),
        });
        Ok(())
    }

    /// Samples that have come to their end.
    fn wait_for_first(&mut self, stage: &mut Stage<'_>) -> Result<u64, GpuError> {
        let Some(first) = self.under_way.pop_front() else {
            return Ok(0);
        };
        let begun = stage.places.begin();
        stage.gpu.wait_for(&first.index)?;
        self.learn(stage, first.at, first.load);
        Self::take_times(stage)?;
        stage.places.end(Place::Wait, begun);
        Ok(first.samples)
    }

    /// What was submitted then has just ended.
    fn learn(&mut self, stage: &mut Stage<'_>, at: Instant, load: Load) {
        let now = Instant::now();
        if stage.warm {
            let took = now.duration_since(at.max(self.free_since));
            stage.pacer.record(took, load);
        }
        self.free_since = now;
    }

    fn take_times(stage: &mut Stage<'_>) -> Result<(), GpuError> {
        match stage.profiler {
            Some(profiler) => profiler.collect(stage.gpu),
            None => Ok(()),
        }
    }

    fn encode(&self, stage: &mut Stage<'_>, encoder: &mut wgpu::CommandEncoder) {
        let (kernels, groups, indirect) = (stage.kernels, stage.groups, stage.indirect);
        let run = |pass: &mut wgpu::ComputePass<'_>, dispatch: &Dispatch| {
            kernels[dispatch.kernel].set(pass, &groups[dispatch.kernel][dispatch.parity]);
            match dispatch.workgroups {
                Workgroups::One => pass.dispatch_workgroups(1, 1, 1),
                Workgroups::At(word) => {
                    pass.dispatch_workgroups_indirect(indirect, 4 * u64::from(word));
                }
            }
        };
        match stage.profiler {
            None => {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                for dispatch in &self.dispatches {
                    run(&mut pass, dispatch);
                }
            }
            Some(profiler) => {
                for dispatch in &self.dispatches {
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: Some(KERNELS[dispatch.kernel]),
                        timestamp_writes: profiler.around(dispatch.kernel),
                    });
                    run(&mut pass, dispatch);
                }
                profiler.resolve(encoder);
            }
        }
    }
}
