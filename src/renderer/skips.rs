//! The savings that can be switched off, to measure what each is worth.

use super::ErrorGoal;
use crate::packed::{
    FRAME_BOTH_SHADOWS, FRAME_NO_CONES, FRAME_NO_GUIDE, FRAME_NO_LAST_VERTEX, FRAME_NO_PHOTONS,
    FRAME_NO_SHARING, Frame, PIXEL_BEAM_MAY_MEET_VIRTUAL, PIXEL_OUT_OF_REACH, PixelInfo,
};
use crate::scene::{Choice, Estimator};

/// Work that is left out because it cannot matter, or seldom does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Skip {
    /// No ray is traced for pixels that nothing virtual can reach. Proven: the result is the same.
    OutOfReach,
    /// The pilot's plan: more samples where they lower the error most, the difference at one in several elsewhere. The expectation is the same.
    Plan,
    /// No virtual primary ray where the lens beam passes all virtual objects by. Proven: the expectation is the same.
    Beams,
    /// The real ray behind a virtual hit is traced in edge pixels alone. Proven: the result is the same.
    EdgeReal,
    /// A light sample of the difference asks the virtual world first, its bounding spheres before its triangles, and the real one only where
    /// something virtual blocks. Proven: the result is the same.
    VirtualFirst,
    /// Directions inside the cones of the virtual bounding spheres; without them the BSDF's alone find virtual objects. The expectation is the
    /// same.
    Cones,
    /// Samples of neighbouring pixels use each other's second vertices. The expectation is the same.
    Sharing,
    /// Where a few lights are all the light there is, a diffuse last vertex leaves all to its shadow ray. The expectation is the same.
    LastVertex,
    /// Caustics of smooth virtual objects come as photons from the lights; without them the eye's paths look for them, and those of lights without
    /// size stay dark. The expectation is the same but for those.
    Photons,
    /// Seen in a mirror or through glass, paths look for caustics where photons found them to come from. The expectation is the same.
    Guide,
    /// Shaders hold the code that the scene needs and no more (GPU). The result is the same to rounding.
    Specialisation,
    /// With a goal, each tile takes the samples that it needs; without, every tile those of the neediest. Both reach the goal.
    Adaptive,
    /// With that goal, a tile stops where its variance is down to the camera's noise; without, only where its rays are spent or another goal is
    /// met. The expectation is the same.
    CameraNoise,
}

impl Choice for Skip {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("out-of-reach", Self::OutOfReach),
        ("plan", Self::Plan),
        ("beams", Self::Beams),
        ("edge-real", Self::EdgeReal),
        ("virtual-first", Self::VirtualFirst),
        ("cones", Self::Cones),
        ("sharing", Self::Sharing),
        ("last-vertex", Self::LastVertex),
        ("photons", Self::Photons),
        ("guide", Self::Guide),
        ("specialisation", Self::Specialisation),
        ("adaptive", Self::Adaptive),
        ("camera-noise", Self::CameraNoise),
    ];
}

/// Savings that are switched off; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Without(u16);

impl Without {
    pub fn contains(self, skip: Skip) -> bool {
        self.0 & bit(skip) != 0
    }

    /// Names with commas between them; "none".
    pub fn names(self) -> String {
        let off = Skip::CHOICES.iter().filter(|(_, s)| self.contains(*s));
        let names: Vec<&str> = off.map(|&(name, _)| name).collect();
        match names.as_slice() {
            [] => "none".to_owned(),
            names => names.join(","),
        }
    }

    /// What [`Without::names`] has written, or nothing.
    pub fn from_names(names: &str) -> Option<Self> {
        let names = names
            .split(',')
            .filter(|name| !matches!(*name, "" | "none"));
        names.map(Skip::from_name).collect()
    }

    /// Those without which a film rendered to its rays per pixel may hold other sums: the others only save time, or act with a goal alone.
    /// `on_gpu`: shaders may render it, which round otherwise.
    #[must_use]
    pub fn of_films(self, on_gpu: bool) -> Self {
        self.filtered(|skip| match skip {
            Skip::VirtualFirst | Skip::Adaptive | Skip::CameraNoise => false,
            Skip::Specialisation => on_gpu,
            Skip::OutOfReach
            | Skip::Plan
            | Skip::Beams
            | Skip::EdgeReal
            | Skip::Cones
            | Skip::Sharing
            | Skip::LastVertex
            | Skip::Photons
            | Skip::Guide => true,
        })
    }

