//! The typed document: every list that mixray reads, with buffers loaded on first use and every access checked.

use std::cell::{Cell, OnceCell};
use std::path::PathBuf;

use gltf::json;
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType, Type};
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::Problem;
use super::container::{Container, clip, file_of_uri, malformed, read_uri};
use super::nodes::{Node, SceneNodes, SkinSource};

/// Elements of an accessor that no buffer backs (all zero, or sparse over zeros): the only size a file can state without bytes.
const MAX_UNBACKED_ELEMENTS: u64 = 1 << 24;

/// Bytes decoded for one file: accessors may be shared, so a small file can ask for any amount.
const MAX_DECODED_BYTES: u64 = 1 << 31;

/// Transforms are read in f64, which the crate's own node type is not.
pub(super) struct Document {
    pub scene: Option<usize>,
    pub scenes: Vec<SceneNodes>,
    pub nodes: Vec<Node>,
    pub meshes: Vec<json::Mesh>,
    pub skins: Vec<SkinSource>,
    pub materials: Vec<json::Material>,
    pub textures: Vec<json::Texture>,
    pub samplers: Vec<json::texture::Sampler>,
    pub images: Vec<json::Image>,
    pub lights: Vec<json::extensions::scene::khr_lights_punctual::Light>,
    pub extensions_used: Vec<String>,
    pub extensions_required: Vec<String>,
    pub folder: PathBuf,
    /// Not looked at before one is asked for.
    animations: Value,
    accessors: Vec<json::Accessor>,
    views: Vec<json::buffer::View>,
    buffers: Vec<json::Buffer>,
    bin: Option<Vec<u8>>,
    loaded: Vec<OnceCell<Vec<u8>>>,
    decoded: Cell<u64>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
    #[serde(rename = "minVersion")]
    min_version: Option<String>,
}

impl Document {
    pub fn new(container: Container, folder: PathBuf) -> Result<Self, Problem> {
        let Container { json, bin } = container;
        let asset: Asset = field(&json, "asset")?
            .ok_or_else(|| malformed("asset", "missing; expected a glTF 2.0 document"))?;
        check_version(&asset)?;
        let buffers: Vec<json::Buffer> = list(&json, "buffers")?;
        let lights = json
            .pointer("/extensions/KHR_lights_punctual")
            .map_or(Ok(Vec::new()), |lights| list(lights, "lights"))?;
        Ok(Self {
            scene: field(&json, "scene")?,
            scenes: list(&json, "scenes")?,
            nodes: list(&json, "nodes")?,
            meshes: list(&json, "meshes")?,
            skins: list(&json, "skins")?,
            materials: list(&json, "materials")?,
            textures: list(&json, "textures")?,
            samplers: list(&json, "samplers")?,
            images: list(&json, "images")?,
            lights,
            extensions_used: list(&json, "extensionsUsed")?,
            extensions_required: list(&json, "extensionsRequired")?,
            folder,
            animations: json.get("animations").cloned().unwrap_or_default(),
            accessors: list(&json, "accessors")?,
            views: list(&json, "bufferViews")?,
            loaded: buffers.iter().map(|_| OnceCell::new()).collect(),
            buffers,
            bin,
            decoded: Cell::new(0),
        })
    }

    pub fn animations(&self) -> Result<Vec<json::Animation>, Problem> {
        if self.animations.is_null() {
            return Ok(Vec::new());
        }
        Vec::deserialize(&self.animations)
            .map_err(|error| malformed("animations", error.to_string()))
    }

    /// The files that buffers and images name, whether or not they exist and are drawn.
    pub fn files(&self) -> Vec<PathBuf> {
        let buffers = self.buffers.iter().filter_map(|buffer| buffer.uri.as_ref());
        let images = self.images.iter().filter_map(|image| image.uri.as_ref());
        (buffers.chain(images))
            .filter_map(|uri| file_of_uri(uri, &self.folder).ok().flatten())
            .collect()
    }

    /// Whether an accessor names bytes of its own; compressed meshes leave theirs out.
    pub fn accessor_is_backed(&self, index: usize) -> bool {
        self.accessors
            .get(index)
            .is_some_and(|accessor| accessor.buffer_view.is_some() || accessor.sparse.is_some())
    }

    fn buffer(&self, index: usize) -> Result<&[u8], Problem> {
        let (Some(buffer), Some(cell)) = (self.buffers.get(index), self.loaded.get(index)) else {
            return Err(malformed(
                format!("buffers[{index}]"),
                format!("does not exist; there are {}", self.buffers.len()),
            ));
        };
        let length = buffer.byte_length.0;
        let bytes = match (&buffer.uri, &self.bin) {
            (Some(uri), _) => match cell.get() {
                Some(bytes) => bytes,
                None => {
                    let bytes = read_uri(uri, &self.folder, u64::from(u32::MAX))
                        .map_err(|reason| malformed(format!("buffers[{index}]"), reason))?;
                    cell.get_or_init(|| bytes)
                }
            },
            (None, Some(bin)) if index == 0 => bin,
            _ => {
                return Err(malformed(
                    format!("buffers[{index}]"),
                    "has no uri and no GLB chunk, so there are no bytes to read",
                ));
            }
        };
        usize::try_from(length)
            .ok()
            .and_then(|length| bytes.get(..length))
            .ok_or_else(|| {
                malformed(
                    format!("buffers[{index}]"),
                    format!("states {length} bytes but has {}", bytes.len()),
                )
            })
    }

