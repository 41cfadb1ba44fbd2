//! Every reader of the program: what it reads, how that is damaged, and what must hold of what is read.

use std::path::Path;

use mixray::bench::{Report, against, csv, markdown, text as table};
use mixray::output::{ChannelFile, read_film};
use mixray::scene::gltf::load_gltf;
use mixray::scene::trajectory::{Focal, Trajectory, read_intrinsics};
use mixray::scene::{NoiseProfile, Photo, Primitive, load};
use mixray::sequence::{SequenceOptions, check_poses};
use mixray::video::{FrameSource, Taken};

use super::mutate::Random;
use super::mutate::{bytes, glb, png, text};
use super::{Outcome, seeds};

/// What reads files of a kind.
pub struct Reader {
    pub name: &'static str,
    /// What the file is called.
    pub file: &'static str,
    pub valid: fn() -> Vec<Vec<u8>>,
    pub damage: fn(&[u8], &mut Random) -> Vec<u8>,
    /// Puts what was damaged into the file that holds it.
    pub wrap: fn(Vec<u8>) -> Vec<u8>,
    pub read: fn(&Path) -> Outcome,
}

pub fn all() -> Vec<Reader> {
    let reader = |name, file, valid, damage, read| Reader {
        name,
        file,
        valid,
        damage,
        wrap: |bytes| bytes,
        read,
    };
    vec![
        reader("scene", "scene.toml", seeds::scenes, text, scene),
        reader("model", "model.glb", seeds::models, glb, model),
        Reader {
            wrap: |texture| seeds::model(&texture),
            ..reader("texture", "model.glb", seeds::textures, bytes, model)
        },
        reader("ply", "scan.ply", seeds::plys, bytes, scan),
        reader("obj", "scan.obj", seeds::objs, text, scan),
        reader("png", "photo.png", seeds::pngs, png, photo),
        reader("jpeg", "photo.jpg", seeds::jpegs, bytes, photo),
        reader("hdr", "photo.hdr", seeds::hdrs, bytes, photo),
        reader("exr", "photo.exr", seeds::exrs, bytes, photo),
        reader("channels", "mask.exr", seeds::exrs, bytes, channels),
        reader("film", "film.exr", seeds::films, bytes, film),
        reader("y4m", "video.y4m", seeds::y4ms, bytes, video),
        reader("mjpeg", "video.mjpeg", seeds::mjpegs, bytes, video),
        reader("toml poses", "poses.toml", seeds::toml_poses, text, poses),
        reader("json poses", "poses.json", seeds::json_poses, text, poses),
        reader("tum poses", "poses.txt", seeds::tum_poses, text, poses),
        reader(
            "colmap images",
            "images.txt",
            seeds::colmap_images,
            text,
            colmap_images,
        ),
        reader(
            "colmap cameras",
            "cameras.txt",
            seeds::colmap_cameras,
            text,
            colmap_cameras,
        ),
        reader(
            "intrinsics",
            "camera.yaml",
            seeds::opencv_intrinsics,
            text,
            intrinsics,
        ),
        reader("profile", "noise.toml", seeds::profiles, text, profile),
        reader("points", "points.csv", seeds::points, text, points),
        reader("results", "results.json", seeds::results, text, results),
    ]
}

fn outcome<T, E: ToString>(
    read: Result<T, E>,
    check: impl FnOnce(T) -> Result<(), String>,
) -> Outcome {
    match read {
        Err(error) => Outcome::Refused(error.to_string()),
        Ok(value) => match check(value) {
            Ok(()) => Outcome::Read,
            Err(problem) => Outcome::Wrong(problem),
        },
    }
}

/// As [`outcome`]; a message names a file of the input's folder.
fn named_outcome<T, E: ToString>(
    path: &Path,
    read: Result<T, E>,
    check: impl FnOnce(T) -> Result<(), String>,
) -> Outcome {
    let folder = path.parent().unwrap_or(path).display().to_string();
    match outcome(read, check) {
        Outcome::Refused(message) if !message.contains(&folder) => {
            Outcome::Wrong(format!("a message without its file: {message}"))
        }
        other => other,
    }
}

fn finite(values: impl IntoIterator<Item = f64>, what: &str) -> Result<(), String> {
    match values.into_iter().find(|x| !x.is_finite()) {
        Some(x) => Err(format!("{what} holds {x}")),
        None => Ok(()),
    }
}

fn all_finite(photo: &Photo) -> Result<(), String> {
    if photo.linear.len() != photo.width as usize * photo.height as usize {
        return Err("a picture has more or fewer pixels than its size says".to_owned());
    }
    finite(
        photo.linear.as_flattened().iter().map(|x| f64::from(*x)),
        "a picture",
    )
}

fn scene(path: &Path) -> Outcome {
    named_outcome(path, load(path), |scene| {
        let camera = &scene.camera;
        finite([camera.fx, camera.fy, camera.cx, camera.cy], "the camera")?;
        finite(
            camera.world_from_camera.to_cols_array(),
            "the camera's pose",
        )
    })
}

fn model(path: &Path) -> Outcome {
    named_outcome(path, load_gltf(path), |model| {
        for instance in &model.instances {
            finite(instance.object_from_local.to_cols_array(), "a transform")?;
            let positions = instance.primitive.positions.as_flattened();
            finite(positions.iter().map(|x| f64::from(*x)), "a mesh")?;
        }
        Ok(())
    })
}

