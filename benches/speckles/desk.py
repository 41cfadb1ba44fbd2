#!/usr/bin/env python3
"""Speckles over a real photograph: a desk with a gold and a clear-coated model under a studio's map and a small lamp.

    pip install numpy opencv-python-headless OpenEXR
    cargo build --release
    python3 benches/speckles/desk.py DATA [--work FOLDER] [--rays 25 49] [--write]

DATA holds tum_desk_rgbd/ (photograph and proxy of the TUM RGB-D benchmark, freiburg2_desk), gltf_models/ (stanford_bunny.glb, Duck.glb) and
hdr_environments/ (brown_photostudio_02_1k.hdr, Poly Haven). The converged picture is the mean of several runs of many rays with `--combine mean`,
16 bits a channel; the standard error of that mean, from the runs, is printed with the table. Only pixels without virtual samples (M = 0) count.
`--write` replaces the table and the picture of docs/speckles.md.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import cv2
import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "speckles.md"
PICTURE = ROOT / "docs" / "speckles.png"
SCENE = """
[photo]
image = "{data}/tum_desk_rgbd/photo.png"
[camera]
fx = 520.9
fy = 521.0
cx = 325.6
cy = 250.2
world_from_camera = [
  [0.9987419457690468, 0.050145047227601144, 0.0, 0.15661301276128026],
  [-0.04370180951545091, 0.87041158962286, 0.4903812970488183, 0.7974619375419273],
  [0.024590193300045294, -0.4897643707832857, 0.8715079939419481, 1.078002224113788],
  [0.0, 0.0, 0.0, 1.0],
]
[environment]
image = "{data}/hdr_environments/brown_photostudio_02_1k.hdr"
scale = 0.4
[[light]]
kind = "quad"
corner = [0.25, 0.75, 0.05]
edge_u = [0.08, 0.0, 0.0]
edge_v = [0.0, 0.0, 0.08]
radiance = [160.0, 150.0, 130.0]
[[real]]
mesh = "{data}/tum_desk_rgbd/proxy.glb"
[[virtual]]
mesh = "{data}/gltf_models/stanford_bunny.glb"
translation = [-0.06, -0.002, 0.22]
scale = 0.11
material = {{ base_color = [1.0, 0.77, 0.34], metallic = 1.0, roughness = 0.2 }}
[[virtual]]
mesh = "{data}/gltf_models/Duck.glb"
translation = [0.32, -0.01, 0.22]
rotation_deg = [0, -60, 0]
scale = 0.1
material = {{ base_color = [0.7, 0.05, 0.03], roughness = 0.5, clearcoat = 1.0, clearcoat_roughness = 0.03 }}
[render]
max_bounces = 5
backend = "cpu"
"""
# Rows of the picture, and columns: both models with what they change.
CROP = np.s_[290:430, 140:480]
WAYS = [("mean", ["--combine", "mean"]), ("robust", []), ("`--filter final`", ["--filter", "final"])]


def encoded(linear):
    """8-bit codes, not rounded."""
    linear = np.clip(linear, 0, 1)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def decoded(codes):
    value = codes / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def read_codes(path):
    """8-bit codes of a PNG of 8 or 16 bits, RGB."""
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., 2::-1]
    return pixels / (257.0 if pixels.dtype == np.uint16 else 1.0)


class Desk:
    def __init__(self, mixray, data, work):
        self.mixray = mixray
        self.work = work
        self.scene = work / "desk.toml"
        self.scene.write_text(SCENE.format(data=data.resolve()))
        self.photo = read_codes(data / "tum_desk_rgbd" / "photo.png")

    def render(self, name, *flags):
        """The picture of that name, kept from run to run."""
        path = self.work / name
        if not path.exists():
            command = [self.mixray, "render", self.scene, "-o", path, *flags]
            subprocess.run([str(word) for word in command], check=True, capture_output=True)
        return path

    def real(self):
        """Pixels without virtual samples."""
        path = self.render("mask.exr", "--rpp", "25", "--combine", "mean")
        return OpenEXR.File(str(path), separate_channels=True).channels()["mask.Y"].pixels == 0

    def converged(self, runs, rays):
        """Codes, and the standard error of each."""
        flags = ["--rpp", rays, "--combine", "mean", "--png-bits", 16]
        each = [
            decoded(read_codes(self.render(f"converged-{rays}-{run}.png", *flags, "--seed", 200 + run)))
            for run in range(1, runs + 1)
        ]
        codes = encoded(np.mean(each, axis=0))
        spread = np.std([encoded(picture) for picture in each], axis=0, ddof=1)
        return codes, spread / np.sqrt(runs)


def median_of_3x3(error):
    planes = [cv2.medianBlur(np.ascontiguousarray(error[..., c].astype(np.float32)), 3) for c in range(3)]
    return np.stack(planes, axis=-1)


def row(name, rays, codes, converged, photo, real):
    error = codes - converged
    off = (np.abs(error).max(axis=-1) >= 10) & real
    lone = off & (np.abs(error - median_of_3x3(error)).max(axis=-1) >= 10)
    still = (np.abs(converged - photo).max(axis=-1) < 0.5) & real
    changed = (codes != photo).any(axis=-1) & still
    black = (codes.min(axis=-1) == 0) & (converged.min(axis=-1) > 2) & real
    rms = np.sqrt((error[real] ** 2).mean())
    return (
        f"| {rays} | {name} | {1e4 * off.sum() / real.sum():.1f} | {1e4 * lone.sum() / real.sum():.2f} | "
        f"{100 * changed.sum() / still.sum():.2f}% | {black.sum()} | {rms:.2f} |"
    )


def replaced(page, rows):
    begin, end = "<!-- desk -->\n", "<!-- end -->"
    before, rest = page.split(begin, 1)
    _, after = rest.split(end, 1)
    return before + begin + "\n".join(rows) + "\n" + end + after


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--mixray", type=Path, default=ROOT / "target" / "release" / "mixray")
    parser.add_argument("--work", type=Path, help="pictures are kept here")
    parser.add_argument("--reference-rays", type=int, default=300)
    parser.add_argument("--reference-runs", type=int, default=4)
    parser.add_argument("--rays", type=int, nargs="+", default=[25, 49])
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        work = arguments.work or Path(scratch)
        work.mkdir(parents=True, exist_ok=True)
        desk = Desk(arguments.mixray, arguments.data, work)
        converged, error = desk.converged(arguments.reference_runs, arguments.reference_rays)
        real = desk.real()
        rows = [
            "| rays | samples combined by | off by 10 codes or more, per 10,000 | of these alone | changed in vain | black | RMS |",
            "| --- | --- | --- | --- | --- | --- | --- |",
        ]
        shown = []
        for rays in arguments.rays:
            for name, flags in WAYS:
                file = f"{name.strip('`-').replace(' ', '-')}-{rays}.png"
                codes = read_codes(desk.render(file, "--rpp", rays, *flags))
                rows.append(row(name, rays, codes, converged, desk.photo, real))
                if rays == arguments.rays[0]:
                    shown.append(codes[CROP])
        rows.append("")
        rows.append(
            f"The converged picture has {arguments.reference_runs} x {arguments.reference_rays} rays a pixel; its own standard error is "
            f"{np.sqrt((error[real] ** 2).mean()):.2f} codes RMS, and 10 codes or more in "
            f"{1e4 * ((error.max(axis=-1) >= 10) & real).sum() / real.sum():.2f} of 10,000 pixels."
        )
        print("\n".join(rows))
        if arguments.write:
            PAGE.write_text(replaced(PAGE.read_text(), rows))
            columns = np.vstack([np.hstack(shown[:2]), np.hstack([shown[2], np.round(converged)[CROP]])])
            cv2.imwrite(str(PICTURE), columns[..., ::-1].astype(np.uint8), [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
