#!/usr/bin/env python3
"""A picture of mixray in Blender's compositor: how far the extension's node group is from the picture's own composite.

    benches/peers/blender_layers.py PHOTO PICTURE.exr [-o OUT.exr]

Wants a Python with `bpy`, `numpy` and `OpenEXR`. The control grades the difference by a half, which must show.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "blender")]

import bpy  # noqa: E402
import mixray  # noqa: E402
from mixray.results import load_picture  # noqa: E402


def rgb(path):
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return np.stack([np.array(file.channels()[c].pixels, np.float64) for c in "RGB"], axis=-1)


def composited(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return rgb(path)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("photo")
    parser.add_argument("picture")
    parser.add_argument("-o", "--output", default="blender-layers.exr")
    arguments = parser.parse_args()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mixray.register()
    scene = bpy.context.scene
    data = bpy.data.cameras.new("camera")
    scene.camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(scene.camera)
    data.background_images.new().image = bpy.data.images.load(str(Path(arguments.photo).resolve()))
    group = load_picture(scene, Path(arguments.picture).resolve())
    theirs = rgb(arguments.picture)
    scene.render.resolution_y, scene.render.resolution_x = theirs.shape[:2]
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    out = Path(arguments.output).resolve()
    error = np.abs(composited(scene, out) - theirs).max()
    group.inputs["Grade difference"].default_value = (0.5, 0.5, 0.5, 1.0)
    control = np.abs(composited(scene, out) - theirs).max()
    print(f"largest error {error:.2e}; with the difference halved {control:.2e}")
    sys.exit(0 if error < 1e-4 < control else 1)


if __name__ == "__main__":
    main()
