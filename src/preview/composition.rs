//! What the window can change of a scene, as one value: undo is the value before, and saving writes what differs from the file.
//!
//! Every number is kept in the form in which the scene file has it, and becomes the scene's by the reader's own operations: what is saved
//! and read again is the same scene, bit for bit.

mod keyed;

use glam::{DMat3, DMat4, DQuat, DVec3, EulerRot};

pub use keyed::Track;

use super::keyframes::Keys;
use super::material_form::MaterialForm;
use crate::scene::{Aperture, Exposure, Lens, Object, Scene, Shutter, Side, Stages};

/// All that can be edited.
#[derive(Clone, Debug, PartialEq)]
pub struct Composition {
    pub camera: CameraPose,
    pub lens: LensForm,
    /// `None`: the scene has no environment.
    pub environment: Option<EnvironmentForm>,
    pub exposure: Exposure,
    pub rays_per_pixel: u32,
    pub max_bounces: u32,
    pub seed: u32,
    /// In the order of [`Scene::objects`]: the real ones first. Where an object has keys, they come after it.
    pub objects: Vec<Placement>,
    /// In the same order: transforms after the object's own.
    pub motions: Vec<Keys<Placement>>,
    /// Distances in metres, in place of the lens's own.
    pub focus_keys: Keys<f64>,
    /// In the same order; `None`: the file replaces nothing of what the object brings.
    pub materials: Vec<Option<MaterialForm>>,
    pub stages: Stages,
    /// `None`: nothing moves while the picture is taken.
    pub shutter: Option<Shutter>,
    pub frame: FrameLead,
}

/// What a video's frame brings in place of the scene's own; no scene file has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameLead {
    pub time_secs: Option<f64>,
    pub focus_distance_m: Option<f64>,
}

/// World-from-camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraPose {
    LookAt {
        position: DVec3,
        look_at: DVec3,
        up: DVec3,
    },
    /// As the file's matrix was read.
    Matrix(DMat4),
}

/// `[lens]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensForm {
    pub opening: Opening,
    pub focus_distance_m: f64,
    pub aperture: Aperture,
    pub blade_rotation_deg: f64,
}

/// How wide the aperture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Opening {
    FNumber { f_number: f64, focal_length_mm: f64 },
    RadiusM(f64),
}

/// `[environment]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvironmentForm {
    pub rotation_deg: f64,
    pub scale: f64,
}

/// World-from-object as translation, rotation and scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub translation: DVec3,
    pub rotation: Rotation,
    pub scale: DVec3,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rotation {
    /// About the fixed axes X, then Y, then Z.
    EulerDeg(DVec3),
    Quaternion(DQuat),
}

impl CameraPose {
    /// Rigid.
    pub fn world_from_camera(&self) -> DMat4 {
        match *self {
            Self::Matrix(matrix) => matrix,
            Self::LookAt {
                position,
                look_at,
                up,
            } => {
                let view = look_at - position;
                let backward = -view / view.length();
                let right = up.normalize().cross(backward).normalize();
                DMat4::from_cols(
                    right.extend(0.0),
                    backward.cross(right).extend(0.0),
                    backward.extend(0.0),
                    position.extend(1.0),
                )
            }
        }
    }
}

impl LensForm {
    pub fn lens(&self) -> Lens {
        let aperture_radius_m = match self.opening {
            Opening::FNumber {
                f_number,
                focal_length_mm,
            } => focal_length_mm / (2000.0 * f_number),
            Opening::RadiusM(radius) => radius,
        };
        Lens {
            aperture_radius_m,
            focus_distance_m: self.focus_distance_m,
            aperture: self.aperture,
            blade_rotation_deg: self.blade_rotation_deg,
            focal_length_m: match self.opening {
                Opening::FNumber {
                    focal_length_mm, ..
                } => focal_length_mm / 1000.0,
                Opening::RadiusM(_) => 0.0,
            },
        }
    }

    /// No lens focuses nearer than this.
    pub fn least_focus_m(&self) -> f64 {
        match self.opening {
            Opening::FNumber {
                focal_length_mm, ..
            } => focal_length_mm / 1000.0 * 1.001,
            Opening::RadiusM(_) => 1e-6,
        }
    }
}

