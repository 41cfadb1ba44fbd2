//! `[[real]]` and `[[virtual]]`: meshes and built-in shapes, placed, with their materials.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};

use super::deformation::Deformation;
use super::error::{Result, SceneError};
use super::gltf::{GltfScene, PlacedLight, Problem, PunctualLight, load_within};
use super::material::{lambertian, read_material};
use super::placing::{self, Surroundings, bounds, read_placed};
use super::reader::{Choice, Node, Table};
use super::scan::settle_scan;
use super::scanned;
use super::shape::Shape;
use super::shutter::read_object_motion;
use super::{AlphaMode, Camera, Instance, Light, LightKind, Material, Object, Side};
use crate::decode::{FileKind, kind_of};

const KEYS: &[&str] = &[
    "mesh",
    "shape",
    "name",
    "translation",
    "rotation_deg",
    "rotation",
    "scale",
    "material",
    "motion",
    "animation",
];

const REAL_KEYS: &[&str] = &["albedo", "smooth_radius_m", "self_shadow_bias_m"];

/// Albedo of a proxy of which nothing is known.
const UNKNOWN_ALBEDO: f32 = 0.5;

/// Farther from the origin nothing stands: well within what the acceleration structures take.
const MAX_DISTANCE_M: f64 = 1e12;

/// Reads the objects of one scene file.
pub(super) struct ObjectReader<'w> {
    has_photo: bool,
    /// At the picture's time.
    camera: &'w Camera,
    warnings: &'w mut Vec<String>,
    /// Lights that meshes brought.
    lights: Vec<Light>,
    /// A file that several objects name is read once.
    meshes: HashMap<(PathBuf, Option<String>), Rc<GltfScene>>,
}

/// What an object is made of, before materials are settled.
struct Parts {
    name: String,
    instances: Vec<Instance>,
    lights: Vec<PlacedLight>,
    has_materials: bool,
}

impl<'w> ObjectReader<'w> {
    pub fn new(has_photo: bool, camera: &'w Camera, warnings: &'w mut Vec<String>) -> Self {
        Self {
            has_photo,
            camera,
            warnings,
            lights: Vec::new(),
            meshes: HashMap::new(),
        }
    }

    /// All of `[[real]]`, then all of `[[virtual]]`, the lights that came with them, and the files that their meshes name.
    pub fn read_all(mut self, root: &Table) -> Result<(Vec<Object>, Vec<Light>, Vec<PathBuf>)> {
        let mut objects = Vec::new();
        for (key, side) in [("real", Side::Real), ("virtual", Side::Virtual)] {
            for node in root.list(key)? {
                let object = self.read(&node, side, &objects)?;
                objects.push(object);
            }
        }
        let files = self.meshes.values().flat_map(|mesh| mesh.files.clone());
        Ok((objects, self.lights, files.collect()))
    }

    /// `before`: the objects that were read before this one, all real ones among them where it is virtual.
    fn read(&mut self, node: &Node, side: Side, before: &[Object]) -> Result<Object> {
        let table = node.any_table(match side {
            Side::Real => "[[real]]",
            Side::Virtual => "[[virtual]]",
        })?;
        let shape = check_keys(&table, side)?;
        let parts = match shape {
            Some(shape) => read_shape(shape, &table)?,
            None => {
                let animation =
                    table.optional("animation", |node| Ok(node.string()?.to_owned()))?;
                table.required("mesh", "mesh = \"file.glb\"", |node| {
                    self.read_mesh(node, side, animation)
                })?
            }
        };
        let reals = before.partition_point(|object| object.side == Side::Real);
        let around = Surroundings {
            camera: self.camera,
            real: &before[..reals],
        };
        let world_from_object = read_placed(&table, &parts.instances, around)?;
        let name = table.optional("name", |node| Ok(node.string()?.to_owned()))?;
        let mut object = Object {
            name: name.unwrap_or(parts.name),
            side,
            world_from_object,
            motion: read_object_motion(&table, world_from_object)?,
            instances: parts.instances,
            self_shadow_bias_m: 0.0,
            albedo_from_photo: false,
        };
        for light in &parts.lights {
            let kind = place_light(world_from_object, light)
                .ok_or_else(|| too_far(&table, "a light of the mesh"))?;
            self.lights.push(Light { kind, side });
        }
        self.drop_flat_instances(&mut object);
        check_extent(&table, &object)?;
        let may_detect = side == Side::Real && shape.is_none();
        let note = settle_scan(&table, &mut object, may_detect)?;
        // A scanner writes the same grey for everything: that is no measured material.
        let measured = parts.has_materials && !(note.is_some() && is_placeholder(&object));
        self.warnings.extend(note);
        self.settle_materials(&table, &mut object, measured, shape.is_some())?;
        Ok(object)
    }

