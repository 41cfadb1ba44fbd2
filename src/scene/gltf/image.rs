//! Images and textures.

use std::collections::HashMap;
use std::sync::Arc;

use gltf::json;
use gltf::json::texture::{MagFilter, MinFilter, WrappingMode};
use gltf::json::validation::Checked;

use super::container::{clip, malformed, read_uri};
use super::document::Document;
use super::{Note, Notes, Problem};
use crate::decode::{Rgba8, decode_rgba8};
use crate::scene::{Texture, Wrap};

const MAX_IMAGE_FILE_BYTES: u64 = 1 << 30;
/// Texels of all textures of one file (4 GiB): a small file can name many images that unpack to a large size.
const MAX_TEXELS: u64 = 1 << 30;

/// Decodes each image once, when a drawn material first uses it.
pub(super) struct Textures<'a> {
    document: &'a Document,
    read: HashMap<usize, Option<Arc<Texture>>>,
    texels: u64,
}

struct Sampling {
    wrap_u: Wrap,
    wrap_v: Wrap,
    nearest: bool,
}

impl<'a> Textures<'a> {
    pub fn new(document: &'a Document) -> Self {
        Self {
            document,
            read: HashMap::new(),
            texels: 0,
        }
    }

    /// None for a texture that names no image.
    pub fn get(
        &mut self,
        index: usize,
        at: &str,
        notes: &mut Notes,
    ) -> Result<Option<Arc<Texture>>, Problem> {
        if let Some(texture) = self.read.get(&index) {
            return Ok(texture.clone());
        }
        let textures = &self.document.textures;
        let source = textures.get(index).ok_or_else(|| {
            malformed(
                at,
                format!("refers to texture {index}; there are {}", textures.len()),
            )
        })?;
        let texture = match image_of(source) {
            Some(image) => Some(Arc::new(self.decode(
                image,
                sampling(self.document, source, index)?,
                index,
            )?)),
            None => {
                if let Some(name) = foreign_image(source) {
                    return Err(Problem::extension(name));
                }
                notes.add(Note::EmptyTexture, 1, &format!("textures[{index}]"));
                None
            }
        };
        self.read.insert(index, texture.clone());
        Ok(texture)
    }

    fn decode(
        &mut self,
        index: usize,
        sampling: Sampling,
        texture: usize,
    ) -> Result<Texture, Problem> {
        let images = &self.document.images;
        let source = images.get(index).ok_or_else(|| {
            malformed(
                format!("textures[{texture}]"),
                format!("refers to image {index}; there are {}", images.len()),
            )
        })?;
        let name = match (&source.name, &source.uri) {
            (Some(name), _) if !name.is_empty() => clip(name),
            (_, Some(uri)) if !uri.starts_with("data:") => clip(uri),
            _ => String::new(),
        };
        let at = match name.as_str() {
            "" => format!("images[{index}]"),
            name => format!("images[{index}] ({name})"),
        };
        let owned;
        let bytes = match (source.buffer_view, &source.uri) {
            (Some(view), _) => self.document.view(view.value())?.0,
            (None, Some(uri)) => {
                owned = read_uri(uri, &self.document.folder, MAX_IMAGE_FILE_BYTES)
                    .map_err(|reason| malformed(&at, reason))?;
                &owned
            }
            (None, None) => return Err(malformed(&at, "names neither a uri nor a bufferView")),
        };
        let Rgba8 {
            width,
            height,
            pixels,
        } = decode_rgba8(bytes).map_err(|reason| malformed(&at, reason))?;
        self.texels += u64::from(width) * u64::from(height);
        if self.texels > MAX_TEXELS {
            return Err(malformed(
                &at,
                format!("brings the textures to more than {MAX_TEXELS} texels"),
            ));
        }
        Ok(Texture {
            name,
            width,
            height,
            rgba8: pixels,
            wrap_u: sampling.wrap_u,
            wrap_v: sampling.wrap_v,
            nearest: sampling.nearest,
        })
    }
}

/// EXT_texture_webp's image where there is one, else the plain source.
fn image_of(texture: &json::Texture) -> Option<usize> {
    let webp = texture
        .extensions
        .as_ref()
        .and_then(|extensions| extensions.others.get("EXT_texture_webp"))
        .and_then(|extension| extension.get("source"))
        .and_then(serde_json::Value::as_u64)
        .map(|index| index as usize);
    // The crate marks an absent source with the largest index.
    let plain = Some(texture.source.value()).filter(|&index| index != u32::MAX as usize);
    webp.or(plain)
}

fn foreign_image(texture: &json::Texture) -> Option<&str> {
    let extensions = texture.extensions.as_ref()?;
    let (name, _) = extensions
        .others
        .iter()
        .find(|(_, extension)| extension.get("source").is_some())?;
    Some(name)
}

fn sampling(
    document: &Document,
    texture: &json::Texture,
    index: usize,
) -> Result<Sampling, Problem> {
    let at = format!("textures[{index}]");
    let default = json::texture::Sampler::default();
    let sampler = match texture.sampler {
        None => &default,
        Some(sampler) => document.samplers.get(sampler.value()).ok_or_else(|| {
            malformed(
                &at,
                format!("refers to a sampler that does not exist: {sampler}"),
            )
        })?,
    };
    let wrap = |mode: Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        Checked::Invalid => Err(malformed(&at, "its sampler has an unknown wrap mode")),
    };
    // There are no mipmaps, so magnification decides; minification does where it alone is given.
    let nearest = match (sampler.mag_filter, sampler.min_filter) {
        (Some(Checked::Valid(filter)), _) => filter == MagFilter::Nearest,
        (None, Some(Checked::Valid(filter))) => matches!(
            filter,
            MinFilter::Nearest | MinFilter::NearestMipmapNearest | MinFilter::NearestMipmapLinear
        ),
        (None, None) => false,
        _ => return Err(malformed(&at, "its sampler has an unknown filter")),
    };
    Ok(Sampling {
        wrap_u: wrap(sampler.wrap_s)?,
        wrap_v: wrap(sampler.wrap_t)?,
        nearest,
    })
}