    /// The bytes of a buffer view and its stride.
    pub fn view(&self, index: usize) -> Result<(&[u8], Option<usize>), Problem> {
        let at = format!("bufferViews[{index}]");
        let view = self.views.get(index).ok_or_else(|| {
            malformed(
                &at,
                format!("does not exist; there are {}", self.views.len()),
            )
        })?;
        let backed = self
            .buffers
            .get(view.buffer.value())
            .is_none_or(|buffer| buffer.uri.is_some())
            || (view.buffer.value() == 0 && self.bin.is_some());
        if let Some(extensions) = &view.extensions
            && !backed
        {
            for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
                if extensions.others.contains_key(name) {
                    return Err(Problem::extension(name));
                }
            }
        }
        let buffer = self.buffer(view.buffer.value())?;
        let start = view.byte_offset.unwrap_or_default().0;
        let bytes = start
            .checked_add(view.byte_length.0)
            .and_then(|end| buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?))
            .ok_or_else(|| {
                malformed(
                    &at,
                    format!(
                        "asks for {} bytes at {start} of a buffer of {}",
                        view.byte_length.0,
                        buffer.len()
                    ),
                )
            })?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }

    /// Vectors of `N` components as floats. Accessors of `shortest..=N` components are accepted, missing ones become 1.
    /// Integers are mapped to 0..1 or -1..1 where the accessor or `normalize` says so (glTF 2.0 section 3.11).
    pub fn vectors<const N: usize>(
        &self,
        index: usize,
        at: &str,
        shortest: usize,
        normalize: bool,
    ) -> Result<Vec<[f32; N]>, Problem> {
        let accessor = self.accessor(index, at)?;
        let Checked::Valid(GenericComponentType(component)) = accessor.component_type else {
            return Err(malformed(at, "has an unknown component type"));
        };
        let components = match accessor.type_ {
            Checked::Valid(Type::Scalar) => 1,
            Checked::Valid(Type::Vec2) => 2,
            Checked::Valid(Type::Vec3) => 3,
            Checked::Valid(Type::Vec4) => 4,
            Checked::Valid(Type::Mat4) => 16,
            _ => 0,
        };
        if !(shortest..=N).contains(&components) || component == ComponentType::U32 {
            return Err(malformed(
                at,
                "has a type or component type that this attribute cannot have",
            ));
        }
        let divisor = if accessor.normalized || normalize {
            component_divisor(component)
        } else {
            1.0
        };
        let decode = |element: &[u8]| {
            let mut vector = [1.0; N];
            for (value, bytes) in vector
                .iter_mut()
                .zip(element.chunks_exact(component.size()))
            {
                *value = component_value(component, bytes) / divisor;
                if divisor != 1.0 {
                    *value = value.max(-1.0);
                }
            }
            vector
        };
        self.elements(accessor, at, component.size() * components, decode)
    }

    /// Unsigned scalars of any width.
    pub fn indices(&self, index: usize, at: &str) -> Result<Vec<u32>, Problem> {
        let accessor = self.accessor(index, at)?;
        let component = match (accessor.component_type, accessor.type_) {
            (
                Checked::Valid(GenericComponentType(
                    component @ (ComponentType::U8 | ComponentType::U16 | ComponentType::U32),
                )),
                Checked::Valid(Type::Scalar),
            ) => component,
            _ => return Err(malformed(at, "indices must be unsigned scalars")),
        };
        self.elements(accessor, at, component.size(), |bytes| {
            unsigned_value(component, bytes)
        })
    }

    fn accessor(&self, index: usize, at: &str) -> Result<&json::Accessor, Problem> {
        self.accessors.get(index).ok_or_else(|| {
            malformed(
                at,
                format!(
                    "refers to accessor {index}; there are {}",
                    self.accessors.len()
                ),
            )
        })
    }

    fn elements<T: Clone>(
        &self,
        accessor: &json::Accessor,
        at: &str,
        size: usize,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Problem> {
        let count = accessor.count.0;
        let decoded = self
            .decoded
            .get()
            .saturating_add(count.saturating_mul(size as u64));
        self.decoded.set(decoded);
        if decoded > MAX_DECODED_BYTES {
            return Err(malformed(
                at,
                format!(
                    "brings the geometry to {decoded} bytes, more than the {MAX_DECODED_BYTES} allowed"
                ),
            ));
        }
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let (bytes, stride) = self.view(view.value())?;
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let stride = stride.unwrap_or(size);
                strided(bytes, offset, stride, size, count, at)?
                    .map(&decode)
                    .collect()
            }
            None if count <= MAX_UNBACKED_ELEMENTS => {
                vec![decode(&[0; 64][..size]); count as usize]
            }
            None => {
                return Err(malformed(
                    at,
                    format!("states {count} elements without any bytes"),
                ));
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let Checked::Valid(IndexComponentType(index_type)) = sparse.indices.component_type
            else {
                return Err(malformed(at, "has sparse indices of an unknown type"));
            };
            let at = &format!("{at}, sparse part");
            let (index_bytes, _) = self.view(sparse.indices.buffer_view.value())?;
            let (value_bytes, _) = self.view(sparse.values.buffer_view.value())?;
            let width = index_type.size();
            let indices = strided(
                index_bytes,
                sparse.indices.byte_offset.0,
                width,
                width,
                sparse.count.0,
                at,
            )?;
            let replacements = strided(
                value_bytes,
                sparse.values.byte_offset.0,
                size,
                size,
                sparse.count.0,
                at,
            )?;
            for (index, replacement) in indices.zip(replacements) {
                let index = unsigned_value(index_type, index);
                let slot = values
                    .get_mut(index as usize)
                    .ok_or_else(|| malformed(at, format!("replaces element {index} of {count}")))?;
                *slot = decode(replacement);
            }
        }
        Ok(values)
    }
}

