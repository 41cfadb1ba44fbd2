// The kernels of the wavefront: samples begin, ask for rays, are answered, and are summed. One step of a path a dispatch, so that no
// invocation runs long and the lanes that are done make room.
//
// The host records rounds without knowing how far the device comes: begin, generate, steps, end, share, accumulate. A batch that is not at its end
// after the steps of its round goes on in the next, in which no other begins.

import package::gpu::buffers::frame;
import package::shared::WORKGROUP;
import package::cpu::estimator::{advance, begin_sample, evaluation};
import package::film::groups::group_add;
import package::film::sums::{guide_add, pixel_add, pixel_add_real};
import package::gpu::lanes::{
    add_rays, append, batches, counters, current_batch, group_sums, guide_sums, pixel_sums, queue_in, records, set_workgroups, work,
    ALIVE_TURNS, COUNT_ALIVE, COUNT_BEGUN, COUNT_IN, COUNT_IS_DONE, COUNT_IS_OPEN, COUNT_OUT, COUNT_RECORD, COUNT_STEPS, COUNT_TURNS,
    FOR_GENERATE, FOR_SHARE, FOR_STEP, FOR_SUM, RECORDS_HEAD, RECORD_WORDS,
};
import package::shared::NONE;
import package::cpu::request::answer;
import package::work::rays::SampleRays;
import package::cpu::state::{
    FAR, FIRST_NONE, PathResult, PathState, REQUEST_CLOSEST_REAL, STAGE_DONE, path_first_hits, path_hits, path_radiances_real, path_rays,
    path_results, path_state, paths, POINTS, POINT_NONE, path_firsts, path_points,
};
import package::cpu::sharing::{gather, link_points};

// Closes the batch that was summed, and opens the next one unless one is open.
@compute @workgroup_size(1)
fn kernel_begin() {
    if atomicLoad(&counters[COUNT_IS_DONE]) != 0u {
        let first = RECORDS_HEAD + records[0] * RECORD_WORDS;
        for (var word = 0u; word < RECORD_WORDS; word++) {
            records[first + word] = atomicLoad(&counters[COUNT_RECORD + word]);
        }
        records[0] += 1u;
        atomicStore(&counters[COUNT_IS_DONE], 0u);
        atomicStore(&counters[COUNT_IS_OPEN], 0u);
    }
    var lanes = 0u;
    if atomicLoad(&counters[COUNT_IS_OPEN]) == 0u {
        let begun = atomicLoad(&counters[COUNT_BEGUN]);
        lanes = batches[begun].lane_count;
        if lanes > 0u {
            atomicStore(&counters[COUNT_BEGUN], begun + 1u);
            atomicStore(&counters[COUNT_IS_OPEN], 1u);
            for (var word = 0u; word < RECORD_WORDS; word++) { atomicStore(&counters[COUNT_RECORD + word], 0u); }
        }
    }
    records[1] = atomicLoad(&counters[COUNT_OUT]);
    set_workgroups(FOR_GENERATE, lanes);
}

@compute @workgroup_size(WORKGROUP)
fn kernel_generate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let lane = id.x;
    let batch = current_batch();
    var alive = false;
    var rays: SampleRays;
    if lane < batch.lane_count {
        @if(sharing) {
            path_firsts[lane].kept = FIRST_NONE;
            path_firsts[lane].cone_probability = 0.0;
            path_firsts[lane].bsdf_probability = 0.0;
            for (var kind = 0u; kind < POINTS; kind++) { path_points[lane][kind].strength = 0.0; }
            path_firsts[lane].capture = POINT_NONE;
        }
        let item = work[batch.first_slot + lane % batch.pixel_count];
        let index = item.first + batch.sample_offset + lane / batch.pixel_count;
        if index < item.end {
            let st = begin_sample(lane, item.pixel, index, batch.real_pass != 0u);
            rays = st.rays;
            path_results[lane] = PathResult(vec3<f32>(0.0), 0u);
            @if(paper) { path_radiances_real[lane] = vec3<f32>(0.0); }
            if batch.with_guides != 0u {
                path_first_hits[lane].depth_m = FAR;
            }
            alive = st.path.stage != STAGE_DONE;
            if alive {
                path_rays[lane] = st.ray;
                path_hits[lane] = st.hits;
                paths[lane] = st.path;
            }
        }
    }
    append(lane, alive, thread);
    add_rays(rays, thread);
}

// The queue that was written becomes the one that is read.
@compute @workgroup_size(1)
fn kernel_turn() {
    let count = atomicLoad(&counters[COUNT_OUT]);
    atomicStore(&counters[COUNT_IN], count);
    atomicStore(&counters[COUNT_OUT], 0u);
    if count > 0u {
        let turn = atomicAdd(&counters[COUNT_TURNS], 1u);
        if turn < ALIVE_TURNS { atomicStore(&counters[COUNT_ALIVE + turn], count); }
        atomicAdd(&counters[COUNT_STEPS], count);
    }
    set_workgroups(FOR_STEP, count);
}

