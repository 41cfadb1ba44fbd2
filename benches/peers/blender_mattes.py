#!/usr/bin/env python3
"""A Cryptomatte of mixray in Blender's compositor: how far an object's matte there is from the one that the file's definition gives.

    benches/peers/blender_mattes.py RENDER.exr OBJECT OTHER

RENDER.exr comes from `mixray render --layers composite,virtual,cryptomatte`; OBJECT and OTHER are names of its virtual objects. Wants a Python
with `bpy`, `numpy` and `OpenEXR`. The control is the matte of OTHER. Exit code 1 if a pixel is off by more than 0.01, or the control is not.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "compositing")]

import bpy  # noqa: E402
import mattes  # noqa: E402


def picked_in_blender(picture, name, size, out):
    """The Matte output of a Cryptomatte node that reads `picture` and has `name` picked."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    tree = bpy.data.node_groups.new("mattes", "CompositorNodeTree")
    scene.compositing_node_group = tree
    node = tree.nodes.new("CompositorNodeCryptomatteV2")
    node.source, node.image = "IMAGE", bpy.data.images.load(str(picture))
    node.matte_id = name
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(node.outputs["Matte"], output.inputs[0])
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath = str(out)
    bpy.ops.render.render(write_still=True)
    with OpenEXR.File(str(out), separate_channels=True) as file:
        return np.array(file.channels()["R"].pixels, np.float64)


def main(picture, name, other):
    picture = Path(picture).resolve()
    ours = np.array(mattes.matte(*mattes.channels_of(str(picture)), name), np.float64)
    with tempfile.TemporaryDirectory() as folder:
        theirs, control = (
            picked_in_blender(picture, picked, ours.shape[::-1], Path(folder, "matte.exr"))
            for picked in (name, other)
        )
    partly = ((ours > 0.02) & (ours < 0.98)).sum()
    error, control = (np.abs(ours - matte).max() for matte in (theirs, control))
    print(f"{name}: {error:.5f} off at most, {partly} pixels covered in part; {other} in its place {control:.5f}")
    return int(not error <= 0.01 < control)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
