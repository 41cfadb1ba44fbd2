//! glTF 2.0 (.gltf, .glb) to placed primitives, materials and lights.
//!
//! The typed model is that of the `gltf` crate; its accessor and import code, which can panic on malformed files, is not used.
//! Every index, offset and length is checked here before it is followed, so a broken file is an error and never a panic.
//!
//! Only what the drawn scene reaches is read: a damaged image that nothing shows does no harm. Drawn are the nodes of the
//! default scene, or of the first scene where no default is named, or all root nodes where there is no scene. A node
//! animation is applied where one is asked for; skins and morph targets shape their meshes. Occlusion textures are not read, because the light transport computes what they fake.

mod animation;
mod container;
mod deformable;
mod document;
mod image;
mod instancing;
mod lights;
mod material;
mod mesh;
mod nodes;
mod notes;
mod slots;
mod specular_glossiness;
mod uv_sets;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};

use super::Instance;
use super::animation::InstanceAnimation;
use super::deformation::{DeformableMesh, Deformation};
use super::sandbox::Sandbox;
use container::malformed;
use deformable::read_skin;
use document::Document;
use instancing::copies;
use lights::place_light;
pub use lights::{PlacedLight, PunctualLight};
use nodes::Node;
use notes::{Note, Notes};

/// What a glTF file brings into an object.
#[derive(Clone, Debug, Default)]
pub struct GltfScene {
    /// A mesh that several nodes draw is shared.
    pub instances: Vec<Instance>,
    pub lights: Vec<PlacedLight>,
    /// At least one drawn primitive names a material of its own; the others have glTF's default (white rough metal).
    pub has_materials: bool,
    /// The files beside this one that its buffers and images name.
    pub files: Vec<PathBuf>,
    /// One line each; the caller adds the file's name.
    pub warnings: Vec<String>,
}

/// A glTF file that cannot be read; the message is one line and names the file and the place in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GltfError {
    pub path: PathBuf,
    pub problem: Problem,
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    #[error("cannot be read: {0}")]
    Unreadable(String),
    /// `at` is a place such as `accessors[3]` or a mesh's name.
    #[error("{at}: {reason}")]
    Malformed { at: String, reason: String },
    #[error("needs the glTF extension {name}, which mixray does not read{advice}")]
    Extension { name: String, advice: String },
}

impl Problem {
    fn extension(name: &str) -> Self {
        let advice = match name {
            "KHR_draco_mesh_compression"
            | "EXT_meshopt_compression"
            | "KHR_meshopt_compression" => {
                "; convert the file with `npx @gltf-transform/cli copy IN.glb OUT.glb`, which writes the mesh uncompressed"
            }
            "KHR_texture_basisu" => {
                "; convert the textures to PNG, for example with `npx @gltf-transform/cli ktxdecompress IN.glb OUT.glb`"
            }
            "EXT_texture_avif" => {
                "; convert the textures with `npx @gltf-transform/cli png IN.glb OUT.glb`"
            }
            _ => "; export the model again without it",
        };
        Self::Extension {
            name: container::clip(name),
            advice: advice.into(),
        }
    }
}

impl fmt::Display for GltfError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let line = format!("{}: {}", self.path.display(), self.problem);
        // Names come from the file and may hold line ends or terminal codes.
        let clean: String = line
            .chars()
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect();
        f.write_str(&clean)
    }
}

impl std::error::Error for GltfError {}

/// Extensions that a file may require. Variants: the default material is what a file shows before anyone picks one.
const SUPPORTED_EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

/// Extensions that are dealt with where they occur: the mesh is either there uncompressed, or it is an error.
const COMPRESSION_EXTENSIONS: &[&str] = &[
    "EXT_meshopt_compression",
    "KHR_draco_mesh_compression",
    "KHR_meshopt_compression",
];

