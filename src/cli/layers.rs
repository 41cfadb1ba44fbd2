//! Photograph, layer and mask of another program, put together.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{Failure, read_photo, say};
use crate::film::Picture;
use crate::output::{ChannelFile, PngBits};
use crate::refusal::Refusal;
use crate::scene::{LayerPicture, Photo, read_coverage, read_layer};

#[derive(Debug, Args)]
pub(super) struct LayerArguments {
    /// The photograph
    photo: PathBuf,
    /// The virtual things, of the photograph's size, with alpha or with MASK; a layer of an OpenEXR file: a.exr#layer. PNG colours are
    /// straight, EXR colours beside an alpha premultiplied, unless --straight or --premultiplied says otherwise; pixels outside the mask
    /// are not read
    layer: PathBuf,
    /// Grey picture: how much of each pixel is virtual, black 0, white 1; its alpha where it has one; of an EXR file the channel mask.Y, A, Y or R
    /// [default: LAYER's alpha]
    mask: Option<PathBuf>,
    /// LAYER's colours are times its alpha, or MASK if it has none
    #[arg(long, conflicts_with = "straight")]
    premultiplied: bool,
    /// LAYER's colours are not times its alpha
    #[arg(long)]
    straight: bool,
    /// MASK is a depth picture: what is nearer than the far limit is virtual; of an EXR file the channel depth.Z, Depth.Z, Z, Y or R
    #[arg(long, requires = "mask")]
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
    /// The layer's colour times the mask.
    light: Vec<[f32; 3]>,
    pub picture: Picture,
}

impl LayerArguments {
    pub(super) fn read(&self) -> Result<Layers, Failure> {
        let photo = read_photo(&self.photo)?;
        let (layer, warnings) = read_layer(&self.layer)
            .map_err(|problem| Failure(format!("{}: {problem}", self.layer.display())))?;
        for warning in warnings {
            say("warning", &format!("{}: {warning}", self.layer.display()));
        }
        self.check_size(&photo, (layer.width, layer.height), &self.layer)?;
        let mask = match &self.mask {
            Some(path) => {
                let mask = self.read_mask(path)?;
                self.check_size(&photo, (mask.width, mask.height), path)?;
                self.coverage(mask.values)
            }
            None if layer.alpha.is_empty() => {
                return Err(Failure(format!(
                    "{}: it has no alpha that tells what is virtual in it; expected a picture with alpha, or a MASK after it; give one",
                    self.layer.display()
                )));
            }
            None => self.coverage(layer.alpha.clone()),
        };
        let light = self.light(&layer, &mask);
        let linear = photo
            .linear
            .iter()
            .zip(&light)
            .zip(&mask)
            .map(|((photo, light), m)| {
                if *m == 0.0 && *light == [0.0; 3] {
                    *photo
                } else {
                    std::array::from_fn(|c| light[c] + (1.0 - m) * photo[c])
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
            light,
            picture,
        })
    }

    /// The layer's colours times the mask.
    fn light(&self, layer: &LayerPicture, mask: &[f32]) -> Vec<[f32; 3]> {
        let is_premultiplied = self.premultiplied || (layer.is_premultiplied && !self.straight);
        let own_alpha = |pixel: usize| layer.alpha.get(pixel).copied();
        let pixels = layer.linear.iter().zip(mask).enumerate();
        pixels
            .map(|(pixel, (colour, m))| {
                let times = match (is_premultiplied, &self.mask, own_alpha(pixel)) {
                    (false, ..) => *m,
                    // What is as bright as it is and covers nothing is added.
                    (true, None, _) | (true, _, None) => 1.0,
                    (true, Some(_), Some(alpha)) if alpha > 0.0 => m / alpha,
                    (true, Some(_), Some(_)) => 0.0,
                };
                match times == 0.0 {
                    true => [0.0; 3],
                    false => colour.map(|c| times * c),
                }
            })
            .collect()
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
    fn read_mask(&self, path: &Path) -> Result<Plane, Failure> {
        let name = path.to_string_lossy().to_ascii_lowercase();
        if name.ends_with(".exr") {
            return self.read_channel(path);
        }
        let failed = |problem: Refusal| Failure(format!("{}: {problem}", path.display()));
        if name.contains(".exr#") && !path.exists() {
            let (layer, _) = read_layer(path).map_err(failed)?;
            return Ok(Plane {
                width: layer.width,
                height: layer.height,
                values: match layer.alpha.is_empty() {
                    true => layer.linear.iter().map(|[red, ..]| *red).collect(),
                    false => layer.alpha,
                },
            });
        }
        let (width, height, values) = read_coverage(path).map_err(failed)?;
        Ok(Plane {
            width,
            height,
            values,
        })
    }

    /// Of an OpenEXR file, which may hold much else.
    fn read_channel(&self, path: &Path) -> Result<Plane, Failure> {
        let mut file = ChannelFile::read(path)?;
        if !self.depth
            && !file.floats.contains_key("mask.Y")
            && let Ok((layer, _)) = read_layer(path)
            && !layer.alpha.is_empty()
        {
            return Ok(Plane {
                width: layer.width,
                height: layer.height,
                values: layer.alpha,
            });
        }
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
                path.display(),
                wanted.join(", ")
            )));
        };
        if let Some(bad) = values.iter().position(|value| value.is_nan()) {
            return Err(Failure(format!(
                "{}: pixel ({}, {}) is NaN; expected numbers; repair the file",
                path.display(),
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
        let pixels = self.light.iter().zip(&self.mask);
        pixels.map(|([r, g, b], m)| [*r, *g, *b, *m]).collect()
    }

    pub(super) fn bits(&self) -> PngBits {
        PngBits::for_photo(Some(&self.photo))
    }
}
