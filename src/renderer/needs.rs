//! What a render will take, held against the memory that there is before it is taken.

use std::collections::HashMap;
use std::sync::Arc;

use crate::cpu::contribution::photons_traced;
use crate::film::{GroupSums, GuideSums, PixelSums, SplatSums};
use crate::memory::{Shortage, ensure, ensure_lazy};
use crate::packed::{PIXEL_OUT_OF_REACH, PackedScene, PixelInfo};
use crate::scene::{EnvironmentMap, Scene, Texture};

/// Of a triangle at least, in the packed scene and its tree, while the tree is built.
const TRIANGLE_BYTES: u64 = 300;
/// Of an environment's texel: packed, and in its tables.
const ENVIRONMENT_TEXEL_BYTES: u64 = 20;
/// Of a pixel: the plan, the composite in linear light, and its codes.
const PICTURE_BYTES: u64 = size_of::<PixelInfo>() as u64 + 12 + 6;
/// Of a pixel of the planes of an EXR file: computed, and once more as channels.
const PLANES_BYTES: u64 = 29 * 4 * 2;

/// Before the scene is packed.
pub(super) fn ensure_scene(scene: &Scene, guides: bool, grouped: bool) -> Result<(), Shortage> {
    let triangles = |count: u64| {
        ensure(
            count * TRIANGLE_BYTES,
            &format!("a scene of {count} triangles"),
        )
    };
    triangles(
        (scene.objects.iter().flat_map(|object| &object.instances))
            .map(|instance| instance.primitive.triangles.len() as u64)
            .sum(),
    )?;
    ensure(texture_bytes(scene), "packing the textures")?;
    if let Some(EnvironmentMap::LatLong { texels, .. }) = scene.environment.as_ref().map(|e| &e.map)
    {
        let bytes = texels.len() as u64 * ENVIRONMENT_TEXEL_BYTES;
        ensure(bytes, "the environment")?;
    }
    let (width, height) = (scene.camera.width, scene.camera.height);
    let pixels = u64::from(width) * u64::from(height);
    let shown = pixels * (PICTURE_BYTES + if guides { PLANES_BYTES } else { 0 });
    let mapped = shown + pixels * film_bytes(guides, grouped);
    ensure_lazy(mapped, shown, &picture(width, height))
}

/// Packed one after the other, in an array that doubles as it grows.
fn texture_bytes(scene: &Scene) -> u64 {
    let instances = scene.objects.iter().flat_map(|object| &object.instances);
    let textures: HashMap<*const Texture, u64> = instances
        .flat_map(|instance| instance.material.textures())
        .map(|r| (Arc::as_ptr(&r.texture), r.texture.rgba8.len() as u64))
        .collect();
    let bytes = textures.values().sum::<u64>() * size_of::<u32>() as u64;
    if textures.len() > 1 { 2 * bytes } else { bytes }
}

/// Before the film is made: of its pixels only those within reach are ever written.
pub(super) fn ensure_film(
    packed: &PackedScene,
    guides: bool,
    grouped: bool,
) -> Result<(), Shortage> {
    let within_reach = (packed.pixels.iter())
        .filter(|pixel| pixel.flags & PIXEL_OUT_OF_REACH == 0)
        .count() as u64;
    let (width, height) = (packed.frame.width, packed.frame.height);
    let splats = match photons_traced(&packed.frame) {
        true => packed.pixels.len() as u64 * size_of::<SplatSums>() as u64,
        false => 0,
    };
    let each = film_bytes(guides, grouped);
    let mapped = packed.pixels.len() as u64 * each + splats;
    let touched = within_reach * each + splats;
    ensure_lazy(mapped, touched, &picture(width, height))
}

fn film_bytes(guides: bool, grouped: bool) -> u64 {
    let guide_bytes = if guides { size_of::<GuideSums>() } else { 0 };
    let groups = if grouped { size_of::<GroupSums>() } else { 0 };
    (size_of::<PixelSums>() + guide_bytes + groups) as u64
}

fn picture(width: u32, height: u32) -> String {
    format!("a picture of {width} x {height} pixels")
}
