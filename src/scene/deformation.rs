//! Meshes that change their shape: skins and morph targets of glTF files (glTF 2.0 sections 3.7.2.2 and 3.7.3).

use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};

use super::Primitive;
use super::animation::Animation;

/// Vertices that stand for all where only the speed of a mesh is asked for.
const SAMPLED_VERTICES: usize = 256;

/// How an instance's mesh is shaped. A skinned mesh is in the space of its file: its own node's transform has no effect.
#[derive(Clone, Debug)]
pub struct Deformation {
    pub mesh: Arc<DeformableMesh>,
    /// Of the morph targets where nothing moves them.
    pub weights: Vec<f64>,
    pub skin: Option<Arc<Skin>>,
    /// The file's nodes, moving or at rest.
    pub animation: Arc<Animation>,
    /// That carries the mesh.
    pub node: usize,
}

/// A mesh before it is shaped, and what each vertex needs for it.
#[derive(Clone, Debug, Default)]
pub struct DeformableMesh {
    pub base: Primitive,
    /// The normals are those of the faces.
    pub is_flat: bool,
    pub targets: Vec<MorphTarget>,
    /// Joints and weights of each vertex that sum to 1; empty without a skin, and none of a vertex that goes with the node.
    pub influences: Vec<Vec<(u32, f32)>>,
}

/// What is added to a vertex, times the target's weight. Arrays are empty or one a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub tangents: Vec<[f32; 3]>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    pub joints: Vec<Joint>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    pub node: usize,
    /// Joint-from-mesh where the mesh was bound.
    pub inverse_bind: DMat4,
}

impl Deformation {
    /// Its shape changes with time.
    pub fn moves(&self) -> bool {
        let morphs = self.animation.nodes[self.node].morphs();
        let bends = |skin: &Arc<Skin>| {
            let mut joints = skin.joints.iter();
            joints.any(|joint| self.animation.moves(joint.node))
        };
        morphs || self.skin.as_ref().is_some_and(bends)
    }

    /// The mesh at a time.
    pub fn at(&self, time_secs: f64) -> Primitive {
        let base = &self.mesh.base;
        let pose = self.pose(time_secs);
        let mut shaped = base.clone();
        for vertex in 0..base.positions.len() {
            let (position, linear) = self.vertex(&pose, vertex);
            shaped.positions[vertex] = position.as_vec3().to_array();
            let morphed = |own: [f32; 3], of: fn(&MorphTarget) -> &Vec<[f32; 3]>| {
                self.morphed(&pose, own, vertex, of)
            };
            let normal = morphed(base.normals[vertex], |target| &target.normals);
            let turned = cofactors(&linear) * normal;
            shaped.normals[vertex] = unit_or(turned, base.normals[vertex]);
            if let Some([x, y, z, hand]) = base.tangents.get(vertex).copied() {
                let tangent = linear * morphed([x, y, z], |target| &target.tangents);
                let [x, y, z] = unit_or(tangent, [x, y, z]);
                let mirrored = linear.determinant() < 0.0;
                shaped.tangents[vertex] = [x, y, z, if mirrored { -hand } else { hand }];
            }
        }
        if self.mesh.is_flat {
            flatten(&mut shaped);
        }
        shaped
    }

    /// Some of the vertices at a time, always the same.
    pub fn sampled_points(&self, time_secs: f64) -> Vec<DVec3> {
        let pose = self.pose(time_secs);
        let count = self.mesh.base.positions.len();
        let step = count.div_ceil(SAMPLED_VERTICES).max(1);
        (0..count)
            .step_by(step)
            .map(|vertex| self.vertex(&pose, vertex).0)
            .collect()
    }

    fn pose(&self, time_secs: f64) -> Pose {
        let object_from_node = self.animation.object_from_node(self.node, time_secs);
        let joints = self.skin.iter().flat_map(|skin| &skin.joints);
        Pose {
            weights: self.animation.weights(self.node, time_secs, &self.weights),
            object_from_node,
            joints: joints
                .map(|joint| {
                    self.animation.object_from_node(joint.node, time_secs) * joint.inverse_bind
                })
                .collect(),
        }
    }

    /// Where a vertex is, and what turns its directions.
    fn vertex(&self, pose: &Pose, vertex: usize) -> (DVec3, DMat3) {
        let own = self.mesh.base.positions[vertex];
        let position = self.morphed(pose, own, vertex, |target| &target.positions);
        let Some(influences) = self
            .mesh
            .influences
            .get(vertex)
            .filter(|_| self.skin.is_some())
        else {
            return (position, DMat3::IDENTITY);
        };
        let matrix = match influences.as_slice() {
            [] => pose.object_from_node,
            _ => influences.iter().fold(DMat4::ZERO, |sum, (joint, weight)| {
                sum + pose.joints[*joint as usize] * f64::from(*weight)
            }),
        };
        (matrix.transform_point3(position), DMat3::from_mat4(matrix))
    }

