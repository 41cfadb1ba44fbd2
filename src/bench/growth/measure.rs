//! A law measured: all sizes in turns, the least of the runs.

use crate::clock::ProcessorTime;
use crate::renderer::Watcher;
use glam::Vec3;

use super::scenes::{Step, ball, steps, triangle_counts};
use super::{Curve, Law, Point};
use crate::accel::WorldBvh;
use crate::bench::measure::{MeasureError, Plan, Subject};
use crate::pack::PackError;

/// A build is repeated until the runs took this long together, so that the clock's grain does not show.
const LEAST_BUILD_SECS: f64 = 0.05;

/// Measures `law` with each of the plan's methods, one after the other; the sizes of a method are rendered in turns `plan.repeats` times after one untimed
/// run of each. The tree is built by the CPU alone and by one thread, whatever the methods. `shrink` divides the width and height of the pictures. Once `cancelled`
/// says so, what is complete is returned.
///
/// # Errors
/// A method cannot render, or another backend had to take over.
pub fn grow(
    law: Law,
    plan: &Plan,
    shrink: u32,
    watcher: &Watcher<'_>,
    tick: &mut dyn FnMut(&str),
) -> Result<Vec<Curve>, MeasureError> {
    if law == Law::Build {
        return Ok(build_curve(plan.repeats, watcher, tick)?
            .into_iter()
            .collect());
    }
    let mut curves = Vec::new();
    for &method in &plan.methods {
        let label = method.label();
        let mut runners = Vec::new();
        for step in steps(law, shrink) {
            if watcher.is_cancelled() {
                return Ok(curves);
            }
            tick(&format!("{label}: {} {}, warm-up", step.work, law.unit()));
            let Step {
                work,
                rays_per_pixel,
                scene,
            } = step;
            let mut subject = Subject::new(&scene, method)?;
            subject.run(Some(rays_per_pixel), plan.first_seed, watcher)?;
            subject.check_backend()?;
            runners.push((work, rays_per_pixel, subject, Vec::new(), 0));
        }
        let by_wall = plan.times_by_wall(method);
        for _ in 0..plan.repeats {
            for (work, rays_per_pixel, subject, runs, rays) in &mut runners {
                tick(&format!("{label}: {work} {}", law.unit()));
                let (sample, _) = subject.run(Some(*rays_per_pixel), plan.first_seed, watcher)?;
                if watcher.is_cancelled() {
                    return Ok(curves);
                }
                subject.check_backend()?;
                runs.push(if by_wall {
                    sample.wall_secs
                } else {
                    sample.cpu_secs
                });
                *rays = sample.rays.traced();
            }
        }
        let device = runners.first().map(|(_, _, subject, ..)| subject.device());
        let points = runners
            .into_iter()
            .map(|(work, _, _, runs, rays)| point(work, runs, rays));
        let cost = if by_wall { "wall" } else { "cpu" };
        let (device, points) = (device.unwrap_or_default(), points.collect());
        curves.push(Curve::new(law, label, device, cost, points));
    }
    Ok(curves)
}

fn point(work: u64, runs: Vec<f64>, rays: u64) -> Point {
    Point {
        work,
        secs: runs.iter().copied().fold(f64::INFINITY, f64::min),
        runs,
        rays,
    }
}

/// On one thread: processor seconds of several count what they wait for one another.
fn build_curve(
    repeats: u32,
    watcher: &Watcher<'_>,
    tick: &mut dyn FnMut(&str),
) -> Result<Option<Curve>, MeasureError> {
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let meshes: Vec<Vec<[Vec3; 3]>> = triangle_counts().map(corners).collect();
    let mut runs = vec![Vec::new(); meshes.len()];
    for turn in 0..=repeats {
        for (mesh, runs) in meshes.iter().zip(&mut runs) {
            if watcher.is_cancelled() {
                return Ok(None);
            }
            tick(&format!("tree of {} triangles", mesh.len()));
            let secs = one_thread.install(|| build_secs(mesh))?;
            if turn > 0 {
                runs.push(secs);
            }
        }
    }
    let points = meshes
        .iter()
        .zip(runs)
        .map(|(mesh, runs)| point(mesh.len() as u64, runs, 0));
    let [method, device] = ["cpu", "1 CPU thread"].map(str::to_owned);
    Ok(Some(Curve::new(
        Law::Build,
        method,
        device,
        "cpu",
        points.collect(),
    )))
}

fn build_secs(mesh: &[[Vec3; 3]]) -> Result<f64, MeasureError> {
    let start = ProcessorTime::now();
    let mut builds = 0;
    loop {
        WorldBvh::build(mesh, 0).map_err(PackError::from)?;
        builds += 1;
        let secs = start.elapsed_secs();
        if secs >= LEAST_BUILD_SECS {
            return Ok(secs / f64::from(builds));
        }
    }
}

/// Of a ball with bumps, so that its boxes are not all alike.
fn corners(triangles: u32) -> Vec<[Vec3; 3]> {
    let ball = ball(triangles);
    let bumpy = |index: u32| {
        let p = Vec3::from(ball.positions[index as usize]);
        p * (1.0 + 0.05 * (9.0 * p.x).sin() * (11.0 * p.y).cos() * (7.0 * p.z).cos())
    };
    ball.triangles.iter().map(|t| t.map(bumpy)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Method;
    use crate::scene::{BackendChoice, Composite, Estimator, SamplerKind};

    #[test]
    fn rays_grow_as_asked() {
        let plan = Plan {
            methods: vec![Method {
                backend: BackendChoice::Cpu,
                estimator: Estimator::Paper,
                sampler: SamplerKind::Jittered,
                composite: Composite::Additive,
                without: None,
                goal: None,
                filter: false,
            }],
            rays_per_pixel: Vec::new(),
            repeats: 2,
            first_seed: 1,
            hardware_gpu: false,
        };
        let mut heard = 0;
        let curves = grow(Law::RaysPerPixel, &plan, 8, &Watcher::none(), &mut |_| {
            heard += 1
        })
        .unwrap();
        let [curve] = curves.as_slice() else {
            panic!("one method, one curve");
        };
        assert_eq!((curve.points.len(), heard), (5, 15));
        for point in &curve.points {
            assert!(point.runs.len() == 2 && point.secs > 0.0 && point.secs <= point.runs[1]);
        }
        // The paper's estimator takes each ray whatever the others brought.
        let rays = curve.rays_exponent.unwrap().slope;
        assert!((rays - 1.0).abs() < 0.02, "{rays}");
        let none = grow(
            Law::Objects,
            &plan,
            8,
            &Watcher::none().cancelled_by(&|| true),
            &mut |_| (),
        )
        .unwrap();
        assert!(none.is_empty(), "what is cancelled has no curve");
    }
}
