//! From pixels on the device to their sums in the film: batches planned, recorded, and continued where they are longer than was learnt.

use std::time::{Duration, Instant};

use super::GpuBackend;
use crate::film::Film;
use crate::gpu::GpuError;
use crate::gpu::lanes::{
    Batch, FOR_GENERATE, FOR_SHARE, FOR_STEP, FOR_SUM, Lanes, MOST_BATCHES, RecordsHead,
    read_records,
};
use crate::gpu::portion::Cursor;
use crate::gpu::profile::{ACCUMULATE, ADVANCE, BEGIN, END, GENERATE, SHARE, TRACE, TURN};
use crate::gpu::recording::{Dispatch, Recording, Stage, Workgroups};
use crate::gpu::slots::{Beside, Home, Slots};
use crate::work::{Pass, PixelWork, Place, RayCounts, Watcher};

/// No sample takes so many steps: at 64 bounces a difference chain with a path at each vertex stays under it.
const MOST_STEPS: usize = 100_000;
/// Sums come home at least this often, so that what ends a render, and a lost device, leave what there is.
const BETWEEN_SUMS: Duration = Duration::from_secs(8);
/// A lane's beginning and its end beside a step of it.
const BEGINNING_STEPS: f64 = 0.5;
const END_STEPS: f64 = 0.5;

/// What a call of [`GpuBackend::render`] does, and has done.
pub struct Job<'a> {
    pub film: &'a mut Film,
    pub pass: Pass,
    /// As of its list.
    pub is_first: bool,
    /// The sums of the portion began at 0 on the device.
    pub from_zero: bool,
    pub rays: &'a mut RayCounts,
    pub watcher: &'a Watcher<'a>,
    /// Rays of pixels that do not have all of their samples yet.
    pub rays_of_parts: RayCounts,
}

/// A dispatch of one thread, which looks at no queue.
fn one(kernel: usize) -> Dispatch {
    Dispatch {
        kernel,
        parity: 0,
        workgroups: Workgroups::One,
    }
}

/// A dispatch of as many workgroups as the device has written down.
fn at(kernel: usize, parity: usize, word: u32) -> Dispatch {
    Dispatch {
        kernel,
        parity,
        workgroups: Workgroups::At(word),
    }
}

/// Closes the batch that is done, and opens the next, whose lanes the next step reads; without effect while one is open.
fn beginning(parity: usize) -> [Dispatch; 2] {
    [one(BEGIN), at(GENERATE, 1 - parity, FOR_GENERATE)]
}

/// What a batch is to take: a beginning, steps, and an end. It has no effect on a batch that goes on from an earlier round but its steps and its end.
struct Round {
    lane_count: f64,
    steps: usize,
    /// Second vertices are shared.
    shares: bool,
}

impl Round {
    /// Records it, where a step takes so many steps of lanes; returns how many samples have come to their end meanwhile.
    fn record(
        &self,
        recording: &mut Recording,
        stage: &mut Stage<'_>,
        parity: &mut usize,
        lane_steps: impl Fn(usize) -> f64,
    ) -> Result<u64, GpuError> {
        let lanes = BEGINNING_STEPS * self.lane_count;
        let mut ended = recording.add(stage, &beginning(*parity), lanes)?;
        for step in 0..self.steps {
            let dispatches = [
                one(TURN),
                at(TRACE, *parity, FOR_STEP),
                at(ADVANCE, *parity, FOR_STEP),
            ];
            ended += recording.add(stage, &dispatches, lane_steps(step))?;
            *parity = 1 - *parity;
        }
        let end = [
            one(END),
            at(SHARE, 0, FOR_SHARE),
            at(ACCUMULATE, 0, FOR_SUM),
        ];
        let lanes = END_STEPS * self.lane_count;
        Ok(ended
            + match self.shares {
                true => recording.add(stage, &end, lanes)?,
                false => recording.add(stage, &[end[0], end[2]], lanes)?,
            })
    }
}

/// A batch of a recording: its samples, and how far the portion is once it is summed.
struct Planned {
    batch: Batch,
    /// That it might have.
    most_lanes: usize,
    samples: u64,
    after: Cursor,
}

