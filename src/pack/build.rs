//! Scene to packed scene: transforms composed in f64, the anchor subtracted in f64, then f32.

use std::ops::Range;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, Vec3};

use super::camera::frame_camera;
use super::lights::pack_lights;
use super::photons::traced_environment;
use crate::accel::{AccelError, Cover, Mesh, WorldBvh};
use crate::light::environment_table::environment_table;
use crate::packed::materials::{MaterialKey, MaterialTable};
use crate::packed::{
    ESTIMATOR_DIRECT, ESTIMATOR_PAPER, FRAME_ALPHA, FRAME_ENV_DRAWN, FRAME_SHUTTER,
    FRAME_SHUTTER_ORDERED, Frame, MATERIAL_ALPHA_BLEND, MATERIAL_ALPHA_MASK, MAX_SPHERES, Moved,
    NONE, PIXEL_BEAM_MAY_MEET_VIRTUAL, PackedScene, PixelInfo, Resting, SAMPLER_CMJ,
    SAMPLER_JITTERED, SAMPLER_SOBOL, Triangle, Vertex,
};
use crate::scene::{
    Camera, EnvironmentMap, Estimator, Exposure, Instance, Lens, LightKind, Material, SamplerKind,
    Scene, Side,
};
use crate::work::{Meter, Phase, Watcher};

/// The anchor is kept while the camera stays within this distance of it: f32 resolves 1 m to 1e-7 m.
const ANCHOR_REACH_M: f64 = 1.0;

/// What a triangle of a tree takes, where packing it is one step.
const STEPS_OF_A_TREE: u64 = 4;

#[derive(Debug, thiserror::Error)]
pub enum PackError {
    #[error(transparent)]
    Accel(#[from] AccelError),
    #[error("the scene has {0} {1}; mixray addresses at most {2}")]
    TooMany(usize, &'static str, usize),
}

/// The anchor for a camera at `position`: the one before while the camera is within its reach.
pub fn next_anchor(before: Option<DVec3>, position: DVec3) -> DVec3 {
    before
        .filter(|anchor| position.distance(*anchor) <= ANCHOR_REACH_M)
        .unwrap_or(position)
}

impl PackedScene {
    /// Packs the whole scene, anchored at its camera.
    ///
    /// # Errors
    /// More triangles or texels than 32-bit indices address, or an acceleration structure cannot be built.
    pub fn build(scene: &Scene, watcher: &Watcher<'_>) -> Result<Self, PackError> {
        Self::build_at(
            scene,
            scene.camera.world_from_camera.w_axis.truncate(),
            watcher,
        )
    }

    /// [`PackedScene::build`] anchored at a point of the world, which should be near the camera.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn build_at(
        scene: &Scene,
        anchor: DVec3,
        watcher: &Watcher<'_>,
    ) -> Result<Self, PackError> {
        Self::build_into(Self::empty(), scene, anchor, watcher)
    }

    /// [`PackedScene::build_at`] with looser spheres about the virtual objects, each with its own: [`PackedScene::move_virtual`] then costs little.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn build_draft(
        scene: &Scene,
        anchor: DVec3,
        watcher: &Watcher<'_>,
    ) -> Result<Self, PackError> {
        let draft = Self {
            object_covers: Some(Vec::new()),
            ..Self::empty()
        };
        Self::build_into(draft, scene, anchor, watcher)
    }

    fn build_into(
        empty: Self,
        scene: &Scene,
        anchor: DVec3,
        watcher: &Watcher<'_>,
    ) -> Result<Self, PackError> {
        let [in_real, in_virtual] = [Side::Real, Side::Virtual].map(|side| triangles(scene, side));
        let steps = (1 + STEPS_OF_A_TREE) * (in_real + in_virtual);
        let meter = Meter::begin(watcher, Phase::Trees, steps);
        let mut packed = Self {
            anchor_m: anchor.to_array(),
            ..empty
        };
        packed.set_camera(scene);
        packed.set_settings(scene);
        packed.set_environment(scene);
        packed.add_world(scene, Side::Real)?;
        meter.add(in_real);
        packed.real_bvh = WorldBvh::build(&packed.corners(0), 0)?;
        packed.frame.real_triangle_count = packed.triangles.len() as u32;
        packed.real_vertex_count = packed.vertices.len();
        meter.add(STEPS_OF_A_TREE * in_real);
        packed.rebuild_virtual(scene)?;
        meter.end();
        Ok(packed)
    }

