//! The mixray side of benches/peers/embree.py: writes meshes and rays to the folder given, then times them when told to.
//!
//! A line `closest|any WORKLOAD coherent|incoherent` on stdin is answered with hits, the sum of
//! their distances, and the seconds of each chunk of rays.

#[path = "../benches/support/workloads.rs"]
mod workloads;

use std::error::Error;
use std::io::BufRead;
use std::path::Path;
use std::time::Instant;

use mixray::accel::Ray;

const CHUNK: usize = 4096;

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

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args()
        .nth(1)
        .ok_or("usage: traversal_peer FOLDER")?;
    let folder = Path::new(&folder);
    let workloads = workloads::workloads();
    for work in &workloads {
        let corners: Vec<f32> = work
            .triangles
            .iter()
            .flatten()
            .flat_map(|v| v.to_array())
            .collect();
        write(&folder.join(format!("{}.triangles", work.name)), &corners)?;
        write(
            &folder.join(format!("{}.coherent", work.name)),
            &flat(&work.coherent),
        )?;
        write(
            &folder.join(format!("{}.incoherent", work.name)),
            &flat(&work.incoherent),
        )?;
        println!("{}", work.name);
    }
    println!("ready");
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let &[kind, name, order] = words.as_slice() else {
            return Err(format!("not understood: {line}").into());
        };
        let work = workloads
            .iter()
            .find(|work| work.name == name)
            .ok_or("no such workload")?;
        let rays = if order == "coherent" {
            &work.coherent
        } else {
            &work.incoherent
        };
        let (mut hits, mut distance) = (0, 0.0);
        let mut seconds = String::new();
        for chunk in rays.chunks(CHUNK) {
            let start = Instant::now();
            if kind == "closest" {
                for ray in chunk {
                    let hit = work.world.closest(ray);
                    if hit.is_hit() {
                        hits += 1;
                        distance += f64::from(hit.t);
                    }
                }
            } else {
                hits += chunk.iter().filter(|ray| work.world.any(ray)).count();
            }
            seconds += &format!(" {}", start.elapsed().as_secs_f64());
        }
        println!("{hits} {distance}{seconds}");
    }
    Ok(())
}