fn check_version(asset: &Asset) -> Result<(), Problem> {
    let wanted = asset.min_version.as_ref().unwrap_or(&asset.version);
    let parsed = wanted
        .split_once('.')
        .and_then(|(major, minor)| Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?)));
    match parsed {
        // A 2.x file without minVersion promises to be readable as 2.0.
        Some((2, minor)) if asset.min_version.is_none() || minor == 0 => Ok(()),
        _ => Err(malformed(
            "asset",
            format!("asks for glTF version `{}`; expected 2.0", clip(wanted)),
        )),
    }
}

/// `count` slices of `size` bytes, `stride` apart, proven to lie inside `bytes`.
fn strided<'a>(
    bytes: &'a [u8],
    offset: u64,
    stride: usize,
    size: usize,
    count: u64,
    at: &str,
) -> Result<impl Iterator<Item = &'a [u8]>, Problem> {
    if stride < size {
        return Err(malformed(
            at,
            format!("has elements of {size} bytes only {stride} apart"),
        ));
    }
    let end = match count.checked_sub(1) {
        None => Some(0),
        Some(last) => last
            .checked_mul(stride as u64)
            .and_then(|span| span.checked_add(offset))
            .and_then(|span| span.checked_add(size as u64)),
    };
    if end.is_none_or(|end| end > bytes.len() as u64) {
        return Err(malformed(
            at,
            format!(
                "needs {count} elements of {size} bytes at {offset}, more than the {} bytes of its buffer view",
                bytes.len()
            ),
        ));
    }
    let tail = if count == 0 {
        &[][..]
    } else {
        &bytes[offset as usize..]
    };
    Ok(tail
        .chunks(stride)
        .take(count as usize)
        .map(move |chunk| &chunk[..size]))
}

fn component_divisor(component: ComponentType) -> f32 {
    match component {
        ComponentType::I8 => 127.0,
        ComponentType::U8 => 255.0,
        ComponentType::I16 => 32767.0,
        ComponentType::U16 => 65535.0,
        ComponentType::U32 | ComponentType::F32 => 1.0,
    }
}

fn component_value(component: ComponentType, bytes: &[u8]) -> f32 {
    match (component, bytes) {
        (ComponentType::I8, &[a]) => f32::from(a as i8),
        (ComponentType::I16, &[a, b]) => f32::from(i16::from_le_bytes([a, b])),
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => unsigned_value(component, bytes) as f32,
    }
}

fn unsigned_value(component: ComponentType, bytes: &[u8]) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a]) => u32::from(a),
        (ComponentType::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}

/// An optional field of the top object.
fn field<T: DeserializeOwned>(json: &Value, key: &str) -> Result<Option<T>, Problem> {
    json.get(key)
        .map(|value| T::deserialize(value).map_err(|error| malformed(key, error.to_string())))
        .transpose()
}

/// A list of the top object; absent is empty.
fn list<T: DeserializeOwned>(json: &Value, key: &str) -> Result<Vec<T>, Problem> {
    match json.get(key) {
        None => Ok(Vec::new()),
        Some(Value::Array(items)) => items
            .iter()
            .enumerate()
            .map(|(index, item)| {
                T::deserialize(item)
                    .map_err(|error| malformed(format!("{key}[{index}]"), error.to_string()))
            })
            .collect(),
        Some(_) => Err(malformed(key, "expected an array")),
    }
}