    fn read_mesh(&mut self, node: &Node, side: Side, animation: Option<String>) -> Result<Parts> {
        let path = node.existing_file()?;
        let kind = kind_of(&path).filter(|kind| *kind != FileKind::Gltf);
        if let Some(refusal) = kind.and_then(|kind| refuse_kind(kind, side)) {
            return Err(node.file_error(&path, refusal));
        }
        let key = (path.clone(), animation);
        let mesh = match self.meshes.get(&key) {
            Some(mesh) => Rc::clone(mesh),
            None => {
                let mesh = match kind {
                    Some(kind) => scanned::read(&path, kind),
                    None => load_within(&path, key.1.as_deref(), node.sandbox())
                        .map_err(|error| advise(&error.problem)),
                }
                .map_err(|problem| node.file_error(&path, problem))?;
                self.warnings
                    .extend(node.file_warnings(mesh.warnings.clone()));
                let mesh = Rc::new(mesh);
                self.meshes.insert(key, Rc::clone(&mesh));
                mesh
            }
        };
        Ok(Parts {
            name: file_stem(&path),
            instances: mesh.instances.clone(),
            lights: mesh.lights.clone(),
            has_materials: mesh.has_materials,
        })
    }

    /// A node of scale 0 is glTF's way to hide things; its normals would be NaN.
    fn drop_flat_instances(&mut self, object: &mut Object) {
        let world_from_object = object.world_from_object;
        let before = object.instances.len();
        object
            .instances
            .retain(|instance| is_invertible(world_from_object * instance.object_from_local));
        let dropped = before - object.instances.len();
        if dropped > 0 {
            let name = &object.name;
            self.warnings.push(format!(
                "{name}: {dropped} parts are dropped: their transforms flatten them"
            ));
        }
    }

    fn settle_materials(
        &mut self,
        table: &Table,
        object: &mut Object,
        has_materials: bool,
        is_shape: bool,
    ) -> Result<()> {
        table.refuse_both("material", "albedo")?;
        let material = table.optional("material", |node| read_material(node, &object.name))?;
        let wish = table.optional("albedo", |node| self.read_albedo(node))?;
        if let Some(material) = material {
            replace_materials(object, |_| material.clone());
        } else if wish.is_some() || (object.side == Side::Real && !has_materials) {
            object.albedo_from_photo = self.has_photo;
            let name = object.name.clone();
            replace_materials(object, |own| {
                keep_alpha(lambertian(&name, UNKNOWN_ALBEDO), own)
            });
        } else if is_shape {
            let name = object.name.clone();
            replace_materials(object, |_| Material {
                name: name.clone(),
                ..Material::default()
            });
        }
        Ok(())
    }

    fn read_albedo(&self, node: &Node) -> Result<()> {
        if node.string()? != "from-photo" {
            return Err(node.impossible("\"from-photo\" (colours stand in `material`)"));
        }
        if !self.has_photo {
            return Err(node.error(
                "`albedo` is \"from-photo\" without a photograph",
                "`image` in [photo]",
                "add the photograph, or give a `material`",
            ));
        }
        Ok(())
    }
}

impl Object {
    /// It has a motion, or a part of it an animation.
    pub fn is_animated(&self) -> bool {
        self.instances.iter().any(|instance| self.moves(instance))
    }

    /// Whether one of its parts moves, with it or by itself.
    pub fn moves(&self, instance: &Instance) -> bool {
        self.motion.is_some() || instance.animation.is_some() || instance.deforms()
    }

