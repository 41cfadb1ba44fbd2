//! Photograph, layer and mask of another program, put together.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Failure, read_photo};
use crate::film::Picture;
use crate::output::{ChannelFile, PngBits};
use crate::scene::{Photo, read_coverage};

#[derive(Debug, Args)]
pub(super) struct LayerArguments {
    /// The photograph
    photo: PathBuf,
    /// The virtual things, not premultiplied, of the photograph's size; pixels outside the mask are not read
    layer: PathBuf,
    /// Grey picture: how much of each pixel is virtual, black 0, white 1; its alpha where it has one; of an EXR file the channel mask.Y, A, Y or R
    mask: PathBuf,
    /// MASK is a depth picture: what is nearer than the far limit is virtual; of an EXR file the channel depth.Z, Depth.Z, Z, Y or R
    #[arg(long)]
    depth: bool,
    /// The far limit: white is 1, EXR values are as stored
    #[arg(long, value_name = "X", default_value_t = 1.0, requires = "depth", value_parser = distance, allow_hyphen_values = true)]
    far: f32,
}

fn distance(text: &str) -> Result<f32, &'static str> {
    match text.parse::<f32>() {
        Ok(x) if !x.is_nan() => Ok(x),
        _ => Err("expected a number"),
    }
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
        let mask = self.read_mask()?;
        self.check_size(&photo, (layer.width, layer.height), &self.layer)?;
        self.check_size(&photo, (mask.width, mask.height), &self.mask)?;
        let mask = self.coverage(mask.values);
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

    fn check_size(&self, photo: &Photo, size: (u32, u32), path: &Path) -> Result<(), Failure> {
        if (photo.width, photo.height) == size {
            return Ok(());
        }
        Err(Failure(format!(
            "{}: it has {} x {} pixels where the photograph {} has {} x {}; expected one size",
            path.display(),
            size.0,
            size.1,
            self.photo.display(),
            photo.width,
            photo.height
        )))
    }

    /// The mask or depth as stored, no curve.
    fn read_mask(&self) -> Result<Plane, Failure> {
        if self
            .mask
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("exr"))
        {
            return self.read_channel();
        }
        let (width, height, values) = read_coverage(&self.mask)
            .map_err(|problem| Failure(format!("{}: {problem}", self.mask.display())))?;
        Ok(Plane {
            width,
            height,
            values,
        })
    }

    /// Of an OpenEXR file, which may hold much else.
    fn read_channel(&self) -> Result<Plane, Failure> {
        let mut file = ChannelFile::read(&self.mask)?;
        let wanted: &[&str] = match self.depth {
            true => &["depth.Z", "Depth.Z", "Z", "Y", "R"],
            false => &["mask.Y", "A", "Y", "R"],
        };
        let found = wanted.iter().find_map(|&wanted| {
            let mut names = file.floats.keys();
            // Blender puts the name of the view layer in front.
            let name = names.find(|name| {
                let rest = name.strip_suffix(wanted);
                rest.is_some_and(|rest| {
                    rest.is_empty() || (rest.ends_with('.') && wanted.contains('.'))
                })
            });
            name.cloned()
        });
        let Some(values) = found.and_then(|name| file.floats.remove(&name)) else {
            return Err(Failure(format!(
                "{}: it has no float channel named {}; expected one of them; write it into the file",
                self.mask.display(),
                wanted.join(", ")
            )));
        };
        if let Some(bad) = values.iter().position(|value| value.is_nan()) {
            return Err(Failure(format!(
                "{}: pixel ({}, {}) is NaN; expected numbers; repair the file",
                self.mask.display(),
                bad % file.width as usize,
                bad / file.width as usize
            )));
        }
        Ok(Plane {
            width: file.width,
            height: file.height,
            values,
        })
    }

    /// 0 to 1.
    fn coverage(&self, stored: Vec<f32>) -> Vec<f32> {
        stored
            .into_iter()
            .map(|value| match self.depth {
                true => f32::from(u8::from(value < self.far)),
                false => value.clamp(0.0, 1.0),
            })
            .collect()
    }
}

/// One number a pixel.
struct Plane {
    width: u32,
    height: u32,
    values: Vec<f32>,
}

impl Layers {
    /// The layer's colour times the mask, and the mask.
    pub(super) fn premultiplied(&self) -> Vec<[f32; 4]> {
        let pixels = self.picture.linear.iter().zip(&self.photo.linear);
        pixels
            .zip(&self.mask)
            .map(|((both, photo), m)| {
                let [r, g, b] = [0, 1, 2].map(|c| both[c] - (1.0 - m) * photo[c]);
                [r, g, b, *m]
            })
            .collect()
    }

    pub(super) fn bits(&self) -> PngBits {
        PngBits::for_photo(Some(&self.photo))
    }
}
