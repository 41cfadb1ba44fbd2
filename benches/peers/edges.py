"""Edges of a square that mixray puts into photographs with `[sharpness] from = "photo"`, read in the delivered PNG.

    python3 benches/peers/edges.py PHOTO... [--mixray target/release/mixray]    # pip install numpy opencv-python-headless

A light square on a dark one, turned by five degrees, in the middle of each photograph: from 10% to 90% of the step, pixels, and how far it goes beyond both
sides within four pixels, mean of its four sides, beside what `mixray sharpness` says of the photograph and without `[sharpness]`.
"""

import argparse
import math
import pathlib
import subprocess
import tempfile

import cv2
import numpy as np

SIDE_PX, TURN_DEG, DEPTH_M = 69.0, 5.0, 10.0
FINE = 4

SCENE = """\
[photo]
image = "{photo}"

[camera]
fx = 1000
fy = 1000
cx = {cx}
cy = {cy}
position = [0, 0, 0]
look_at = [0, 0, -1]

[[virtual]]
shape = "quad"
corner = [-0.7, -0.7, -10.1]
edge_u = [1.4, 0, 0]
edge_v = [0, 1.4, 0]
material = {{ base_color = [0.1, 0.1, 0.1], unlit = true }}

[[virtual]]
shape = "quad"
corner = {corner}
edge_u = {edge_u}
edge_v = {edge_v}
material = {{ base_color = [0.5, 0.5, 0.5], unlit = true }}

[render]
rays_per_pixel = 256
{sharpness}
"""


def linear(codes):
    x = codes / 255.0
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def profile(green, centre, normal):
    """Bright side positive, FINE bins a pixel, over the middle half of a side."""
    y, x = np.mgrid[0 : green.shape[0], 0 : green.shape[1]] + 0.5
    along = (x - centre[0]) * -normal[1] + (y - centre[1]) * normal[0]
    across = (x - centre[0]) * normal[0] + (y - centre[1]) * normal[1]
    distance = SIDE_PX / 2 - across
    near = (abs(along) < SIDE_PX / 3.5) & (abs(distance) < 9)
    bins = np.floor((distance[near] + 9) * FINE).astype(int)
    return np.bincount(bins, green[near], 18 * FINE) / np.bincount(bins, minlength=18 * FINE)


def measured(picture, centre):
    turn = math.radians(TURN_DEG)
    green = linear(picture[..., 1].astype(float))
    sides = [turn + k * math.pi / 2 for k in range(4)]
    mean = np.mean([profile(green, centre, (math.cos(a), math.sin(a))) for a in sides], 0)
    dark, bright = mean[: 3 * FINE].mean(), mean[-3 * FINE :].mean()
    step = (mean - dark) / (bright - dark)
    at = np.arange(len(step)) / FINE
    crossing = [np.interp(level, step[6 * FINE : 12 * FINE], at[6 * FINE : 12 * FINE]) for level in (0.1, 0.9)]
    half = len(step) // 2
    beyond = 0.5 * (step[half : half + 4 * FINE] - 1 - step[half - 4 * FINE : half][::-1])
    return crossing[1] - crossing[0], max(beyond.max(), 0)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("photos", nargs="+", type=pathlib.Path)
    parser.add_argument("--mixray", default="target/release/mixray")
    arguments = parser.parse_args()
    program = str(pathlib.Path(arguments.mixray).resolve())
    for photo in arguments.photos:
        said = subprocess.run([program, "sharpness", photo], capture_output=True, text=True, check=True).stdout
        height, width = cv2.imread(str(photo)).shape[:2]
        centre = (width / 2 + 0.3, height / 2 + 0.2)
        turn, half = math.radians(TURN_DEG), SIDE_PX / 2 / 1000 * DEPTH_M
        # The picture's y points down, the scene's up.
        u = (math.cos(turn), -math.sin(turn))
        v = (math.sin(turn), math.cos(turn))
        corner = [-half * (u[0] + v[0]), -half * (u[1] + v[1]), -DEPTH_M]
        found = []
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for sharpness in ("", '\n[sharpness]\nfrom = "photo"'):
                (folder / "scene.toml").write_text(
                    SCENE.format(
                        photo=photo.resolve(), cx=centre[0], cy=centre[1], corner=corner, sharpness=sharpness,
                        edge_u=[2 * half * u[0], 2 * half * u[1], 0], edge_v=[2 * half * v[0], 2 * half * v[1], 0],
                    )
                )
                subprocess.run([program, "-q", "render", folder / "scene.toml", "-o", folder / "out.png"], check=True)
                found.append(measured(cv2.imread(str(folder / "out.png")), centre))
        real, table = [line.split(": ", 1)[1] for line in said.splitlines()[:2]]
        (plain, _), (spread, beyond) = found
        print(f"{photo.stem}: photograph {real} table {table} rendered {spread:.2f} px, {100 * beyond:.1f}%; without {plain:.2f} px")


if __name__ == "__main__":
    main()
