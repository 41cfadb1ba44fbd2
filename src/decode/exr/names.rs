//! Which channels of an OpenEXR file are a picture: names of Nuke, Blender, Houdini (C), RenderMan (Ci), Unreal (FinalImage) and others.

use ::exr::meta::header::Header;

use super::text_of;

/// Names of a layer or part that hold the picture as such.
const PICTURE_NAMES: [&str; 10] = [
    "rgba",
    "rgb",
    "beauty",
    "combined",
    "composite",
    "color",
    "main",
    "c",
    "ci",
    "finalimage",
];

/// What programs call red, green, blue and alpha, in small letters.
const CHANNEL_NAMES: [[&str; 4]; 2] = [["r", "g", "b", "a"], ["red", "green", "blue", "alpha"]];

/// A part and the channels of a picture.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub part: usize,
    pub rgb: [usize; 3],
    pub alpha: Option<usize>,
}

/// The pictures by their names: part and layer with a point between them, as far as they have any.
fn pictures(headers: &[Header]) -> Vec<(String, Place)> {
    let mut found = Vec::new();
    for (part, header) in headers.iter().enumerate() {
        let part_name = match (headers.len(), &header.own_attributes.layer_name) {
            (2.., Some(name)) => text_of(name),
            _ => String::new(),
        };
        let channels: Vec<String> = (header.channels.list.iter())
            .map(|channel| text_of(&channel.name))
            .collect();
        let split = |name: &str| match name.rsplit_once('.') {
            Some((layer, channel)) => (layer.to_owned(), channel.to_ascii_lowercase()),
            None => (String::new(), name.to_ascii_lowercase()),
        };
        let parts: Vec<(String, String)> = channels.iter().map(|name| split(name)).collect();
        for (layer, channel) in &parts {
            let Some(names) = CHANNEL_NAMES.iter().find(|names| names[0] == channel) else {
                continue;
            };
            let at = |name: &str| parts.iter().position(|(l, c)| l == layer && c == name);
            if let [Some(r), Some(g), Some(b), alpha] = names.map(at) {
                let whole = [part_name.as_str(), layer].join(".");
                let whole = whole.trim_matches('.').to_owned();
                let rgb = [r, g, b];
                found.push((whole, Place { part, rgb, alpha }));
            }
        }
    }
    found
}

/// By its name, or the end of it after a point.
pub(super) fn pick_named(headers: &[Header], layer: &str) -> Result<Place, String> {
    let found = pictures(headers);
    let is_whole = |(name, _): &&(String, Place)| name == layer;
    let ends = |(name, _): &&(String, Place)| {
        name.strip_suffix(layer)
            .is_some_and(|rest| rest.ends_with('.'))
    };
    let mut alike = found.iter().filter(ends);
    match (found.iter().find(is_whole), alike.next(), alike.next()) {
        (Some((_, place)), ..) | (None, Some((_, place)), None) => Ok(*place),
        _ => {
            let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
            Err(format!(
                "it has no one picture \"{layer}\"; expected one of \"{}\"; correct the name after the #",
                names.join("\", \"")
            ))
        }
    }
}

/// The part and the channels that are the picture: those without a layer's name; else of a layer that is named so; else the only ones.
pub(super) fn pick(headers: &[Header]) -> Result<Place, String> {
    let mut found = pictures(headers);
    let rank = |name: &str| {
        let last = name.rsplit('.').next().unwrap_or_default();
        let is_last = |own: &&str| last.eq_ignore_ascii_case(own);
        match last {
            "" => 0,
            _ => 1 + (PICTURE_NAMES.iter().position(is_last)).unwrap_or(PICTURE_NAMES.len()),
        }
    };
    found.sort_by_key(|(name, place)| (rank(name), place.part));
    match found.as_slice() {
        [(_, place)] => Ok(*place),
        [(name, place), ..] if rank(name) == 0 => Ok(*place),
        // Several of the same name, as of several view layers, are not told apart by it.
        [(name, place), (next, _), ..]
            if rank(name) <= PICTURE_NAMES.len() && rank(name) < rank(next) =>
        {
            Ok(*place)
        }
        [] => grey(headers).ok_or_else(|| {
            "it has no channels R, G, B or Y; expected an RGB or grey image; convert it".to_owned()
        }),
        several => {
            let names: Vec<&str> = several.iter().map(|(name, ..)| name.as_str()).collect();
            Err(format!(
                "it holds several pictures ({}) and no single one is named as such; expected R, G and B without a layer, or one of {}; name it, or say which after the file's name (a.exr#layer)",
                names.join(", "),
                PICTURE_NAMES.join(", ")
            ))
        }
    }
}

/// With RY and BY beside it, Y alone would lose the colour.
fn grey(headers: &[Header]) -> Option<Place> {
    headers.iter().enumerate().find_map(|(part, header)| {
        let grey = find(header, "Y").filter(|_| find(header, "RY").is_none())?;
        let rgb = [grey; 3];
        let alpha = find(header, "A");
        Some(Place { part, rgb, alpha })
    })
}

fn find(header: &Header, name: &str) -> Option<usize> {
    let channels = &header.channels.list;
    channels.iter().position(|channel| channel.name.eq(name))
}
