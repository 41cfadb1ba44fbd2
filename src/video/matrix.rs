//! What Y'CbCr means by its luma.

/// Which weights red, green and blue have in luma.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matrix {
    Bt601,
    Bt709,
}

impl Matrix {
    /// Lines from which on a film is of high definition, whose standard is BT.709.
    const HIGH_DEFINITION: u32 = 720;

    /// What a film of this height is, where it does not say.
    pub fn of_height(height: u32) -> Self {
        match height {
            Self::HIGH_DEFINITION.. => Self::Bt709,
            _ => Self::Bt601,
        }
    }

    /// "BT.601".
    pub fn name(self) -> &'static str {
        match self {
            Self::Bt601 => "BT.601",
            Self::Bt709 => "BT.709",
        }
    }

    /// Of red and blue; green has the rest.
    pub(super) fn weights(self) -> (f64, f64) {
        match self {
            Self::Bt601 => (0.299, 0.114),
            Self::Bt709 => (0.2126, 0.0722),
        }
    }
}