    /// World-from-object at a time.
    pub fn world_from_object_at(&self, time_secs: f64) -> DMat4 {
        match &self.motion {
            Some(motion) => motion.at(time_secs),
            None => self.world_from_object,
        }
    }

    /// The middle of the smallest box along the object's own axes around all its vertices, at a time, world space; `None` if it is empty.
    pub fn centre_at(&self, time_secs: f64) -> Option<DVec3> {
        let points = self.instances.iter().flat_map(|instance| {
            let transform = instance.object_from_local_at(time_secs);
            (instance.primitive.positions.iter())
                .map(move |p| transform.transform_point3(DVec3::from(p.map(f64::from))))
        });
        let (lo, hi) = bounds(points)?;
        let world_from_object = self.world_from_object_at(time_secs);
        Some(world_from_object.transform_point3((lo + hi) * 0.5))
    }
}

impl Instance {
    /// Its shape changes with time.
    pub fn deforms(&self) -> bool {
        self.deformation.as_ref().is_some_and(Deformation::moves)
    }

    pub fn object_from_local_at(&self, time_secs: f64) -> DMat4 {
        match &self.animation {
            Some(animation) => animation.object_from_local(time_secs),
            None => self.object_from_local,
        }
    }

    /// Corners of the box around the vertices, local space; none if there are no vertices.
    pub fn corners(&self) -> Vec<DVec3> {
        let positions = self.primitive.positions.iter();
        let Some((lo, hi)) = bounds(positions.map(|p| DVec3::from(p.map(f64::from)))) else {
            return Vec::new();
        };
        let side = |corner: u32, axis: usize| match corner >> axis & 1 {
            0 => lo[axis],
            _ => hi[axis],
        };
        (0..8)
            .map(|corner| DVec3::new(side(corner, 0), side(corner, 1), side(corner, 2)))
            .collect()
    }
}

/// Refuses keys that do not go with this side and shape; returns the shape.
fn check_keys(table: &Table, side: Side) -> Result<Option<Shape>> {
    table.refuse_both("mesh", "shape")?;
    let shape: Option<Shape> = table.optional("shape", |node| node.choice())?;
    if side == Side::Virtual {
        for key in REAL_KEYS {
            let message = format!(
                "`{key}` in [[virtual]]; expected it in [[real]] only, where the photograph and scans are; remove it"
            );
            if let Some(error) = table.key_error(key, &message) {
                return Err(error);
            }
        }
    }
    if side == Side::Real {
        for key in ["motion", "animation"].iter().chain(placing::VIRTUAL_KEYS) {
            let message = format!(
                "`{key}` in [[real]]; expected it in [[virtual]] only: the photograph shows real things where they are; remove it"
            );
            if let Some(error) = table.key_error(key, &message) {
                return Err(error);
            }
        }
    }
    let mut known = KEYS.to_vec();
    known.extend(placing::KEYS);
    known.extend(shape.map_or(&[][..], Shape::keys));
    known.extend(match side {
        Side::Real => REAL_KEYS,
        Side::Virtual => placing::VIRTUAL_KEYS,
    });
    table.refuse_unknown(&known)?;
    Ok(shape)
}

fn read_shape(shape: Shape, table: &Table) -> Result<Parts> {
    Ok(Parts {
        name: shape.name().to_owned(),
        instances: vec![Instance {
            animation: None,
            deformation: None,
            object_from_local: DMat4::IDENTITY,
            primitive: Arc::new(shape.read(table)?),
            material: Arc::new(Material::default()),
        }],
        lights: Vec::new(),
        has_materials: false,
    })
}

/// Every part has one grey without textures.
fn is_placeholder(object: &Object) -> bool {
    object.instances.iter().all(|instance| {
        let m = &*instance.material;
        let [r, g, b, _] = m.base_color;
        r == g
            && g == b
            && m.metallic == 0.0
            && m.base_color_texture.is_none()
            && instance.primitive.colors.is_empty()
    })
}

