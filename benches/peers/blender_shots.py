#!/usr/bin/env python3
"""Shots that Blender writes, exported by the extension of blender/ and rendered by Cycles and by mixray, side by side.

    benches/peers/blender_shots.py [aperture] [animated] [tracked] [--mixray PROGRAM] [-o FOLDER]

Wants a Python with `bpy`, `numpy` and `OpenEXR`. Prints a line a shot for docs/blender.md and ends with code 1 where one misses its bound.
"""

import argparse
import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "blender"), str(ROOT / "benches" / "peers")]

import bpy  # noqa: E402
import mixray  # noqa: E402
from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mixray.export import export_shot  # noqa: E402

import blender_scenes  # noqa: E402

RAYS_PER_PIXEL = 256
BOUNDS = {"reprojection_px": 0.05, "mask_iou": 0.995, "irradiance": 0.01}


def planes(path):
    """Channels of an EXR file by their names, f64."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels, np.float64) for name, channel in file.channels().items()}


def rgb(channels, layer=""):
    return np.stack([channels[f"{layer}{c}"] for c in "RGB"], axis=-1)


class Cycles:
    """The worlds of a shot as Cycles renders them."""

    def __init__(self, scene, folder):
        self.scene, self.folder = scene, folder
        meshes = [thing for thing in scene.objects if thing.type == "MESH"]
        self.real = [thing for thing in meshes if thing.is_shadow_catcher]
        self.virtual = [thing for thing in meshes if not thing.is_shadow_catcher]

    def render(self, world):
        """Picture of "mixed" or "real", RGB, or the share of each pixel that is "mask"."""
        scene = self.scene
        for thing in self.virtual:
            thing.hide_render = world == "real"
        for thing in self.real:
            thing.is_shadow_catcher, thing.is_holdout = False, world == "mask"
        scene.render.film_transparent = world == "mask"
        scene.render.image_settings.color_mode = "RGBA" if world == "mask" else "RGB"
        lamps = [thing for thing in scene.objects if thing.type == "LIGHT"]
        for thing in lamps:
            thing.visible_camera = False
        scene.render.filepath = str(self.folder / f"cycles-{world}.exr")
        bpy.ops.render.render(write_still=True)
        for thing in self.virtual:
            thing.hide_render = False
        for thing in self.real:
            thing.is_shadow_catcher, thing.is_holdout = True, False
        scene.render.film_transparent = False
        channels = planes(scene.render.filepath)
        return channels["A"] if world == "mask" else rgb(channels)


def write_photograph(picture, path):
    """Linear Rec.709 as a PNG, through Blender."""
    height, width, _ = picture.shape
    image = bpy.data.images.new(path.stem, width, height, float_buffer=False)
    encoded = np.where(picture <= 0.0031308, picture * 12.92, 1.055 * np.maximum(picture, 1e-9) ** (1 / 2.4) - 0.055)
    rgba = np.concatenate([encoded, np.ones((height, width, 1))], axis=-1)[::-1]
    image.pixels.foreach_set(np.clip(rgba, 0.0, 1.0).astype(np.float32).ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def set_background(camera, path, *, frames=1):
    """The photograph, or the first of numbered ones, as the camera's background."""
    if frames == 1:
        background = camera.data.background_images.new()
        background.image = bpy.data.images.load(str(path))
        return None
    clip = bpy.data.movieclips.load(str(path))
    background = camera.data.background_images.new()
    background.source, background.clip = "MOVIE_CLIP", clip
    return clip


def check_points(program, shot, folder, rows):
    """Largest distance, pixels, between where mixray sees points and where Blender does, by `mixray sequence --check`.

    `rows`: frame, x_px, y_px, then the point in mixray's world.
    """
    table = folder / "points.csv"
    with table.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", "x_px", "y_px", "x_m", "y_m", "z_m"])
        writer.writerows(rows)
    command = [program, "sequence", str(shot.scene_file), "--frames", str(shot.frames), "--trajectory", str(shot.trajectory)]
    command += ["--check", str(table), "--max-error", "1000"]
    said = subprocess.run(command, check=True, capture_output=True, text=True)
    print(said.stdout + said.stderr)
    return said.stdout


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("shots", nargs="*", default=[])
    parser.add_argument("--mixray", default=str(ROOT / "target" / "release" / "mixray"))
    parser.add_argument("-o", "--output", default="blender-shots")
    arguments = parser.parse_args()
    mixray.register()
    scene = blender_scenes.aperture()
    folder = Path(arguments.output).resolve() / "aperture"
    folder.mkdir(parents=True, exist_ok=True)
    cycles = Cycles(scene, folder)
    real = cycles.render("real"); mixed = cycles.render("mixed"); mask = cycles.render("mask")
    write_photograph(real, folder / "photo_0001.png")
    set_background(scene.camera, folder / "photo_0001.png")
    shot = export_shot(bpy.context, folder / "shot")
    print(shot.report.text())
    out = folder / "mixray.exr"
    subprocess.run([arguments.mixray, "render", str(shot.scene_file), "--layers", "composite,difference,mask,real,mixed", "--rpp", "256", "-o", str(out)], check=True)
    ours = planes(out)
    print({k: v.shape for k, v in ours.items()})
    m2 = ours["mask.Y"]
    print("IoU", np.minimum(mask, m2).sum() / np.maximum(mask, m2).sum())
    clear = (mask == 0) & (m2 == 0)
    for layer, theirs in (("real.", real), ("mixed.", mixed)):
        o = rgb(ours, layer)
        print(layer, o[clear].mean(0) / theirs[clear].mean(0))
    d = rgb(ours, "difference."); dt = mixed - real
    print("diff", d[clear].sum(0) / dt[clear].sum(0))
    pair = np.concatenate([mixed, rgb(ours, "mixed."), np.abs(mixed - rgb(ours, "mixed.")) * 4], 1)
    write_photograph(pair, folder / "pair.png")


if __name__ == "__main__":
    main()
