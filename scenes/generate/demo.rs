//! The demo: a table with a book, a mug and an orange in front of a papered wall, by a window.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec2, DVec3};
use mixray::scene::{Instance, Material, Object, Side, TextureRef};
use serde_json::json;

use crate::mesh::{Mesh, ball, cuboid, lathe, quad, rounded, straight, trefoil, tube};
use crate::photograph::{Sensor, photograph, real_scene};
use crate::{environment, glb, texture};

/// Enough for the renderer's own noise to drown in the camera's.
const PHOTO_RAYS: u32 = 256;

/// A good camera at a low ISO.
pub const SENSOR: Sensor = Sensor {
    shot_variance: 6e-5,
    read_sigma: 8e-4,
};

const TABLE_LOW: DVec2 = DVec2::new(-0.9, -0.42);
const TABLE_SIZE_M: DVec2 = DVec2::new(1.8, 1.35);
const WALL_SIZE_M: DVec2 = DVec2::new(2.4, 1.6);
const MUG_HEIGHT_M: f64 = 0.092;

/// A thing that the camera saw, finely meshed, with what the proxy has no knowledge of: its look.
struct Thing {
    name: &'static str,
    mesh: Mesh,
    material: Material,
}

pub fn generate(folder: &Path) -> Result<(), Box<dyn Error>> {
    environment::write_exr(&environment::room_with_window(), &folder.join("env.exr"))?;
    write_proxy(folder)?;
    write_virtual(folder)?;
    let mut scene = real_scene(&folder.join("scene.toml"))?;
    scene.objects = objects();
    photograph(scene, PHOTO_RAYS, SENSOR, &folder.join("photo.png"))
}

fn table() -> Mesh {
    quad(
        DVec3::new(TABLE_LOW.x, 0.0, TABLE_LOW.y + TABLE_SIZE_M.y),
        DVec3::X * TABLE_SIZE_M.x,
        DVec3::NEG_Z * TABLE_SIZE_M.y,
    )
}

fn wall() -> Mesh {
    quad(
        DVec3::new(-0.5 * WALL_SIZE_M.x, -0.4, TABLE_LOW.y),
        DVec3::X * WALL_SIZE_M.x,
        DVec3::Y * WALL_SIZE_M.y,
    )
}

fn on_table(x: f64, z: f64, turn_deg: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, 0.0, z))
        * DAffine3::from_rotation_y(turn_deg.to_radians())
}

/// Two boards and a spine, and the pages between them.
fn book() -> (Mesh, Mesh) {
    let place = on_table(-0.150, -0.135, 24.0);
    let size = DVec3::new(0.145, 0.036, 0.200);
    let (x, z, board) = (0.5 * size.x, 0.5 * size.z, 0.003);
    let mut cover = cuboid(DVec3::new(-x, size.y - board, -z), DVec3::new(x, size.y, z));
    cover.append(&cuboid(DVec3::new(-x, 0.0, -z), DVec3::new(x, board, z)));
    cover.append(&cuboid(
        DVec3::new(-x, board, -z),
        DVec3::new(-x + board, size.y - board, z),
    ));
    let pages = cuboid(
        DVec3::new(-x + board, board, -z + board),
        DVec3::new(x - board, size.y - board, z - board),
    );
    (cover.placed(place), pages.placed(place))
}

/// The cup with its handle, and the coffee in it.
fn mug(segments: usize) -> (Mesh, Mesh) {
    let place = on_table(0.115, -0.075, -35.0);
    let (outer, inner, top) = (0.0405, 0.0375, MUG_HEIGHT_M);
    let lines = [
        straight(&[[0.0, 0.0], [0.031, 0.0]]),
        rounded(
            &[[0.031, 0.0], [0.0375, 0.004], [0.040, 0.014], [outer, 0.03]],
            4,
        ),
        straight(&[[outer, 0.03], [outer, top - 0.0015]]),
        rounded(
            &[
                [outer, top - 0.0015],
                [0.5 * (outer + inner), top],
                [inner, top - 0.0015],
            ],
            4,
        ),
        straight(&[[inner, top - 0.0015], [inner, 0.02]]),
        straight(&[[inner, 0.02], [0.0, 0.02]]),
    ];
    let mut cup = lathe(&lines, segments, MUG_HEIGHT_M);
    let handle = |t: f64| {
        let (sin, cos) = ((t - 0.5) * 3.5).sin_cos();
        (
            DVec3::new(outer - 0.002 + 0.027 * cos, 0.048 + 0.027 * sin, 0.0),
            DVec3::Z,
        )
    };
    let mut handle = tube(handle, 0.0048, segments / 3, segments / 6);
    for uv in &mut handle.uvs {
        uv.y = 0.0;
    }
    cup.append(&handle);
    let coffee = lathe(&[straight(&[[inner, 0.074], [0.0, 0.074]])], segments, 1.0);
    (cup.placed(place), coffee.placed(place))
}

