//! Node animations. They are read only where one is asked for, so that a broken one does no harm to a picture that does not use it.

use glam::DVec4;
use gltf::json::animation as file;
use gltf::json::validation::Checked;

use super::container::malformed;
use super::document::Document;
use super::{Problem, local_transform};
use crate::scene::animation::{AnimatedNode, Animation, Interpolation, Track};

/// An animation that was asked for by name or number.
pub(super) fn read(document: &Document, wanted: &str) -> Result<Animation, Problem> {
    let animations = document.animations()?;
    let by_name = (animations.iter()).position(|a| a.name.as_deref() == Some(wanted));
    let index = by_name.or_else(|| wanted.parse().ok().filter(|i| *i < animations.len()));
    let Some(index) = index else {
        let names = (animations.iter().enumerate())
            .map(|(i, a)| a.name.clone().unwrap_or_else(|| i.to_string()));
        return Err(malformed(
            "animations",
            format!(
                "there is none called or numbered \"{wanted}\"; there are: {}",
                names.collect::<Vec<_>>().join(", ")
            ),
        ));
    };
    let animation = &animations[index];
    let mut nodes = still_nodes(document)?;
    let mut duration_secs = 0.0f64;
    for (number, channel) in animation.channels.iter().enumerate() {
        let at = format!("animations[{index}].channels[{number}]");
        let sampler = animation.samplers.get(channel.sampler.value());
        let sampler =
            sampler.ok_or_else(|| malformed(&at, "refers to a sampler that does not exist"))?;
        let target = channel.target.node.value();
        let node = nodes
            .get_mut(target)
            .ok_or_else(|| malformed(&at, format!("moves node {target}, which does not exist")))?;
        let (slot, components) = match channel.target.path {
            Checked::Valid(file::Property::Translation) => (&mut node.translation, 3),
            Checked::Valid(file::Property::Scale) => (&mut node.scale, 3),
            Checked::Valid(file::Property::Rotation) => (&mut node.rotation, 4),
            Checked::Valid(file::Property::MorphTargetWeights) => {
                node.weights = read_weights(document, sampler, &at)?;
                for track in &node.weights {
                    duration_secs = duration_secs.max(track.times[track.times.len() - 1]);
                }
                continue;
            }
            Checked::Invalid => return Err(malformed(&at, "moves a property that is not known")),
        };
        let track = read_track(document, sampler, &at, components)?;
        duration_secs = duration_secs.max(track.times[track.times.len() - 1]);
        *slot = Some(track);
    }
    Ok(Animation {
        nodes,
        duration_secs,
    })
}

/// All nodes where the file puts them.
pub(super) fn at_rest(document: &Document) -> Result<Animation, Problem> {
    Ok(Animation {
        nodes: still_nodes(document)?,
        duration_secs: 0.0,
    })
}

fn still_nodes(document: &Document) -> Result<Vec<AnimatedNode>, Problem> {
    let mut nodes = (document.nodes.iter().enumerate())
        .map(|(index, node)| {
            Ok(AnimatedNode {
                parent: None,
                rest: local_transform(node, index)?,
                translation: None,
                rotation: None,
                scale: None,
                weights: Vec::new(),
            })
        })
        .collect::<Result<Vec<_>, Problem>>()?;
    for (parent, node) in document.nodes.iter().enumerate() {
        for child in &node.children {
            // The walk over the drawn nodes has refused cycles and children that do not exist.
            if let Some(child) = nodes.get_mut(*child) {
                child.parent = Some(parent);
            }
        }
    }
    Ok(nodes)
}

fn read_track(
    document: &Document,
    sampler: &file::Sampler,
    at: &str,
    components: usize,
) -> Result<Track, Problem> {
    let interpolation = interpolation_of(sampler, at)?;
    let times = read_times(document, sampler, at)?;
    let vectors = document.vectors::<4>(sampler.output.value(), at, components, components == 4)?;
    let values: Vec<DVec4> = vectors
        .iter()
        .map(|v| {
            let [x, y, z, w] = v.map(f64::from);
            DVec4::new(x, y, z, if components == 4 { w } else { 0.0 })
        })
        .collect();
    let each = keys_of(interpolation);
    if values.len() != each * times.len() {
        return Err(malformed(
            at,
            format!(
                "has {} values for {} times; expected {each} a time",
                values.len(),
                times.len()
            ),
        ));
    }
    let keys = values.iter().skip(each / 2).step_by(each);
    let flat = components == 4 && keys.clone().any(|q| q.length() < 1e-6);
    if flat || !values.iter().all(|v| v.is_finite()) {
        return Err(malformed(
            at,
            "has a value that is not finite, or a rotation without length",
        ));
    }
    Ok(Track {
        times,
        values,
        interpolation,
    })
}

/// Weights of morph targets, four of them a track.
fn read_weights(
    document: &Document,
    sampler: &file::Sampler,
    at: &str,
) -> Result<Vec<Track>, Problem> {
    let interpolation = interpolation_of(sampler, at)?;
    let times = read_times(document, sampler, at)?;
    let values = document.vectors::<1>(sampler.output.value(), at, 1, false)?;
    let rows = keys_of(interpolation) * times.len();
    let targets = values.len() / rows;
    if targets * rows != values.len() || !values.as_flattened().iter().all(|w| w.is_finite()) {
        return Err(malformed(
            at,
            format!(
                "has {} weights for {} times, or one that is not finite",
                values.len(),
                times.len()
            ),
        ));
    }
    let tracks = (0..targets).step_by(4).map(|first| {
        let weight = |row: usize, target: usize| match target < targets {
            true => f64::from(values[row * targets + target][0]),
            false => 0.0,
        };
        let rows = 0..rows;
        Track {
            times: times.clone(),
            values: rows
                .map(|row| DVec4::from([0, 1, 2, 3].map(|i| weight(row, first + i))))
                .collect(),
            interpolation,
        }
    });
    Ok(tracks.collect())
}

fn interpolation_of(sampler: &file::Sampler, at: &str) -> Result<Interpolation, Problem> {
    match sampler.interpolation {
        Checked::Valid(file::Interpolation::Step) => Ok(Interpolation::Step),
        Checked::Valid(file::Interpolation::Linear) => Ok(Interpolation::Linear),
        Checked::Valid(file::Interpolation::CubicSpline) => Ok(Interpolation::Cubic),
        Checked::Invalid => Err(malformed(at, "has an unknown interpolation")),
    }
}

/// Values a time.
fn keys_of(interpolation: Interpolation) -> usize {
    match interpolation {
        Interpolation::Cubic => 3,
        Interpolation::Step | Interpolation::Linear => 1,
    }
}

fn read_times(document: &Document, sampler: &file::Sampler, at: &str) -> Result<Vec<f64>, Problem> {
    let times: Vec<f64> = (document
        .vectors::<1>(sampler.input.value(), at, 1, false)?
        .iter())
    .map(|[time]| f64::from(*time))
    .collect();
    let rising = times.windows(2).all(|pair| pair[0] < pair[1]);
    if times.is_empty() || !rising || !times.iter().all(|t| t.is_finite() && *t >= 0.0) {
        return Err(malformed(
            at,
            "its times are not finite, rising and at least 0",
        ));
    }
    Ok(times)
}
