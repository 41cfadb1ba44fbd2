//! Composes shaders: the embedded modules of `shaders/`, WESL imports and `@if(feature)`, unused declarations left out.
//!
//! Names of imported items carry their module: `package::light::cones::cone_pdf` is `light_cones__cone_pdf` in the emitted WGSL.

use std::borrow::Cow;

use wesl::{CompileOptions, Feature, Mangler, ModulePath, VirtualResolver, Wesl};

use super::GpuError;
use crate::packed::{self, PackedScene};
use crate::shared::{self, Module};
use crate::{accel, camera, cpu, distortion, film, light, material, math, work};

/// The embedded modules, one a file of `shaders/`: name and source.
pub const MODULES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/shader_modules.rs"));

macro_rules! features {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// What a scene uses; the `@if(...)` flags of the shaders. What is off is absent from the emitted code.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Features {
            $($(#[$doc])* pub $name: bool,)*
        }

        impl Features {
            /// Every flag by its name in the shaders.
            pub fn flags(&self) -> Vec<(&'static str, bool)> {
                vec![$((stringify!($name), self.$name),)*]
            }

            /// With one flag the other way round; unchanged if there is none of that name.
            #[must_use]
            pub fn toggled(mut self, name: &str) -> Self {
                match name {
                    $(stringify!($name) => self.$name = !self.$name,)*
                    _ => {}
                }
                self
            }

            /// Everything on: the largest variant.
            pub const ALL: Self = Self { $($name: true,)* };
        }
    };
}

features! {
    /// Some material refers to a texture.
    textures,
    /// Alpha mask or blend.
    alpha,
    transmission,
    clearcoat,
    /// A lat-long map rather than a constant.
    environment_map,
    /// Quads and emissive triangles.
    area_lights,
    /// Point, spot and directional lights.
    delta_lights,
    /// Aperture radius above 0.
    lens,
    /// A lens of the rational, thin-prism or fisheye model.
    lens_models,
    /// max_bounces above 1.
    multi_bounce,
    /// Some real material takes its albedo from the photograph.
    photo_albedo,
    normal_maps,
    /// The `paper` estimator instead of `direct`.
    paper,
    /// Some material has a GGX lobe.
    rough_specular,
    /// The camera moves while the shutter is open.
    shutter,
    /// Second vertices are shared between pixels.
    sharing,
    /// Photons are traced.
    photons,
    /// What photons found guides paths that are seen by way of smooth surfaces.
    guide,
    /// Light goes straight through some material.
    panes,
    /// Facets send light to each other.
    facets,
    /// Virtual objects show the photograph behind them.
    backdrop,
    /// No tree has more than [`SHALLOW_LEVELS`](accel::trace::SHALLOW_LEVELS) levels.
    shallow_trees,
}

impl Features {
    /// What `scene` needs if kernels are `specialised`, else everything that does not exclude its estimator.
    pub fn wanted(scene: &PackedScene, specialised: bool) -> Self {
        let needed = Self::for_scene(scene);
        if specialised {
            return needed;
        }
        Self {
            paper: needed.paper,
            sharing: !needed.paper,
            shallow_trees: false,
            ..Self::ALL
        }
    }

    /// What `scene` needs, never less.
    pub fn for_scene(scene: &PackedScene) -> Self {
        let material = |test: &dyn Fn(&packed::Material) -> bool| scene.materials.iter().any(test);
        let flag = |bits: u32| material(&|m| m.flags & bits != 0);
        let light = |kinds: &[u32]| scene.lights.iter().any(|l| kinds.contains(&l.kind));
        let no_lobe =
            packed::MATERIAL_LAMBERTIAN | packed::MATERIAL_UNLIT | packed::MATERIAL_QUAD_LIGHT;
        Self {
            textures: flag(packed::MATERIAL_TEXTURED),
            alpha: flag(packed::MATERIAL_ALPHA_MASK | packed::MATERIAL_ALPHA_BLEND),
            transmission: material(&|m| m.transmission > 0.0),
            clearcoat: material(&|m| m.clearcoat > 0.0),
            environment_map: scene.frame.env_width > 0,
            area_lights: light(&[packed::LIGHT_QUAD, packed::LIGHT_TRIANGLE]),
            delta_lights: light(&[
                packed::LIGHT_POINT,
                packed::LIGHT_SPOT,
                packed::LIGHT_DIRECTIONAL,
            ]),
            lens: scene.frame.aperture_radius > 0.0,
            lens_models: scene.frame.lens_model != distortion::LENS_RADIAL,
            multi_bounce: scene.frame.max_bounces > 1,
            photo_albedo: flag(packed::MATERIAL_PHOTO_ALBEDO),
            normal_maps: material(&|m| {
                m.normal_texture != packed::NONE || m.clearcoat_normal_texture != packed::NONE
            }),
            paper: scene.frame.estimator == packed::ESTIMATOR_PAPER,
            rough_specular: material(&|m| m.flags & no_lobe == 0),
            shutter: scene.frame.flags & packed::FRAME_SHUTTER != 0,
            sharing: (scene.pixels.iter()).any(|info| info.flags & packed::PIXEL_SHARES != 0),
            photons: cpu::contribution::photons_traced(&scene.frame),
            guide: scene.frame.guide_cell_count > 0,
            panes: scene.frame.flags & packed::FRAME_PANES != 0,
            facets: !scene.facet_tables.is_empty(),
            backdrop: scene.frame.flags & packed::FRAME_BACKDROP != 0,
            shallow_trees: [&scene.real_bvh, &scene.virtual_bvh]
                .iter()
                .all(|tree| tree.gpu_levels() <= accel::trace::SHALLOW_LEVELS),
        }
    }
}

