//! `[environment]`: a lat-long image or a constant radiance.

use std::sync::Arc;

use super::error::Result;
use super::reader::{MAX_RADIANCE, Node, Table};
use super::{Environment, EnvironmentMap};
use crate::decode::{Pixels, read_image};

const KEYS: &[&str] = &["image", "radiance", "rotation_deg", "scale"];

pub(super) fn read_environment(
    root: &Table,
    warnings: &mut Vec<String>,
) -> Result<Option<Environment>> {
    let Some(table) = root.table("environment", "[environment]", KEYS)? else {
        return Ok(None);
    };
    table.refuse_both("image", "radiance")?;
    let rotation_deg = table.optional("rotation_deg", Node::finite)?.unwrap_or(0.0);
    let scale = table.optional("scale", Node::not_negative)?.unwrap_or(1.0);
    let constant = table.optional("radiance", Node::radiance)?;
    let map = match constant {
        Some(radiance) => EnvironmentMap::Constant(radiance),
        None => table.required("image", "image = \"env.hdr\"", |node| {
            read_lat_long(node, warnings)
        })?,
    };
    let brightest = match &map {
        EnvironmentMap::Constant(radiance) => largest(std::slice::from_ref(radiance)),
        EnvironmentMap::LatLong { texels, .. } => largest(texels),
    };
    if f64::from(brightest) * scale > MAX_RADIANCE {
        return Err(table.error(
            format!("the environment's radiance reaches {brightest:e} times {scale:e}"),
            "at most 1e30",
            "lower `scale`",
        ));
    }
    Ok(Some(Environment {
        map,
        rotation_deg,
        scale,
    }))
}

fn largest(texels: &[[f32; 3]]) -> f32 {
    texels.as_flattened().iter().copied().fold(0.0, f32::max)
}

fn read_lat_long(node: &Node, warnings: &mut Vec<String>) -> Result<EnvironmentMap> {
    let path = node.existing_file()?;
    let image = read_image(&path).map_err(|problem| node.file_error(&path, problem))?;
    let (width, height) = (image.width, image.height);
    let mut notes = image.warnings.clone();
    if width < 2 || height < 2 {
        let problem = format!(
            "it has {width} x {height} pixels; expected at least 2 x 2; use `radiance` for a constant"
        );
        return Err(node.file_error(&path, problem));
    }
    if width != height * 2 {
        notes.push(format!(
            "it has {width} x {height} pixels: a lat-long map is twice as wide as high"
        ));
    }
    let clipped = "it holds encoded 8- or 16-bit colours: its lights are clipped at 1";
    let decoded = image.linear();
    let mut texels: Vec<[f32; 3]> = match image.pixels {
        Pixels::Linear(linear) => linear,
        Pixels::Codes8(_) | Pixels::Codes16(_) => {
            notes.push(clipped.to_owned());
            decoded
        }
    };
    let mut negative = 0;
    for channel in texels.as_flattened_mut() {
        if *channel < 0.0 {
            *channel = 0.0;
            negative += 1;
        }
    }
    if negative > 0 {
        notes.push(format!("{negative} negative values are taken as 0"));
    }
    warnings.extend(node.file_warnings(notes));
    Ok(EnvironmentMap::LatLong {
        width,
        height,
        texels: Arc::new(texels),
    })
}