    /// Those of [`Without::of_films`] that the composite shows too, and not only the other planes.
    #[must_use]
    pub fn of_pictures(self, on_gpu: bool) -> Self {
        let proven = |skip| matches!(skip, Skip::OutOfReach | Skip::EdgeReal);
        self.of_films(on_gpu).filtered(|skip| !proven(skip))
    }

    /// Those that a render like this has none of, each with the reason: switched off or not, they do nothing.
    pub fn idle(
        self,
        estimator: Estimator,
        on_gpu: bool,
        goal: Option<&ErrorGoal>,
    ) -> Vec<(&'static str, &'static str)> {
        let reason = |skip| match skip {
            Skip::Adaptive if goal.is_none() => Some("there is no goal"),
            Skip::CameraNoise if goal.is_none_or(|goal| goal.noise.is_none()) => {
                Some("the goal is not the camera's noise")
            }
            Skip::Specialisation if !on_gpu => Some("the CPU renders"),
            Skip::Plan
            | Skip::Beams
            | Skip::EdgeReal
            | Skip::VirtualFirst
            | Skip::Cones
            | Skip::Sharing
            | Skip::LastVertex
            | Skip::Photons
            | Skip::Guide
                if estimator == Estimator::Paper =>
            {
                Some("the estimator is paper")
            }
            _ => None,
        };
        let off = Skip::CHOICES.iter().filter(|(_, s)| self.contains(*s));
        off.filter_map(|&(name, skip)| Some((name, reason(skip)?)))
            .collect()
    }

    fn filtered(self, keep: impl Fn(Skip) -> bool) -> Self {
        let all = Skip::CHOICES.iter().map(|&(_, skip)| skip);
        all.filter(|&skip| self.contains(skip) && keep(skip))
            .collect()
    }

    /// Takes the estimator's share of the savings back.
    pub(super) fn apply_to_frame(self, frame: &mut Frame) {
        for (skip, flag) in [
            (Skip::VirtualFirst, FRAME_BOTH_SHADOWS),
            (Skip::Cones, FRAME_NO_CONES),
            (Skip::LastVertex, FRAME_NO_LAST_VERTEX),
            (Skip::Sharing, FRAME_NO_SHARING),
            (Skip::Photons, FRAME_NO_PHOTONS),
            (Skip::Guide, FRAME_NO_GUIDE),
        ] {
            if self.contains(skip) {
                frame.flags |= flag;
            }
        }
    }

    /// Takes the pixels' share of the savings back.
    pub(super) fn apply_to_pixels(self, pixels: &mut [PixelInfo]) {
        if self == Self::default() {
            return;
        }
        for pixel in pixels {
            if self.contains(Skip::OutOfReach) {
                pixel.flags &= !PIXEL_OUT_OF_REACH;
            }
            if self.contains(Skip::Beams) && pixel.flags & PIXEL_OUT_OF_REACH == 0 {
                pixel.flags |= PIXEL_BEAM_MAY_MEET_VIRTUAL;
            }
            if self.contains(Skip::Plan) {
                *pixel = PixelInfo::uniform(pixel.flags);
            }
        }
    }
}

impl FromIterator<Skip> for Without {
    fn from_iter<I: IntoIterator<Item = Skip>>(skips: I) -> Self {
        Self(skips.into_iter().fold(0, |bits, skip| bits | bit(skip)))
    }
}

fn bit(skip: Skip) -> u16 {
    1 << skip as u8
}

impl ErrorGoal {
    /// What is left to aim at without these savings.
    #[must_use]
    pub fn without(self, without: Without) -> Self {
        let stops_at_noise = !without.contains(Skip::CameraNoise);
        Self {
            noise: self.noise.filter(|_| stops_at_noise),
            ..self
        }
    }
}

#[cfg(test)]
mod tests;
