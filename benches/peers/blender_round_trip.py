#!/usr/bin/env python3
"""A scene to Blender by `mixray export-blender`, and back by the extension: how far the composites are apart, over their noise.

    benches/peers/blender_round_trip.py [SCENE.toml] [--mixray PROGRAM] [--rays N] [-o FOLDER]

Wants a Python with `bpy`, `numpy` and `OpenEXR`. Two seeds of the scene tell its noise: RMS of their difference. The picture of the scene that came
back, of a third seed, must be as far from the first. The control has lamps and an environment that are a fifth brighter.
"""

import argparse
import runpy
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


def render(program, scene_file, out, *, rays, seed):
    command = [program, "render", scene_file, "--rpp", rays, "--seed", seed, "--layers", "composite,difference,mask", "-o", out]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    with OpenEXR.File(str(out), separate_channels=True) as file:
        channels = file.channels()
        picture = np.stack([np.array(channels[c].pixels, np.float64) for c in "RGB"], axis=-1)
        changed = np.array(channels["mask.Y"].pixels) + sum(abs(np.array(channels[f"difference.{c}"].pixels)) for c in "RGB") > 0
    return picture, changed


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", nargs="?", default=str(ROOT / "scenes" / "room" / "scene.toml"))
    parser.add_argument("--mixray", default=str(ROOT / "target" / "release" / "mixray"))
    parser.add_argument("--rays", type=int, default=16)
    parser.add_argument("-o", "--output", default="blender-round-trip")
    arguments = parser.parse_args()
    folder = Path(arguments.output).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run([arguments.mixray, "export-blender", arguments.scene, "-o", str(folder / "scene.py")], check=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mixray.register()
    runpy.run_path(str(folder / "scene.py"), run_name="__main__")
    if bpy.context.window is None:
        raise SystemExit("Blender has no window to show the scene in")
    shot = export_shot(bpy.context, folder / "back")
    print(shot.report.text())
    brighter = tomllib.loads(shot.scene_file.read_text())
    if "environment" in brighter:
        brighter["environment"]["scale"] *= 1.2
    for light in brighter.get("light", []):
        for key in ("radiance", "intensity", "irradiance"):
            if key in light:
                light[key] = convert.scaled(light[key], 1.2)
    control_file = shot.scene_file.with_name("brighter.toml")
    control_file.write_text(convert.toml(brighter))
    jobs = {"first": (arguments.scene, 1), "second": (arguments.scene, 2), "back": (shot.scene_file, 3), "control": (control_file, 3)}
    pictures, changed = {}, None
    for name, (scene_file, seed) in jobs.items():
        pictures[name], now = render(arguments.mixray, scene_file, folder / f"{name}.exr", rays=arguments.rays, seed=seed)
        changed = now if changed is None else changed | now
    rms = {name: float(np.sqrt(((picture - pictures["first"])[changed] ** 2).mean())) for name, picture in pictures.items()}
    mean = {name: float((picture - pictures["first"])[changed].mean()) for name, picture in pictures.items()}
    print(f"{int(changed.sum())} pixels that change, RMS from the first picture: noise {rms['second']:.5f}, there and back {rms['back']:.5f}, control {rms['control']:.5f}")
    print(f"mean: noise {mean['second']:+.6f}, there and back {mean['back']:+.6f}, control {mean['control']:+.6f}")
    sys.exit(0 if rms["back"] < 1.1 * rms["second"] < rms["control"] else 1)


if __name__ == "__main__":
    main()
