//! The window's keys, and the list of them.

use eframe::egui::{self, Key, Modifiers};

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Act {
    Help,
    Open,
    Save,
    Undo,
    Redo,
    Reload,
    Fit,
    Wireframe,
    Wipe,
    Gizmo,
    SetKey,
    Remove,
    WiderAperture,
    NarrowerAperture,
}

const COMMAND: Modifiers = Modifiers::COMMAND;
const COMMAND_SHIFT: Modifiers = Modifiers {
    shift: true,
    ..Modifiers::COMMAND
};

/// More modifiers first: a shortcut takes its key.
const KEYS: &[(Modifiers, Key, Act, &str)] = &[
    (COMMAND_SHIFT, Key::Z, Act::Redo, "redo"),
    (COMMAND, Key::Z, Act::Undo, "undo"),
    (COMMAND, Key::Y, Act::Redo, "redo"),
    (COMMAND, Key::O, Act::Open, "open a file"),
    (COMMAND, Key::S, Act::Save, "save the scene file"),
    (COMMAND, Key::R, Act::Reload, "read the scene file again"),
    (
        Modifiers::NONE,
        Key::Num0,
        Act::Fit,
        "fit the picture into the window",
    ),
    (
        Modifiers::NONE,
        Key::W,
        Act::Wireframe,
        "wireframe of the proxy",
    ),
    (
        Modifiers::NONE,
        Key::P,
        Act::Wipe,
        "wipe against the bare photograph",
    ),
    (
        Modifiers::NONE,
        Key::G,
        Act::Gizmo,
        "arrows and rings on the selected object",
    ),
    (
        Modifiers::NONE,
        Key::OpenBracket,
        Act::WiderAperture,
        "a third of a stop wider",
    ),
    (
        Modifiers::NONE,
        Key::CloseBracket,
        Act::NarrowerAperture,
        "a third of a stop narrower",
    ),
    (
        Modifiers::NONE,
        Key::K,
        Act::SetKey,
        "a key for the selected object at the present time",
    ),
    (
        Modifiers::NONE,
        Key::Delete,
        Act::Remove,
        "remove the selected object",
    ),
    (Modifiers::NONE, Key::Questionmark, Act::Help, "this list"),
];

const POINTER: &[(&str, &str)] = &[
    ("click", "focus there"),
    (
        "drag an object",
        "along the real surface under it, resting on it",
    ),
    (
        "drag an arrow, a ring",
        "move the selected object along an axis, turn it about one",
    ),
    ("drag a corner of the frame", "scale the selected object"),
    (
        "drag elsewhere",
        "move the picture; without a photograph: orbit",
    ),
    ("Alt + drag, or right button", "orbit the camera"),
    ("Shift + right button", "pan the camera"),
    ("middle button", "move the picture"),
    ("L + drag", "turn the environment"),
    ("wheel", "zoom to single pixels"),
    ("Shift + wheel", "turn the object under the pointer"),
    ("Ctrl + wheel", "dolly the camera"),
    ("click the timeline", "to that time; on a key, to its time"),
    ("drag a key on the timeline", "another time for it"),
    ("drop a file", "scene, mesh, photograph or environment"),
];

/// What was asked for since the last frame; nothing while a text is being typed.
pub(super) fn pressed(context: &egui::Context) -> Vec<Act> {
    if context.egui_wants_keyboard_input() {
        return Vec::new();
    }
    context.input_mut(|input| {
        // The question mark is a shifted key on most keyboards.
        let asks = |input: &mut egui::InputState| {
            input.consume_key(Modifiers::SHIFT, Key::Questionmark)
                || input.consume_key(Modifiers::SHIFT, Key::Slash)
        };
        let mut acts: Vec<Act> = asks(input).then_some(Act::Help).into_iter().collect();
        let pressed = KEYS
            .iter()
            .filter(|(modifiers, key, ..)| input.consume_key(*modifiers, *key));
        acts.extend(pressed.map(|(_, _, act, _)| *act));
        acts
    })
}

pub(super) fn help(ui: &mut egui::Ui) {
    egui::Grid::new("keys").striped(true).show(ui, |ui| {
        for (modifiers, key, _, what) in KEYS {
            let mut name = String::new();
            if modifiers.command {
                name += "Ctrl + ";
            }
            if modifiers.shift {
                name += "Shift + ";
            }
            ui.label(name + key.symbol_or_name());
            ui.label(*what);
            ui.end_row();
        }
        for (gesture, what) in POINTER {
            ui.label(*gesture);
            ui.label(*what);
            ui.end_row();
        }
    });
}