@compute @workgroup_size(WORKGROUP)
fn kernel_trace(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    var st: PathState;
    if id.x < atomicLoad(&counters[COUNT_IN]) {
        let lane = queue_in[id.x];
        st.lane = lane;
        st.ray = path_rays[lane];
        answer(&st, thread);
        path_hits[lane].in_real = st.hits.in_real;
        // A request for the real hit alone leaves the other as it was: it need not be read for that.
        if st.ray.request != REQUEST_CLOSEST_REAL {
            path_hits[lane].in_virtual = st.hits.in_virtual;
        }
    }
    add_rays(st.rays, thread);
}

@compute @workgroup_size(WORKGROUP)
fn kernel_advance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    var st: PathState;
    var alive = false;
    if id.x < atomicLoad(&counters[COUNT_IN]) {
        let lane = queue_in[id.x];
        st.lane = lane;
        st.ray = path_rays[lane];
        st.hits = path_hits[lane];
        st.path = paths[lane];
        advance(&st);
        alive = st.path.stage != STAGE_DONE;
        if alive {
            path_rays[lane] = st.ray;
            paths[lane] = st.path;
        }
    }
    append(st.lane, alive, thread);
}

// After the steps of a round: the batch is summed if all of its samples are at their end.
@compute @workgroup_size(1)
fn kernel_end() {
    var lanes = 0u;
    var pixels = 0u;
    if atomicLoad(&counters[COUNT_IS_OPEN]) != 0u && atomicLoad(&counters[COUNT_OUT]) == 0u {
        let batch = current_batch();
        lanes = batch.lane_count;
        pixels = batch.pixel_count;
        atomicStore(&counters[COUNT_IS_DONE], 1u);
    }
    set_workgroups(FOR_SHARE, lanes);
    set_workgroups(FOR_SUM, pixels);
}

// Once all samples are at their end: second vertices go to others of their tiles.
@compute @workgroup_size(WORKGROUP)
fn kernel_share(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    var st = path_state(id.x, 0u, 0u);
    @if(sharing) {
        if id.x < current_batch().lane_count && path_firsts[id.x].kept != FIRST_NONE {
            link_points(&st, thread);
        }
    }
    add_rays(st.rays, thread);
}

// One thread sums all samples of one pixel, in their order.
@compute @workgroup_size(WORKGROUP)
fn kernel_accumulate(@builtin(global_invocation_id) id: vec3<u32>) {
    let batch = current_batch();
    if id.x < batch.pixel_count {
        let slot = batch.first_slot + id.x;
        let zero = batch.zero;
        let item = work[slot];
        var sums = pixel_sums[slot];
        for (var k = 0u; k < batch.sample_count; k++) {
            let index = item.first + batch.sample_offset + k;
            if index >= item.end {
                break;
            }
            let lane = k * batch.pixel_count + id.x;
            let result = path_results[lane];
            let is_virtual = result.mask != 0u;
            var found = result.radiance;
            @if(sharing) {
                if batch.real_pass == 0u && path_firsts[lane].kept != FIRST_NONE { found += gather(lane); }
            }
            let radiance = found * frame.exposure_scale;
            var contribution = radiance;
            if batch.real_pass != 0u {
                sums = pixel_add_real(sums, index, is_virtual, radiance, zero);
            } else {
                @if(paper) {
                    let real = path_radiances_real[lane] * frame.exposure_scale;
                    // Later samples leave a gap in the real pass, which is replayed, once one was left out.
                    let real_is_next = sums.n_real == sums.n;
                    if !is_virtual {
                        contribution = (result.radiance - path_radiances_real[lane]) * frame.exposure_scale;
                    }
                    sums = pixel_add(sums, index, is_virtual, contribution, zero);
                    if real_is_next {
                        sums = pixel_add_real(sums, index, is_virtual, real, zero);
                    }
                }
                @else {
                    sums = pixel_add(sums, index, is_virtual, radiance, zero);
                }
                let number = evaluation(item.pixel, index);
                if batch.with_groups != 0u && !is_virtual && number != NONE {
                    group_sums[slot] = group_add(group_sums[slot], number, contribution, zero);
                }
                if batch.with_guides != 0u && path_first_hits[lane].depth_m < FAR {
                    let hit = path_first_hits[lane];
                    guide_sums[slot] = guide_add(guide_sums[slot], hit.depth_m, hit.normal, hit.albedo, zero);
                }
            }
        }
        pixel_sums[slot] = sums;
    }
}
