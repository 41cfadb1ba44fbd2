//! Rays a second of processor time on one thread, closest and any hit, beside obvhs' own traversals of the same kind of tree.

#[path = "support/cpu_time.rs"]
mod cpu_time;
#[path = "support/obvhs_peer.rs"]
mod obvhs_peer;
#[path = "support/workloads.rs"]
mod workloads;

use std::hint::black_box;

use cpu_time::thread_cpu_secs;
use mixray::accel::Ray;
use obvhs_peer::ObvhsPeer;

/// A name and whether a ray meets anything.
type Tracer<'a> = (&'a str, &'a dyn Fn(&Ray) -> bool);

/// Timed passes over the rays, after one to warm up. The tracers take turns, so that what slows the machine meets all alike.
const PASSES: usize = 11;

/// Prints a table row for each tracer: median, lowest and highest of the passes in Mrays/s, and the median over mixray's.
fn compare(label: &str, rays: &[Ray], tracers: &[Tracer]) {
    let mut speeds = vec![Vec::new(); tracers.len()];
    for pass in 0..=PASSES {
        for ((_, trace), speeds) in tracers.iter().zip(&mut speeds) {
            let start = thread_cpu_secs();
            black_box(rays.iter().filter(|ray| trace(black_box(ray))).count());
            let speed = rays.len() as f64 * 1e-6 / (thread_cpu_secs() - start);
            if pass > 0 {
                speeds.push(speed);
            }
        }
    }
    for speeds in &mut speeds {
        speeds.sort_by(f64::total_cmp);
    }
    let mixray = speeds[0][PASSES / 2];
    for ((name, _), speeds) in tracers.iter().zip(&speeds) {
        let median = speeds[PASSES / 2];
        let (lowest, highest) = (speeds[0], speeds[PASSES - 1]);
        println!(
            "| {label} | {name} | {median:.2} | {lowest:.2} to {highest:.2} | {:.2} |",
            median / mixray
        );
    }
}

fn main() {
    println!("| rays | tracer | Mrays/s | spread | of mixray's |");
    println!("| --- | --- | --- | --- | --- |");
    for work in workloads::workloads() {
        let peer = ObvhsPeer::new(&work.triangles);
        for (rays_name, rays) in [
            ("coherent", &work.coherent),
            ("incoherent", &work.incoherent),
        ] {
            compare(
                &format!("{}, {rays_name}, closest", work.name),
                rays,
                &[
                    ("mixray", &|ray| work.world.closest(ray).is_hit()),
                    ("obvhs BVH2", &|ray| peer.binary_closest(ray).is_some()),
                    ("obvhs CWBVH", &|ray| peer.wide_closest(ray).is_some()),
                ],
            );
            compare(
                &format!("{}, {rays_name}, any", work.name),
                rays,
                &[
                    ("mixray", &|ray| work.world.any(ray)),
                    ("obvhs BVH2", &|ray| peer.binary_any(ray)),
                    ("obvhs CWBVH", &|ray| peer.wide_any(ray)),
                ],
            );
        }
    }
}