fn replace_materials(object: &mut Object, material: impl Fn(&Material) -> Material) {
    for instance in &mut object.instances {
        instance.material = Arc::new(material(&instance.material));
    }
}

/// Leaves that a scan cuts out by alpha stay cut out when their colour comes from the photograph.
fn keep_alpha(material: Material, own: &Material) -> Material {
    if own.alpha_mode == AlphaMode::Opaque {
        return material;
    }
    let [r, g, b, _] = material.base_color;
    Material {
        base_color: [r, g, b, own.base_color[3]],
        base_color_texture: own.base_color_texture.clone(),
        alpha_mode: own.alpha_mode,
        ..material
    }
}

fn is_invertible(world_from_local: DMat4) -> bool {
    let axes = DMat3::from_mat4(world_from_local);
    let lengths = [axes.x_axis, axes.y_axis, axes.z_axis].map(DVec3::length);
    let volume = lengths.iter().product::<f64>();
    lengths.iter().all(|length| *length > 1e-30) && axes.determinant().abs() > 1e-9 * volume
}

fn check_extent(table: &Table, object: &Object) -> Result<()> {
    for instance in &object.instances {
        let world_from_local = object.world_from_object * instance.object_from_local;
        for position in &instance.primitive.positions {
            let position = DVec3::from(position.map(f64::from));
            if !is_near(world_from_local.transform_point3(position)) {
                return Err(too_far(table, &instance.primitive.name));
            }
        }
    }
    Ok(())
}

/// False for NaN too.
fn is_near(world: DVec3) -> bool {
    world.to_array().iter().all(|x| x.abs() <= MAX_DISTANCE_M)
}

fn too_far(table: &Table, what: &str) -> SceneError {
    table.error(
        format!("`{what}` is more than 1e12 m from the origin"),
        "coordinates of at most 1e12 m",
        "lower `scale` or `translation`",
    )
}

/// None where the light's position or direction is lost in a flat or huge transform.
fn place_light(world_from_object: DMat4, light: &PlacedLight) -> Option<LightKind> {
    let world_from_light = world_from_object * light.object_from_light;
    let position = world_from_light.w_axis.truncate();
    let direction = world_from_light
        .transform_vector3(DVec3::NEG_Z)
        .try_normalize()
        .map(|direction| direction.to_array());
    if !is_near(position) {
        return None;
    }
    let position = position.to_array();
    Some(match light.kind {
        PunctualLight::Point { intensity } => LightKind::Point {
            position,
            intensity,
        },
        PunctualLight::Spot {
            intensity,
            inner_deg,
            outer_deg,
        } => LightKind::Spot {
            position,
            direction: direction?,
            intensity,
            inner_deg,
            outer_deg,
        },
        PunctualLight::Directional { irradiance } => LightKind::Directional {
            direction: direction?,
            irradiance,
        },
    })
}

/// Why a file of that kind, which is not glTF, is no mesh of that side.
fn refuse_kind(kind: FileKind, side: Side) -> Option<String> {
    let name = kind.name();
    let convert = "import it in Blender and export it as glTF 2.0 (.glb)";
    match (kind, side) {
        (FileKind::Ply | FileKind::Obj, Side::Real) => None,
        (FileKind::Ply | FileKind::Obj, Side::Virtual) => Some(format!(
            "it is {name}, which is read in [[real]] alone; expected glTF, with its materials; {convert}"
        )),
        (FileKind::Picture(_) | FileKind::Film(_), _) => Some(format!(
            "it is {name}; expected a glTF model; name another file"
        )),
        _ => Some(format!(
            "it is {name}; expected glTF 2.0, or in [[real]] PLY or OBJ; {convert}"
        )),
    }
}

/// "problem; expected ...; how to mend" of a mesh file.
fn advise(problem: &Problem) -> String {
    match problem {
        Problem::Unreadable(_) => {
            format!("{problem}; expected a readable file; correct the path or the rights")
        }
        Problem::Malformed { .. } => {
            format!("{problem}; expected valid glTF 2.0; export or repair the model")
        }
        Problem::Extension { .. } => problem.to_string(),
    }
}

fn file_stem(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}
