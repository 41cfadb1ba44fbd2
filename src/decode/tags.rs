//! What a file says of its codes beside them.

use std::sync::Arc;

use image::metadata::Orientation;

use super::ColourProfile;

/// What is written back with codes that are kept.
#[derive(Clone, Debug)]
pub struct Tags {
    /// `None`: sRGB.
    pub profile: Option<Arc<ColourProfile>>,
    /// How the pixels are to be turned for a viewer.
    pub orientation: Orientation,
}

impl Default for Tags {
    fn default() -> Self {
        Self {
            profile: None,
            orientation: Orientation::NoTransforms,
        }
    }
}

impl Tags {
    /// An EXIF block with the orientation alone; `None`: nothing is to be turned.
    pub fn exif(&self) -> Option<Vec<u8>> {
        if self.orientation == Orientation::NoTransforms {
            return None;
        }
        let mut block = b"II*\0\x08\0\0\0\x01\0".to_vec();
        // One entry: tag 0x0112, a short, once, its value in four bytes; no further directory.
        block.extend([0x12, 0x01, 3, 0, 1, 0, 0, 0]);
        block.extend([self.orientation.to_exif(), 0, 0, 0]);
        block.extend([0; 4]);
        Some(block)
    }
}

/// Width and height of a picture once it is turned.
pub(crate) fn turned_size((width, height): (u32, u32), orientation: Orientation) -> (u32, u32) {
    match orientation {
        Orientation::Rotate90
        | Orientation::Rotate270
        | Orientation::Rotate90FlipH
        | Orientation::Rotate270FlipH => (height, width),
        _ => (width, height),
    }
}

/// Pixels of a picture of this size, turned for a viewer. Row-major from the top left.
pub(crate) fn turned<T: Copy>(size: (u32, u32), pixels: &[T], orientation: Orientation) -> Vec<T> {
    let (last_x, last_y) = (size.0 - 1, size.1 - 1);
    let (width, height) = turned_size(size, orientation);
    let from = |x: u32, y: u32| match orientation {
        Orientation::NoTransforms => (x, y),
        Orientation::Rotate90 => (y, last_y - x),
        Orientation::Rotate180 => (last_x - x, last_y - y),
        Orientation::Rotate270 => (last_x - y, x),
        Orientation::FlipHorizontal => (last_x - x, y),
        Orientation::FlipVertical => (x, last_y - y),
        Orientation::Rotate90FlipH => (y, x),
        Orientation::Rotate270FlipH => (last_x - y, last_y - x),
    };
    (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| {
            let (x, y) = from(x, y);
            pixels[y as usize * size.0 as usize + x as usize]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_turned_as_another_program_turns_them() {
        let pixels: Vec<[u8; 3]> = (0..12).map(|i| [i, 0, 0]).collect();
        for exif in 1..=8 {
            let orientation = Orientation::from_exif(exif).unwrap();
            let raw = pixels.as_flattened().to_vec();
            let mut theirs = image::DynamicImage::ImageRgb8(
                image::RgbImage::from_raw(4, 3, raw).expect("the size fits"),
            );
            theirs.apply_orientation(orientation);
            assert_eq!(
                turned_size((4, 3), orientation),
                (theirs.width(), theirs.height())
            );
            let ours = turned((4, 3), &pixels, orientation);
            assert_eq!(ours.as_flattened(), theirs.as_bytes(), "{exif}");
        }
        assert_ne!(
            turned((4, 3), &pixels, Orientation::Rotate90),
            pixels,
            "control"
        );
    }

    #[test]
    fn the_block_says_the_orientation() {
        assert_eq!(Tags::default().exif(), None);
        for exif in 2..=8 {
            let orientation = Orientation::from_exif(exif).unwrap();
            let tags = Tags {
                orientation,
                ..Tags::default()
            };
            let block = tags.exif().unwrap();
            assert_eq!(Orientation::from_exif_chunk(&block), Some(orientation));
        }
    }
}
