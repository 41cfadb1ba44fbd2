"""Rendered pictures back in the compositor: their layers, and a node group that puts the composite together anew."""

import re
from dataclasses import dataclass
from pathlib import Path

import bpy
from bpy.props import StringProperty

GROUP = "mixray composite"


@dataclass
class Film:
    """Of numbered pictures: the scene's frame at the first, the number in its name, and how many there are."""

    scene_frame: int
    number: int
    count: int

    def show(self, user):
        """Has a node, or what else shows an image, follow the scene's frames."""
        user.frame_start, user.frame_duration, user.frame_offset = self.scene_frame, self.count, self.number - 1
        user.use_auto_refresh = True


def load_picture(scene, path, film=None):
    """Image nodes of the EXR, the first one of a film, and of the photograph, and the group between them and the output; returns the group's node."""
    tree, output = _compositor(scene)
    for node in [n for n in tree.nodes if n.label.startswith("mixray")]:
        tree.nodes.remove(node)
    image = bpy.data.images.load(str(path), check_existing=True)
    image.source = "SEQUENCE" if film else "FILE"
    image.reload()
    picture = _image_node(tree, image, "mixray layers", (-600, 0))
    if film:
        film.show(picture)
    group = tree.nodes.new("CompositorNodeGroup")
    group.node_tree, group.label, group.location, group.width = _group(), "mixray composite", (-300, 0), 280
    tree.links.new(picture.outputs["Combined"], group.inputs["Composite"])
    tree.links.new(picture.outputs["mask"], group.inputs["Mask"])
    photograph = _photograph_node(tree, scene)
    if photograph is not None:
        tree.links.new(photograph.outputs["Image"], group.inputs["Photograph"])
    tree.links.new(group.outputs["Image"], output.inputs[0])
    return group


def _compositor(scene):
    """The scene's compositor and its output node; Blender 5.0 made it a node group."""
    if hasattr(scene, "compositing_node_group"):
        if scene.compositing_node_group is None:
            scene.compositing_node_group = bpy.data.node_groups.new("compositor", "CompositorNodeTree")
        tree = scene.compositing_node_group
        kind = "NodeGroupOutput"
        if not any(item.item_type == "SOCKET" and item.in_out == "OUTPUT" for item in tree.interface.items_tree):
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    else:
        scene.use_nodes = True
        tree, kind = scene.node_tree, "CompositorNodeComposite"
    output = next((node for node in tree.nodes if node.bl_idname == kind), None) or tree.nodes.new(kind)
    return tree, output


def _image_node(tree, image, label, location):
    node = tree.nodes.new("CompositorNodeImage")
    node.image, node.label, node.location, node.width = image, label, location, 240
    return node


def _photograph_node(tree, scene):
    backgrounds = scene.camera.data.background_images if scene.camera else ()
    for background in backgrounds:
        if background.source == "MOVIE_CLIP" and background.clip:
            node = tree.nodes.new("CompositorNodeMovieClip")
            node.clip, node.label, node.location, node.width = background.clip, "mixray photograph", (-600, 400), 240
            return node
        if background.source == "IMAGE" and background.image:
            node = _image_node(tree, background.image, "mixray photograph", (-600, 400))
            if background.image.source in ("SEQUENCE", "MOVIE"):
                user = background.image_user
                Film(user.frame_start, user.frame_offset + 1, user.frame_duration).show(node)
            return node
    return None


def _group():
    """Image = photograph (1 - mask) + difference + objects, the last two times a colour to grade them by.

    What mixray adds to the photograph is split by the mask: shadows and light on real things are the difference.
    """
    tree = bpy.data.node_groups.get(GROUP)
    if tree is not None:
        return tree
    tree = bpy.data.node_groups.new(GROUP, "CompositorNodeTree")
    for name, kind, value in (
        ("Photograph", "NodeSocketColor", (0.0, 0.0, 0.0, 1.0)),
        ("Composite", "NodeSocketColor", (0.0, 0.0, 0.0, 1.0)),
        ("Mask", "NodeSocketFloat", 0.0),
        ("Grade difference", "NodeSocketColor", (1.0, 1.0, 1.0, 1.0)),
        ("Grade objects", "NodeSocketColor", (1.0, 1.0, 1.0, 1.0)),
    ):
        tree.interface.new_socket(name, in_out="INPUT", socket_type=kind).default_value = value
    for name in ("Image", "Difference", "Objects"):
        tree.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketColor")
    given, result = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    given.location, result.location = (-1000, 0), (800, 0)
    photograph, composite, mask, grade_difference, grade_objects = given.outputs[:5]
    behind = _mix(tree, "MULTIPLY", photograph, _mix(tree, "SUBTRACT", (1.0, 1.0, 1.0, 1.0), mask))
    added = _mix(tree, "SUBTRACT", composite, behind)
    objects = _mix(tree, "MULTIPLY", added, mask)
    difference = _mix(tree, "SUBTRACT", added, objects)
    graded_difference = _mix(tree, "MULTIPLY", difference, grade_difference)
    graded_objects = _mix(tree, "MULTIPLY", objects, grade_objects)
    image = _mix(tree, "ADD", _mix(tree, "ADD", behind, graded_difference), graded_objects)
    for socket, value in zip(result.inputs, (image, graded_difference, graded_objects)):
        tree.links.new(value, socket)
    return tree


def _mix(tree, operation, first, second):
    """The output of a node of two colours; each is a socket or a colour. The node's name changed with Blender 5.0."""
    if bpy.app.version >= (5, 0, 0):
        node = tree.nodes.new("ShaderNodeMix")
        node.data_type = "RGBA"
        colors = [s for s in node.inputs if s.type == "RGBA"]
        output = next(s for s in node.outputs if s.type == "RGBA")
        next(s for s in node.inputs if s.enabled and s.type == "VALUE").default_value = 1.0
    else:
        node = tree.nodes.new("CompositorNodeMixRGB")
        colors, output = node.inputs[1:3], node.outputs[0]
        node.inputs[0].default_value = 1.0
    node.blend_type = operation
    node.location = (-800 + 180 * len(tree.nodes), 0)
    for socket, value in zip(colors, (first, second)):
        if isinstance(value, tuple):
            socket.default_value = value
        else:
            tree.links.new(value, socket)
    return output


class MIXRAY_OT_load_result(bpy.types.Operator):
    bl_idname = "mixray.load_result"
    bl_label = "Load layers"
    bl_description = "Load a picture that mixray rendered, as layers, into the compositor; of a frame range its first one"

    filepath: StringProperty(subtype="FILE_PATH")
    filter_glob: StringProperty(default="*.exr", options={"HIDDEN"})

    def invoke(self, context, _event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        scene, path = context.scene, Path(self.filepath)
        film = None
        if scene.mixray.is_sequence:
            digits = re.search(r"(\d+)(?=\D*$)", path.stem)
            if digits is None:
                self.report({"ERROR"}, f"{path.name} has no frame number in its name; choose the first picture of the range, or switch Frame range off")
                return {"CANCELLED"}
            film = Film(scene.frame_start, int(digits[1]), scene.frame_end - scene.frame_start + 1)
        load_picture(scene, path, film)
        return {"FINISHED"}


CLASSES = (MIXRAY_OT_load_result,)
