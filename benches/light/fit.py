#!/usr/bin/env python3
"""`mixray light fit` on photographs that mixray renders under a known light, and on two that a depth camera took.

    pip install numpy pillow OpenEXR
    cargo build --release
    python3 benches/light/fit.py [--mixray target/release/mixray] [--data ../shared/data] [--write]

DATA holds hdr_environments/ (brown_photostudio_02_1k.hdr, "studio", and venice_sunset_1k.hdr, "sunset", Poly Haven), tum_desk_rgbd/ and
kinect_basket_rgbd/ (photograph, camera and proxy). Prints the tables; `--write` replaces them in docs/light.md, and docs/light.png and
docs/light_shadows.png.
"""

import argparse
import json
import math
import pathlib
import random
import re
import subprocess
import tempfile

import numpy as np
import OpenEXR
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "light.md"
CAMERA = """
[camera]
width = {0}
height = {1}
vertical_fov_deg = 45
position = [0.3, 1.6, 2.6]
look_at = [0, 0.1, 0]
"""
SUN_DEG = (40.0, 60.0)  # elevation and azimuth
STRONG = (0.5, 0.25)  # scales of the room under the strong sun
STRONG_IRRADIANCE = 2.5


class Mixray:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def __call__(self, *arguments, codes=(0,)):
        done = subprocess.run([self.program, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True)
        if done.returncode not in codes:
            raise SystemExit(f"mixray {' '.join(map(str, arguments))}: {done.stderr}")
        return done.stderr

    def fit(self, scene, *more):
        (self.folder / "scene.toml").write_text(scene)
        said = self("light", "fit", "scene.toml", "--stats", "fit.json", *more, codes=(0, 1))
        return json.loads((self.folder / "fit.json").read_text()), said


def things(side, known, has_ball):
    """A floor of tiles, boxes and perhaps a ball on it, each of its own colour."""
    colours = random.Random(7)
    parts = []

    def add(shape):
        grey = 0.25 + 0.4 * colours.random()
        colour = [round(grey * (0.85 + 0.3 * colours.random()), 4) for _ in range(3)]
        look = f"material = {{ base_color = {colour}, specular = 0.0 }}" if known else 'albedo = "from-photo"'
        parts.append(f"[[{side}]]\n{shape}\n{look}\n")

    for tile in range(36):
        x, z = -2.1 + 0.7 * (tile % 6), 2.1 - 0.7 * (tile // 6)
        add(f'shape = "quad"\ncorner = [{x}, 0, {z}]\nedge_u = [0.7, 0, 0]\nedge_v = [0, 0, -0.7]')
    for x, z, across, height, turn in [(-0.6, -0.3, 0.35, 0.5, 20), (0.5, 0.2, 0.3, 0.25, -35), (0.1, -0.9, 0.5, 0.8, 10), (-0.2, 0.7, 0.2, 0.15, 50)]:
        add(f'shape = "box"\nsize = [{across}, {height}, {across}]\ntranslation = [{x}, {height / 2 + 0.001}, {z}]\nrotation_deg = [0, {turn}, 0]')
    if has_ball:
        add('shape = "sphere"\nscale = 0.22\ntranslation = [0.85, 0.221, -0.35]')
    return "\n".join(parts)


def towards_sun():
    up, azimuth = (math.radians(angle) for angle in SUN_DEG)
    return [math.cos(up) * math.sin(azimuth), math.sin(up), -math.cos(up) * math.cos(azimuth)]


def map_light(image, rotation, scale):
    return f'[environment]\nimage = "{image}"\nrotation_deg = {rotation}\nscale = {scale}\n'


def sun_light(irradiance):
    return f'[[light]]\nkind = "directional"\nside = "virtual"\ndirection = {[-x for x in towards_sun()]}\nirradiance = {[irradiance] * 3}\n'


def photograph(mixray, light, size, has_ball=True):
    """A scene without a photograph, all of it drawn: taken as one."""
    settings = '[render]\nrays_per_pixel = 64\nmax_bounces = 4\nbackend = "cpu"\n'
    (mixray.folder / "truth.toml").write_text(CAMERA.format(*size) + light + things("virtual", True, has_ball) + settings)
    mixray("-q", "render", "truth.toml", "-o", "photo.png")


def scene(light, size, known, has_ball=True):
    return '[photo]\nimage = "photo.png"\n' + CAMERA.format(*size) + light + things("real", known, has_ball)


def found(fit, known, truth_over_sky=None):
    """What a row says of a fit."""
    parts = []
    if fit["poor"]:
        parts.append("poor")
    rotation, scale, sun = fit["rotation_deg"], fit["scale"], fit["sun"]
    if rotation:
        parts.append("rotation kept" if rotation["kept"] else f"rotation {rotation['is']:.1f} +- {rotation['sigma']:.1f}")
    if known:
        parts.append(f"scale {scale['is']:.3f}" + (f" +- {scale['sigma']:.3f}" if scale["sigma"] else ""))
    if sun is None:
        return ", ".join(parts + ["no sun"])
    x, y, z = (-value for value in sun["direction"])
    parts.append(f"sun {math.degrees(math.asin(y)):.1f} and {math.degrees(math.atan2(x, -z)):.1f}")
    sigma = f" +- {100 * sun['irradiance_relative_sigma']:.0f}%" if sun["irradiance_relative_sigma"] else ""
    if known:
        parts.append(f"irradiance {sun['irradiance']:.3f}{sigma}")
    else:
        parts.append(f"sun over sky {sun['irradiance'] / scale['is']:.1f}{sigma} (truth {truth_over_sky:.1f})")
    return ", ".join(parts)


def of_renders(mixray, environments):
    size = (320, 240)
    studio, sunset = (environments / name for name in ("brown_photostudio_02_1k.hdr", "venice_sunset_1k.hdr"))
    white = "[environment]\nradiance = [{0}, {0}, {0}]\n"
    cases = [
        ("studio turned 130, scale 0.25; sun 40 up, azimuth 60, irradiance 0.9", map_light(studio, 130.0, 0.25) + sun_light(0.9), map_light(studio, 0.0, 1.0), 3.6),
        ("studio turned 130, scale 0.4", map_light(studio, 130.0, 0.4), map_light(studio, 0.0, 1.0), None),
        ("sunset turned 200, scale 0.15", map_light(sunset, 200.0, 0.15), map_light(sunset, 0.0, 1.0), None),
        ("white sky, 0.6", white.format(0.6), white.format(1.0), None),
        ("white sky, but the scene has the studio", white.format(0.6), map_light(studio, 0.0, 1.0), None),
    ]
    rows = []
    for name, truth, begin, over_sky in cases:
        photograph(mixray, truth, size)
        for known in (True, False):
            residual = ["--residual", "light.png"] if over_sky and not known else []
            fit, said = mixray.fit(scene(begin, size, known), *residual)
            text = found(fit, known, over_sky)
            if "--white-sky" in said:
                text += '; "a white sky explains more"'
            rows.append((name if known else "the same", "known" if known else "unknown", text))
    spots = np.random.default_rng(3).integers(40, 200, (24, 32)).astype(np.uint8)
    Image.fromarray(spots).resize(size, Image.Resampling.NEAREST).convert("RGB").save(mixray.folder / "photo.png")
    for known in (True, False):
        fit, _ = mixray.fit(scene(map_light(studio, 0.0, 1.0), size, known))
        rows.append(("spots of any grey" if known else "the same", "known" if known else "unknown", found(fit, known, math.nan)))
    return rows


def room(path):
    """A window and a lamp in a dark room."""
    codes = np.full((32, 64, 3), 70, np.uint8)
    codes[8:16, 20:30] = 255
    codes[4:8, 50:54] = 200
    Image.fromarray(codes).save(path)
    return path.name


def under_strong_sun(mixray):
    rows, size = [], (96, 72)
    image = room(mixray.folder / "room.png")
    for scale in STRONG:
        photograph(mixray, map_light(image, 130.0, scale) + sun_light(STRONG_IRRADIANCE), size, has_ball=False)
        for known in (True, False):
            fit, _ = mixray.fit(scene(map_light(image, 10.0, 1.0), size, known, has_ball=False))
            sun, right = fit["sun"], STRONG_IRRADIANCE / scale
            if sun is None:
                rows.append((scale, "known" if known else "unknown", "no sun", "", ""))
                continue
            off = math.degrees(math.acos(min(1.0, -float(np.dot(sun["direction"], towards_sun())))))
            over_sky = sun["irradiance"] / fit["scale"]["is"]
            sigma = sun["irradiance_relative_sigma"]
            told = f"{100 * sigma:.0f}%" if sigma else "not told"
            rows.append((scale, "known" if known else "unknown", f"{off:.1f}", f"{over_sky:.2f} (truth {right:.0f}), {100 * (over_sky / right - 1):+.0f}%", told))
    return rows


def taken(data, name):
    camera = json.loads((data / name / "camera.json").read_text())
    rows = ", ".join(str(row) for row in camera["camera_to_world_gltf"])
    return (
        f'[photo]\nimage = "{data / name / "photo.png"}"\n[camera]\nfx = {camera["fx"]}\nfy = {camera["fy"]}\ncx = {camera["cx"] + 0.5}\n'
        f'cy = {camera["cy"] + 0.5}\nworld_from_camera = [{rows}]\n[[real]]\nmesh = "{data / name / "proxy.glb"}"\n'
    )


def of_photographs(mixray, data, environments):
    rows = []
    for title, name in [("desk (TUM RGB-D)", "tum_desk_rgbd"), ("basket", "kinect_basket_rgbd")]:
        light = map_light(environments / "brown_photostudio_02_1k.hdr", 0.0, 0.4)
        fit, _ = mixray.fit(taken(data, name) + light)
        shadows, explained = fit["shadows_over_around"], fit["explained"]
        rows.append((title, *(f"{shadows[key]:.2f}" for key in ("in_photograph", "by_white_sky", "as_given", "fitted")), f"{100 * explained['by_white_sky']:.0f}%", f"{fit['scale']['is']:.2f}", "poor" if fit["poor"] else "good"))
    return rows


def ball_on_desk(mixray, data, environments, scale):
    """The desk, and with a ball on it at the studio's scale of 0.4 and at the one that was fitted; what the darkest quarter of what it shades keeps, and
    how much of the proxy's albedo lies at its limit."""
    box = (40, 220, 320, 420)
    desk = Image.open(data / "tum_desk_rgbd" / "photo.png").convert("RGB")
    panels, kept, limited = [desk.crop(box)], [], []
    for strength in (0.4, scale):
        light = map_light(environments / "brown_photostudio_02_1k.hdr", 0.0, strength)
        ball = '[[virtual]]\nshape = "sphere"\nsize_m = 0.12\nrest_on = "real"\npixel = [185, 345]\nmaterial = { base_color = [0.5, 0.5, 0.5], specular = 0.0 }\n'
        (mixray.folder / "ball.toml").write_text(taken(data, "tum_desk_rgbd") + light + ball)
        said = mixray("render", "ball.toml", "--rpp", "64", "-o", "ball.png", "-o", "ball.exr", "--layers", "composite,virtual")
        at_limit = re.search(r"(\d+)% of the proxy's albedo", said)
        limited.append(f"{at_limit[1]}%" if at_limit else "less than half")
        panels.append(Image.open(mixray.folder / "ball.png").convert("RGB").crop(box))
        codes = [np.asarray(picture, float) / 255 for picture in (desk, Image.open(mixray.folder / "ball.png").convert("RGB"))]
        before, after = (np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722] for code in codes)
        with OpenEXR.File(str(mixray.folder / "ball.exr")) as file:
            covered = file.channels()["virtual"].pixels[..., 3]
        ratio = (after / np.maximum(before, 1e-3))[covered == 0]
        shaded = np.sort(ratio[ratio < 0.97])
        kept.append(float(shaded[: max(1, len(shaded) // 4)].mean()))
    strip = Image.new("RGB", (sum(panel.width for panel in panels), panels[0].height))
    for place, panel in enumerate(panels):
        strip.paste(panel, (place * panel.width, 0))
    return strip.resize((strip.width * 3 // 2, strip.height * 3 // 2), Image.Resampling.LANCZOS), kept, limited


def table(head, rows):
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    return "\n".join(lines + [f"| {' | '.join(map(str, row))} |" for row in rows]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mixray", type=pathlib.Path, default=ROOT / "target/release/mixray")
    parser.add_argument("--data", type=pathlib.Path, default=ROOT / "../shared/data")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    data = arguments.data.resolve()
    environments = data / "hdr_environments"
    with tempfile.TemporaryDirectory() as folder:
        mixray = Mixray(arguments.mixray.resolve(), pathlib.Path(folder))
        strong = under_strong_sun(mixray)
        print(table(["room's scale", "albedo", "direction off, degrees", "sun over room", "stated deviation"], strong))
        photographs = of_photographs(mixray, data, environments)
        print(table(["", "photograph", "white sky", "studio as given", "studio, best fit", "explained by a white sky", "scale found", "fit"], photographs))
        renders = of_renders(mixray, environments)
        print(table(["truth", "albedo", "found"], renders))
        fitted = photographs[0][6]
        strip, kept, limited = ball_on_desk(mixray, data, environments, float(fitted))
        ball = (
            f"At 0.4 {limited[0]} of the proxy's albedo lies at its limit, at {fitted} {limited[1]}. Of what the ball shades the darkest quarter keeps "
            f"{kept[0]:.2f} of the photograph at 0.4, and {kept[1]:.2f} at {fitted}.\n"
        )
        print(ball)
        if not arguments.write:
            return
        tables = {
            "renders": table(["truth", "albedo", "found"], renders),
            "strong": table(["room's scale", "albedo", "direction off, degrees", "sun over room", "stated deviation"], strong),
            "photographs": table(["", "photograph", "white sky", "studio as given", "studio, best fit", "explained by a white sky", "scale found", "fit"], photographs),
            "ball": ball,
        }
        page = PAGE.read_text()
        for name, text in tables.items():
            page, count = re.subn(rf"(<!-- {name} -->\n).*?(<!-- end -->)", lambda match: match.group(1) + text + match.group(2), page, flags=re.DOTALL)
            assert count == 1, name
        PAGE.write_text(page)
        (ROOT / "docs" / "light.png").write_bytes((mixray.folder / "light.png").read_bytes())
        strip.save(ROOT / "docs" / "light_shadows.png", optimize=True)


if __name__ == "__main__":
    main()
