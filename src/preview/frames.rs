//! The frames of a video behind a scene, each with its picture and pose: what the window's timeline goes through.

use std::path::{Path, PathBuf};

use super::composition::FrameLead;
use crate::scene::trajectory::{CameraPath, FrameView, Trajectory, Views};
use crate::scene::{Camera, Given, Photo, Scene, load_text_with};
use crate::video::FrameSource;

/// Frames a second where the trajectory tells none, as `mixray sequence` takes them.
const ANY_RATE: f64 = 25.0;

/// A folder of pictures and their poses.
pub struct Frames {
    folder: PathBuf,
    trajectory: PathBuf,
    /// Those with a pose; the others pass through a sequence unchanged.
    posed: Vec<Frame>,
}

pub struct Frame {
    pub label: String,
    /// As `--range` counts.
    pub number: u32,
    picture: PathBuf,
    view: FrameView,
    /// The camera's way around it.
    path: CameraPath,
}

impl Frames {
    /// Reads the poses and the names of the pictures.
    ///
    /// # Errors
    /// In one line: the folder or the trajectory cannot be used, or no picture has a pose.
    pub fn open(folder: &Path, trajectory: &Path) -> Result<Self, String> {
        let poses = Trajectory::read(trajectory).map_err(|error| error.to_string())?;
        let source = FrameSource::open(folder).map_err(|error| error.to_string())?;
        let name = folder.display();
        if source.is_stream() {
            return Err(format!(
                "{name}: it is a film; expected a folder of pictures, between which the timeline goes to and fro; write them by `ffmpeg -i {name} frames/%05d.png`"
            ));
        }
        let rate = poses.frames_per_second.unwrap_or(ANY_RATE);
        let views = Views::new(&poses, Some(rate), false).map_err(|error| error.to_string())?;
        let views = views.passing_missing(true);
        let mut posed = Vec::new();
        for (name, picture) in source.pictures() {
            let view = views.of(&name).map_err(|error| error.to_string())?;
            if view.world_from_camera.is_some() {
                posed.push(Frame {
                    path: views.path_near(view.time_secs.unwrap_or(0.0)),
                    label: name.label,
                    number: name.number,
                    picture,
                    view,
                });
            }
        }
        if posed.is_empty() {
            return Err(format!(
                "{}: it has a pose for none of the frames in {name}; expected one at least; look whether their names are the same",
                trajectory.display()
            ));
        }
        Ok(Self {
            folder: folder.to_path_buf(),
            trajectory: trajectory.to_path_buf(),
            posed,
        })
    }

    /// With a pose, in their order; never empty.
    pub fn posed(&self) -> &[Frame] {
        &self.posed
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn trajectory(&self) -> &Path {
        &self.trajectory
    }

    /// The scene of that text as the camera of a frame saw it.
    ///
    /// # Errors
    /// In one line: the picture or the scene cannot be used, or the intrinsics are of another size.
    pub fn scene(&self, frame: usize, path: &Path, text: &str) -> Result<Scene, String> {
        let Frame {
            picture,
            view,
            path: camera_path,
            ..
        } = &self.posed[frame];
        let of_picture = |problem: String| format!("{}: {problem}", picture.display());
        let (photo, _) = Photo::read(picture).map_err(|problem| of_picture(problem.to_string()))?;
        let given = Given {
            photo: Some(photo),
            intrinsics: view.intrinsics,
            sandbox: false,
        };
        let mut scene = load_text_with(path, text, given).map_err(|error| error.to_string())?;
        if let Some(world_from_camera) = view.world_from_camera {
            let size = (scene.camera.width, scene.camera.height);
            scene.camera = match view.intrinsics {
                Some(intrinsics) => (intrinsics.camera(size, world_from_camera)).map_err(|problem| {
                    of_picture(format!("{problem}; expected intrinsics of the frames' size; calibrate at that size, or scale the frames"))
                })?,
                None => Camera {
                    world_from_camera,
                    ..scene.camera
                },
            };
        }
        scene.camera_path = camera_path.clone();
        if let Some(time_secs) = view.time_secs {
            if let Some(shutter) = &mut scene.shutter {
                shutter.time_secs = time_secs;
            }
            scene.set_time(time_secs);
            scene.lens = scene.lens_at(time_secs);
        }
        if let Some(focus_distance_m) = view.focus_distance_m {
            scene.lens.focus_distance_m = focus_distance_m;
        }
        Ok(scene)
    }
}

impl Frame {
    pub fn time_secs(&self) -> Option<f64> {
        self.view.time_secs
    }

    /// What it brings in place of the scene's own.
    pub fn lead(&self) -> FrameLead {
        FrameLead {
            time_secs: self.view.time_secs,
            focus_distance_m: self.view.focus_distance_m,
        }
    }
}
