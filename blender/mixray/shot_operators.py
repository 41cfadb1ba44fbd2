"""Export, and export and render, as operators. A render runs beside Blender, which stays usable; Esc ends it with what there is."""

import signal
import subprocess
from pathlib import Path

import bpy

from .export import export_shot
from .report import Refused
from .results import Film, load_picture


def folder_of(scene):
    folder = scene.mixray.folder
    if folder.startswith("//") and not bpy.data.filepath:
        raise Refused("the folder is relative to a file that is not saved; save it, or give an absolute folder")
    return Path(bpy.path.abspath(folder))


def binary_of(context):
    addon = context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.binary) if addon else "mixray"


def _export(operator, context):
    """The shot, or None where the operator has said why not."""
    try:
        shot = export_shot(context, folder_of(context.scene))
    except (Refused, OSError) as problem:
        operator.report({"ERROR"}, str(problem))
        return None
    context.scene.mixray.report = "\n".join(shot.report.lines)
    for line in shot.report.lines:
        operator.report({"WARNING"}, line)
    operator.report({"INFO"}, f"written: {shot.scene_file}")
    return shot


class MIXRAY_OT_export(bpy.types.Operator):
    bl_idname = "mixray.export"
    bl_label = "Export shot"
    bl_description = "Write the scene file of mixray, its meshes and the camera's poses"

    def execute(self, context):
        return {"FINISHED"} if _export(self, context) else {"CANCELLED"}


class MIXRAY_OT_render(bpy.types.Operator):
    bl_idname = "mixray.render"
    bl_label = "Export and render"
    bl_description = "Export the shot, render it with mixray, and load the layers into the compositor"

    def execute(self, context):
        if not self._start(context):
            return {"CANCELLED"}
        self.process.wait()
        return self._end(context)

    def invoke(self, context, _event):
        if not self._start(context):
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(0.5, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("mixray renders; Esc ends it")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.process.send_signal(getattr(signal, "CTRL_C_EVENT", signal.SIGINT))
        if event.type != "TIMER" or self.process.poll() is None:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)
        return self._end(context)

    def _start(self, context):
        shot = _export(self, context)
        if shot is None:
            return False
        folder = shot.scene_file.parent
        if shot.trajectory:
            first, end = shot.numbers
            self.film = Film(shot.first_frame, first, end - first)
            self.output = folder / "frames-out"
            self.picture = self.output / Path(shot.first_name).with_suffix(".exr").name
        else:
            self.film = None
            self.output = self.picture = folder / "result.exr"
        self.log = folder / "mixray.log"
        try:
            with self.log.open("w") as log:
                self.process = subprocess.Popen(shot.command(binary_of(context), self.output), stdout=log, stderr=log)
        except OSError as problem:
            self.report({"ERROR"}, f"mixray cannot be started ({problem}); give its path in the extension's preferences")
            return False
        return True

    def _end(self, context):
        code = self.process.returncode
        lines = self.log.read_text(errors="replace").strip().splitlines()
        for line in lines:
            if line.startswith("warning: "):
                self.report({"WARNING"}, line.removeprefix("warning: "))
        if code not in (0, 130):
            self.report({"ERROR"}, f"mixray: {lines[-1] if lines else f'ended with code {code}'}")
            return {"CANCELLED"}
        # Ended early, a film may have no frame yet.
        if self.picture.is_file():
            load_picture(context.scene, self.picture, self.film)
        self.report({"INFO"}, f"rendered: {self.output}")
        return {"FINISHED"}


CLASSES = (MIXRAY_OT_export, MIXRAY_OT_render)
