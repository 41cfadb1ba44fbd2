//! The Rust side of benches/peers/embree.py: writes meshes and rays to the folder given, then times them when told to.
//!
//! A line `TRACER closest|any WORKLOAD coherent|incoherent THREADS` on stdin, TRACER being mixray, obvhs-bvh2 or obvhs-cwbvh, is answered
//! with hits, the sum of their distances, and the processor seconds of each chunk of rays.

#[path = "../benches/support/cpu_time.rs"]
mod cpu_time;
#[path = "../benches/support/obvhs_peer.rs"]
mod obvhs_peer;
#[path = "../benches/support/workloads.rs"]
mod workloads;

use std::error::Error;
use std::io::BufRead;
use std::path::Path;
use std::sync::Barrier;

use cpu_time::thread_cpu_secs;
use mixray::accel::Ray;
use obvhs_peer::ObvhsPeer;

const CHUNK: usize = 2048;

fn write(path: &Path, floats: &[f32]) -> std::io::Result<()> {
    std::fs::write(path, bytemuck::cast_slice(floats))
}

fn flat(rays: &[Ray]) -> Vec<f32> {
    rays.iter()
        .flat_map(|ray| {
            let [ox, oy, oz] = ray.origin.to_array();
            let [dx, dy, dz] = ray.direction.to_array();
            [ox, oy, oz, ray.t_min, dx, dy, dz, ray.t_max]
        })
        .collect()
}

#[derive(Default)]
struct Timing {
    hits: usize,
    distance: f64,
    chunk_secs: Vec<f64>,
}

/// Each thread takes every `threads`-th chunk. `trace` returns the distance of a hit.
fn time(rays: &[Ray], threads: usize, trace: impl Fn(&Ray) -> Option<f32> + Sync) -> Timing {
    let start_line = Barrier::new(threads);
    let run = |thread: usize| {
        let mut timing = Timing::default();
        start_line.wait();
        for chunk in rays.chunks(CHUNK).skip(thread).step_by(threads) {
            let start = thread_cpu_secs();
            for distance in chunk.iter().filter_map(&trace) {
                timing.hits += 1;
                timing.distance += f64::from(distance);
            }
            timing.chunk_secs.push(thread_cpu_secs() - start);
        }
        timing
    };
    std::thread::scope(|scope| {
        let handles: Vec<_> = (1..threads)
            .map(|thread| scope.spawn(move || run(thread)))
            .collect();
        let mut total = run(0);
        for handle in handles {
            let part = handle.join().expect("a tracer does not panic");
            total.hits += part.hits;
            total.distance += part.distance;
            total.chunk_secs.extend(part.chunk_secs);
        }
        total
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args()
        .nth(1)
        .ok_or("usage: traversal_peer FOLDER")?;
    let folder = Path::new(&folder);
    let workloads: Vec<_> = workloads::workloads()
        .into_iter()
        .map(|work| (ObvhsPeer::new(&work.triangles), work))
        .collect();
    for (_, work) in &workloads {
        let corners: Vec<f32> = work
            .triangles
            .iter()
            .flatten()
            .flat_map(|v| v.to_array())
            .collect();
        let path = |kind: &str| folder.join(format!("{}.{kind}", work.name));
        write(&path("triangles"), &corners)?;
        write(&path("coherent"), &flat(&work.coherent))?;
        write(&path("incoherent"), &flat(&work.incoherent))?;
        println!("{}", work.name);
    }
    println!("ready");
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let &[tracer, kind, name, order, threads] = words.as_slice() else {
            return Err(format!("not understood: {line}").into());
        };
        let threads = threads.parse()?;
        let (peer, work) = workloads
            .iter()
            .find(|(_, work)| work.name == name)
            .ok_or("no such workload")?;
        let rays = if order == "coherent" {
            &work.coherent
        } else {
            &work.incoherent
        };
        let found = |any: bool| any.then_some(0.0);
        let world = &work.world;
        let timing = match (tracer, kind) {
            ("mixray", "closest") => time(rays, threads, |ray| {
                let hit = world.closest(ray);
                hit.is_hit().then_some(hit.t)
            }),
            ("mixray", "any") => time(rays, threads, |ray| found(world.any(ray))),
            ("obvhs-bvh2", "closest") => time(rays, threads, |ray| peer.binary_closest(ray)),
            ("obvhs-bvh2", "any") => time(rays, threads, |ray| found(peer.binary_any(ray))),
            ("obvhs-cwbvh", "closest") => time(rays, threads, |ray| peer.wide_closest(ray)),
            ("obvhs-cwbvh", "any") => time(rays, threads, |ray| found(peer.wide_any(ray))),
            _ => return Err(format!("not understood: {line}").into()),
        };
        let seconds: Vec<String> = timing.chunk_secs.iter().map(f64::to_string).collect();
        println!("{} {} {}", timing.hits, timing.distance, seconds.join(" "));
    }
    Ok(())
}