fn orange(segments: usize) -> Mesh {
    ball(0.037, segments)
        .placed(DAffine3::from_rotation_z(0.5))
        .standing()
        .placed(on_table(-0.020, -0.215, 0.0))
}

fn matt(texture: TextureRef) -> Material {
    Material {
        base_color_texture: Some(texture),
        specular: 0.0,
        ..Material::default()
    }
}

fn things() -> Vec<Thing> {
    let (cover, pages) = book();
    let (cup, coffee) = mug(120);
    let thing = |name, mesh, material| Thing {
        name,
        mesh,
        material,
    };
    vec![
        thing(
            "table",
            table(),
            Material {
                roughness: 0.55,
                specular: 0.4,
                ..matt(texture::wooden_boards(TABLE_SIZE_M))
            },
        ),
        thing("wall", wall(), matt(texture::wallpaper(WALL_SIZE_M))),
        thing("book cover", cover, matt(texture::book_cover())),
        thing("pages", pages, matt(texture::pages())),
        thing(
            "mug",
            cup,
            Material {
                roughness: 0.25,
                specular: 1.0,
                ..matt(texture::mug_glaze())
            },
        ),
        thing(
            "coffee",
            coffee,
            Material {
                base_color: [0.03, 0.014, 0.006, 1.0],
                roughness: 0.1,
                ..Material::default()
            },
        ),
        thing(
            "orange",
            orange(120),
            Material {
                roughness: 0.45,
                specular: 0.8,
                ..matt(texture::peel())
            },
        ),
    ]
}

/// All that the camera saw.
pub fn objects() -> Vec<Object> {
    things().into_iter().map(object).collect()
}

fn object(thing: Thing) -> Object {
    Object {
        motion: None,
        name: thing.name.to_owned(),
        side: Side::Real,
        world_from_object: DMat4::IDENTITY,
        instances: vec![Instance {
            animation: None,
            deformation: None,
            object_from_local: DMat4::IDENTITY,
            primitive: Arc::new(thing.mesh.to_primitive(thing.name)),
            material: Arc::new(thing.material),
        }],
        self_shadow_bias_m: 0.0,
        albedo_from_photo: false,
    }
}

/// Coarser than the things themselves, and without any material.
fn write_proxy(folder: &Path) -> std::io::Result<()> {
    glb::write(
        &folder.join("room.glb"),
        &[(&table(), None), (&wall(), None)],
    )?;
    let (cover, pages) = book();
    let (cup, coffee) = mug(48);
    let parts = [cover, pages, cup, coffee, orange(48)];
    let parts: Vec<_> = parts.iter().map(|mesh| (mesh, None)).collect();
    glb::write(&folder.join("props.glb"), &parts)
}

fn write_virtual(folder: &Path) -> std::io::Result<()> {
    let gold = json!({
        "name": "gold",
        "pbrMetallicRoughness": { "baseColorFactor": [1.0, 0.75, 0.33, 1.0], "metallicFactor": 1.0, "roughnessFactor": 0.24 },
    });
    let knot = trefoil(0.062, 180, 20);
    glb::write(&folder.join("knot.glb"), &[(&knot, Some(gold))])?;
    let lacquer = json!({
        "name": "lacquer",
        "pbrMetallicRoughness": { "baseColorFactor": [0.03, 0.10, 0.36, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.5 },
        "extensions": { "KHR_materials_clearcoat": { "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.15 } },
    });
    glb::write(&folder.join("pawn.glb"), &[(&pawn(), Some(lacquer))])
}

/// A chess pawn, 1 m high.
fn pawn() -> Mesh {
    let foot = rounded(&[[0.28, 0.0], [0.31, 0.03], [0.30, 0.09], [0.25, 0.12]], 4);
    let body = rounded(
        &[
            [0.25, 0.12],
            [0.24, 0.16],
            [0.16, 0.24],
            [0.115, 0.36],
            [0.10, 0.50],
            [0.11, 0.58],
        ],
        4,
    );
    let collar = rounded(
        &[
            [0.11, 0.58],
            [0.19, 0.60],
            [0.20, 0.62],
            [0.19, 0.64],
            [0.12, 0.66],
        ],
        3,
    );
    let centre = 0.81;
    let radius = 0.19;
    let head = (0..=20).map(|step| {
        let turn = (f64::from(step) / 20.0 * 0.78 + 0.22) * std::f64::consts::PI;
        DVec2::new((radius * turn.sin()).max(0.0), centre - radius * turn.cos())
    });
    lathe(
        &[
            straight(&[[0.0, 0.0], [0.28, 0.0]]),
            foot,
            body,
            collar,
            head.collect(),
        ],
        56,
        1.0,
    )
}