    /// Packs the virtual objects and all lights anew; the real world and its BVH stay.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn rebuild_virtual(&mut self, scene: &Scene) -> Result<(), PackError> {
        self.place_virtual(scene)?;
        let first = self.frame.real_triangle_count;
        self.virtual_bvh = WorldBvh::build(&self.corners(first as usize), first)?;
        self.rebuild_moving(scene)
    }

    /// Puts what rests of the virtual world where it is, and the spheres about it.
    pub(super) fn place_virtual(&mut self, scene: &Scene) -> Result<(), PackError> {
        self.moved = None;
        self.resting_objects.clear();
        let first = self.frame.real_triangle_count as usize;
        self.triangles.truncate(first);
        self.vertices.truncate(self.real_vertex_count);
        self.add_world(scene, Side::Virtual)?;
        self.resting = Resting {
            triangles: self.triangles.len(),
            vertices: self.vertices.len(),
        };
        self.cover_resting(scene, first);
        Ok(())
    }

    /// Packs what moves of the virtual objects, and all lights, anew: the cost is that of the moving triangles, and of a look at every vertex.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub fn rebuild_moving(&mut self, scene: &Scene) -> Result<(), PackError> {
        self.place_moving(scene)?;
        let corners = self.corners(self.resting.triangles);
        self.virtual_bvh.set_moving(&corners)?;
        let alpha = self
            .materials
            .iter()
            .any(|m| m.flags & (MATERIAL_ALPHA_MASK | MATERIAL_ALPHA_BLEND) != 0);
        self.frame.flags = self.frame.flags & !FRAME_ALPHA | if alpha { FRAME_ALPHA } else { 0 };
        self.mark_panes();
        self.pack_facets(scene);
        pack_lights(self, scene);
        self.pack_photons();
        Ok(())
    }

    /// Puts what moves where it is, and the spheres about it; its tree and the lights stay as they were.
    ///
    /// # Errors
    /// As [`PackedScene::build`].
    pub(super) fn place_moving(&mut self, scene: &Scene) -> Result<(), PackError> {
        self.triangles.truncate(self.resting.triangles);
        self.vertices.truncate(self.resting.vertices);
        self.add_objects(scene, Side::Virtual, true)?;
        let mesh = self.mesh(self.resting.triangles..self.triangles.len(), |_| true);
        let cover = Cover::of(&mesh, MAX_SPHERES);
        let covers: Vec<&Cover> = self.resting_covers.iter().chain([&cover]).collect();
        let spheres = Cover::spheres(&covers, MAX_SPHERES);
        self.frame.sphere_count = spheres.len() as u32;
        self.frame.spheres = [[0.0; 4]; MAX_SPHERES];
        self.frame.spheres[..spheres.len()].copy_from_slice(&spheres);
        Ok(())
    }

    /// Whether the camera is still near enough to the anchor to keep what is packed.
    pub fn anchor_serves(&self, scene: &Scene) -> bool {
        let camera = scene.camera.world_from_camera.w_axis.truncate();
        let anchor = DVec3::from(self.anchor_m);
        next_anchor(Some(anchor), camera) == anchor
    }

    /// Camera and lens; nothing else depends on them but the pilot.
    pub fn set_camera(&mut self, scene: &Scene) {
        self.set_view(&scene.camera, &scene.lens);
    }

    /// The same of a camera that need not be the scene's.
    pub fn set_view(&mut self, camera: &Camera, lens: &Lens) {
        frame_camera(camera, lens, DVec3::from(self.anchor_m), &mut self.frame);
        self.frame.flags &= !(FRAME_SHUTTER | FRAME_SHUTTER_ORDERED);
        (self.frame.shutter_open, self.frame.shutter_row) = (1.0, 0.0);
        let count = camera.width as usize * camera.height as usize;
        self.pixels = vec![PixelInfo::uniform(PIXEL_BEAM_MAY_MEET_VIRTUAL); count];
    }

    /// Seed, sampler, estimator, bounces, exposure.
    pub fn set_settings(&mut self, scene: &Scene) {
        let settings = &scene.settings;
        let frame = &mut self.frame;
        frame.seed = settings.seed;
        frame.rays_total = settings.rays_per_pixel;
        frame.max_bounces = settings.max_bounces;
        frame.clamp_indirect = settings.clamp_indirect.min(f32::MAX);
        frame.sampler = match settings.sampler {
            SamplerKind::Jittered => SAMPLER_JITTERED,
            SamplerKind::Cmj => SAMPLER_CMJ,
            SamplerKind::Sobol => SAMPLER_SOBOL,
        };
        frame.estimator = match settings.estimator {
            Estimator::Direct => ESTIMATOR_DIRECT,
            Estimator::Paper => ESTIMATOR_PAPER,
        };
        frame.exposure_scale = match settings.exposure {
            Exposure::Ev(ev) => ev.exp2() as f32,
            Exposure::Auto => 1.0,
        };
        if scene.photo.is_some() {
            frame.flags |= FRAME_ENV_DRAWN;
        }
    }

    /// The environment's radiance, rotation and tables; lights are packed after it.
    pub fn set_environment(&mut self, scene: &Scene) {
        let Some(environment) = &scene.environment else {
            set_rotation(&mut self.frame, 0.0);
            return;
        };
        set_rotation(&mut self.frame, environment.rotation_deg);
        let scale = environment.scale as f32;
        match &environment.map {
            EnvironmentMap::Constant(radiance) => {
                let [r, g, b] = radiance.map(|c| c * scale);
                self.frame.env_radiance = [r, g, b, 0.0];
                self.env_mean_luminance = f64::from(crate::math::luminance(Vec3::new(r, g, b)));
            }
            EnvironmentMap::LatLong {
                width,
                height,
                texels,
            } => {
                self.env_texels = texels.iter().flatten().copied().collect();
                let table = environment_table(*width, *height, &self.env_texels);
                self.frame.env_width = *width;
                self.frame.env_height = *height;
                self.frame.env_radiance = [scale, scale, scale, table.normaliser];
                self.env_mean_luminance = table.mean_luminance * environment.scale;
                self.env_traced = traced_environment(
                    *width,
                    *height,
                    &self.env_texels,
                    environment.scale,
                    self.env_mean_luminance,
                );
                self.env_cdf = table.cdf;
                self.env_starts = table.starts;
                self.env_edges = table.edges;
            }
        }
    }

    /// Appends the triangles of one side that rest: its objects, then its quad lights.
    fn add_world(&mut self, scene: &Scene, side: Side) -> Result<(), PackError> {
        self.add_objects(scene, side, false)?;
        for (index, light) in scene.lights.iter().enumerate() {
            if light.side != side {
                continue;
            }
            if let LightKind::Quad {
                corner,
                edge_u,
                edge_v,
                radiance,
            } = light.kind
            {
                let record = MaterialTable::quad_light(radiance);
                // The virtual world is packed again whenever it moves: its lamps must not pile up.
                let known = self.materials.iter().position(|m| *m == record);
                let material = known.unwrap_or(self.materials.len()) as u32;
                if known.is_none() {
                    self.materials.push(record);
                }
                self.add_quad(
                    DVec3::from(corner),
                    DVec3::from(edge_u),
                    DVec3::from(edge_v),
                    material,
                    index as u32,
                );
            }
        }
        self.check_triangles()
    }

    /// Appends the parts of one side's objects that move, or those that rest.
    fn add_objects(&mut self, scene: &Scene, side: Side, moving: bool) -> Result<(), PackError> {
        let objects = (scene.objects.iter().enumerate()).filter(|(_, o)| o.side == side);
        for (index, _) in objects {
            let (triangles, vertices) = (self.triangles.len(), self.vertices.len());
            self.add_object(scene, index, moving)?;
            if side == Side::Virtual && !moving {
                self.resting_objects.push(Moved {
                    object: index,
                    triangles: triangles..self.triangles.len(),
                    vertices: vertices..self.vertices.len(),
                });
            }
        }
        self.check_triangles()
    }

    /// Appends the parts of an object that move, or those that rest.
    pub(super) fn add_object(
        &mut self,
        scene: &Scene,
        index: usize,
        moving: bool,
    ) -> Result<(), PackError> {
        let object = &scene.objects[index];
        let parts = object.instances.iter();
        for instance in parts.filter(|instance| object.moves(instance) == moving) {
            let material = self.add_material(
                &instance.material,
                object.self_shadow_bias_m,
                object.albedo_from_photo,
            )?;
            self.add_instance(&object.world_from_object, instance, material, index as u32);
        }
        Ok(())
    }

    fn check_triangles(&self) -> Result<(), PackError> {
        let limit = (NONE / 8) as usize;
        if self.triangles.len() > limit {
            return Err(PackError::TooMany(self.triangles.len(), "triangles", limit));
        }
        Ok(())
    }

    /// A virtual object is made of another material, and nothing is made of the one before; its triangles are as they were.
    pub fn replace_material(&mut self, before: &Arc<Material>, material: &Arc<Material>) {
        let mut table = std::mem::take(&mut self.material_table);
        table.replace(self, before, material);
        self.material_table = table;
    }

    fn add_material(
        &mut self,
        material: &Arc<Material>,
        self_shadow_bias_m: f32,
        from_photo: bool,
    ) -> Result<u32, PackError> {
        let key = MaterialKey::new(material, self_shadow_bias_m, from_photo);
        let mut table = std::mem::take(&mut self.material_table);
        let index = table.index_of(self, material, key);
        self.material_table = table;
        let limit = NONE as usize;
        if self.texels.len() > limit {
            return Err(PackError::TooMany(self.texels.len(), "texels", limit));
        }
        Ok(index)
    }

    fn add_instance(
        &mut self,
        world_from_object: &DMat4,
        instance: &Instance,
        material: u32,
        object: u32,
    ) {
        let world_from_local = *world_from_object * instance.object_from_local;
        let linear = DMat3::from_mat4(world_from_local);
        let mirrored = linear.determinant() < 0.0;
        let normal_from_local = normal_matrix(&linear);
        let primitive = &instance.primitive;
        let anchor = DVec3::from(self.anchor_m);
        let first_vertex = self.vertices.len() as u32;
        let direction = |m: &DMat3, v: [f32; 3]| {
            (*m * Vec3::from(v).as_dvec3())
                .normalize_or_zero()
                .as_vec3()
        };
        for (i, position) in primitive.positions.iter().enumerate() {
            let at = world_from_local.transform_point3(Vec3::from(*position).as_dvec3()) - anchor;
            let at = at.as_vec3();
            let normal = direction(&normal_from_local, primitive.normals[i]);
            let uv = |set: usize| primitive.uvs[set].get(i).copied().unwrap_or([0.0; 2]);
            let (uv0, uv1) = (uv(0), uv(1));
            let tangent = primitive.tangents.get(i).map_or([0.0; 4], |t| {
                let d = direction(&linear, [t[0], t[1], t[2]]);
                [d.x, d.y, d.z, if mirrored { -t[3] } else { t[3] }]
            });
            self.vertices.push(Vertex {
                position_u0: [at.x, at.y, at.z, uv0[0]],
                normal_v0: [normal.x, normal.y, normal.z, uv0[1]],
                tangent,
                color: primitive.colors.get(i).copied().unwrap_or([1.0; 4]),
                uv1: [uv1[0], uv1[1], 0.0, 0.0],
            });
        }
        for &[a, b, c] in &primitive.triangles {
            let (b, c) = if mirrored { (c, b) } else { (b, c) };
            let vertices = [a, b, c].map(|i| first_vertex + i);
            self.add_triangle(vertices, material, object, NONE);
        }
    }

    fn add_quad(&mut self, corner: DVec3, edge_u: DVec3, edge_v: DVec3, material: u32, light: u32) {
        let first_vertex = self.vertices.len() as u32;
        let normal = edge_u.cross(edge_v).normalize_or_zero().as_vec3();
        let anchor = DVec3::from(self.anchor_m);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let at = (corner + edge_u * u + edge_v * v - anchor).as_vec3();
            self.vertices.push(Vertex {
                position_u0: [at.x, at.y, at.z, u as f32],
                normal_v0: [normal.x, normal.y, normal.z, v as f32],
                tangent: [0.0; 4],
                color: [1.0; 4],
                uv1: [0.0; 4],
            });
        }
        for corners in [[0, 1, 2], [0, 2, 3]] {
            let vertices = corners.map(|i| first_vertex + i);
            self.add_triangle(vertices, material, NONE, light);
        }
    }

    /// Triangles that the transform or the rounding made degenerate are left out.
    fn add_triangle(&mut self, vertices: [u32; 3], material: u32, object: u32, light: u32) {
        let [a, b, c] = vertices.map(|v| self.position(v));
        if (b - a)
            .as_dvec3()
            .cross((c - a).as_dvec3())
            .length_squared()
            > 0.0
        {
            self.triangles.push(Triangle {
                light,
                ..Triangle::new(vertices, &self.vertices, material, object)
            });
        }
    }

    /// Anchor-relative position of a vertex.
    pub fn position(&self, vertex: u32) -> Vec3 {
        let [x, y, z, _] = self.vertices[vertex as usize].position_u0;
        Vec3::new(x, y, z)
    }

    pub(super) fn corners(&self, first_triangle: usize) -> Vec<[Vec3; 3]> {
        self.corners_of(first_triangle..self.triangles.len())
    }

    pub(super) fn corners_of(&self, triangles: Range<usize>) -> Vec<[Vec3; 3]> {
        self.triangles[triangles]
            .iter()
            .map(|t| t.vertices.map(|v| self.position(v)))
            .collect()
    }

    /// Those of the triangles that are kept.
    pub(super) fn mesh(&self, range: Range<usize>, is_kept: impl Fn(&Triangle) -> bool) -> Mesh {
        let kept = self.triangles[range].iter().filter(|t| is_kept(t));
        let triangles: Vec<[u32; 3]> = kept.map(|t| t.vertices).collect();
        let vertices = triangles.iter().flatten().copied();
        let (Some(first), Some(last)) = (vertices.clone().min(), vertices.max()) else {
            return Mesh::default();
        };
        Mesh {
            points: (first..=last).map(|v| self.position(v)).collect(),
            triangles: (triangles.iter()).map(|t| t.map(|v| v - first)).collect(),
        }
    }
}

/// How many the objects of one side have.
fn triangles(scene: &Scene, side: Side) -> u64 {
    let objects = scene.objects.iter().filter(|object| object.side == side);
    let instances = objects.flat_map(|object| &object.instances);
    instances.map(|i| i.primitive.triangles.len() as u64).sum()
}

fn set_rotation(frame: &mut Frame, rotation_deg: f64) {
    let (sin, cos) = rotation_deg.to_radians().sin_cos();
    frame.env_cos = cos as f32;
    frame.env_sin = sin as f32;
}

/// Cofactors instead of the inverse transpose: the same directions up to sign, and defined for flattened objects too.
fn normal_matrix(linear: &DMat3) -> DMat3 {
    let sign = if linear.determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let [a, b, c] = [linear.x_axis, linear.y_axis, linear.z_axis];
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b)) * sign
}