/// Reads a .gltf or .glb file, with its external and embedded buffers and images.
///
/// The geometry is finite, indexed in range and free of degenerate triangles; a triangle may still collapse when a transform is
/// applied and rounded. Instances whose transform cannot be inverted are left out with a warning.
///
/// # Errors
/// A [`GltfError`] of one line where the file is unreadable or broken, refers to something that does not exist, holds a
/// number that is not finite, or needs an extension that mixray does not have (with the way to convert it).
pub fn load_gltf(path: &Path) -> Result<GltfScene, GltfError> {
    load_animated(path, None)
}

/// [`load_gltf`] with the animation of that name or number on the instances that it moves.
///
/// # Errors
/// As [`load_gltf`]; or there is no such animation, or it is broken.
pub fn load_animated(path: &Path, animation: Option<&str>) -> Result<GltfScene, GltfError> {
    load_within(path, animation, None)
}

/// Names of its animations, or their numbers where they have none.
///
/// # Errors
/// As [`load_gltf`].
pub fn animation_names(path: &Path) -> Result<Vec<String>, GltfError> {
    let names = || {
        let container = container::read_container(path)?;
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        let animations = Document::new(container, folder)?.animations()?;
        let named = animations.into_iter().enumerate();
        Ok(named
            .map(|(i, a)| a.name.unwrap_or_else(|| i.to_string()))
            .collect())
    };
    names().map_err(|problem| GltfError {
        path: path.to_path_buf(),
        problem,
    })
}

/// [`load_animated`] of a file all of whose buffers and images lie in the sandbox.
pub(super) fn load_within(
    path: &Path,
    animation: Option<&str>,
    sandbox: Option<&Sandbox>,
) -> Result<GltfScene, GltfError> {
    load(path, animation, sandbox).map_err(|problem| GltfError {
        path: path.to_path_buf(),
        problem,
    })
}

fn load(
    path: &Path,
    wanted: Option<&str>,
    sandbox: Option<&Sandbox>,
) -> Result<GltfScene, Problem> {
    let container = container::read_container(path)?;
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    let document = Document::new(container, folder)?;
    let files = document.files();
    if let Some(refusal) = sandbox.and_then(|sandbox| {
        let mut refusals = files.iter().filter_map(|file| sandbox.refusal(file));
        refusals.next()
    }) {
        return Err(container::malformed("a URI", refusal));
    }
    let mut notes = Notes::default();
    check_extensions(&document, &mut notes)?;

    let mut meshes = mesh::Meshes::new(&document);
    let mut materials = material::Materials::new(&document);
    let mut scene = GltfScene {
        files,
        ..GltfScene::default()
    };
    let placed = placed_nodes(&document, &mut notes)?;
    let animation = wanted
        .map(|wanted| animation::read(&document, wanted))
        .transpose()?
        .map(Arc::new);
    let nodes = match &animation {
        Some(animation) => Arc::clone(animation),
        None => Arc::new(animation::at_rest(&document)?),
    };
    for (index, object_from_node) in placed {
        let node = &document.nodes[index];
        if let Some(placed) = &node.extensions.light {
            scene
                .lights
                .push(place_light(&document, placed.light, object_from_node)?);
        }
        let Some(mesh) = node.mesh else { continue };
        let inverse = object_from_node.inverse();
        if object_from_node.determinant() == 0.0 || !inverse.is_finite() {
            notes.add(Note::Collapsed, 1, &format!("nodes[{index}]"));
            continue;
        }
        let at = format!("nodes[{index}]");
        let drawn = meshes.get(mesh, &at, &mut notes)?;
        let deformable: Vec<&DeformableMesh> = drawn
            .iter()
            .filter_map(|d| d.deformable.as_deref())
            .collect();
        let skin = match node.skin {
            Some(skin) if !deformable.is_empty() => Some(read_skin(&document, skin, &deformable)?),
            _ => None,
        };
        let copies = match &node.extensions.instancing {
            Some(instancing) if skin.is_none() => copies(instancing, &document, &at)?,
            _ => vec![DMat4::IDENTITY],
        };
        for drawn in &drawn {
            let material = materials.get(drawn.material, &drawn.primitive, &mut notes)?;
            scene.has_materials |= drawn.material.is_some();
            let deformation = drawn.deformable.as_ref().map(|mesh_of| Deformation {
                mesh: Arc::clone(mesh_of),
                weights: rest_weights(&document, node, mesh),
                skin: skin.clone(),
                animation: Arc::clone(&nodes),
                node: index,
            });
            let is_skinned = deformation.as_ref().is_some_and(|d| d.skin.is_some());
            let primitive = match &deformation {
                Some(deformation) => Arc::new(deformation.at(0.0)),
                None => Arc::clone(&drawn.primitive),
            };
            for node_from_local in &copies {
                scene.instances.push(Instance {
                    object_from_local: match is_skinned {
                        true => DMat4::IDENTITY,
                        false => object_from_node * *node_from_local,
                    },
                    animation: (animation.as_ref())
                        .filter(|animation| animation.moves(index) && !is_skinned)
                        .map(|animation| InstanceAnimation {
                            animation: Arc::clone(animation),
                            node: index,
                            node_from_local: *node_from_local,
                        }),
                    deformation: deformation.clone(),
                    primitive: Arc::clone(&primitive),
                    material: Arc::clone(&material),
                });
            }
        }
    }
    if scene.instances.is_empty() && scene.lights.is_empty() {
        notes.plain("the file draws nothing".into());
    }
    scene.warnings = notes.lines();
    Ok(scene)
}