impl GpuBackend {
    /// All samples of pixels that fit on the device together, from upload to film. If the watcher ends it, some pixels have theirs.
    pub(super) fn render_portion(
        &mut self,
        job: &mut Job<'_>,
        work: &[PixelWork],
    ) -> Result<(), GpuError> {
        let begun = self.places.begin();
        self.prepare_slots(work.len(), Beside::of(job.film))?;
        let Some(slots) = self.slots.take() else {
            return Err(GpuError::Lost("no room for sums".to_owned()));
        };
        slots.upload_work(&self.gpu, work);
        let begun = self.places.end(Place::List, begun);
        let mut before = self.gpu.device.create_command_encoder(&Default::default());
        let is_untouched = |work: &PixelWork| job.film.is_untouched(work.pixel as usize);
        let from_zero = job.is_first || work.iter().all(is_untouched);
        job.from_zero = from_zero;
        if from_zero {
            slots.clear_sums(&mut before, work.len());
        } else {
            slots.upload_sums(&self.gpu, job.film, work);
        }
        self.places.end(Place::Sums, begun);
        let outcome = self.render_slots(job, work, &slots, before);
        self.slots = Some(slots);
        outcome
    }

    /// The same, once work and sums are on the device; `before` has what precedes.
    fn render_slots(
        &mut self,
        job: &mut Job<'_>,
        work: &[PixelWork],
        slots: &Slots,
        mut before: wgpu::CommandEncoder,
    ) -> Result<(), GpuError> {
        let samples = work.iter().map(|work| u64::from(work.samples())).sum();
        let mut cursor = Cursor::default();
        loop {
            let lanes = self.pacer.lanes_for(samples);
            let lane_count = self.prepare_lanes(lanes)?;
            let Some(lanes) = self.lanes.take() else {
                return Err(GpuError::Lost("no room for samples".to_owned()));
            };
            let next = self.gpu.device.create_command_encoder(&Default::default());
            let encoder = std::mem::replace(&mut before, next);
            let outcome = self.bind(&lanes, slots).and_then(|()| {
                self.count_down_to_loss();
                let planned = self.plan(job, work, cursor, lane_count, slots.beside);
                self.run(job, work, &planned, cursor, (&lanes, slots), encoder)
            });
            self.lanes = Some(lanes);
            cursor = outcome?;
            let may_end = cursor.is_between_pixels() && job.watcher.is_cancelled();
            if cursor.slot == work.len() || may_end {
                return Ok(());
            }
        }
    }

    /// The batches of the next recording.
    fn plan(
        &self,
        job: &Job<'_>,
        work: &[PixelWork],
        mut cursor: Cursor,
        lanes: usize,
        beside: Beside,
    ) -> Vec<Planned> {
        let most = match self.pacer.is_trying() {
            true => 1,
            false => MOST_BATCHES,
        };
        let is_real = job.pass == Pass::Real;
        let mut planned = Vec::new();
        while planned.len() < most
            && let Some((batch, samples)) = cursor.next(work, lanes)
        {
            planned.push(Planned {
                batch: Batch {
                    real_pass: u32::from(is_real),
                    with_guides: u32::from(beside.guides && !is_real),
                    with_groups: u32::from(beside.groups && !is_real),
                    ..batch
                },
                most_lanes: lanes,
                samples,
                after: cursor,
            });
        }
        planned
    }

