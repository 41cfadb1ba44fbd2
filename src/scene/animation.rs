//! Node animations of glTF files: transforms of nodes in time.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3, DVec4};

/// How a track goes from one key to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    Step,
    /// Rotations along the shorter arc.
    Linear,
    /// Hermite, with an incoming and an outgoing tangent at each key.
    Cubic,
}

/// Keys of one property. Quaternions are x, y, z, w; vectors leave w at 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Seconds, rising, at least one.
    pub times: Vec<f64>,
    /// One a key; of a cubic track three: incoming tangent, value, outgoing tangent.
    pub values: Vec<DVec4>,
    pub interpolation: Interpolation,
}

impl Track {
    fn value(&self, key: usize) -> DVec4 {
        match self.interpolation {
            Interpolation::Cubic => self.values[3 * key + 1],
            _ => self.values[key],
        }
    }

    fn at(&self, time_secs: f64, is_rotation: bool) -> DVec4 {
        let after = self.times.partition_point(|time| *time <= time_secs);
        if after == 0 {
            return self.value(0);
        }
        let (from, to) = (after - 1, after);
        if to == self.times.len() || self.interpolation == Interpolation::Step {
            return self.value(from);
        }
        let span = self.times[to] - self.times[from];
        let t = (time_secs - self.times[from]) / span;
        let (a, b) = (self.value(from), self.value(to));
        match self.interpolation {
            Interpolation::Cubic => {
                let (t2, t3) = (t * t, t * t * t);
                let out = self.values[3 * from + 2] * span;
                let into = self.values[3 * to] * span;
                a * (2.0 * t3 - 3.0 * t2 + 1.0)
                    + out * (t3 - 2.0 * t2 + t)
                    + b * (3.0 * t2 - 2.0 * t3)
                    + into * (t3 - t2)
            }
            _ if is_rotation => {
                let quaternion = |v: DVec4| DQuat::from_vec4(v).normalize();
                DVec4::from(quaternion(a).slerp(quaternion(b), t))
            }
            _ => a.lerp(b, t),
        }
    }
}

/// A node: its own place, and what moves of it.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedNode {
    pub parent: Option<usize>,
    /// Parent-from-node where nothing moves.
    pub rest: DMat4,
    pub translation: Option<Track>,
    pub rotation: Option<Track>,
    pub scale: Option<Track>,
    /// Of its mesh's morph targets, four a track.
    pub weights: Vec<Track>,
}

impl AnimatedNode {
    fn moves(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }

    /// The shape of its mesh changes.
    pub fn morphs(&self) -> bool {
        !self.weights.is_empty()
    }

    fn at(&self, time_secs: f64) -> DMat4 {
        if !self.moves() {
            return self.rest;
        }
        let (scale, rotation, translation) = self.rest.to_scale_rotation_translation();
        let vector = |track: &Option<Track>, rest: DVec3| {
            (track.as_ref()).map_or(rest, |track| track.at(time_secs, false).truncate())
        };
        let rotation = (self.rotation.as_ref()).map_or(rotation, |track| {
            let turned = DQuat::from_vec4(track.at(time_secs, true));
            match turned.length() > 1e-9 {
                true => turned.normalize(),
                false => rotation,
            }
        });
        DMat4::from_scale_rotation_translation(
            vector(&self.scale, scale),
            rotation,
            vector(&self.translation, translation),
        )
    }
}

/// All nodes of a file, moving. It begins again when it is over.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// A node's parent comes before it or after; none is its own ancestor.
    pub nodes: Vec<AnimatedNode>,
    /// To the last key.
    pub duration_secs: f64,
}

impl Animation {
    /// The node, or one of its ancestors, moves.
    pub fn moves(&self, node: usize) -> bool {
        self.ancestry(node).any(|node| self.nodes[node].moves())
    }

    /// The transform from a node to the file's space.
    pub fn object_from_node(&self, node: usize, time_secs: f64) -> DMat4 {
        let within = self.within(time_secs);
        self.ancestry(node)
            .fold(DMat4::IDENTITY, |m, node| self.nodes[node].at(within) * m)
    }

    /// Weights of the morph targets of a node's mesh; those at `rest` where nothing moves them.
    pub fn weights(&self, node: usize, time_secs: f64, rest: &[f64]) -> Vec<f64> {
        let tracks = &self.nodes[node].weights;
        if tracks.is_empty() {
            return rest.to_vec();
        }
        let within = self.within(time_secs);
        let fours = tracks
            .iter()
            .map(|track| track.at(within, false).to_array());
        fours.flatten().collect()
    }

    fn within(&self, time_secs: f64) -> f64 {
        match self.duration_secs > 0.0 {
            true => time_secs.rem_euclid(self.duration_secs),
            false => 0.0,
        }
    }

    fn ancestry(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(node), |node| self.nodes[*node].parent)
    }
}

/// The node of an animation that carries an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct InstanceAnimation {
    pub animation: Arc<Animation>,
    pub node: usize,
    /// Of one of several copies that the node carries.
    pub node_from_local: DMat4,
}

impl InstanceAnimation {
    pub fn object_from_local(&self, time_secs: f64) -> DMat4 {
        let object_from_node = self.animation.object_from_node(self.node, time_secs);
        match self.node_from_local == DMat4::IDENTITY {
            true => object_from_node,
            false => object_from_node * self.node_from_local,
        }
    }
}
