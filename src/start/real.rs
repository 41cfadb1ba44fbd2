//! The camera and what stands before it.

use std::path::Path;

use glam::{DMat4, DVec3};

use super::depth::{DepthMap, DepthUnit, Surface};
use super::mesh::mesh_triangles;
use super::place::RealWorld;
use super::scan::ScanFrame;
use super::scene_text::Proxy;
use super::view::View;
use super::{Claim, Request, Scan};
use crate::refusal::Refusal;
use crate::scene::{Camera, Photo};

/// The made proxy beside the scene file.
pub const PROXY: &str = "proxy.glb";
/// The ground reaches so many heights of the camera.
const GROUND_REACH: f64 = 30.0;

/// A camera and its proxy.
pub struct RealScene {
    pub camera: Claim<Camera>,
    pub proxy: Claim<Proxy>,
    /// What [`PROXY`] is to hold.
    pub surface: Option<Surface>,
    /// What models are put down on.
    pub world: RealWorld,
}

impl RealScene {
    /// # Errors
    /// What was given cannot be read or contradicts itself.
    pub fn of_photograph(
        photo: &Photo,
        request: &Request,
        name: &dyn Fn(&Path) -> String,
    ) -> Result<Self, Refusal> {
        let view = View::of(photo, request)?;
        if let Some(mesh) = &request.mesh {
            let basis = "Proxy: the mesh as given, in the axes of this scene: the camera stands above the origin.";
            return Self::of_mesh(view.camera, mesh, DMat4::IDENTITY, basis, name);
        }
        if let Some(depth) = &view.depth {
            let basis = match depth.unit.is_relative() {
                true => {
                    "Proxy: the depth map, whose scale is not its own but follows the camera's height. An inverse depth that is off by a constant bends it."
                }
                false => "Proxy: the depth map.",
            };
            return Ok(Self::of_depth(view.camera, depth, basis));
        }
        let height = view.camera.value.world_from_camera.w_axis.y.abs();
        let reach = (GROUND_REACH * height).max(1.0);
        let basis = "Proxy: guessed, level ground and nothing else. Real things stand in no shadow's way and hide nothing: give --depth or --mesh, or add them as [[real]].";
        let corner = |x: f64, z: f64| DVec3::new(x * reach, 0.0, z * reach);
        let corners = [
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
            corner(1.0, -1.0),
            corner(-1.0, -1.0),
        ];
        Ok(Self {
            camera: view.camera,
            proxy: Claim::new(Proxy::Ground(reach), basis),
            surface: None,
            world: RealWorld {
                triangles: vec![
                    [corners[0], corners[1], corners[2]],
                    [corners[0], corners[2], corners[3]],
                ],
            },
        })
    }

    /// # Errors
    /// The frame's camera does not fit its photograph, or depth or mesh cannot be read.
    pub fn of_scan(
        scan: &Scan,
        frame: &ScanFrame,
        photo: &Photo,
        request: &Request,
        name: &dyn Fn(&Path) -> String,
    ) -> Result<Self, Refusal> {
        let size = (photo.width, photo.height);
        let camera = (frame.intrinsics.camera(size, frame.world_from_camera)).map_err(|problem| {
            format!(
                "{}: {problem}; expected the photograph that the scan has taken; export it again",
                frame.photo.display()
            )
        })?;
        let camera = Claim::new(camera, format!("Camera: {}.", scan.basis));
        let given = request
            .mesh
            .clone()
            .map(|mesh| (mesh, scan.world_from_scan));
        if let Some((mesh, place)) = given.or_else(|| scan.mesh.clone()) {
            let basis = "Proxy: the scan's mesh, right to a centimetre or two.";
            return Self::of_mesh(camera, &mesh, place, basis, name);
        }
        let Some(path) = &request.depth else {
            return Err(format!(
                "{}: the scan has neither a mesh nor depth for it; expected one of them; export it with depth, or give --mesh or --depth",
                frame.photo.display()
            )
            .into());
        };
        let unit = request.depth_unit.or(Some(DepthUnit::Millimetres));
        let depth = DepthMap::read(path, unit)
            .map_err(|problem| format!("{}: {problem}", path.display()))?;
        let basis = "Proxy: the frame's own depth map, right to a centimetre or two near by, a guess from 5 m on; what the frame does not see has none.";
        Ok(Self::of_depth(camera, &depth, basis))
    }

    fn of_depth(camera: Claim<Camera>, depth: &DepthMap, basis: &str) -> Self {
        let surface = depth.surface(&camera.value);
        Self {
            camera,
            proxy: Claim::new(Proxy::Mesh(PROXY.to_owned(), DMat4::IDENTITY), basis),
            world: RealWorld {
                triangles: (surface.triangles.iter())
                    .map(|corners| corners.map(|corner| surface.positions[corner as usize]))
                    .collect(),
            },
            surface: Some(surface),
        }
    }

    fn of_mesh(
        camera: Claim<Camera>,
        mesh: &Path,
        world_from_mesh: DMat4,
        basis: &str,
        name: &dyn Fn(&Path) -> String,
    ) -> Result<Self, Refusal> {
        Ok(Self {
            camera,
            proxy: Claim::new(Proxy::Mesh(name(mesh), world_from_mesh), basis),
            surface: None,
            world: RealWorld {
                triangles: mesh_triangles(mesh, world_from_mesh)?,
            },
        })
    }
}