/// Of the morph targets; a node's weights go before its mesh's.
fn rest_weights(document: &Document, node: &Node, mesh: usize) -> Vec<f64> {
    let of_mesh = || document.meshes.get(mesh)?.weights.clone();
    let weights = node.weights.clone().or_else(of_mesh).unwrap_or_default();
    let finite = |weight: &f32| {
        if weight.is_finite() {
            f64::from(*weight)
        } else {
            0.0
        }
    };
    weights.iter().map(finite).collect()
}

fn check_extensions(document: &Document, notes: &mut Notes) -> Result<(), Problem> {
    for name in &document.extensions_required {
        if !SUPPORTED_EXTENSIONS.contains(&name.as_str()) {
            return Err(Problem::extension(name));
        }
    }
    for name in &document.extensions_used {
        let known = SUPPORTED_EXTENSIONS.contains(&name.as_str())
            || COMPRESSION_EXTENSIONS.contains(&name.as_str());
        if !known {
            notes.plain(format!(
                "the extension {} is not supported and was ignored",
                container::clip(name)
            ));
        }
    }
    Ok(())
}

/// The nodes to draw, with their transforms to the file's space, in file order of a depth-first walk.
fn placed_nodes(document: &Document, notes: &mut Notes) -> Result<Vec<(usize, DMat4)>, Problem> {
    let count = document.nodes.len();
    let mut parents = vec![None; count];
    for (index, node) in document.nodes.iter().enumerate() {
        for &child in &node.children {
            let slot = parents
                .get_mut(child)
                .ok_or_else(|| no_such_node(&format!("nodes[{index}]"), child, count))?;
            // The node graph must be a forest (glTF 2.0 section 3.5.3). Besides a cycle, this rules out diamonds, by which a
            // file of n nodes can ask for 2^n instances.
            if slot.replace(index).is_some() {
                return Err(malformed(
                    format!("nodes[{child}]"),
                    "has two parents; the nodes of a glTF file form a tree",
                ));
            }
        }
    }
    let roots = (0..count).filter(|&node| parents[node].is_none()).collect();
    let reachable = walk(document, roots)?;
    if reachable.len() < count {
        return Err(malformed(
            format!("nodes[{}]", node_on_cycle(&parents, &reachable)),
            "is its own ancestor; the nodes of a glTF file form a tree",
        ));
    }
    let roots = match (document.scene, document.scenes.first()) {
        (Some(scene), _) => {
            let scenes = document.scenes.len();
            let nodes = document.scenes.get(scene).ok_or_else(|| {
                malformed(
                    "scene",
                    format!("refers to scene {scene}; there are {scenes}"),
                )
            })?;
            nodes.nodes.clone()
        }
        (None, Some(first)) => {
            if document.scenes.len() > 1 {
                notes.plain(
                    "no default scene is named; the first of several scenes is shown".into(),
                );
            }
            first.nodes.clone()
        }
        (None, None) => return Ok(visible(document, &parents, reachable)),
    };
    if let Some(&node) = roots.iter().find(|&&node| node >= count) {
        return Err(no_such_node("scenes", node, count));
    }
    Ok(visible(document, &parents, walk(document, roots)?))
}

