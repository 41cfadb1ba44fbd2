//! `[[virtual.motion]]` and `[[lens.motion]]`.

use toml_edit::{ArrayOfTables, Item, Table, TableLike};

use super::{
    element, element_mut, insert_element, length, number, read_placement, remove_element, set,
    write_placement,
};
use crate::preview::composition::Placement;
use crate::preview::keyframes::Keys;

const LIST: &str = "motion";

/// Of an object.
pub(super) fn read_motion(object: &dyn TableLike) -> Keys<Placement> {
    read(object, |key| Some(read_placement(key)))
}

/// Of the lens, metres.
pub(super) fn read_focus(lens: &dyn TableLike) -> Keys<f64> {
    read(lens, |key| number(key.get("focus_distance_m")?))
}

fn read<T>(owner: &dyn TableLike, value: impl Fn(&dyn TableLike) -> Option<T>) -> Keys<T> {
    let Some(list) = owner.get(LIST) else {
        return Keys::default();
    };
    let tables = (0..length(list)).filter_map(|index| element(list, index));
    Keys::of_file(tables.filter_map(|key| Some((time_secs(key)?, value(key)?))))
}

fn time_secs(key: &dyn TableLike) -> Option<f64> {
    number(key.get("time_secs")?)
}

pub(super) fn write_motion(
    object: &mut dyn TableLike,
    was: &Keys<Placement>,
    is: &Keys<Placement>,
) {
    write(object, was, is, |key, was, is| {
        write_placement(key, was.unwrap_or(&Placement::IDENTITY), is);
    });
}

pub(super) fn write_focus(lens: &mut dyn TableLike, was: &Keys<f64>, is: &Keys<f64>) {
    write(lens, was, is, |key, _, is| {
        set(key, "focus_distance_m", *is)
    });
}

/// Writes what differs; keys that are new come before the first later one.
fn write<T: PartialEq>(
    owner: &mut dyn TableLike,
    was: &Keys<T>,
    is: &Keys<T>,
    write_value: impl Fn(&mut dyn TableLike, Option<&T>, &T),
) {
    if is.is_empty() {
        owner.remove(LIST);
        return;
    }
    if !owner.contains_key(LIST) {
        owner.insert(LIST, Item::ArrayOfTables(ArrayOfTables::new()));
    }
    let Some(list) = owner.get_mut(LIST) else {
        return;
    };
    let kept = |place| is.iter().find(|key| key.place == Some(place));
    for place in (0..length(list)).rev() {
        let (Some(before), Some(key)) = (was.iter().find(|k| k.place == Some(place)), kept(place))
        else {
            remove_element(list, place);
            continue;
        };
        let Some(table) = element_mut(list, place) else {
            continue;
        };
        if before.time_secs != key.time_secs {
            set(table, "time_secs", key.time_secs);
        }
        if before.value != key.value {
            write_value(table, Some(&before.value), &key.value);
        }
    }
    for key in is.iter().filter(|key| key.place.is_none()) {
        let mut table = Table::new();
        set(&mut table, "time_secs", key.time_secs);
        write_value(&mut table, None, &key.value);
        let is_later = |index: &usize| {
            let time_secs = element(list, *index).and_then(time_secs);
            time_secs.is_some_and(|time_secs| time_secs > key.time_secs)
        };
        let end = length(list);
        let index = (0..end).find(is_later).unwrap_or(end);
        insert_element(list, index, table);
    }
}
