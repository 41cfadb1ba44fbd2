//! What a scene file asks of the camera stages: the one place where its reader meets them. A stage whose table is absent is off.
//!
//! What can be set of a stage, and how it is read, stands in the stage's own folder and knows nothing that renders: scenes are made of it.

pub use super::antialias::settings::AntialiasSettings;
pub use super::cartoon::settings::{CartoonSettings, CartoonStyle, FlowSettings};
pub use super::motion_blur::settings::{MotionBlurMethod, MotionBlurSettings};
pub use super::noise::settings::{
    Autocorrelation, LAGS, MAX_BINS, NOISE_PROFILE_VERSION, NoiseBin, NoiseFit, NoiseMethod,
    NoiseProfile, NoiseSettings, WHITE, bin_index,
};
pub use super::sharpness::settings::{PointSpread, SharpnessSettings};

use crate::scene::error::Result;
use crate::scene::fingerprint::content;
use crate::scene::reader::Table;
use crate::stages::table::StageSettings;

macro_rules! stages {
    ($($(#[$doc:meta])* $name:ident: $settings:ty,)*) => {
        /// The stages that a scene asks for.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Stages {
            $($(#[$doc])* pub $name: Option<$settings>,)*
        }

        content! { Stages { $($name),* } }

        impl Stages {
            /// Their tables in a scene file, which are their names.
            pub(crate) const TABLES: &'static [&'static str] = &[$(stringify!($name),)*];

            /// Those whose tables the scene file has.
            ///
            /// # Errors
            /// Keys or values that a stage does not know, or stages that exclude one another.
            pub(crate) fn read(root: &Table) -> Result<Self> {
                $(if <$settings>::ALONE {
                    for other in Self::TABLES.iter().filter(|table| **table != stringify!($name)) {
                        root.refuse_both(stringify!($name), other)?;
                    }
                })*
                Ok(Self {
                    $($name: root
                        .table(stringify!($name), concat!("[", stringify!($name), "]"), <$settings>::KEYS)?
                        .map(|table| <$settings>::read(&table))
                        .transpose()?,)*
                })
            }
        }
    };
}

stages! {
    antialias: AntialiasSettings,
    motion_blur: MotionBlurSettings,
    sharpness: SharpnessSettings,
    noise: NoiseSettings,
    /// Never beside the others: it replaces what makes a picture look photographed.
    cartoon: CartoonSettings,
}
