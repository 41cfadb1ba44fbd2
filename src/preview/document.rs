//! The scene file's text, edited in place: comments, order and everything that was not changed stay as they are.

mod keyframes;
mod materials;
mod stages;

use std::path::Path;

use glam::{DQuat, DVec3};
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

use super::composition::{
    CameraPose, Composition, EnvironmentForm, FrameLead, LensForm, Opening, Placement, Rotation,
};
use super::keyframes::Keys;
use super::material_form::MaterialForm;
use crate::scene::{Aperture, Exposure, Lens, ObjectMotion, Scene, Side};

/// Keys that place an object in place of numbers.
const PLACING_KEYS: [&str; 4] = ["rest_on", "pixel", "size_m", "look_at"];

/// A scene file's text that is valid TOML.
#[derive(Clone, Debug)]
pub struct Document(DocumentMut);

impl Document {
    /// # Errors
    /// It is no TOML; [`crate::scene::load_text`] says where.
    pub fn parse(text: &str) -> Result<Self, toml_edit::TomlError> {
        Ok(Self(text.parse()?))
    }

    pub fn text(&self) -> String {
        self.0.to_string()
    }

    /// What the text says, of a scene that was read from it.
    pub fn composition(&self, scene: &Scene) -> Composition {
        let (mut objects, mut motions, mut materials) = (Vec::new(), Vec::new(), Vec::new());
        for (object, (key, index)) in scene.objects.iter().zip(entries(scene)) {
            let table = self.entry(key, index);
            objects.push(match table {
                Some(table) if is_placed(table) => {
                    let rest = object.motion.as_ref().map(ObjectMotion::rest);
                    Placement::of(rest.unwrap_or(object.world_from_object))
                }
                Some(table) => read_placement(table),
                None => Placement::IDENTITY,
            });
            motions.push(table.map_or(Keys::default(), keyframes::read_motion));
            let is_given = table.is_some_and(|table| table.contains_key("material"));
            let first = object.instances.first().filter(|_| is_given);
            materials.push(first.map(|part| MaterialForm::of(&part.material)));
        }
        Composition {
            camera: self.camera(scene),
            lens: self.lens(scene),
            environment: (scene.environment.as_ref()).map(|environment| EnvironmentForm {
                rotation_deg: environment.rotation_deg,
                scale: environment.scale,
            }),
            exposure: scene.settings.exposure,
            rays_per_pixel: scene.settings.rays_per_pixel,
            max_bounces: scene.settings.max_bounces,
            seed: scene.settings.seed,
            objects,
            motions,
            focus_keys: self
                .table("lens")
                .map_or(Keys::default(), keyframes::read_focus),
            materials,
            stages: scene.stages.clone(),
            shutter: scene.shutter,
            frame: FrameLead::default(),
        }
    }

    fn table(&self, key: &str) -> Option<&dyn TableLike> {
        self.0.get(key)?.as_table_like()
    }

    fn entry(&self, key: &str, index: usize) -> Option<&dyn TableLike> {
        element(self.0.get(key)?, index)
    }

    fn entry_mut(&mut self, key: &str, index: usize) -> Option<&mut dyn TableLike> {
        element_mut(self.0.get_mut(key)?, index)
    }

    fn table_mut(&mut self, key: &str) -> &mut dyn TableLike {
        let item = self.0.entry(key).or_insert(Item::Table(Table::new()));
        if !item.is_table_like() {
            *item = Item::Table(Table::new());
        }
        item.as_table_like_mut()
            .expect("a table has just been put there")
    }

    fn camera(&self, scene: &Scene) -> CameraPose {
        let matrix = CameraPose::Matrix(scene.camera.world_from_camera);
        let Some(table) = self.table("camera") else {
            return matrix;
        };
        match (vector(table, "position"), vector(table, "look_at")) {
            (Some(position), Some(look_at)) => CameraPose::LookAt {
                position,
                look_at,
                up: vector(table, "up").unwrap_or(DVec3::Y),
            },
            _ => matrix,
        }
    }

    fn lens(&self, scene: &Scene) -> LensForm {
        let lens = scene.lens;
        let table = self.table("lens");
        let number = |key| number(table?.get(key)?);
        let opening = match (number("f_number"), number("focal_length_mm")) {
            (Some(f_number), Some(focal_length_mm)) => Opening::FNumber {
                f_number,
                focal_length_mm,
            },
            _ => Opening::RadiusM(lens.aperture_radius_m),
        };
        LensForm {
            opening,
            // The scene's own is that of its time.
            focus_distance_m: number("focus_distance_m").unwrap_or(Lens::PINHOLE.focus_distance_m),
            aperture: lens.aperture,
            blade_rotation_deg: lens.blade_rotation_deg,
        }
    }