impl Placement {
    pub const IDENTITY: Self = Self {
        translation: DVec3::ZERO,
        rotation: Rotation::EulerDeg(DVec3::ZERO),
        scale: DVec3::ONE,
    };

    /// Of a transform without shear.
    pub fn of(world_from_object: DMat4) -> Self {
        let (scale, rotation, translation) = world_from_object.to_scale_rotation_translation();
        Self {
            translation,
            rotation: Rotation::Quaternion(rotation),
            scale,
        }
    }

    /// Its scale at the origin.
    fn scale_alone(&self) -> Self {
        Self {
            scale: self.scale,
            ..Self::IDENTITY
        }
    }

    /// In short numbers, as edits are.
    fn tidy(&self) -> Self {
        Self {
            translation: rounded_m(self.translation),
            rotation: match self.rotation {
                Rotation::Quaternion(quaternion) => Rotation::of(quaternion),
                degrees @ Rotation::EulerDeg(_) => degrees,
            },
            scale: self.scale.map(|factor| match rounded(factor, 1e-6) {
                0.0 => factor,
                short => short,
            }),
        }
    }

    pub fn world_from_object(&self) -> DMat4 {
        let rotation = self.rotation.quaternion();
        DMat4::from_scale_rotation_translation(self.scale, rotation, self.translation)
    }
}

impl Rotation {
    pub fn quaternion(&self) -> DQuat {
        match *self {
            Self::Quaternion(quaternion) => quaternion,
            Self::EulerDeg(deg) => {
                let [x, y, z] = deg.to_array().map(f64::to_radians);
                DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x)
            }
        }
    }

    /// The same rotation in degrees about the fixed axes, rounded as edits are.
    pub fn of(quaternion: DQuat) -> Self {
        // Fixed axes X, Y, Z are the moving axes Z, Y, X.
        let (z, y, x) = DMat3::from_quat(quaternion).to_euler(EulerRot::ZYX);
        Self::EulerDeg(DVec3::new(x, y, z).map(|angle| rounded(angle.to_degrees(), 1e-3)))
    }
}

/// What a hand sets is rounded to a step, so that the file reads well.
pub fn rounded(value: f64, step: f64) -> f64 {
    // Dividing by a power of ten gives the decimal number's own f64.
    let per_unit = (1.0 / step).round();
    // No negative zero.
    (value * per_unit).round() / per_unit + 0.0
}

/// Three of them, metres, to a hundredth of a millimetre.
pub fn rounded_m(point: DVec3) -> DVec3 {
    point.map(|x| rounded(x, 1e-5))
}

/// What of a composition differs, by what a renderer does about it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Difference {
    pub camera: bool,
    pub lens: bool,
    pub environment: bool,
    pub transport: bool,
    pub samples: bool,
    pub objects: Vec<usize>,
    /// Keys of objects, or the time: the same places may come about in another way.
    pub motion: bool,
    /// Those made of another material.
    pub materials: Vec<usize>,
    /// What works on the finished film alone.
    pub stages: bool,
    /// What no renderer takes up: it is built anew.
    pub built: bool,
}

impl Difference {
    pub fn between(a: &Composition, b: &Composition) -> Self {
        let differs = |index: usize| {
            let is_same = a.objects[index] == b.objects[index]
                && a.motions[index] == b.motions[index]
                && (a.motions[index].is_empty() || a.time_secs() == b.time_secs());
            !is_same && a.world_from_object(index) != b.world_from_object(index)
        };
        let open = |c: &Composition| c.shutter.filter(Shutter::is_open);
        let moves = a.motions.iter().any(|keys| !keys.is_empty());
        let motion = a.motions != b.motions || (moves && a.time_secs() != b.time_secs());
        Self {
            camera: a.camera != b.camera,
            lens: a.lens() != b.lens(),
            environment: a.environment != b.environment,
            transport: (a.exposure, a.max_bounces) != (b.exposure, b.max_bounces),
            samples: (a.rays_per_pixel, a.seed) != (b.rays_per_pixel, b.seed),
            objects: (0..a.objects.len().min(b.objects.len()))
                .filter(|index| differs(*index))
                .collect(),
            motion,
            materials: (0..a.materials.len().min(b.materials.len()))
                .filter(|index| a.materials[*index] != b.materials[*index])
                .collect(),
            stages: a.stages != b.stages,
            built: open(a) != open(b) || (open(a).is_some() && motion),
        }
    }

    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The film serves both: nothing differs, or the stages alone.
    pub fn keeps_film(&self) -> bool {
        let stages = Self {
            stages: true,
            ..Self::default()
        };
        self.is_none() || *self == stages
    }

