//! `[[light]]`.

use glam::DVec3;

use super::error::Result;
use super::reader::{Choice, Node, Table};
use super::{Light, LightKind, Side};

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Point,
    Spot,
    Directional,
    Quad,
}

impl Choice for Kind {
    const CHOICES: &'static [(&'static str, Self)] = &[
        ("point", Self::Point),
        ("spot", Self::Spot),
        ("directional", Self::Directional),
        ("quad", Self::Quad),
    ];
}

impl Kind {
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Point => &["kind", "side", "position", "intensity"],
            Self::Spot => &[
                "kind",
                "side",
                "position",
                "direction",
                "intensity",
                "inner_deg",
                "outer_deg",
            ],
            Self::Directional => &["kind", "side", "direction", "irradiance"],
            Self::Quad => &["kind", "side", "corner", "edge_u", "edge_v", "radiance"],
        }
    }
}

pub(super) fn read_lights(root: &Table) -> Result<Vec<Light>> {
    root.list("light")?.iter().map(read_light).collect()
}

fn read_light(node: &Node) -> Result<Light> {
    let table = node.any_table("[[light]]")?;
    let kind: Kind = table.required("kind", "kind = \"point\"", |node| node.choice())?;
    table.refuse_unknown(kind.keys())?;
    let position = || {
        table.required("position", "position = [x, y, z]", |node| {
            node.vector::<3>()
        })
    };
    let direction = || {
        let direction =
            table.required("direction", "direction = [x, y, z]", Node::nonzero_vector)?;
        Ok(DVec3::from(direction).normalize().to_array())
    };
    let colour = |key| table.required(key, &format!("{key} = [r, g, b]"), Node::radiance);
    let kind = match kind {
        Kind::Point => LightKind::Point {
            position: position()?,
            intensity: colour("intensity")?,
        },
        Kind::Spot => {
            let (inner_deg, outer_deg) = read_cone(&table)?;
            LightKind::Spot {
                position: position()?,
                direction: direction()?,
                intensity: colour("intensity")?,
                inner_deg,
                outer_deg,
            }
        }
        Kind::Directional => LightKind::Directional {
            direction: direction()?,
            irradiance: colour("irradiance")?,
        },
        Kind::Quad => {
            let (corner, edge_u, edge_v) = read_parallelogram(&table)?;
            LightKind::Quad {
                corner,
                edge_u,
                edge_v,
                radiance: colour("radiance")?,
            }
        }
    };
    Ok(Light {
        kind,
        side: table
            .optional("side", |node| node.choice())?
            .unwrap_or(Side::Real),
    })
}

/// Half-angles in degrees; glTF's defaults.
fn read_cone(table: &Table) -> Result<(f64, f64)> {
    let outer_deg = table
        .optional("outer_deg", |node| {
            node.number("degrees above 0, at most 90", |deg| {
                deg > 0.0 && deg <= 90.0
            })
        })?
        .unwrap_or(45.0);
    let inner_deg = table
        .optional("inner_deg", |node| {
            node.number(
                &format!("degrees from 0 to below `outer_deg` ({outer_deg})"),
                |deg| (0.0..outer_deg).contains(&deg),
            )
        })?
        .unwrap_or(0.0);
    Ok((inner_deg, outer_deg))
}

/// Corner and two edges that span an area.
pub(super) fn read_parallelogram(table: &Table) -> Result<([f64; 3], [f64; 3], [f64; 3])> {
    let corner = table.required("corner", "corner = [x, y, z]", |node| node.vector::<3>())?;
    let edge_u = table.required("edge_u", "edge_u = [x, y, z]", Node::nonzero_vector)?;
    let edge_v = table.required("edge_v", "edge_v = [x, y, z]", |node| {
        let edge_v = node.nonzero_vector()?;
        let (u, v) = (DVec3::from(edge_u), DVec3::from(edge_v));
        if u.normalize().cross(v.normalize()).length() < 1e-6 {
            return Err(node.error(
                "`edge_v` is parallel to `edge_u`",
                "edges that span an area",
                "correct one of them",
            ));
        }
        Ok(edge_v)
    })?;
    Ok((corner, edge_u, edge_v))
}