/// A proxy of a scanner, as a scene reads it.
fn scan(path: &Path) -> Outcome {
    let file = path.file_name().unwrap_or_default().display();
    let scene = path.with_file_name("scene.toml");
    let text = format!(
        "[camera]\nwidth = 8\nheight = 6\nvertical_fov_deg = 45\n[[real]]\nmesh = \"{file}\"\n"
    );
    std::fs::write(&scene, text).expect("a writable folder");
    named_outcome(path, load(&scene), |scene| {
        let parts = scene.objects.iter().flat_map(|object| &object.instances);
        for part in parts {
            let Primitive {
                positions, normals, ..
            } = &*part.primitive;
            let values = positions.iter().chain(normals).flatten();
            finite(values.map(|x| f64::from(*x)), "a mesh")?;
        }
        Ok(())
    })
}

fn photo(path: &Path) -> Outcome {
    outcome(Photo::read(path), |(photo, _)| all_finite(&photo))
}

fn channels(path: &Path) -> Outcome {
    named_outcome(path, ChannelFile::read(path), |file| {
        let count = file.width as usize * file.height as usize;
        match file.floats.values().all(|plane| plane.len() == count) {
            true => Ok(()),
            false => Err("a channel has more or fewer samples than the size says".to_owned()),
        }
    })
}

fn film(path: &Path) -> Outcome {
    named_outcome(path, read_film(path), |(film, _)| {
        let sums = film.pixels.iter().flat_map(|pixel| {
            [pixel.m_im, pixel.diff, pixel.m_ir, pixel.r_ir, pixel.sq].map(|sum| sum.hi)
        });
        finite(sums.flatten().map(f64::from), "a film")
    })
}

fn video(path: &Path) -> Outcome {
    let read = || -> Result<(), String> {
        let mut source = FrameSource::open(path).map_err(|error| error.to_string())?;
        let mut damage = Ok(());
        while let Some((_, taken)) = source.next(&|_| true).map_err(|error| error.to_string())? {
            match taken {
                Taken::Skipped => return Err("a frame was asked for and is not there".to_owned()),
                Taken::Whole(frame) => all_finite(&frame.photo)?,
                Taken::Damaged { problem, rest } => {
                    rest.map_or(Ok(()), |frame| all_finite(&frame.photo))?;
                    damage = Err(problem.to_string());
                }
            }
        }
        damage
    };
    named_outcome(path, read(), Ok)
}

fn poses(path: &Path) -> Outcome {
    named_outcome(path, Trajectory::read(path), |trajectory| {
        let poses = trajectory
            .entries
            .iter()
            .filter_map(|entry| entry.world_from_camera);
        finite(poses.flat_map(|pose| pose.to_cols_array()), "a pose")
    })
}

fn colmap_images(path: &Path) -> Outcome {
    beside(path, "cameras.txt", &seeds::colmap_cameras()[0]);
    poses(path)
}

fn colmap_cameras(path: &Path) -> Outcome {
    beside(path, "images.txt", &seeds::colmap_images()[0]);
    poses(&path.with_file_name("images.txt"))
}

fn beside(path: &Path, name: &str, bytes: &[u8]) {
    let other = path.with_file_name(name);
    if !other.exists() {
        std::fs::write(other, bytes).expect("a writable folder");
    }
}

fn intrinsics(path: &Path) -> Outcome {
    named_outcome(path, read_intrinsics(path), |intrinsics| {
        let focal = match intrinsics.focal {
            Focal::Pixels(focal) => focal,
            Focal::FieldOfView(angle) => [angle; 2],
        };
        finite(
            focal
                .into_iter()
                .chain(intrinsics.centre.into_iter().flatten()),
            "a camera",
        )?;
        finite(intrinsics.distortion.coefficients, "a distortion")
    })
}

fn profile(path: &Path) -> Outcome {
    outcome(NoiseProfile::read(path), |profile| {
        finite(
            profile.bins.iter().flat_map(|bin| bin.sigma),
            "a noise profile",
        )
    })
}

/// Points against poses that are right.
fn points(path: &Path) -> Outcome {
    beside(path, "poses.json", &seeds::json_poses()[0]);
    let mut options = SequenceOptions::new(
        path.with_file_name("scene.toml"),
        "frames",
        path.with_file_name("poses.json"),
        "out",
    );
    options.frames = None;
    named_outcome(
        path,
        check_poses(&options, Some(path), &|_| {}),
        |reprojection| finite(reprojection.largest_px, "a reprojection"),
    )
}

/// Earlier results, and all that is made from them.
fn results(path: &Path) -> Outcome {
    named_outcome(path, Report::read(path), |report| {
        let rows = report.rows.iter();
        finite(
            rows.flat_map(|row| [row.cpu_secs, row.errors.all.rmse, row.mse_sd]),
            "a row",
        )?;
        let verdict = against(&report, &report, 0.05);
        let compared = verdict.changes.len() + verdict.not_compared.len();
        if compared != report.rows.len() {
            return Err(format!(
                "{compared} of {} rows are compared",
                report.rows.len()
            ));
        }
        let made = [table(&report), markdown(&report), csv(&report)];
        if made.iter().any(String::is_empty) {
            return Err("a table is empty".to_owned());
        }
        Ok(())
    })
}
