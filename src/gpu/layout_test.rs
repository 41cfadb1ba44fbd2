//! Host records against their WGSL structs, by naga reflection; needs no device.

use std::collections::HashMap;

use bytemuck::Zeroable;
use wgpu::naga;

use crate::packed::*;

/// Name, offset, size.
type Fields = Vec<(String, u32, u32)>;

/// The pattern without `..` names every field, or does not compile.
macro_rules! host_fields {
    ($record:ident { $($field:ident),* $(,)? }) => {{
        let zero: $record = Zeroable::zeroed();
        let $record { $($field),* } = zero;
        let fields: Fields = vec![$((
            stringify!($field).to_owned(),
            std::mem::offset_of!($record, $field) as u32,
            size_of_val(&$field) as u32,
        )),*];
        (stringify!($record), size_of::<$record>() as u32, fields)
    }};
}

fn host() -> Vec<(&'static str, u32, Fields)> {
    vec![
        host_fields!(Frame {
            camera_position,
            camera_right,
            camera_up,
            camera_back,
            intrinsics,
            distortion,
            distortion_k3,
            aperture_radius,
            inv_focus_distance,
            blade_rotation,
            aperture_shape,
            width,
            height,
            seed,
            sampler,
            rays_total,
            max_bounces,
            estimator,
            real_triangle_count,
            light_count,
            sphere_count,
            flags,
            env_cos,
            env_sin,
            env_width,
            env_height,
            env_radiance,
            env_light,
            exposure_scale,
            virtual_node_base,
            virtual_leaf_base,
            clamp_indirect,
            shutter_row,
            shutter_open,
            pad,
            spheres,
            shutter_poses,
        }),
        host_fields!(Vertex {
            position_u0,
            normal_v0,
            tangent,
            color,
            uv1
        }),
        host_fields!(Triangle {
            vertices,
            material,
            light,
            object,
            pad
        }),
        host_fields!(Material {
            base_color,
            emissive,
            normal_scale,
            metallic,
            roughness,
            ior,
            specular,
            specular_color,
            transmission,
            sigma_a,
            clearcoat,
            clearcoat_roughness,
            clearcoat_normal_scale,
            alpha_cutoff,
            self_shadow_bias,
            flags,
            base_color_texture,
            metallic_roughness_texture,
            normal_texture,
            emissive_texture,
            specular_texture,
            specular_color_texture,
            transmission_texture,
            clearcoat_texture,
            clearcoat_roughness_texture,
            clearcoat_normal_texture,
            pad,
        }),
        host_fields!(TextureRef {
            offset,
            width,
            height,
            flags,
            transform_u,
            transform_v
        }),
        host_fields!(Light {
            position,
            axis_u,
            axis_v,
            radiance,
            kind,
            side,
            select_pdf,
            alias_threshold,
            alias,
            triangle,
            pad,
        }),
        host_fields!(PixelInfo {
            difference_period,
            sample_factor,
            flags
        }),
    ]
}

fn bindings_module() -> (naga::Module, naga::proc::Layouter) {
    let source = include_str!("../../shaders/packed/bindings.wgsl");
    let module = naga::front::wgsl::parse_str(source).expect("bindings.wgsl is plain WGSL");
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).expect("layout");
    (module, layouter)
}

/// Size of an array element, and the fields.
fn shader() -> HashMap<String, (u32, Fields)> {
    let (module, layouter) = bindings_module();
    module
        .types
        .iter()
        .filter_map(|(handle, ty)| {
            let naga::TypeInner::Struct { members, .. } = &ty.inner else {
                return None;
            };
            let fields = members
                .iter()
                .map(|member| {
                    // `alias` is a keyword in WGSL, where the field is called `alias_`.
                    let name = member.name.clone().unwrap_or_default();
                    (
                        name.trim_end_matches('_').to_owned(),
                        member.offset,
                        layouter[member.ty].size,
                    )
                })
                .collect();
            Some((ty.name.clone()?, (layouter[handle].to_stride(), fields)))
        })
        .collect()
}

#[test]
fn every_record_has_the_same_layout_on_both_sides() {
    let shader = shader();
    for (record, size, fields) in host() {
        let (shader_size, shader_fields) = &shader[record];
        assert_eq!((size, &fields), (*shader_size, shader_fields), "{record}");
    }
}

#[test]
fn a_swapped_pair_of_fields_is_noticed() {
    let shader = shader();
    let (record, _, mut fields) = host().swap_remove(3);
    assert_eq!(record, "Material");
    let (roughness, ior) = (5, 6);
    let name = std::mem::take(&mut fields[roughness].0);
    fields[roughness].0 = std::mem::replace(&mut fields[ior].0, name);
    assert_ne!(fields, shader[record].1);
}

#[test]
fn constants_have_the_same_values_on_both_sides() {
    macro_rules! host_constants {
        ($($name:ident),* $(,)?) => { vec![$((stringify!($name), $name as u64)),*] };
    }
    let expected = host_constants![
        NONE,
        MAX_SPHERES,
        FRAME_ENV_DRAWN,
        FRAME_AOVS,
        FRAME_ALPHA,
        FRAME_LIGHTS_SUFFICE,
        FRAME_SHUTTER,
        FRAME_SHUTTER_ORDERED,
        FRAME_BOTH_SHADOWS,
        FRAME_NO_CONES,
        FRAME_NO_LAST_VERTEX,
        SHUTTER_POSES,
        MATERIAL_LAMBERTIAN,
        MATERIAL_ALPHA_MASK,
        MATERIAL_ALPHA_BLEND,
        MATERIAL_UNLIT,
        MATERIAL_THIN_WALLED,
        MATERIAL_PHOTO_ALBEDO,
        MATERIAL_QUAD_LIGHT,
        MATERIAL_TEXTURED,
        TEXTURE_SRGB,
        TEXTURE_NEAREST,
        TEXTURE_UV1,
        TEXTURE_WRAP_U_SHIFT,
        TEXTURE_WRAP_V_SHIFT,
        LIGHT_POINT,
        LIGHT_SPOT,
        LIGHT_DIRECTIONAL,
        LIGHT_QUAD,
        LIGHT_TRIANGLE,
        LIGHT_ENVIRONMENT,
        PIXEL_BEAM_MAY_MEET_VIRTUAL,
        PIXEL_OUT_OF_REACH,
    ];
    let (module, _) = bindings_module();
    let found: HashMap<String, u64> = module
        .constants
        .iter()
        .filter_map(
            |(_, constant)| match module.global_expressions[constant.init] {
                naga::Expression::Literal(naga::Literal::U32(value)) => {
                    Some((constant.name.clone()?, u64::from(value)))
                }
                _ => None,
            },
        )
        .collect();
    for (name, value) in &expected {
        assert_eq!(found.get(*name), Some(value), "{name}");
    }
    assert_eq!(
        found.len(),
        expected.len(),
        "a constant of the shader is not compared"
    );
}