    /// Writes what differs; `was` is what the text says. Both are of this scene.
    pub fn write(&mut self, was: &Composition, is: &Composition, scene: &Scene) {
        if was.camera != is.camera {
            self.write_camera(&is.camera);
        }
        if was.lens != is.lens {
            self.write_lens(&was.lens, &is.lens);
        }
        if let Some(form) = is.environment.filter(|_| was.environment != is.environment) {
            let table = self.table_mut("environment");
            set(table, "rotation_deg", form.rotation_deg);
            set(table, "scale", form.scale);
        }
        if was.exposure != is.exposure {
            let table = self.table_mut("photo");
            match is.exposure {
                Exposure::Ev(ev) => set(table, "exposure_ev", ev),
                Exposure::Auto => set(table, "exposure_ev", "auto"),
            }
        }
        for (key, was, is) in [
            ("rays_per_pixel", was.rays_per_pixel, is.rays_per_pixel),
            ("max_bounces", was.max_bounces, is.max_bounces),
            ("seed", was.seed, is.seed),
        ] {
            if was != is {
                set(self.table_mut("render"), key, i64::from(is));
            }
        }
        if was.focus_keys != is.focus_keys {
            let lens = self.table_mut("lens");
            keyframes::write_focus(lens, &was.focus_keys, &is.focus_keys);
        }
        self.write_shutter(was.shutter, is.shutter);
        self.write_stages(&was.stages, &is.stages);
        for (index, (key, place)) in entries(scene).enumerate() {
            let Some(table) = self.entry_mut(key, place) else {
                continue;
            };
            if was.objects[index] != is.objects[index] {
                write_placement(table, &was.objects[index], &is.objects[index]);
            }
            if was.motions[index] != is.motions[index] {
                keyframes::write_motion(table, &was.motions[index], &is.motions[index]);
            }
            if was.materials[index] != is.materials[index] {
                materials::write(table, was.materials[index], is.materials[index]);
            }
        }
    }

    fn write_camera(&mut self, pose: &CameraPose) {
        let table = self.table_mut("camera");
        match *pose {
            CameraPose::LookAt {
                position,
                look_at,
                up,
            } => {
                table.remove("world_from_camera");
                set_vector(table, "position", position);
                set_vector(table, "look_at", look_at);
                if up != DVec3::Y || table.contains_key("up") {
                    set_vector(table, "up", up);
                }
            }
            CameraPose::Matrix(matrix) => {
                for key in ["position", "look_at", "up"] {
                    table.remove(key);
                }
                let rows = matrix.transpose().to_cols_array_2d();
                let rows: Array = rows
                    .iter()
                    .map(|row| Value::Array(Array::from_iter(*row)))
                    .collect();
                set(table, "world_from_camera", rows);
            }
        }
    }

    fn write_lens(&mut self, was: &LensForm, is: &LensForm) {
        let table = self.table_mut("lens");
        if was.opening != is.opening {
            match is.opening {
                Opening::FNumber {
                    f_number,
                    focal_length_mm,
                } => {
                    table.remove("aperture_radius_m");
                    for (key, value) in
                        [("f_number", f_number), ("focal_length_mm", focal_length_mm)]
                    {
                        if table.get(key).and_then(number) != Some(value) {
                            set(table, key, value);
                        }
                    }
                }
                Opening::RadiusM(radius) => {
                    table.remove("f_number");
                    table.remove("focal_length_mm");
                    set(table, "aperture_radius_m", radius);
                }
            }
        }
        if was.focus_distance_m != is.focus_distance_m || !table.contains_key("focus_distance_m") {
            set(table, "focus_distance_m", is.focus_distance_m);
        }
        if was.aperture != is.aperture {
            match is.aperture {
                Aperture::Disc => set(table, "aperture", "disc"),
                Aperture::Square => set(table, "aperture", "square"),
                Aperture::Blades(blades) => set(table, "aperture", i64::from(blades)),
            }
        }
        if was.blade_rotation_deg != is.blade_rotation_deg {
            set(table, "blade_rotation_deg", is.blade_rotation_deg);
        }
    }

    /// Appends a virtual object.
    pub fn add_mesh(&mut self, mesh: &str, placement: &Placement) {
        let mut table = Table::new();
        table["mesh"] = toml_edit::value(mesh);
        write_placement(&mut table, &Placement::IDENTITY, placement);
        let list = (self.0.entry("virtual")).or_insert(Item::ArrayOfTables(ArrayOfTables::new()));
        let end = length(list);
        insert_element(list, end, table);
    }

    /// Takes a virtual object out, by its number among them.
    pub fn remove_virtual(&mut self, index: usize) {
        if let Some(list) = self.0.get_mut("virtual") {
            remove_element(list, index);
        }
    }

    /// Names another image, `[photo]` or `[environment]`.
    pub fn set_image(&mut self, table: &str, image: &str) {
        let table = self.table_mut(table);
        table.remove("radiance");
        set(table, "image", image);
    }
}

/// A file as a scene file names it: relative to the scene's folder where it lies within.
pub fn name_of(file: &Path, scene: &Path) -> String {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let (file, scene) = (absolute(file), absolute(scene));
    let folder = scene.parent().unwrap_or(Path::new("")).to_path_buf();
    let name = file.strip_prefix(&folder).unwrap_or(&file);
    // Slashes are read on every system.
    name.to_string_lossy().replace('\\', "/")
}

