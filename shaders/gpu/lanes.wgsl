// A batch of samples in flight: one lane each, its state in the arrays of cpu/state.wgsl, the lanes that still want a ray in a queue.

import package::shared::WORKGROUP;
import package::work::list::PixelWork;
import package::work::rays::SampleRays;
import package::film::groups::GroupSums;
import package::film::sums::{PixelSums, GuideSums};

// In their order; the one after the last has no lanes.
@group(1) @binding(0) var<storage, read> batches: array<Batch>;
// By slot.
@group(1) @binding(1) var<storage, read> work: array<PixelWork>;
@group(1) @binding(2) var<storage, read> queue_in: array<u32>;
@group(1) @binding(3) var<storage, read_write> queue_out: array<u32>;
@group(1) @binding(4) var<storage, read_write> counters: array<atomic<u32>, COUNTERS>;
@group(1) @binding(5) var<storage, read_write> indirect: array<u32, INDIRECT_WORDS>;
// By slot.
@group(1) @binding(6) var<storage, read_write> pixel_sums: array<PixelSums>;
@group(1) @binding(7) var<storage, read_write> guide_sums: array<GuideSums>;
@group(1) @binding(8) var<storage, read_write> group_sums: array<GroupSums>;
// How many batches are summed, how many lanes of the open one are alive, then a record of each that is summed.
@group(1) @binding(9) var<storage, read_write> records: array<u32>;

// The batch that is open. Kept in storage: some drivers compile a kernel anew before each dispatch where a uniform bounds a loop (Mesa's lavapipe).
fn current_batch() -> Batch {
    return batches[atomicLoad(&counters[COUNT_BEGUN]) - 1u];
}

// What is wanted of a lane's pixel.
fn work_of(lane: u32) -> PixelWork {
    let batch = current_batch();
    return work[batch.first_slot + lane % batch.pixel_count];
}

fn set_workgroups(place: u32, invocations: u32) {
    indirect[place] = (invocations + WORKGROUP - 1u) / WORKGROUP;
    indirect[place + 1u] = 1u;
    indirect[place + 2u] = 1u;
}

var<workgroup> appended: atomic<u32>;
var<workgroup> first_place: u32;

// Queues the lane for its next step if it is alive. All threads of the workgroup call it.
fn append(lane: u32, alive: bool, thread: u32) {
    if thread == 0u {
        atomicStore(&appended, 0u);
    }
    workgroupBarrier();
    var rank = 0u;
    if alive {
        rank = atomicAdd(&appended, 1u);
    }
    workgroupBarrier();
    if thread == 0u {
        first_place = atomicAdd(&counters[COUNT_OUT], atomicLoad(&appended));
    }
    workgroupBarrier();
    if alive {
        queue_out[first_place + rank] = lane;
    }
}

var<workgroup> counted: array<atomic<u32>, RAY_KINDS>;

// Counts rays that this thread has traced. All threads of the workgroup call it.
fn add_rays(rays: SampleRays, thread: u32) {
    if thread < RAY_KINDS {
        atomicStore(&counted[thread], 0u);
    }
    workgroupBarrier();
    if rays.primary > 0u { atomicAdd(&counted[0], rays.primary); }
    if rays.mixed > 0u { atomicAdd(&counted[1], rays.mixed); }
    if rays.real > 0u { atomicAdd(&counted[2], rays.real); }
    if rays.mixed_shadow > 0u { atomicAdd(&counted[3], rays.mixed_shadow); }
    if rays.real_shadow > 0u { atomicAdd(&counted[4], rays.real_shadow); }
    workgroupBarrier();
    if thread < RAY_KINDS {
        let sum = atomicLoad(&counted[thread]);
        if sum > 0u { atomicAdd(&counters[COUNT_RAYS + thread], sum); }
    }
}
