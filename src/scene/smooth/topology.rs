//! A primitive as one connected surface: coincident vertices joined, neighbours listed.

use std::collections::HashMap;

use glam::Vec3;

use crate::scene::Primitive;

/// Vertices that share a position are one here, whatever their other attributes: a flat-shaded mesh would otherwise be a heap of
/// unconnected triangles.
pub(super) struct Topology {
    /// Joined vertex of each vertex of the primitive.
    pub joined: Vec<u32>,
    pub positions: Vec<Vec3>,
    pub faces: Vec<[u32; 3]>,
    /// On the rim of the surface, or where it is not a manifold.
    pub rim: Vec<bool>,
    /// `neighbours[starts[v]..starts[v + 1]]` are those of `v`, sorted.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
}

impl Topology {
    pub fn new(primitive: &Primitive) -> Self {
        let mut index = HashMap::with_capacity(primitive.positions.len());
        let mut positions = Vec::new();
        let joined: Vec<u32> = primitive
            .positions
            .iter()
            .map(|position| {
                // Adding zero turns -0 into 0.
                let key = position.map(|value| (value + 0.0).to_bits());
                *index.entry(key).or_insert_with(|| {
                    positions.push(Vec3::from(*position));
                    positions.len() as u32 - 1
                })
            })
            .collect();
        let faces: Vec<[u32; 3]> = primitive
            .triangles
            .iter()
            .map(|triangle| triangle.map(|vertex| joined[vertex as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        let (starts, neighbours, rim) = connect(&faces, positions.len());
        Self {
            joined,
            positions,
            faces,
            rim,
            starts,
            neighbours,
        }
    }

    pub fn neighbours(&self, vertex: u32) -> &[u32] {
        let start = self.starts[vertex as usize] as usize;
        let end = self.starts[vertex as usize + 1] as usize;
        &self.neighbours[start..end]
    }

    /// Area-weighted unit normals; +Y where no face leaves one.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for &face in &self.faces {
            let [a, b, c] = face.map(|vertex| self.positions[vertex as usize]);
            let normal = (b - a).cross(c - a);
            for vertex in face {
                sums[vertex as usize] += normal;
            }
        }
        sums.into_iter()
            .map(|sum| sum.normalize_or(Vec3::Y))
            .collect()
    }

    /// Mean distance of each vertex to its neighbours; 0 where there are none.
    pub fn spacings(&self) -> Vec<f32> {
        (0..self.positions.len() as u32)
            .map(|vertex| {
                let centre = self.positions[vertex as usize];
                let neighbours = self.neighbours(vertex);
                let sum: f32 = neighbours
                    .iter()
                    .map(|&other| self.positions[other as usize].distance(centre))
                    .sum();
                sum / neighbours.len().max(1) as f32
            })
            .collect()
    }
}

fn connect(faces: &[[u32; 3]], count: usize) -> (Vec<u32>, Vec<u32>, Vec<bool>) {
    // Each directed edge once from either end; an inner edge of a manifold is there twice, once in each direction.
    let mut edges: Vec<(u32, u32, bool)> = faces
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .flat_map(|(from, to)| [(from, to, true), (to, from, false)])
        .collect();
    edges.sort_unstable();
    let mut starts = vec![0; count + 1];
    let mut neighbours = Vec::new();
    let mut rim = vec![false; count];
    for group in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let (from, to, _) = group[0];
        neighbours.push(to);
        starts[from as usize + 1] += 1;
        let forward = group.iter().filter(|edge| edge.2).count();
        if group.len() != 2 || forward != 1 {
            rim[from as usize] = true;
            rim[to as usize] = true;
        }
    }
    for vertex in 0..count {
        starts[vertex + 1] += starts[vertex];
    }
    (starts, neighbours, rim)
}

/// Collects the vertices around one; reused so that a search costs no allocation.
pub(super) struct Search<'a> {
    topology: &'a Topology,
    stamps: Vec<u32>,
    stamp: u32,
    found: Vec<u32>,
}

impl<'a> Search<'a> {
    pub fn new(topology: &'a Topology) -> Self {
        Self {
            topology,
            stamps: vec![0; topology.positions.len()],
            stamp: 0,
            found: Vec::new(),
        }
    }

    /// `centre` first, then all vertices nearer than `radius` that edges connect to it inside that ball: surfaces that pass
    /// nearby, such as the desk behind an edge of the monitor, are not among them.
    pub fn ball(&mut self, centre: u32, radius: f32) -> &[u32] {
        let positions = &self.topology.positions;
        let middle = positions[centre as usize];
        self.stamp += 1;
        self.found.clear();
        self.found.push(centre);
        self.stamps[centre as usize] = self.stamp;
        let mut next = 0;
        while let Some(&vertex) = self.found.get(next) {
            next += 1;
            for &other in self.topology.neighbours(vertex) {
                let stamp = &mut self.stamps[other as usize];
                if *stamp != self.stamp
                    && positions[other as usize].distance_squared(middle) < radius * radius
                {
                    *stamp = self.stamp;
                    self.found.push(other);
                }
            }
        }
        &self.found
    }
}
