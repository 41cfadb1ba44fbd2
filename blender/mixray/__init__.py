"""Exports a shot to mixray, renders it, and brings the layers back into the compositor."""

import bpy

from . import panel, results, shot_operators

CLASSES = (*panel.CLASSES, *shot_operators.CLASSES, *results.CLASSES)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.mixray = bpy.props.PointerProperty(type=panel.SceneSettings)
    bpy.types.Object.mixray = bpy.props.PointerProperty(type=panel.ObjectSettings)


def unregister():
    del bpy.types.Object.mixray
    del bpy.types.Scene.mixray
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
