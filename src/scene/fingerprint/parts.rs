//! What of a scene's parts is content. Names and places on disk are not.

use super::{Content, ContentHash, content, content_by_name};
use crate::scene::animation::{AnimatedNode, Animation, InstanceAnimation, Interpolation, Track};
use crate::scene::trajectory::{Entry, EntryKey, Intrinsics};
use crate::scene::{
    AlphaMode, Aperture, Backdrop, BackendChoice, Camera, Combine, Composite, Environment,
    EnvironmentMap, Estimator, Exposure, Instance, Lens, Light, LightKind, MotionKey, Object,
    Photo, Primitive, SamplerKind, Settings, Shutter, Side, Texture, TextureRef, Wrap,
};

content! {
    Photo { width, height, linear; encoded }
    Camera { width, height, fx, fy, cx, cy, distortion, world_from_camera }
    Lens { aperture_radius_m, focus_distance_m, aperture, blade_rotation_deg }
    Shutter { exposure_secs, readout_secs, samples, time_secs }

    Environment { map, rotation_deg, scale }
    Light { kind, side }

    Object { side, world_from_object, motion, instances, self_shadow_bias_m, albedo_from_photo; name }
    Instance { object_from_local, animation, primitive, material }
    Primitive { positions, normals, tangents, uvs, colors, triangles; name }
    MotionKey { time_secs, translation, rotation, scale }
    InstanceAnimation { animation, node }
    Animation { nodes, duration_secs }
    AnimatedNode { parent, rest, translation, rotation, scale }
    Track { times, values, interpolation }

    TextureRef { texture, uv_set, transform }
    Texture { width, height, rgba8, wrap_u, wrap_v, nearest; name }

    Settings { rays_per_pixel, max_bounces, clamp_indirect, seed, estimator, sampler, composite, combine, backend, exposure, backdrop, multiple_scattering }

    Intrinsics { size, fx, fy, cx, cy, distortion }
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
    EntryKey { Number(number), Name(name), Time }
}
