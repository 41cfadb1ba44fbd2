//! COLMAP's binary model: `cameras.bin`, `images.bin`, and `points3D.bin` where it is there. Little-endian, lists with their counts before.

use std::collections::HashMap;
use std::path::Path;

use glam::{DQuat, DVec3};

use super::colmap::{intrinsics, parameters_of, whole_model};
use super::{
    Entry, Intrinsics, KnownPoint, Result, Trajectory, file_error, finite, from_opencv_axes,
    name_of, pose_of_quaternion,
};
use crate::decode::{MAX_POSES_BYTES, read_file};

/// The models by their numbers.
const MODELS: [&str; 11] = [
    "SIMPLE_PINHOLE",
    "PINHOLE",
    "SIMPLE_RADIAL",
    "RADIAL",
    "OPENCV",
    "OPENCV_FISHEYE",
    "FULL_OPENCV",
    "FOV",
    "SIMPLE_RADIAL_FISHEYE",
    "RADIAL_FISHEYE",
    "THIN_PRISM_FISHEYE",
];

type Problem<T> = std::result::Result<T, String>;

pub(super) fn read(folder: &Path, images: &Path) -> Result<Trajectory> {
    let cameras_path = folder.join("cameras.bin");
    let cameras = read_list(&cameras_path, read_camera)?.into_iter().collect();
    let points_path = folder.join("points3D.bin");
    let points = match points_path.is_file() {
        true => read_list(&points_path, read_point)?.into_iter().collect(),
        false => HashMap::new(),
    };
    let mut known_points = Vec::new();
    let entries = read_list(images, |bytes| {
        read_image(bytes, &cameras, &points, &mut known_points)
    })?;
    let mut files = vec![images.to_owned(), cameras_path];
    files.extend(points_path.is_file().then_some(points_path));
    Ok(whole_model(images, files, &cameras, entries, known_points))
}

/// A count, and as many items.
fn read_list<T>(path: &Path, mut item: impl FnMut(&mut Bytes) -> Problem<T>) -> Result<Vec<T>> {
    let unreadable = |reason: String| {
        file_error(
            path,
            format!(
                "it cannot be read ({reason}); expected COLMAP's binary model; export it again"
            ),
        )
    };
    let bytes = read_file(path, MAX_POSES_BYTES).map_err(unreadable)?;
    let mut bytes = Bytes(&bytes);
    let count = bytes.whole().map_err(|problem| file_error(path, problem))?;
    let mut items = Vec::new();
    for number in 0..count {
        let item = item(&mut bytes)
            .map_err(|problem| file_error(path, format!("item {number}: {problem}")))?;
        items.push(item);
    }
    Ok(items)
}

/// What is left of a file.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take<const N: usize>(&mut self) -> Problem<[u8; N]> {
        let (taken, rest) = self.0.split_first_chunk().ok_or_else(cut_off)?;
        self.0 = rest;
        Ok(*taken)
    }

    fn skip(&mut self, count: u64) -> Problem<()> {
        let count = usize::try_from(count).map_err(|_| cut_off())?;
        self.0 = self.0.get(count..).ok_or_else(cut_off)?;
        Ok(())
    }

    fn whole(&mut self) -> Problem<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn number(&mut self) -> Problem<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn floats<const N: usize>(&mut self, what: &str) -> Problem<[f64; N]> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = finite(self.take().map(f64::from_le_bytes)?, what)?;
        }
        Ok(values)
    }

    /// Up to a zero.
    fn text(&mut self) -> Problem<&'a str> {
        let end = self
            .0
            .iter()
            .position(|byte| *byte == 0)
            .ok_or_else(cut_off)?;
        let (text, rest) = self.0.split_at(end);
        self.0 = &rest[1..];
        std::str::from_utf8(text).map_err(|_| {
            "its name is no UTF-8; expected a file's name; rename the image".to_owned()
        })
    }
}

fn cut_off() -> String {
    "the file ends early; expected COLMAP's whole model; export it again".to_owned()
}

fn read_camera(bytes: &mut Bytes) -> Problem<(u32, Intrinsics)> {
    let id = bytes.number()?;
    let model = bytes.number()?;
    let model = MODELS.get(model as usize).ok_or_else(|| {
        format!("camera model {model} is not known; expected 0 to 10; undistort the images")
    })?;
    let side = |side: u64| {
        u32::try_from(side).map_err(|_| {
            format!("a side of {side} pixels; expected a picture's; export the model again")
        })
    };
    let size = (side(bytes.whole()?)?, side(bytes.whole()?)?);
    let names = parameters_of(model)?;
    let mut values = Vec::new();
    for name in names {
        let [value] = bytes.floats(name)?;
        values.push(value);
    }
    Ok((id, intrinsics(model, size, names, &values)?))
}

fn read_point(bytes: &mut Bytes) -> Problem<(i64, DVec3)> {
    let id = bytes.whole()? as i64;
    let position = bytes.floats::<3>("a point")?;
    // Colour, error, and the images that see it.
    bytes.skip(3 + 8)?;
    let track = bytes.whole()?;
    bytes.skip(track.saturating_mul(8))?;
    Ok((id, DVec3::from(position)))
}

fn read_image(
    bytes: &mut Bytes,
    cameras: &HashMap<u32, Intrinsics>,
    points: &HashMap<i64, DVec3>,
    known: &mut Vec<KnownPoint>,
) -> Problem<Entry> {
    let id = bytes.number()?;
    let [w, x, y, z] = bytes.floats("a quaternion")?;
    let position = DVec3::from(bytes.floats::<3>("a position")?);
    let camera_from_world = pose_of_quaternion(DQuat::from_xyzw(x, y, z, w), position)?;
    let camera = bytes.number()?;
    let intrinsics = cameras.get(&camera).ok_or_else(|| {
        format!(
            "camera {camera} is not in cameras.bin; expected one of its cameras; export both again"
        )
    })?;
    let key = name_of(bytes.text()?);
    let place = format!("image {id}");
    let seen = bytes.whole()?;
    for _ in 0..seen {
        let pixel = bytes.floats::<2>("an observation")?;
        let point = bytes.whole()? as i64;
        if let Some(world) = points.get(&point) {
            known.push(KnownPoint {
                key: key.clone(),
                place: place.clone(),
                world: *world,
                seen: Some(pixel),
            });
        }
    }
    Ok(Entry {
        key,
        place,
        time_secs: None,
        world_from_camera: Some(from_opencv_axes(camera_from_world.inverse())),
        intrinsics: Some(*intrinsics),
        focus_distance_m: None,
    })
}
