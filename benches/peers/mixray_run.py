"""Runs the built mixray on a scene file at the size of its Mitsuba twin."""

import json
import subprocess
from pathlib import Path

import numpy as np

from mitsuba_scene import mi

ROOT = Path(__file__).resolve().parents[2]
BINARY = ROOT / "target" / "release" / "mixray"


def scene_file(name):
    """`FOLDER` of scenes/, or `FOLDER/FILE` for another scene file in it."""
    folder, _, file = name.partition("/")
    return ROOT / "scenes" / folder / f"{file or 'scene'}.toml"


def reference_file(name):
    return ROOT / "tests" / "references" / f"{name.replace('/', '_')}.exr"


def _value(v):
    if isinstance(v, bool):
        return "true" if v else "false"
    if isinstance(v, dict):
        return "{ " + ", ".join(f"{k} = {_value(x)}" for k, x in v.items()) + " }"
    if isinstance(v, list):
        return "[" + ", ".join(map(_value, v)) + "]"
    return json.dumps(v) if isinstance(v, str) else repr(v)


def to_toml(document):
    """Enough of TOML for a scene file."""
    lines = []
    for table, content in document.items():
        for entry in content if isinstance(content, list) else [content]:
            lines.append(f"[[{table}]]" if isinstance(content, list) else f"[{table}]")
            lines += [f"{key} = {_value(value)}" for key, value in entry.items()]
    return "\n".join(lines) + "\n"


def write_scene(peer, folder):
    """A copy of the scene at the peer's size, its photograph averaged in linear light; returns the scene file's path."""
    source = peer.path.parent.resolve()
    document = json.loads(json.dumps(peer.toml))
    document["camera"].update(width=peer.width, height=peer.height)
    if peer.photo is not None:
        mi.Bitmap(peer.photo.astype(np.float32)).write(str(folder / "photo.exr"))
        document["photo"]["image"] = "photo.exr"
    for entry in [document.get("environment", {}), *document.get("real", []), *document.get("virtual", [])]:
        for key in ("image", "mesh"):
            if key in entry:
                entry[key] = str(source / entry[key])
    path = folder / "scene.toml"
    path.write_text(to_toml(document))
    return path


def render(scene_path, *, rays_per_pixel, seed, estimator="direct", sampler="sobol", backend="cpu", combine="robust", picture="out.exr"):
    """(layers of the EXR by channel name, statistics). A PNG has no layers and spares the real radiance that they need."""
    image, stats = scene_path.with_name(picture), scene_path.with_name("stats.json")
    arguments = {
        "--rpp": rays_per_pixel,
        "--seed": seed,
        "--estimator": estimator,
        "--sampler": sampler,
        "--backend": backend,
        "--combine": combine,
        "--stats": stats,
        "-o": image,
    }
    command = [BINARY, "render", scene_path, *(str(x) for pair in arguments.items() for x in pair)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    if image.suffix != ".exr":
        return {}, json.loads(stats.read_text())
    bitmap = mi.Bitmap(str(image))
    names = [field.name for field in bitmap.struct_()]
    planes = np.array(bitmap, np.float64)
    return {name: planes[..., i] for i, name in enumerate(names)}, json.loads(stats.read_text())


def rgb(layers, layer=""):
    """The composite, or a named layer."""
    prefix = f"{layer}." if layer else ""
    return np.stack([layers[prefix + c] for c in "RGB"], axis=-1)
