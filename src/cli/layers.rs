//! Photograph, layer and mask of another program, put together.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Failure, read_photo};
use crate::film::Picture;
use crate::output::PngBits;
use crate::scene::{EncodedPhoto, Photo};

#[derive(Debug, Args)]
pub(super) struct LayerArguments {
    /// The photograph
    photo: PathBuf,
    /// The virtual things, not premultiplied, of the photograph's size; pixels outside the mask are not read
    layer: PathBuf,
    /// Grey picture: how much of each pixel is virtual, black 0, white 1
    mask: PathBuf,
    /// MASK is a depth picture: what is nearer than the far limit is virtual
    #[arg(long)]
    depth: bool,
    /// The far limit: white is 1, EXR values are as stored
    #[arg(long, value_name = "X", default_value_t = 1.0, requires = "depth")]
    far: f32,
}

/// The composite with what it was made from, linear.
pub(super) struct Layers {
    pub photo: Photo,
    pub mask: Vec<f32>,
    pub picture: Picture,
}

impl LayerArguments {
    pub(super) fn read(&self) -> Result<Layers, Failure> {
        let photo = read_photo(&self.photo)?;
        let layer = read_photo(&self.layer)?;
        let mask = read_photo(&self.mask)?;
        self.check_size(&photo, &layer, &self.layer)?;
        self.check_size(&photo, &mask, &self.mask)?;
        let mask = self.coverage(&mask);
        let linear = photo
            .linear
            .iter()
            .zip(&layer.linear)
            .zip(&mask)
            .map(|((photo, layer), m)| {
                if *m == 0.0 {
                    *photo
                } else {
                    std::array::from_fn(|c| m * layer[c] + (1.0 - m) * photo[c])
                }
            })
            .collect();
        let picture = Picture {
            width: photo.width,
            height: photo.height,
            linear,
        };
        Ok(Layers {
            photo,
            mask,
            picture,
        })
    }

    fn check_size(&self, photo: &Photo, other: &Photo, path: &Path) -> Result<(), Failure> {
        if (photo.width, photo.height) == (other.width, other.height) {
            return Ok(());
        }
        Err(Failure(format!(
            "{}: it has {} x {} pixels where the photograph {} has {} x {}; expected one size",
            path.display(),
            other.width,
            other.height,
            self.photo.display(),
            photo.width,
            photo.height
        )))
    }

    /// 0 to 1; the first channel as stored, no curve.
    fn coverage(&self, mask: &Photo) -> Vec<f32> {
        let stored: Vec<f32> = match &mask.encoded {
            EncodedPhoto::Srgb8(codes) => codes.iter().map(|c| f32::from(c[0]) / 255.0).collect(),
            EncodedPhoto::Srgb16(codes) => {
                codes.iter().map(|c| f32::from(c[0]) / 65535.0).collect()
            }
            EncodedPhoto::Linear => mask.linear.iter().map(|value| value[0]).collect(),
        };
        stored
            .into_iter()
            .map(|value| match self.depth {
                true => f32::from(u8::from(value < self.far)),
                false => value.clamp(0.0, 1.0),
            })
            .collect()
    }
}

impl Layers {
    pub(super) fn bits(&self) -> PngBits {
        PngBits::for_photo(Some(&self.photo))
    }
}