/// Where every node has at most one parent, whatever no root reaches is on a cycle or hangs from one: upwards leads onto it.
fn node_on_cycle(parents: &[Option<usize>], reachable: &[(usize, DMat4)]) -> usize {
    let mut reached = vec![false; parents.len()];
    for &(node, _) in reachable {
        reached[node] = true;
    }
    let mut node = reached.iter().position(|reached| !reached).unwrap_or(0);
    for _ in 0..parents.len() {
        node = parents[node].unwrap_or(node);
    }
    node
}

fn no_such_node(at: &str, node: usize, count: usize) -> Problem {
    malformed(at, format!("refers to node {node}; there are {count}"))
}

/// Depth first from `roots`, whose indices exist; stops with an error at a node that is met twice.
fn walk(document: &Document, roots: Vec<usize>) -> Result<Vec<(usize, DMat4)>, Problem> {
    let mut seen = vec![false; document.nodes.len()];
    let mut placed = Vec::new();
    let mut stack: Vec<(usize, DMat4)> = roots
        .into_iter()
        .rev()
        .map(|root| (root, DMat4::IDENTITY))
        .collect();
    while let Some((index, parent)) = stack.pop() {
        if std::mem::replace(&mut seen[index], true) {
            return Err(malformed(
                format!("nodes[{index}]"),
                "is reached twice from the scene",
            ));
        }
        let node = &document.nodes[index];
        let transform = parent * local_transform(node, index)?;
        if !transform.is_finite() {
            return Err(malformed(
                format!("nodes[{index}]"),
                "its transform, composed with its parents', is not finite",
            ));
        }
        placed.push((index, transform));
        stack.extend(node.children.iter().rev().map(|&child| (child, transform)));
    }
    Ok(placed)
}

/// Without nodes that are hidden, or hang from one that is.
fn visible(
    document: &Document,
    parents: &[Option<usize>],
    placed: Vec<(usize, DMat4)>,
) -> Vec<(usize, DMat4)> {
    let is_hidden = |node: &usize| {
        let visibility = &document.nodes[*node].extensions.visibility;
        visibility
            .as_ref()
            .is_some_and(|visibility| !visibility.visible)
    };
    let hangs = |node: usize| {
        std::iter::successors(Some(node), |node| parents[*node]).any(|node| is_hidden(&node))
    };
    placed
        .into_iter()
        .filter(|(node, _)| !hangs(*node))
        .collect()
}

fn local_transform(node: &Node, index: usize) -> Result<DMat4, Problem> {
    let bad = |reason: &str| malformed(format!("nodes[{index}]"), reason);
    let matrix = match node.matrix {
        Some(columns) => {
            let matrix = DMat4::from_cols_array(&columns);
            if (matrix.row(3) - glam::DVec4::W).abs().max_element() > 1e-6 {
                return Err(bad(
                    "its matrix is not affine; expected 0 0 0 1 as the last row",
                ));
            }
            matrix
        }
        None => {
            let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
            if rotation.length() < 1e-6 || !rotation.is_finite() {
                return Err(bad(
                    "its rotation is not a quaternion that can be normalised",
                ));
            }
            DMat4::from_scale_rotation_translation(
                DVec3::from_array(node.scale.unwrap_or([1.0; 3])),
                rotation.normalize(),
                DVec3::from_array(node.translation.unwrap_or([0.0; 3])),
            )
        }
    };
    if matrix.is_finite() {
        Ok(matrix)
    } else {
        Err(bad("its transform is not finite"))
    }
}
