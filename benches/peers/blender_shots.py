#!/usr/bin/env python3
"""Shots that Blender writes, exported by the extension of blender/ and rendered by Cycles and by mixray.

    benches/peers/blender_shots.py [aperture] [animated] [tracked] [--mixray PROGRAM] [--rays N] [-o FOLDER]

Wants a Python with `bpy`, `numpy` and `OpenEXR`. Prints a row a shot of the table in docs/blender.md, writes both pictures side by side, and
ends with code 1 where a figure misses its bound, or where a control does not: the same comparison with one thing wrong.
"""

import argparse
import csv
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "blender")]

import bpy  # noqa: E402
import mixray  # noqa: E402
from mixray import convert  # noqa: E402
from mixray.export import export_shot  # noqa: E402

import blender_scenes  # noqa: E402

SAMPLES = 144
# Cycles renders the picture so many times larger, for the lens to bend it and the mean to be taken.
OVERSIZE = 4


def planes(path):
    """Channels of an EXR file by their names, f64."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: np.array(channel.pixels, np.float64) for name, channel in file.channels().items()}


def rgb(channels, layer=""):
    return np.stack([channels[f"{layer}{c}"] for c in "RGB"], axis=-1)


class Cycles:
    """The worlds of a shot as Cycles renders them; `bend` makes of a picture what the lens does."""

    def __init__(self, scene, folder, bend=None):
        self.scene, self.folder, self.bend = scene, folder, bend
        meshes = [thing for thing in scene.objects if thing.type == "MESH"]
        self.real = [thing for thing in meshes if thing.is_shadow_catcher]
        self.virtual = [thing for thing in meshes if not thing.is_shadow_catcher]

    def render(self, world):
        """Picture of "mixed" or "real", RGB, or the share of each pixel that is "mask"."""
        self._arrange(world)
        render = self.scene.render
        render.filepath = str(self.folder / f"cycles-{world}.exr")
        render.resolution_percentage = 100 * OVERSIZE if self.bend else 100
        self.scene.cycles.samples = SAMPLES // OVERSIZE**2 if self.bend else SAMPLES
        bpy.ops.render.render(write_still=True)
        render.resolution_percentage = 100
        self._arrange(None)
        channels = planes(render.filepath)
        picture = channels["A"][..., None] if world == "mask" else rgb(channels)
        picture = self.bend(picture) if self.bend else picture
        return picture[..., 0] if world == "mask" else picture

    def _arrange(self, world):
        for thing in self.virtual:
            thing.hide_render = world == "real"
        for thing in self.real:
            thing.is_shadow_catcher, thing.is_holdout = world is None, world == "mask"
        for thing in self.scene.objects:
            if thing.type == "LIGHT":
                thing.visible_camera = False
        self.scene.render.film_transparent = world == "mask"
        self.scene.render.image_settings.color_mode = "RGBA" if world == "mask" else "RGB"


def distortion_map(clip, folder):
    """Where each pixel of the lens's picture, OVERSIZE times larger, is in the pinhole's: pixels from the top left, by Blender's compositor.

    Its node bends what is a pixel beside (Blender 5.0.1): a lens that bends nothing tells by how much, and the map is moved back.
    """
    lens = clip.tracking.camera
    given = lens.k1, lens.k2
    x, y = _through_node(clip, folder)
    lens.k1 = lens.k2 = 0.0
    x0, y0 = _through_node(clip, folder)
    lens.k1, lens.k2 = given
    j, i = np.indices(x.shape)
    middle = x.shape[0] // 2, x.shape[1] // 2
    beside_x, beside_y = round((x0 - i - 0.5)[middle]), round((y0 - j - 0.5)[middle])
    from_row, from_column = np.clip(j - beside_y, 0, x.shape[0] - 1), np.clip(i - beside_x, 0, x.shape[1] - 1)
    return x[from_row, from_column], y[from_row, from_column]


def _through_node(clip, folder):
    width, height = OVERSIZE * clip.size[0], OVERSIZE * clip.size[1]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    image = bpy.data.images.new("ramp", width, height, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(np.stack([x, y, 0 * x, 0 * x + 1], -1).astype(np.float32).ravel())
    image.pack()
    made = bpy.data.scenes.new("distortion")
    made.render.resolution_x, made.render.resolution_y = width, height
    made.render.image_settings.file_format, made.render.image_settings.color_depth = "OPEN_EXR", "32"
    made.render.filepath = str(folder / "distortion.exr")
    tree = bpy.data.node_groups.new("distortion", "CompositorNodeTree")
    made.compositing_node_group = tree
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, bend, output = (tree.nodes.new(kind) for kind in ("CompositorNodeImage", "CompositorNodeMovieDistortion", "NodeGroupOutput"))
    source.image, bend.clip = image, clip
    bend.inputs["Type"].default_value = "Distort"
    tree.links.new(source.outputs["Image"], bend.inputs["Image"])
    tree.links.new(bend.outputs["Image"], output.inputs[0])
    bpy.ops.render.render(write_still=True, scene=made.name)
    channels = planes(made.render.filepath)
    bpy.data.scenes.remove(made)
    return channels["R"] * width, (1.0 - channels["G"]) * height


def bent(picture, pinhole_x, pinhole_y):
    """An oversized picture of the pinhole as the lens shows it, at the picture's own size."""
    height, width, channels = picture.shape
    x, y = np.clip(pinhole_x - 0.5, 0, width - 1.001), np.clip(pinhole_y - 0.5, 0, height - 1.001)
    i, j = x.astype(int), y.astype(int)
    u, v = (x - i)[..., None], (y - j)[..., None]
    mixed = (picture[j, i] * (1 - u) + picture[j, i + 1] * u) * (1 - v) + (picture[j + 1, i] * (1 - u) + picture[j + 1, i + 1] * u) * v
    return mixed.reshape(height // OVERSIZE, OVERSIZE, width // OVERSIZE, OVERSIZE, channels).mean((1, 3))


def write_png(picture, path):
    """Linear Rec.709 as sRGB, through Blender."""
    height, width, _ = picture.shape
    image = bpy.data.images.new(path.stem, width, height)
    encoded = np.where(picture <= 0.0031308, picture * 12.92, 1.055 * np.maximum(picture, 1e-9) ** (1 / 2.4) - 0.055)
    rgba = np.concatenate([encoded, np.ones((height, width, 1))], axis=-1)[::-1]
    image.pixels.foreach_set(np.clip(rgba, 0.0, 1.0).astype(np.float32).ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


class Mixray:
    def __init__(self, program, rays):
        self.program, self.rays = program, rays

    def run(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr)
        return done.stdout + done.stderr

    def render(self, scene_file, layers="composite,mask,real,mixed"):
        out = scene_file.with_suffix(".exr")
        self.run("render", scene_file, "--layers", layers, "--rpp", self.rays, "-o", out)
        return planes(out)

    def reprojection_px(self, shot, rows):
        """Largest distance between where mixray projects points and where Blender does. `rows`: frame, x_px, y_px, x_m, y_m, z_m."""
        table = shot.scene_file.with_name("points.csv")
        with table.open("w", newline="") as file:
            csv.writer(file).writerows([["frame", "x_px", "y_px", "x_m", "y_m", "z_m"], *rows])
        said = self.run(
            *("sequence", shot.scene_file, "--frames", shot.frames, "--trajectory", shot.trajectory),
            *("--check", table, "--max-error", 1000),
        )
        return float(re.search(r"largest ([0-9.]+)", said)[1])


def still_of(shot, frame_file):
    """A scene file of one frame of an exported film."""
    entry = next(e for e in json.loads(shot.trajectory.read_text())["frames"] if e["file"] == frame_file)
    document = tomllib.loads(shot.scene_file.read_text())
    camera = {key: value for key, value in entry["camera"].items() if key not in ("width", "height")}
    document["photo"] = {"image": str(shot.frames / frame_file)}
    document["camera"] = {**camera, "world_from_camera": entry["world_from_camera"]}
    document["shutter"] = {"exposure_secs": 0.0, "time_secs": entry["time_secs"]}
    path = shot.scene_file.with_name("frame.toml")
    path.write_text(convert.toml(document))
    return path


def iou(a, b):
    return np.minimum(a, b).sum() / np.maximum(a, b).sum()


def compare(name, scene_file, theirs, program, folder):
    """(figures of both programs' pictures, mixray's mask): overlap of the masks; irradiance on catchers, everywhere and in shadow, over Cycles'."""
    ours = program.render(scene_file)
    mask = ours["mask.Y"]
    clear = (mask == 0.0) & (theirs["mask"] == 0.0)
    real, mixed = rgb(ours, "real."), rgb(ours, "mixed.")
    lit = clear & (theirs["real"].min(-1) > 0.01)
    shadow = lit & ((theirs["mixed"] / np.maximum(theirs["real"], 1e-9)).mean(-1) < 0.85)
    figures = {
        "iou": iou(mask, theirs["mask"]),
        "irradiance": mixed[lit].sum() / theirs["mixed"][lit].sum() - 1.0,
        "shadow": mixed[shadow].sum() / theirs["mixed"][shadow].sum() - 1.0,
        "shadow_px": int(shadow.sum()),
        "control_iou": iou(np.roll(mask, 1, 1), theirs["mask"]),
        "control_shadow": real[shadow].sum() / theirs["mixed"][shadow].sum() - 1.0,
    }
    sides = [theirs["mixed"], mixed, 4.0 * np.abs(mixed - theirs["mixed"])]
    write_png(np.concatenate(sides, 1), folder / f"{name}.png")
    return figures, mask


def worlds(cycles):
    return {world: cycles.render(world) for world in ("real", "mixed", "mask")}


def pinhole_points(scene, size, frame_file, at=None):
    """Rows for Mixray.reprojection_px: a grid of pixels, each with the point 2 m before Blender's camera that is seen there.

    `at`: where the pinhole sees what the lens shows at a pixel.
    """
    width, height = size
    matrix = scene.camera.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.normalized()
    # Blender's own corners of the picture, one unit before the camera: its sensor, shift and fit.
    frame = [corner / -corner.z for corner in scene.camera.data.view_frame(scene=scene)]
    right, top, left, bottom = max(c.x for c in frame), max(c.y for c in frame), min(c.x for c in frame), min(c.y for c in frame)
    rows = []
    for y in np.linspace(1, height - 2, 9).astype(int) + 0.5:
        for x in np.linspace(1, width - 2, 11).astype(int) + 0.5:
            u, v = at(x, y) if at else (x, y)
            point = 2.0 * np.array([left + (right - left) * u / width, top - (top - bottom) * v / height, -1.0])
            world = np.array(matrix)[:3, :3] @ point + np.array(matrix)[:3, 3]
            rows.append([frame_file, x, y, *convert.point_y_up(world)])
    return rows


def aperture(program, folder):
    scene = blender_scenes.aperture()
    theirs = worlds(Cycles(scene, folder))
    write_png(theirs["real"], folder / "plate_0001.png")
    background = scene.camera.data.background_images.new()
    background.image = bpy.data.images.load(str(folder / "plate_0001.png"))
    shot = export_shot(bpy.context, folder / "shot")
    figures, mask = compare("aperture", shot.scene_file, theirs, program, folder)
    # A control: the aperture turned by half a blade.
    document = tomllib.loads(shot.scene_file.read_text())
    document["lens"]["blade_rotation_deg"] += 36.0
    turned = shot.scene_file.with_name("turned.toml")
    turned.write_text(convert.toml(document))
    bead = np.zeros_like(theirs["mask"])
    bead[: bead.shape[0] // 3, bead.shape[1] // 2 :] = 1.0
    wrong = program.render(turned, "composite,mask")["mask.Y"]
    figures["bead_iou"], figures["control_bead"] = (iou(m * bead, theirs["mask"] * bead) for m in (mask, wrong))
    # The camera of a still, as a film of one frame.
    shot.frames, shot.trajectory = folder / "one", folder / "one.json"
    shot.frames.mkdir(exist_ok=True)
    (shot.frames / "plate_0001.png").write_bytes((folder / "plate_0001.png").read_bytes())
    camera = document["camera"]
    pose = camera.pop("world_from_camera")
    frame = {"file": "plate_0001.png", "time_secs": 0.0, "world_from_camera": pose, "camera": {"width": blender_scenes.WIDTH, "height": blender_scenes.HEIGHT, **camera}}
    shot.trajectory.write_text(json.dumps({"frames": [frame]}))
    return figures, shot, pinhole_points(scene, (blender_scenes.WIDTH, blender_scenes.HEIGHT), "plate_0001.png")


def film(name, scene, frame, program, folder, cycles):
    """Frame `frame` of a film, its photograph rendered now."""
    scene.frame_set(frame)
    theirs = worlds(cycles)
    write_png(theirs["real"], folder / f"plate_{frame:04}.png")
    scene.mixray.is_sequence = True
    shot = export_shot(bpy.context, folder / "shot")
    scene.frame_set(frame)
    figures, _ = compare(name, still_of(shot, f"plate_{frame:04}.png"), theirs, program, folder)
    return figures, shot


def animated(program, folder):
    scene = blender_scenes.animated()
    black = np.zeros((blender_scenes.HEIGHT, blender_scenes.WIDTH, 3))
    for frame in range(1, 9):
        write_png(black, folder / f"plate_{frame:04}.png")
    background = scene.camera.data.background_images.new()
    background.source, background.clip = "MOVIE_CLIP", bpy.data.movieclips.load(str(folder / "plate_0001.png"))
    figures, shot = film("animated", scene, 6, program, folder, Cycles(scene, folder))
    return figures, shot, pinhole_points(scene, (blender_scenes.WIDTH, blender_scenes.HEIGHT), "plate_0006.png")


def tracked(program, folder):
    scene, clip = blender_scenes.tracked(folder)
    pinhole = distortion_map(clip, folder)
    cycles = Cycles(scene, folder, lambda picture: bent(picture, *pinhole))
    figures, shot = film("tracked", scene, 6, program, folder, cycles)

    def at(x, y):
        i, j = int(x * OVERSIZE), int(y * OVERSIZE)
        # A pixel's centre is a corner of the larger picture's.
        return tuple(m[j - 1 : j + 1, i - 1 : i + 1].mean() / OVERSIZE for m in pinhole)

    return figures, shot, pinhole_points(scene, tuple(clip.size), "plate_0006.png", at)


SHOTS = {"aperture": aperture, "animated": animated, "tracked": tracked}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("shots", nargs="*", help=", ".join(SHOTS))
    parser.add_argument("--mixray", default=str(ROOT / "target" / "release" / "mixray"))
    parser.add_argument("--rays", type=int, default=144)
    parser.add_argument("-o", "--output", default="blender-shots")
    arguments = parser.parse_args()
    mixray.register()
    program = Mixray(arguments.mixray, arguments.rays)
    print("| shot | reprojection, px | mask IoU (a pixel beside) | irradiance | in shadow (without shadow) | bead's IoU (blades turned) |")
    met = True
    for name in arguments.shots or SHOTS:
        folder = Path(arguments.output).resolve() / name
        folder.mkdir(parents=True, exist_ok=True)
        figures, shot, rows = SHOTS[name](program, folder)
        figures["reprojection"] = program.reprojection_px(shot, rows)
        bead = "{bead_iou:.4f} ({control_bead:.4f})".format(**figures) if "bead_iou" in figures else ""
        print("| {0} | {reprojection:.3f} | {iou:.4f} ({control_iou:.4f}) | {irradiance:+.2%} | {shadow:+.2%} ({control_shadow:+.0%}) | {1} |".format(name, bead, **figures))
        sys.stdout.flush()
        met &= figures["reprojection"] < 0.05 and figures["iou"] > 0.995 and abs(figures["irradiance"]) < 0.01 and abs(figures["shadow"]) < 0.01
        met &= figures["control_iou"] < 0.995 and abs(figures["control_shadow"]) > 0.01
        met &= figures.get("control_bead", 0.0) < figures.get("bead_iou", 1.0) - 0.01
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
