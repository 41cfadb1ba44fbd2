//! What virtual objects stand on: the highest surface under their foot, of the proxy or of another object.

use std::collections::BTreeMap;

use glam::{DMat4, DVec3};

use super::{Finding, Metres};
use crate::scene::check::Check;
use crate::scene::placing::{Foot, bounds};
use crate::scene::{Instance, Object, Scene, Side};

/// Share of its size that an object may hang above its support or reach below it.
const TOLERANCE: f64 = 0.01;

/// Places under an object's foot where the proxy is looked for, along each side.
const PROBES: usize = 3;
/// Share of an object's width that the places are apart.
const PROBE_SPREAD: f64 = 0.25;

/// `feet`: of the scene's objects in order, where they are asked for.
pub(super) fn findings(scene: &Scene, feet: &[Option<Foot>]) -> Vec<Finding> {
    let has_proxy = scene.objects.iter().any(|o| o.side == Side::Real);
    if !has_proxy {
        return Vec::new();
    }
    let objects = scene.objects.iter().zip(feet);
    let standing: Vec<(&Object, &Foot)> = objects
        .filter_map(|(object, foot)| Some((object, foot.as_ref()?)))
        .filter(|(_, foot)| foot.size_m > 0.0)
        .collect();
    let mut probes: Vec<Probe> = Vec::new();
    for (index, (object, foot)) in standing.iter().enumerate() {
        let middle = (PROBES as f64 - 1.0) * 0.5;
        let step = PROBE_SPREAD * foot.width_m;
        for place in 0..PROBES * PROBES {
            let [i, j] = [place / PROBES, place % PROBES].map(|i| i as f64 - middle);
            probes.push(Probe {
                standing: index,
                object,
                x: foot.point.x + i * step,
                z: foot.point.z + j * step,
                is_middle: i == 0.0 && j == 0.0,
                highest_y: foot.point.y + 0.5 * foot.size_m,
                support_y: None,
            });
        }
    }
    drop_onto(&scene.objects, &mut probes);
    let mut of_object: BTreeMap<usize, Vec<&Probe>> = BTreeMap::new();
    for probe in &probes {
        of_object.entry(probe.standing).or_default().push(probe);
    }
    let findings = of_object.into_iter();
    let findings = findings.filter_map(|(index, probes)| {
        let (object, foot) = standing[index];
        finding(object, foot, &probes)
    });
    findings.collect()
}

fn finding(object: &Object, foot: &Foot, probes: &[&Probe]) -> Option<Finding> {
    let name = &object.name;
    let supported = probes.iter().filter(|probe| probe.support_y.is_some());
    let middle = probes.iter().find(|probe| probe.is_middle)?;
    let Some(support_y) = middle.support_y else {
        let message = format!(
            "`{name}` has nothing of the proxy under it: nothing takes its shadow; extend the proxy, or move the object (`rest_on` and `pixel`)"
        );
        return Some(Finding::new(Check::Uncovered, message));
    };
    let gap_m = foot.point.y - support_y;
    let size = Metres(foot.size_m);
    let mend = "set rest_on = \"real\", or correct `translation`";
    if gap_m > TOLERANCE * foot.size_m {
        let gap = Metres(gap_m);
        let message =
            format!("`{name}`, {size} large, floats {gap} above what is under it; {mend}");
        return Some(Finding::new(Check::Floating, message));
    }
    if gap_m < -TOLERANCE * foot.size_m {
        let depth = Metres(-gap_m);
        let message =
            format!("`{name}`, {size} large, is sunk {depth} into what it stands on; {mend}");
        return Some(Finding::new(Check::Sunken, message));
    }
    if 2 * supported.count() < probes.len() {
        let message = format!(
            "the proxy ends under `{name}`: it does not reach {} beside its foot, where its shadow falls; extend the proxy",
            Metres(PROBE_SPREAD * foot.width_m)
        );
        return Some(Finding::new(Check::Uncovered, message));
    }
    None
}

/// A way straight down.
struct Probe<'s> {
    standing: usize,
    /// Its own surface does not carry it.
    object: &'s Object,
    x: f64,
    z: f64,
    is_middle: bool,
    /// What is higher is above it.
    highest_y: f64,
    support_y: Option<f64>,
}

/// Finds the highest surface on each way, in one walk over the triangles of what some of them meet.
fn drop_onto(objects: &[Object], probes: &mut [Probe]) {
    probes.sort_by(|a, b| a.x.total_cmp(&b.x));
    for object in objects {
        for instance in &object.instances {
            let transform = object.world_from_object * instance.object_from_local;
            let corners = instance.corners().into_iter();
            let Some((low, high)) = bounds(corners.map(|c| transform.transform_point3(c))) else {
                continue;
            };
            let mut near: Vec<&mut Probe> = probes
                .iter_mut()
                .filter(|probe| !std::ptr::eq(probe.object, object))
                .filter(|probe| (low.x..=high.x).contains(&probe.x))
                .filter(|probe| (low.z..=high.z).contains(&probe.z))
                .collect();
            if !near.is_empty() {
                drop_on(instance, transform, &mut near);
            }
        }
    }
}

/// `probes` are sorted by x.
fn drop_on(instance: &Instance, world_from_local: DMat4, probes: &mut [&mut Probe]) {
    let positions = &instance.primitive.positions;
    let at = |p: &[f32; 3]| world_from_local.transform_point3(DVec3::from(p.map(f64::from)));
    let xs: Vec<f64> = positions.iter().map(|p| at(p).x).collect();
    for triangle in &instance.primitive.triangles {
        let [a, b, c] = triangle.map(|vertex| xs[vertex as usize]);
        let (least, most) = (a.min(b).min(c), a.max(b).max(c));
        let start = probes.partition_point(|probe| probe.x < least);
        for probe in &mut probes[start..] {
            if probe.x > most {
                break;
            }
            let corners = triangle.map(|vertex| at(&positions[vertex as usize]));
            let height = height_at(corners, probe.x, probe.z);
            let below = height.filter(|y| *y <= probe.highest_y);
            probe.support_y = match (below, probe.support_y) {
                (Some(a), Some(b)) => Some(a.max(b)),
                (a, b) => a.or(b),
            };
        }
    }
}

/// Of a triangle over a place; `None` beside it, or where it is upright.
fn height_at([a, b, c]: [DVec3; 3], x: f64, z: f64) -> Option<f64> {
    let area = |p: DVec3, q: DVec3| (p.x - x) * (q.z - z) - (q.x - x) * (p.z - z);
    let [of_a, of_b, of_c] = [area(b, c), area(c, a), area(a, b)];
    let all = of_a + of_b + of_c;
    let inside = [of_a, of_b, of_c].iter().all(|part| part * all >= 0.0);
    (inside && all != 0.0).then(|| (of_a * a.y + of_b * b.y + of_c * c.y) / all)
}