/// `package::light::cones::cone_pdf` -> `light_cones__cone_pdf`.
struct ModuleItemMangler;

/// Between module and item in an emitted name.
const ITEM: &str = "__";

impl Mangler for ModuleItemMangler {
    fn mangle(&self, path: &ModulePath, item: &str) -> String {
        format!("{}{ITEM}{item}", path.components.join("_"))
    }
}

/// What the module that declares it calls the item of that emitted name.
pub(super) fn item_name(emitted: &str) -> &str {
    emitted.split_once(ITEM).map_or(emitted, |(_, item)| item)
}

/// What Rust declares for the shaders at the level of the estimator and below.
pub(super) const DECLARED: &[&Module] = &[
    &shared::SHARED,
    &math::SHARED,
    &packed::materials::SHARED,
    &packed::records::SHARED,
    &distortion::SHARED,
    &accel::trace::SHARED,
    &work::list::SHARED,
    &work::rays::SHARED,
    &camera::lens::SHARED,
    &camera::sampler::SHARED,
    &camera::shutter::SHARED,
    &camera::splat::SHARED,
    &cpu::panes::SHARED,
    &light::backdrop::SHARED,
    &light::cones::SHARED,
    &light::environment::SHARED,
    &light::guide::SHARED,
    &light::lights::SHARED,
    &light::rectangle::SHARED,
    &material::facets::SHARED,
    &material::fresnel::SHARED,
    &material::ggx::SHARED,
    &material::interface::SHARED,
    &material::lobes::SHARED,
    &material::scatter::SHARED,
    &material::surface::SHARED,
    &material::texture::SHARED,
    &film::groups::SHARED,
    &film::sums::SHARED,
    &super::lanes::SHARED,
    &super::photons::SHARED,
    &cpu::contribution::SHARED,
    &cpu::estimator::SHARED,
    &cpu::photons::emission::SHARED,
    &cpu::photons::path::SHARED,
    &cpu::request::SHARED,
    &cpu::sharing::SHARED,
    &cpu::sharing_tile::SHARED,
    &cpu::state::SHARED,
    &cpu::vertex::SHARED,
];

/// A set of modules to compose from: the embedded ones, some of them replaced or joined by others.
pub struct Composer {
    modules: Vec<(String, Cow<'static, str>)>,
}

impl Default for Composer {
    /// The files of `shaders/`, each with what its Rust twin declares for both.
    fn default() -> Self {
        let files = Self {
            modules: MODULES
                .iter()
                .map(|&(name, source)| (name.to_owned(), Cow::Borrowed(source)))
                .collect(),
        };
        DECLARED
            .iter()
            .fold(files, |composer, module| composer.with_shared(module))
    }
}

impl Composer {
    /// Adds the module `package::NAME` (which may be a path: `light::cones`), in place of the embedded one of that name if there is one.
    pub fn with_module(mut self, name: &str, source: impl Into<Cow<'static, str>>) -> Self {
        self.modules.retain(|(present, _)| present != name);
        self.modules.push((name.to_owned(), source.into()));
        self
    }

    /// Adds what a Rust file declares with [`shared!`](crate::shared) to the module of the same path.
    pub(crate) fn with_shared(mut self, declared: &Module) -> Self {
        let path = declared.path();
        match self.modules.iter_mut().find(|(name, _)| name == path) {
            Some((_, source)) => {
                let text = source.to_mut();
                text.push('\n');
                text.push_str(&declared.wgsl());
            }
            None => self.modules.push((path.to_owned(), declared.wgsl().into())),
        }
        self
    }

    /// WGSL of the module `package::ROOT` reduced to `entry_point` and what it reaches.
    ///
    /// # Errors
    /// [`GpuError::Shader`] for a syntax error, an unknown import or an `@if` flag that [`Features`] does not have.
    pub fn compose(
        &self,
        root: &str,
        entry_point: &str,
        features: &Features,
    ) -> Result<String, GpuError> {
        let shader_error = |message: String| GpuError::Shader {
            entry_point: entry_point.to_owned(),
            message,
        };
        let mut resolver = VirtualResolver::new();
        let path = |name: &str| {
            format!("package::{name}")
                .parse::<ModulePath>()
                .map_err(|error| shader_error(error.to_string()))
        };
        for (name, source) in &self.modules {
            resolver.add_module(path(name)?, Cow::Borrowed(source));
        }
        let mut compiler = Wesl::new_barebones().set_custom_resolver(resolver);
        compiler.set_options(CompileOptions {
            imports: true,
            condcomp: true,
            strip: true,
            lazy: true,
            // naga validates what comes out, wgpu once more when the module is made.
            validate: false,
            keep: Some(vec![entry_point.to_owned()]),
            features: wesl::Features {
                default: Feature::Error,
                flags: features
                    .flags()
                    .into_iter()
                    .map(|(name, on)| (name.to_owned(), on.into()))
                    .collect(),
            },
            ..CompileOptions::default()
        });
        compiler.use_sourcemap(true);
        compiler.set_custom_mangler(ModuleItemMangler);
        compiler
            .compile(&path(root)?)
            .map(|result| result.to_string())
            .map_err(|error| shader_error(without_colours(&error.to_string())))
    }
}

/// WESL paints its messages whether or not they go to a terminal.
fn without_colours(text: &str) -> String {
    let mut pieces = text.split("\u{1b}[");
    let first = pieces.next().unwrap_or_default().to_owned();
    pieces.fold(first, |plain, piece| {
        plain + piece.split_once('m').map_or("", |(_, rest)| rest)
    })
}

#[cfg(test)]
mod tests;