/// Where the objects of a scene stand in its file: the list, and the number in it.
fn entries(scene: &Scene) -> impl Iterator<Item = (&'static str, usize)> {
    let [mut real, mut added] = [0, 0];
    scene.objects.iter().map(move |object| {
        let (key, count) = match object.side {
            Side::Real => ("real", &mut real),
            Side::Virtual => ("virtual", &mut added),
        };
        *count += 1;
        (key, *count - 1)
    })
}

/// Its transform follows from what is around it.
fn is_placed(table: &dyn TableLike) -> bool {
    PLACING_KEYS.iter().any(|key| table.contains_key(key))
}

fn read_placement(table: &dyn TableLike) -> Placement {
    let quaternion = table.get("rotation").and_then(numbers::<4>);
    let euler = vector(table, "rotation_deg").unwrap_or(DVec3::ZERO);
    let scale = table.get("scale").and_then(|item| match number(item) {
        Some(factor) => Some(DVec3::splat(factor)),
        None => numbers::<3>(item).map(DVec3::from),
    });
    Placement {
        translation: vector(table, "translation").unwrap_or(DVec3::ZERO),
        rotation: match quaternion {
            Some(q) => Rotation::Quaternion(DQuat::from_array(q).normalize()),
            None => Rotation::EulerDeg(euler),
        },
        scale: scale.unwrap_or(DVec3::ONE),
    }
}

fn write_placement(table: &mut dyn TableLike, was: &Placement, is: &Placement) {
    // Numbers take the place of what placed it, all of them.
    let was = match is_placed(table) {
        true => &Placement::IDENTITY,
        false => was,
    };
    for key in PLACING_KEYS {
        table.remove(key);
    }
    if was.translation != is.translation {
        set_vector(table, "translation", is.translation);
    }
    if was.rotation != is.rotation {
        match is.rotation {
            Rotation::EulerDeg(deg) => {
                table.remove("rotation");
                set_vector(table, "rotation_deg", deg);
            }
            Rotation::Quaternion(q) => {
                table.remove("rotation_deg");
                set(table, "rotation", Array::from_iter(q.to_array()));
            }
        }
    }
    if was.scale != is.scale {
        match is.scale == DVec3::splat(is.scale.x) {
            true => set(table, "scale", is.scale.x),
            false => set_vector(table, "scale", is.scale),
        }
    }
}

/// Of a list of tables, however it is written.
fn length(list: &Item) -> usize {
    match list {
        Item::ArrayOfTables(tables) => tables.len(),
        Item::Value(Value::Array(array)) => array.len(),
        _ => 0,
    }
}

fn element(list: &Item, index: usize) -> Option<&dyn TableLike> {
    match list {
        Item::ArrayOfTables(tables) => tables.get(index).map(|table| table as &dyn TableLike),
        Item::Value(Value::Array(array)) => {
            (array.get(index)?.as_inline_table()).map(|table| table as &dyn TableLike)
        }
        _ => None,
    }
}

fn element_mut(list: &mut Item, index: usize) -> Option<&mut dyn TableLike> {
    match list {
        Item::ArrayOfTables(tables) => {
            (tables.get_mut(index)).map(|table| table as &mut dyn TableLike)
        }
        Item::Value(Value::Array(array)) => {
            (array.get_mut(index)?.as_inline_table_mut()).map(|table| table as &mut dyn TableLike)
        }
        _ => None,
    }
}

/// Before the one of that number, or at the end.
fn insert_element(list: &mut Item, index: usize, mut table: Table) {
    match list {
        Item::ArrayOfTables(tables) => {
            table.decor_mut().set_prefix("\n");
            tables.insert(index, table);
        }
        Item::Value(Value::Array(array)) => array.insert(index, table.into_inline_table()),
        _ => {}
    }
}

fn remove_element(list: &mut Item, index: usize) {
    match list {
        Item::ArrayOfTables(tables) if index < tables.len() => {
            tables.remove(index);
        }
        Item::Value(Value::Array(array)) if index < array.len() => {
            array.remove(index);
        }
        _ => {}
    }
}

fn number(item: &Item) -> Option<f64> {
    item.as_float()
        .or_else(|| item.as_integer().map(|n| n as f64))
}

fn numbers<const N: usize>(item: &Item) -> Option<[f64; N]> {
    let array = item.as_array()?;
    let all: Option<Vec<f64>> = array
        .iter()
        .map(|value| {
            value
                .as_float()
                .or_else(|| value.as_integer().map(|n| n as f64))
        })
        .collect();
    all?.try_into().ok()
}

fn vector(table: &dyn TableLike, key: &str) -> Option<DVec3> {
    table.get(key).and_then(numbers::<3>).map(DVec3::from)
}

fn set_vector(table: &mut dyn TableLike, key: &str, vector: DVec3) {
    set(table, key, Array::from_iter(vector.to_array()));
}

/// The comment behind the value stays.
fn set(table: &mut dyn TableLike, key: &str, value: impl Into<Value>) {
    let mut value = value.into();
    if let Some(old) = table.get(key).and_then(Item::as_value) {
        *value.decor_mut() = old.decor().clone();
    }
    table.insert(key, Item::Value(value));
}

#[cfg(test)]
mod tests;
