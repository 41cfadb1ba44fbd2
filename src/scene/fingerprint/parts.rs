//! What of a scene's parts is content. Names and places on disk are not.

use super::{Content, ContentHash, content, content_by_name};
use crate::scene::animation::{AnimatedNode, Animation, InstanceAnimation, Interpolation, Track};
use crate::scene::deformation::{DeformableMesh, Deformation, Joint, MorphTarget, Skin};
use crate::scene::trajectory::{Entry, EntryKey, Focal, Intrinsics};
use crate::scene::{
    AlphaMode, Aperture, Backdrop, BackendChoice, Camera, Combine, Composite, Distortion,
    Environment, EnvironmentMap, Estimator, Exposure, Instance, Lens, Light, LightKind, MotionKey,
    Object, Photo, Primitive, SamplerKind, Settings, Shutter, Side, Texture, TextureRef, Wrap,
};

content! {
    Photo { width, height, linear; encoded, tags }
    Distortion { model, coefficients }
    Camera { width, height, fx, fy, cx, cy, distortion, world_from_camera }
    Lens { aperture_radius_m, focus_distance_m, aperture, blade_rotation_deg; focal_length_m }
    Shutter { exposure_secs, readout_secs, samples, time_secs }

    Environment { map, rotation_deg, scale }
    Light { kind, side }

    Object { side, world_from_object, motion, instances, self_shadow_bias_m, albedo_from_photo; name }
    Instance { object_from_local, animation, deformation, primitive, material }
    Deformation { mesh, weights, skin, animation, node }
    DeformableMesh { base, is_flat, targets, influences }
    MorphTarget { positions, normals, tangents }
    Skin { joints }
    Joint { node, inverse_bind }
    Primitive { positions, normals, tangents, uvs, colors, triangles; name }
    MotionKey { time_secs, translation, rotation, scale }
    InstanceAnimation { animation, node, node_from_local }
    Animation { nodes, duration_secs }
    AnimatedNode { parent, rest, translation, rotation, scale, weights }
    Track { times, values, interpolation }

    TextureRef { texture, uv_set, transform }
    Texture { width, height, rgba8, wrap_u, wrap_v, nearest; name }

    Settings { rays_per_pixel, max_bounces, clamp_indirect, seed, estimator, sampler, composite, combine, backend, exposure, backdrop, multiple_scattering, upright_photo }

    Intrinsics { size, focal, centre, distortion }
    Entry { key, time_secs, world_from_camera, intrinsics, focus_distance_m; place }
}

content_by_name! {
    Estimator SamplerKind Composite Combine BackendChoice
}

/// [`Content`] of what is one of several things: which, and what that holds.
macro_rules! content_of_variants {
    ($($type:ident { $($variant:ident $(($value:ident))? $({ $($field:ident),* })?),* $(,)? })*) => {$(
        impl Content for $type {
            fn add_to(&self, hash: &mut ContentHash) {
                match self {
                    $(Self::$variant $(($value))? $({ $($field),* })? => {
                        stringify!($variant).add_to(hash);
                        $($value.add_to(hash);)?
                        $($($field.add_to(hash);)*)?
                    })*
                }
            }
        }
    )*};
}

content_of_variants! {
    Side { Real, Virtual }
    Aperture { Disc, Square, Blades(count) }
    EnvironmentMap { Constant(radiance), LatLong { width, height, texels } }
    LightKind {
        Point { position, intensity },
        Spot { position, direction, intensity, inner_deg, outer_deg },
        Directional { direction, irradiance },
        Quad { corner, edge_u, edge_v, radiance },
    }
    AlphaMode { Opaque, Mask(cut_off), Blend }
    Wrap { Repeat, Mirror, Clamp }
    Interpolation { Step, Linear, Cubic }
    Exposure { Ev(ev), Auto }
    Backdrop { Environment, Photograph(distance_m) }
    Focal { Pixels(focal), FieldOfView(angle) }
    EntryKey { Number(number), Name(name), Order(place) }
}
