// Photons, one an invocation from light to end: their splats go to a list, which the host adds up in fixed point. Host: src/gpu/photons.rs.

import package::gpu::buffers::frame;
import package::shared::WORKGROUP;
import package::cpu::photons::path::{PhotonNumber, trace_photon};
import package::cpu::state::PathState;

@group(1) @binding(0) var<uniform> photon_batch: PhotonBatch;
// Splats that there was no room for are counted too. Then rays by kind.
@group(1) @binding(1) var<storage, read_write> photon_counters: array<atomic<u32>, PHOTON_COUNTERS>;
@group(1) @binding(2) var<storage, read_write> splats: array<ListedSplat>;

fn add_splat(pixel: u32, is_virtual: bool, value: vec3<f32>) {
    let place = atomicAdd(&photon_counters[0], 1u);
    if place < photon_batch.most_splats {
        splats[place] = ListedSplat(value, (pixel << 1u) | u32(is_virtual));
    }
}

@compute @workgroup_size(WORKGROUP)
fn kernel_photons(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if id.x < photon_batch.count {
        let window = vec2<f32>(photon_batch.window_begin, photon_batch.window_length);
        let st = trace_photon(PhotonNumber(photon_batch.sequence, photon_batch.first + id.x, window), thread);
        atomicAdd(&photon_counters[1], st.rays.mixed);
        atomicAdd(&photon_counters[2], st.rays.mixed_shadow);
    }
}