    fn morphed(
        &self,
        pose: &Pose,
        own: [f32; 3],
        vertex: usize,
        of: fn(&MorphTarget) -> &Vec<[f32; 3]>,
    ) -> DVec3 {
        let wide = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let targets = self.mesh.targets.iter().zip(&pose.weights);
        targets.fold(wide(own), |sum, (target, weight)| {
            match of(target).get(vertex) {
                Some(delta) if *weight != 0.0 => sum + wide(*delta) * *weight,
                _ => sum,
            }
        })
    }
}

/// Of all that shapes a mesh, at one time.
struct Pose {
    weights: Vec<f64>,
    object_from_node: DMat4,
    /// Object-from-mesh of each joint.
    joints: Vec<DMat4>,
}

/// The inverse transposed times the determinant: turns normals, and is there for a matrix without an inverse too.
fn cofactors(m: &DMat3) -> DMat3 {
    let turned = DMat3::from_cols(
        m.y_axis.cross(m.z_axis),
        m.z_axis.cross(m.x_axis),
        m.x_axis.cross(m.y_axis),
    );
    match m.determinant() < 0.0 {
        true => -turned,
        false => turned,
    }
}

fn unit_or(vector: DVec3, otherwise: [f32; 3]) -> [f32; 3] {
    match vector.try_normalize() {
        Some(unit) => unit.as_vec3().to_array(),
        None => otherwise,
    }
}

/// Gives each triangle, whose vertices are its own, the normal of its face.
fn flatten(primitive: &mut Primitive) {
    for triangle in &primitive.triangles {
        let [a, b, c] =
            triangle.map(|vertex| DVec3::from(primitive.positions[vertex as usize].map(f64::from)));
        if let Some(normal) = (b - a).cross(c - a).try_normalize() {
            for vertex in triangle {
                primitive.normals[*vertex as usize] = normal.as_vec3().to_array();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::animation::{AnimatedNode, Interpolation, Track};
    use glam::DVec4;

    /// A triangle one metre above a joint that turns by 90 degrees about X in a second.
    fn bent() -> Deformation {
        let node = |rest: DMat4| AnimatedNode {
            parent: None,
            rest,
            translation: None,
            rotation: None,
            scale: None,
            weights: Vec::new(),
        };
        let quarter = glam::DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
        let mut joint = node(DMat4::from_scale(DVec3::splat(0.01)));
        joint.rotation = Some(Track {
            times: vec![0.0, 1.0],
            values: vec![DVec4::W, DVec4::from(quarter)],
            interpolation: Interpolation::Linear,
        });
        let base = Primitive {
            positions: vec![[0.0, 100.0, 0.0], [100.0, 100.0, 0.0], [0.0, 100.0, -100.0]],
            normals: vec![[0.0, 1.0, 0.0]; 3],
            triangles: vec![[0, 1, 2]],
            ..Primitive::default()
        };
        let target = MorphTarget {
            positions: vec![[0.0, 100.0, 0.0]; 3],
            ..MorphTarget::default()
        };
        Deformation {
            mesh: Arc::new(DeformableMesh {
                base,
                is_flat: false,
                targets: vec![target],
                influences: vec![vec![(0, 1.0)]; 3],
            }),
            weights: vec![0.0],
            skin: Some(Arc::new(Skin {
                joints: vec![Joint {
                    node: 1,
                    inverse_bind: DMat4::IDENTITY,
                }],
            })),
            animation: Arc::new(Animation {
                // The mesh's own node has no effect.
                nodes: vec![node(DMat4::from_translation(DVec3::X * 7.0)), joint],
                duration_secs: 2.0,
            }),
            node: 0,
        }
    }

    fn near(a: [f32; 3], b: [f32; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
    }

    #[test]
    fn a_skin_follows_its_joints_and_normals_turn_with_it() {
        let deformation = bent();
        assert!(deformation.moves());
        let rest = deformation.at(0.0);
        assert!(
            near(rest.positions[1], [1.0, 1.0, 0.0]),
            "{:?}",
            rest.positions
        );
        let turned = deformation.at(1.0);
        assert!(
            near(turned.positions[1], [1.0, 0.0, 1.0]),
            "{:?}",
            turned.positions
        );
        assert!(
            near(turned.normals[1], [0.0, 0.0, 1.0]),
            "{:?}",
            turned.normals
        );
        assert!(!near(turned.normals[1], rest.normals[1]), "control");
    }

    #[test]
    fn morph_targets_come_before_the_skin() {
        let mut deformation = bent();
        deformation.weights = vec![0.5];
        let morphed = deformation.at(0.0);
        assert!(
            near(morphed.positions[0], [0.0, 1.5, 0.0]),
            "{:?}",
            morphed.positions
        );
        deformation.skin = None;
        let unskinned = deformation.at(0.0);
        assert!(near(unskinned.positions[0], [0.0, 150.0, 0.0]));
        assert!(!deformation.moves(), "control: nothing is animated");
    }
}