    /// Goes through what is planned, in one recording if the batches take as many steps as was learnt; returns how far the portion has come.
    fn run(
        &mut self,
        job: &mut Job<'_>,
        work: &[PixelWork],
        planned: &[Planned],
        from: Cursor,
        (lanes, slots): (&Lanes, &Slots),
        mut encoder: wgpu::CommandEncoder,
    ) -> Result<Cursor, GpuError> {
        let start = Instant::now();
        let batches: Vec<Batch> = planned.iter().map(|planned| planned.batch).collect();
        lanes.begin(&self.gpu, &batches, &mut encoder);
        let course = &mut self.courses[usize::from(job.pass == Pass::Real)];
        let mut stage = Stage {
            gpu: &self.gpu,
            kernels: &self.kernels,
            groups: &self.groups,
            indirect: &lanes.indirect,
            pacer: &mut self.pacer,
            profiler: &mut self.profiler,
            places: &mut self.places,
            warm: self.warm,
        };
        let shares = self.features.sharing && job.pass == Pass::Main;
        let mut recording = Recording::new(encoder);
        let mut steps = course.steps();
        let mut recorded_steps = 0;
        let mut to_run = planned.len();
        let mut after = from;
        let mut samples_left: u64 = planned.iter().map(|planned| planned.samples).sum();
        for (at, next) in planned.iter().enumerate() {
            let may_end = at > 0 && after.is_between_pixels() && job.watcher.is_cancelled();
            let are_small = (stage.pacer).affords_far_more(next.most_lanes, samples_left);
            if may_end || (at > 0 && (are_small || start.elapsed() > BETWEEN_SUMS)) {
                to_run = at;
                break;
            }
            let lane_count = f64::from(next.batch.lane_count);
            let round = Round {
                lane_count,
                steps,
                shares,
            };
            let lane_steps = |step| course.lane_steps(lane_count, step);
            let ended = round.record(&mut recording, &mut stage, &mut self.parity, lane_steps)?;
            job.watcher.taken(ended);
            recording.end_samples(next.samples);
            samples_left -= next.samples;
            recorded_steps += steps;
            after = next.after;
        }
        let planned = &planned[..to_run];
        let home = Home {
            batches: to_run,
            slots: from.slot..after.slot,
            from_zero: job.from_zero,
        };
        let mut records = Vec::new();
        let mut steps_in_vain = 0;
        loop {
            // Closes the last batch; if that went on in the place of the next, it opens the next, which has lanes from then on.
            let close = beginning(self.parity);
            let ended = recording.add(&mut stage, &close, 0.0)?;
            job.watcher.taken(ended);
            let ended = recording.finish(
                &mut stage,
                |encoder| slots.copy_home(encoder, &lanes.records, &home),
                || slots.wait(&self.gpu, &home),
            )?;
            job.watcher.taken(ended);
            stage.warm = true;
            let begun = stage.places.begin();
            let known = records.len();
            let (head, more): (RecordsHead, _) =
                slots.take_home(&self.gpu, job.film, work, &home, |bytes| {
                    let (head, records) = read_records(bytes, known);
                    (head.closed as usize == to_run, (head, records))
                })?;
            stage.places.end(Place::Sums, begun);
            records.extend(more);
            if records.len() == to_run {
                break;
            }
            // Longer than what was learnt: the device goes on where it is.
            steps_in_vain = if records.len() > known {
                0
            } else {
                steps_in_vain + steps
            };
            if steps_in_vain > MOST_STEPS {
                return Err(GpuError::Endless(steps_in_vain as u32));
            }
            let next = self.gpu.device.create_command_encoder(&Default::default());
            recording = Recording::new(next);
            for (at, next) in planned.iter().enumerate().skip(records.len()) {
                let is_open = at == records.len();
                let lane_count = f64::from(next.batch.lane_count);
                let alive = f64::from(head.lanes_alive);
                let round = Round {
                    lane_count,
                    steps,
                    shares,
                };
                // None of one that has just begun are counted yet.
                let lane_steps = |step| match is_open && alive > 0.0 {
                    true => alive / (1.0 + step as f64),
                    false => course.lane_steps(lane_count, step),
                };
                round.record(&mut recording, &mut stage, &mut self.parity, lane_steps)?;
                recorded_steps += steps;
            }
            steps *= 2;
        }
        self.warm = true;
        let needed: u32 = records.iter().map(|record| record.steps).sum();
        self.gpu
            .count_steps(recorded_steps as u64, u64::from(needed));
        for (planned, record) in planned.iter().zip(&records) {
            job.rays_of_parts += record.rays;
            if planned.after.is_between_pixels() {
                *job.rays += std::mem::take(&mut job.rays_of_parts);
            }
        }
        let lanes_of = planned.iter().map(|planned| planned.batch.lane_count);
        course.learn(lanes_of.zip(records));
        Ok(after)
    }
}