    /// For figures of latency.
    pub fn name(&self) -> &'static str {
        match self {
            _ if !self.objects.is_empty() => "object",
            Self { camera: true, .. } => "camera",
            Self {
                environment: true, ..
            } => "light",
            Self { lens: true, .. } => "lens",
            Self {
                transport: true, ..
            } => "exposure or bounces",
            Self { samples: true, .. } => "rays",
            _ if !self.materials.is_empty() => "material",
            Self { built: true, .. } => "shutter",
            Self { stages: true, .. } => "stages",
            Self { motion: true, .. } => "keys",
            _ => "none",
        }
    }
}

impl Composition {
    /// The scene with everything as it is set here.
    pub fn apply(&self, scene: &mut Scene) {
        scene.camera.world_from_camera = self.camera.world_from_camera();
        scene.lens = self.lens();
        scene.focus_path = self.focus_path();
        if let (Some(environment), Some(form)) = (&mut scene.environment, self.environment) {
            (environment.rotation_deg, environment.scale) = (form.rotation_deg, form.scale);
        }
        scene.settings.exposure = self.exposure;
        scene.settings.rays_per_pixel = self.rays_per_pixel;
        scene.settings.max_bounces = self.max_bounces;
        scene.settings.seed = self.seed;
        for (index, object) in scene.objects.iter_mut().enumerate() {
            // What the reader placed is no product of these numbers to the last bit.
            let is_kept = object.motion.is_none()
                && self.motions[index].is_empty()
                && Placement::of(object.world_from_object) == self.objects[index];
            if !is_kept {
                object.motion = self.motion(index);
                object.world_from_object = self.world_from_object(index);
            }
        }
        for (object, form) in scene.objects.iter_mut().zip(&self.materials) {
            if let Some(form) = form {
                form.apply(object);
            }
        }
        scene.stages = self.stages.clone();
        scene.shutter = self.shutter;
    }

    /// Another time moves the camera along its keys, and what is animated within an object: the text is read anew.
    pub fn needs_reading(&self, other: &Self, scene: &Scene) -> bool {
        let is_led = self.frame.time_secs.is_none() && !scene.camera_path.is_empty();
        self.time_secs() != other.time_secs() && (is_led || scene.objects.iter().any(moves_within))
    }

    /// The picture's time.
    pub fn time_secs(&self) -> f64 {
        let own = self.shutter.map_or(0.0, |shutter| shutter.time_secs);
        self.frame.time_secs.unwrap_or(own)
    }
}

/// An animation moves it, its parts or their shapes.
pub fn moves_within(object: &Object) -> bool {
    let mut parts = object.instances.iter();
    parts.any(|part| part.animation.is_some() || part.deforms())
}

/// Indices of the virtual objects.
pub fn virtual_objects(scene: &Scene) -> impl Iterator<Item = usize> + '_ {
    let objects = scene.objects.iter().enumerate();
    objects.filter_map(|(index, object)| (object.side == Side::Virtual).then_some(index))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotation_survives_its_degrees() {
        for deg in [
            DVec3::new(10.0, 20.0, 30.0),
            DVec3::new(-170.0, 45.0, 5.0),
            DVec3::new(0.0, -88.0, 120.0),
        ] {
            let rotation = Rotation::EulerDeg(deg).quaternion();
            let back = Rotation::of(rotation).quaternion();
            assert!(back.dot(rotation).abs() > 1.0 - 1e-9, "{deg}");
            let other = Rotation::of(rotation * DQuat::from_rotation_x(0.01)).quaternion();
            assert!(other.dot(rotation).abs() < 1.0 - 1e-6, "control");
        }
    }

    #[test]
    fn edits_are_short_decimals() {
        assert_eq!(rounded(0.123_456_789, 1e-5).to_string(), "0.12346");
        assert_eq!(rounded(2.799_999_9, 1e-3).to_string(), "2.8");
        assert_eq!(rounded(-1e-9, 1e-3).to_string(), "0", "no -0");
    }
}
