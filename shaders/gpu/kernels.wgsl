// The kernels of the wavefront: samples begin, ask for rays, are answered, and are summed. One step of a path a dispatch, so that no
// invocation runs long and the lanes that are done make room.

import package::packed::bindings::frame;
import package::cpu::estimator::{advance, begin_sample};
import package::film::sums::{guide_add, pixel_add, pixel_add_real};
import package::gpu::lanes::{
    append, batch, counters, guide_sums, indirect, paths, pixel_sums, queue_in, work,
    COUNT_IN, COUNT_OUT, COUNT_RAYS, COUNT_STEPS, RAY_KINDS, WORKGROUP,
};
import package::cpu::request::answer;
import package::cpu::state::{FAR, STAGE_DONE};

@compute @workgroup_size(64)
fn kernel_generate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let lane = id.x;
    var alive = false;
    if lane < batch.lane_count {
        let item = work[lane % batch.pixel_count];
        let index = item.y + batch.sample_offset + lane / batch.pixel_count;
        if index < item.z {
            var path = begin_sample(item.x, index, batch.real_pass != 0u);
            paths[lane] = path;
            alive = path.stage != STAGE_DONE;
        }
    }
    append(lane, alive, thread);
}

// The queue that was written becomes the one that is read.
@compute @workgroup_size(1)
fn kernel_turn() {
    let count = atomicLoad(&counters[COUNT_OUT]);
    atomicStore(&counters[COUNT_IN], count);
    atomicStore(&counters[COUNT_OUT], 0u);
    atomicAdd(&counters[COUNT_STEPS], count);
    indirect[0] = (count + WORKGROUP - 1u) / WORKGROUP;
    indirect[1] = 1u;
    indirect[2] = 1u;
}

@compute @workgroup_size(64)
fn kernel_trace(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if id.x < atomicLoad(&counters[COUNT_IN]) {
        let lane = queue_in[id.x];
        var path = paths[lane];
        answer(&path, thread);
        // The rest of the state is as it was.
        paths[lane].hit_real = path.hit_real;
        paths[lane].hit_virtual = path.hit_virtual;
        paths[lane].rays = path.rays;
    }
}

@compute @workgroup_size(64)
fn kernel_advance(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    var lane = 0u;
    var alive = false;
    if id.x < atomicLoad(&counters[COUNT_IN]) {
        lane = queue_in[id.x];
        var path = paths[lane];
        advance(&path);
        paths[lane] = path;
        alive = path.stage != STAGE_DONE;
    }
    append(lane, alive, thread);
}

var<workgroup> rays: array<atomic<u32>, 5>;

// One thread sums all samples of one pixel, in their order.
@compute @workgroup_size(64)
fn kernel_accumulate(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if thread < RAY_KINDS {
        atomicStore(&rays[thread], 0u);
    }
    workgroupBarrier();
    let slot = id.x;
    if slot < batch.pixel_count {
        let zero = batch.zero;
        let item = work[slot];
        var sums = pixel_sums[slot];
        for (var k = 0u; k < batch.sample_count; k++) {
            let index = item.y + batch.sample_offset + k;
            if index >= item.z {
                break;
            }
            let lane = k * batch.pixel_count + slot;
            let is_virtual = paths[lane].mask != 0u;
            let radiance = paths[lane].radiance * frame.exposure_scale;
            if batch.real_pass != 0u {
                sums = pixel_add_real(sums, index, is_virtual, radiance, zero);
            } else {
                @if(paper) {
                    let real = paths[lane].radiance_real * frame.exposure_scale;
                    // Later samples leave a gap in the real pass, which is replayed, once one was left out.
                    let real_is_next = sums.n_real == sums.n;
                    var contribution = radiance;
                    if !is_virtual {
                        contribution = (paths[lane].radiance - paths[lane].radiance_real) * frame.exposure_scale;
                    }
                    sums = pixel_add(sums, index, is_virtual, contribution, zero);
                    if real_is_next {
                        sums = pixel_add_real(sums, index, is_virtual, real, zero);
                    }
                }
                @else {
                    sums = pixel_add(sums, index, is_virtual, radiance, zero);
                }
                let depth_m = paths[lane].depth_m;
                if batch.with_guides != 0u && depth_m < FAR {
                    guide_sums[slot] = guide_add(guide_sums[slot], depth_m, paths[lane].normal, paths[lane].albedo, zero);
                }
            }
            atomicAdd(&rays[0], paths[lane].rays.primary);
            atomicAdd(&rays[1], paths[lane].rays.mixed);
            atomicAdd(&rays[2], paths[lane].rays.real);
            atomicAdd(&rays[3], paths[lane].rays.mixed_shadow);
            atomicAdd(&rays[4], paths[lane].rays.real_shadow);
        }
        pixel_sums[slot] = sums;
    }
    workgroupBarrier();
    if thread < RAY_KINDS {
        atomicAdd(&counters[COUNT_RAYS + thread], atomicLoad(&rays[thread]));
    }
}
