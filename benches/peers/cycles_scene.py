"""A mixray scene file in Blender's Cycles: two passes, or its shadow catcher. Covers diffuse surfaces, perfect mirrors, quad lights and constant
environments, and refuses the rest."""

import json
import math
import os
import subprocess
from pathlib import Path

import numpy as np

from mitsuba_scene import Unsupported, camera_matrix, mi

WORKER = Path(__file__).with_name("cycles_worker.py")


def _material(entry):
    m = entry.get("material", {})
    color = m.get("base_color", [1, 1, 1])[:3]
    if m.get("transmission", 0.0) == 0.0 and m.get("metallic", 0.0) == 0.0 and m.get("specular", 1.0) == 0.0:
        return {"kind": "diffuse", "color": color}
    if m.get("metallic", 0.0) == 1.0 and m.get("roughness", 1.0) == 0.0:
        return {"kind": "mirror", "color": color}
    raise Unsupported(f"material {m}")


def _camera(peer):
    camera, lens = peer.toml["camera"], peer.toml.get("lens", {})
    if "vertical_fov_deg" not in camera or "f_number" in lens:
        raise Unsupported("a camera without vertical_fov_deg, or a lens by its f-number")
    return {
        "vertical_fov_deg": camera["vertical_fov_deg"],
        "world_from_camera": camera_matrix(camera).tolist(),
        "aperture_radius_m": lens.get("aperture_radius_m", 0.0),
        "focus_distance_m": lens.get("focus_distance_m", 1.0),
    }


def _background(peer):
    environment = peer.toml.get("environment", {"radiance": [0.0] * 3})
    if "radiance" not in environment:
        raise Unsupported("an environment map")
    return [c * environment.get("scale", 1.0) for c in environment["radiance"]]


class CyclesScene:
    """`python` has `bpy`; `folder` takes what the two processes exchange."""

    def __init__(self, peer, python, folder):
        self.folder = Path(folder)
        arrays, meshes = {}, []
        for side in ("real", "virtual"):
            for entry, triangles in peer._objects(side):
                i = len(meshes)
                arrays[f"positions_{i}"] = triangles.positions
                arrays[f"normals_{i}"] = triangles.normals
                arrays[f"faces_{i}"] = triangles.faces
                meshes.append({"side": side, "material": _material(entry)})
        lights = peer.toml.get("light", [])
        if any(light["kind"] != "quad" or light.get("side", "real") != "real" for light in lights):
            raise Unsupported("a light other than real quads")
        world = {
            "width": peer.width,
            "height": peer.height,
            "threads": os.cpu_count(),
            "max_bounces": peer.max_bounces,
            "camera": _camera(peer),
            "background": _background(peer),
            "lights": lights,
            "meshes": meshes,
        }
        np.savez(self.folder / "meshes.npz", **arrays)
        (self.folder / "world.json").write_text(json.dumps(world))
        read, write = os.pipe()
        # The worker answers on its descriptor 3.
        command = f'exec "{python}" "{WORKER}" 3>&{write} >/dev/null 2>&1'
        self.process = subprocess.Popen(
            ["bash", "-c", command], stdin=subprocess.PIPE, pass_fds=[write], text=True
        )
        os.close(write)
        self.answers = os.fdopen(read)
        self._send(str(self.folder))

    def _send(self, value):
        self.process.stdin.write(json.dumps(value) + "\n")
        self.process.stdin.flush()

    def render(self, world, samples, seed):
        """(planes by channel name, CPU seconds)."""
        out = self.folder / "cycles.exr"
        self._send({"world": world, "samples": samples, "seed": seed, "out": str(out)})
        answer = self.answers.readline()
        if not answer:
            raise RuntimeError("Cycles ended: does the given Python have bpy?")
        bitmap = mi.Bitmap(str(out))
        names = [field.name for field in bitmap.struct_()]
        planes = np.array(bitmap, np.float64)
        return {name: planes[..., i] for i, name in enumerate(names)}, json.loads(answer)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def plane(planes, layer, channels="RGB"):
    """The channels of a pass; Blender puts the view layer's name in front."""
    return np.stack([next(v for k, v in planes.items() if k.endswith(f"{layer}.{c}")) for c in channels], axis=-1)
