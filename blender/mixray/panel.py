"""Settings of a scene and its lamps, and the panel in the render properties."""

import blf
import bpy
from bpy.props import BoolProperty, IntProperty, PointerProperty, StringProperty

from .report import wrapped

# Of a panel's width, at a scale of 1: what the margins of the panel and of a box in it take.
BOX_MARGINS_PX = 60


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    binary: StringProperty(
        name="Program",
        description="mixray; its name alone if it is on the path",
        subtype="FILE_PATH",
        default="mixray",
    )

    def draw(self, _context):
        self.layout.prop(self, "binary")


class SceneSettings(bpy.types.PropertyGroup):
    folder: StringProperty(
        name="Folder",
        description="Where the scene file, its meshes and the pictures go",
        subtype="DIR_PATH",
        default="//mixray/",
    )
    real_collection: PointerProperty(
        name="Real",
        description="Its objects are in the photograph already, as shadow catchers are; all others are added",
        type=bpy.types.Collection,
    )
    is_sequence: BoolProperty(
        name="Frame range",
        description="Every frame of the range into the clip, and not the present one alone",
    )
    rays_per_pixel: IntProperty(
        name="Rays per pixel",
        description="0: as many as Cycles has samples",
        min=0,
        soft_max=4096,
    )
    report: StringProperty(description="What the last export could not carry, a line each")


class ObjectSettings(bpy.types.PropertyGroup):
    is_added: BoolProperty(
        name="Added light",
        description="The lamp is not in the photograph: its light is added to it",
    )


class MIXRAY_PT_panel(bpy.types.Panel):
    bl_label = "mixray"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    def draw(self, context):
        layout, settings = self.layout, context.scene.mixray
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "folder")
        layout.prop(settings, "real_collection")
        layout.prop(settings, "is_sequence")
        layout.prop(settings, "rays_per_pixel")
        layout.operator("mixray.export", icon="EXPORT")
        layout.operator("mixray.render", icon="RENDER_STILL")
        layout.operator("mixray.load_result", icon="NODE_COMPOSITING")
        if settings.report:
            box = layout.box()
            box.label(text="Not carried as it is", icon="INFO")
            column = box.column(align=True)
            for line in settings.report.splitlines():
                _paragraph(column, line, context)
                column.separator()


def _paragraph(column, text, context):
    """Labels below each other: Blender cuts what is wider than the panel out of the middle of a label."""
    scale = context.preferences.system.ui_scale
    blf.size(0, context.preferences.ui_styles[0].widget.points * scale)
    width_px = context.region.width - BOX_MARGINS_PX * scale
    for line in wrapped(text, width_px, lambda words: blf.dimensions(0, words)[0]):
        column.label(text=line)


class MIXRAY_PT_lamp(bpy.types.Panel):
    bl_label = "mixray"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "LIGHT"

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.prop(context.object.mixray, "is_added")


CLASSES = (Preferences, SceneSettings, ObjectSettings, MIXRAY_PT_panel, MIXRAY_PT_lamp)
