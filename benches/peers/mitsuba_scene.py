"""Builds the mixed and the real world of a mixray scene file for Mitsuba 3, an independent renderer.

Covers what both renderers define alike, and refuses the rest: a pinhole or a thin lens with a disc; point and directional lights, quads,
constant and lat-long environments; the built-in shapes and .glb meshes; Lambertian surfaces, metals that reflect all light (base colour 1, so
that Schlick's and a conductor's Fresnel factor are both 1) and smooth clear dielectrics.
"""

import json
import math
import os
import struct
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

for _library in ("/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1", "/usr/lib/llvm-19/lib/libLLVM.so.1"):
    if os.path.exists(_library):
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", _library)

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")

# Deep enough to end no path early: the reference must not depend on roulette.
NEVER = 10_000
# Marks the faces of virtual meshes.
VIRTUAL = "face_virtual"


class Unsupported(Exception):
    """The scene has something that the two renderers do not define alike."""


@dataclass
class Triangles:
    """A mesh in local space."""

    positions: np.ndarray
    normals: np.ndarray
    faces: np.ndarray

    def placed(self, world_from_local):
        linear = world_from_local[:3, :3]
        normals = self.normals @ np.linalg.inv(linear)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        faces = self.faces[:, ::-1] if np.linalg.det(linear) < 0.0 else self.faces
        return Triangles(self.positions @ linear.T + world_from_local[:3, 3], normals, faces)


# Shapes, triangle for triangle as in src/scene/shape.rs.


def sphere(segments):
    rings = segments // 2
    columns = segments + 1
    theta = np.arange(rings + 1) / rings * math.pi
    sin_theta, cos_theta = np.sin(theta), np.cos(theta)
    sin_theta[[0, -1]] = 0.0
    cos_theta[[0, -1]] = [1.0, -1.0]
    phi = (np.arange(columns) % segments) / segments * math.tau
    points = np.stack(
        [
            np.outer(sin_theta, np.sin(phi)),
            np.outer(cos_theta, np.ones(columns)),
            np.outer(sin_theta, np.cos(phi)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    faces = []
    for ring in range(rings):
        for column in range(segments):
            a = ring * columns + column
            b = a + columns
            if ring > 0:
                faces.append([a, b, a + 1])
            if ring + 1 < rings:
                faces.append([a + 1, b, b + 1])
    return Triangles(points, points.copy(), np.array(faces))


def quad(corner, edge_u, edge_v):
    corner, edge_u, edge_v = (np.asarray(v, float) for v in (corner, edge_u, edge_v))
    normal = np.cross(edge_u, edge_v)
    normal /= np.linalg.norm(normal)
    points = np.array([corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v])
    return Triangles(points, np.tile(normal, (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]))


def box(size):
    size = np.asarray(size, float)
    parts = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            normal, u, v = np.zeros((3, 3))
            normal[axis] = sign
            u[(axis + 1) % 3] = sign * size[(axis + 1) % 3]
            v[(axis + 2) % 3] = size[(axis + 2) % 3]
            parts.append(quad((normal * size - u - v) / 2.0, u, v))
    return Triangles(
        np.concatenate([p.positions for p in parts]),
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.faces + 4 * i for i, p in enumerate(parts)]),
    )


# Meshes: .glb files with plain float attributes; their materials are not read.

_COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def glb(path):
    """(triangles, object from local) of every primitive of the default scene."""
    data = Path(path).read_bytes()
    json_size = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + json_size])
    binary = data[28 + json_size :]

    def accessor(index):
        a = document["accessors"][index]
        view = document["bufferViews"][a["bufferView"]]
        component = np.dtype(_COMPONENTS[a["componentType"]])
        width = _WIDTHS[a["type"]]
        stride = view.get("byteStride", component.itemsize * width)
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        return np.ndarray(
            (a["count"], width), component, binary, start, (stride, component.itemsize)
        ).copy()

    found = []

    def visit(index, parent):
        node = document["nodes"][index]
        world = parent @ _node_matrix(node)
        if "mesh" in node:
            for primitive in document["meshes"][node["mesh"]]["primitives"]:
                if primitive.get("mode", 4) != 4 or "NORMAL" not in primitive["attributes"]:
                    raise Unsupported(f"{path}: only triangle lists with normals are converted")
                positions = accessor(primitive["attributes"]["POSITION"]).astype(float)
                if "indices" in primitive:
                    faces = accessor(primitive["indices"]).astype(int).reshape(-1, 3)
                else:
                    faces = np.arange(len(positions)).reshape(-1, 3)
                normals = accessor(primitive["attributes"]["NORMAL"]).astype(float)
                found.append((Triangles(positions, normals, faces), world))
        for child in node.get("children", []):
            visit(child, world)

    for root in document["scenes"][document.get("scene", 0)]["nodes"]:
        visit(root, np.eye(4))
    return found


def _node_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    return _transform(
        node.get("translation", [0, 0, 0]),
        _quaternion(node.get("rotation", [0, 0, 0, 1])),
        node.get("scale", [1, 1, 1]),
    )


# Transforms: T * R * S.


def _quaternion(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _about(axis, deg):
    c, s = math.cos(math.radians(deg)), math.sin(math.radians(deg))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    r = np.eye(3)
    r[i, i], r[i, j], r[j, i], r[j, j] = c, -s, s, c
    return r


def _transform(translation, rotation, scale):
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * np.broadcast_to(np.asarray(scale, float), 3)
    matrix[:3, 3] = translation
    return matrix


def object_matrix(entry):
    if "rotation" in entry:
        rotation = _quaternion(entry["rotation"])
    else:
        x, y, z = entry.get("rotation_deg", [0, 0, 0])
        rotation = _about(2, z) @ _about(1, y) @ _about(0, x)
    return _transform(entry.get("translation", [0, 0, 0]), rotation, entry.get("scale", 1.0))


def camera_matrix(camera):
    if "world_from_camera" in camera:
        return np.array(camera["world_from_camera"], float)
    position = np.array(camera["position"], float)
    back = position - np.array(camera["look_at"], float)
    back /= np.linalg.norm(back)
    right = np.cross(camera.get("up", [0, 1, 0]), back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(back, right), back, position], axis=1)
    return matrix


def _rgb(values):
    return {"type": "rgb", "value": [float(v) for v in values[:3]]}


def _material(entry):
    m = entry.get("material")
    if m is None:
        raise Unsupported("an object without `material`")
    colour = m.get("base_color", [1, 1, 1])
    known = {"base_color", "metallic", "roughness", "specular", "ior", "transmission"}
    if set(m) - known or colour[3:] not in ([], [1.0]):
        raise Unsupported(f"material {m}")
    metallic, transmission = m.get("metallic", 0.0), m.get("transmission", 0.0)
    roughness = m.get("roughness", 1.0)
    white = all(c == 1.0 for c in colour[:3])
    if metallic == 0.0 and transmission == 0.0 and m.get("specular", 1.0) == 0.0:
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _rgb(colour)}}
    if metallic == 1.0 and white and roughness == 0.0:
        return {"type": "twosided", "bsdf": {"type": "conductor", "material": "none"}}
    if metallic == 1.0 and white:
        return {
            "type": "twosided",
            "bsdf": {
                "type": "roughconductor",
                "material": "none",
                "distribution": "ggx",
                "alpha": roughness * roughness,
            },
        }
    if transmission == 1.0 and metallic == 0.0 and white and roughness == 0.0 and m.get("specular", 1.0) == 1.0:
        return {"type": "dielectric", "int_ior": float(m.get("ior", 1.5)), "ext_ior": 1.0}
    raise Unsupported(f"material {m}")


def _mesh(name, triangles, properties):
    props = mi.Properties()
    for key, value in properties.items():
        props[key] = mi.load_dict(value)
    mesh = mi.Mesh(name, len(triangles.positions), len(triangles.faces), props=props, has_vertex_normals=True)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(triangles.positions).astype(np.float32)
    parameters["vertex_normals"] = np.ravel(triangles.normals).astype(np.float32)
    parameters["faces"] = np.ravel(triangles.faces).astype(np.uint32)
    parameters.update()
    return mesh


def _quad_light(entry):
    """Black, emits to the side of edge_u x edge_v."""
    corner, u, v = (np.array(entry[key], float) for key in ("corner", "edge_u", "edge_v"))
    properties = {
        "bsdf": {"type": "diffuse", "reflectance": _rgb([0, 0, 0])},
        "emitter": {"type": "area", "radiance": _rgb(entry["radiance"])},
    }
    if abs(u @ v) > 1e-6 * np.linalg.norm(u) * np.linalg.norm(v):
        return _mesh("light", quad(corner, u, v), properties)
    matrix = np.eye(4)
    normal = np.cross(u, v)
    matrix[:3] = np.stack([u / 2, v / 2, normal / np.linalg.norm(normal), corner + (u + v) / 2], axis=1)
    return {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), **properties}


def read_image(path):
    """Linear RGB, float64; 8- and 16-bit files are decoded from sRGB."""
    bitmap = mi.Bitmap(str(path))
    encoded = bitmap.component_format() in (mi.Struct.Type.UInt8, mi.Struct.Type.UInt16)
    raw = np.array(bitmap)[..., :3]
    if not encoded:
        return raw.astype(np.float64)
    code = raw / float(np.iinfo(raw.dtype).max)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def environment_emitter(entry, folder):
    scale = float(entry.get("scale", 1.0))
    if "radiance" in entry:
        return {"type": "constant", "radiance": _rgb(np.array(entry["radiance"]) * scale)}
    texels = read_image(folder / entry["image"]) * scale
    height = len(texels)
    # mixray's rows have their centres at (j + 0.5) / height and are constant beyond the first and last; Mitsuba's first and last row lie
    # on the poles. 2 * height + 1 rows hold the same piecewise linear function exactly. Both centre columns at (i + 0.5) / width.
    at = np.clip(np.arange(2 * height + 1) / 2.0 - 0.5, 0.0, height - 1.0)
    low = np.minimum(at.astype(int), height - 2)
    fraction = (at - low)[:, None, None]
    rows = texels[low] * (1.0 - fraction) + texels[low + 1] * fraction
    # Mitsuba's left edge looks along -Z, mixray's centre does.
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180.0 + float(entry.get("rotation_deg", 0.0)))
    return {"type": "envmap", "bitmap": mi.Bitmap(rows.astype(np.float32)), "to_world": turn}


class PeerScene:
    """A scene file, at its camera's size divided by `shrink`."""

    def __init__(self, path, shrink=1):
        self.path = Path(path)
        self.shrink = shrink
        with open(path, "rb") as file:
            self.toml = tomllib.load(file)
        unknown = set(self.toml) - {"photo", "camera", "lens", "environment", "light", "real", "virtual", "render"}
        photo = self.toml.get("photo", {})
        if unknown or photo.get("exposure_ev", 0.0) != 0.0:
            raise Unsupported(f"{path}: {unknown or 'exposure'}")
        camera = self.toml["camera"]
        if any(key in camera for key in ("cx", "cy", "distortion")) or camera.get("fx") != camera.get("fy"):
            raise Unsupported(f"{path}: only centred, undistorted square pixels")
        self.photo = None
        if "image" in photo:
            full = read_image(self.path.parent / photo["image"])
            height, width = (side // shrink for side in full.shape[:2])
            self.photo = full[: height * shrink, : width * shrink].reshape(height, shrink, width, shrink, 3).mean((1, 3))
        elif "environment" in self.toml:
            raise Unsupported(f"{path}: an environment without a photograph is not drawn")
        else:
            height, width = camera["height"] // shrink, camera["width"] // shrink
        self.width, self.height = width, height
        self.max_bounces = self.toml.get("render", {}).get("max_bounces", 4)

    def _sensor(self, sampler, rays_per_pixel):
        camera = self.toml["camera"]
        lens = self.toml.get("lens", {})
        if lens.get("aperture", "disc") != "disc":
            raise Unsupported("an aperture other than a disc")
        if "vertical_fov_deg" in camera:
            fov = camera["vertical_fov_deg"]
        else:
            fov = math.degrees(2.0 * math.atan(self.height * self.shrink / (2.0 * camera["fy"])))
        if "f_number" in lens:
            radius = lens["focal_length_mm"] / (2000.0 * lens["f_number"])
        else:
            radius = lens.get("aperture_radius_m", 0.0)
        # Mitsuba's camera looks along +Z with +X to the left.
        pose = camera_matrix(camera) @ np.diag([-1.0, 1.0, -1.0, 1.0])
        optics = {"type": "perspective"}
        if radius > 0.0:
            optics = {"type": "thinlens", "aperture_radius": radius, "focus_distance": lens["focus_distance_m"]}
        return {
            **optics,
            "fov": fov,
            "fov_axis": "y",
            "near_clip": 1e-3,
            "far_clip": 1e6,
            "to_world": mi.ScalarTransform4f(pose),
            "film": {
                "type": "hdrfilm",
                "width": self.width,
                "height": self.height,
                "rfilter": {"type": "box"},
                "component_format": "float32",
            },
            "sampler": {"type": sampler, "sample_count": rays_per_pixel},
        }

    def _objects(self, key):
        """(entry, triangles in world space) of every part."""
        for entry in self.toml.get(key, []):
            shape = entry.get("shape")
            if shape == "sphere":
                parts = [(sphere(entry.get("segments", 160)), np.eye(4))]
            elif shape == "quad":
                parts = [(quad(entry["corner"], entry["edge_u"], entry["edge_v"]), np.eye(4))]
            elif shape == "box":
                parts = [(box(entry.get("size", [1, 1, 1])), np.eye(4))]
            else:
                parts = glb(self.path.parent / entry["mesh"])
            for triangles, object_from_local in parts:
                yield entry, triangles.placed(object_matrix(entry) @ object_from_local)

    def has_caustics(self):
        """Something virtual is smooth metal or glass."""
        materials = [entry.get("material", {}) for entry in self.toml.get("virtual", [])]
        smooth = (m for m in materials if m.get("roughness", 1.0) == 0.0)
        return any(max(m.get("metallic", 0.0), m.get("transmission", 0.0)) > 0.0 for m in smooth)

    def world(self, mixed, sampler, rays_per_pixel, integrator="path"):
        """The real world, or with the virtual things in it the mixed one; `integrator` is "path", or "ptracer" from the lights' side."""
        scene = {
            "type": "scene",
            "integrator": {
                "type": integrator,
                # Mitsuba counts the emitter's own vertex: 2 is direct light.
                "max_depth": self.max_bounces + 1,
                "rr_depth": NEVER,
            },
            "sensor": self._sensor(sampler, rays_per_pixel),
        }
        for key in ("real", "virtual") if mixed else ("real",):
            for i, (entry, triangles) in enumerate(self._objects(key)):
                mesh = _mesh(key, triangles, {"bsdf": _material(entry)})
                if key == "virtual":
                    mesh.add_attribute(VIRTUAL, 1, np.ones(len(triangles.faces), np.float32))
                scene[f"{key}_{i}"] = mesh
        for i, entry in enumerate(self.toml.get("light", [])):
            virtual = entry.get("side", "real") == "virtual"
            if virtual and (not mixed or entry["kind"] == "quad"):
                if mixed:
                    raise Unsupported("a virtual quad light")
                continue
            if entry["kind"] == "quad":
                scene[f"light_{i}"] = _quad_light(entry)
            elif entry["kind"] == "point":
                scene[f"light_{i}"] = {
                    "type": "point",
                    "position": [float(x) for x in entry["position"]],
                    "intensity": _rgb(entry["intensity"]),
                }
            elif entry["kind"] == "directional":
                scene[f"light_{i}"] = {
                    "type": "directional",
                    "direction": [float(x) for x in entry["direction"]],
                    "irradiance": _rgb(entry["irradiance"]),
                }
            else:
                raise Unsupported(f"light {entry['kind']}")
        if "environment" in self.toml:
            scene["environment"] = environment_emitter(self.toml["environment"], self.path.parent)
        return mi.load_dict(scene)

    def composite(self, mask, mixed, real):
        """Eq. 4 of Kan and Kaufmann 2012."""
        ic = 0.0 if self.photo is None else self.photo
        return mask * mixed + (1.0 - mask) * (ic + mixed - real)


class Mask(mi.SamplingIntegrator):
    """1 where the primary ray meets virtual geometry first."""

    def sample(self, scene, sampler, ray, medium=None, active=True):
        si = scene.ray_intersect(ray, active)
        hit = si.is_valid() & active
        virtual = hit & si.shape.has_attribute(VIRTUAL, hit)
        return mi.Spectrum(dr.select(virtual, mi.Float(1.0), mi.Float(0.0))), hit, []


class Passes:
    """The two passes and the mask, with one seed: the same primary rays in each."""

    def __init__(self, scene, sampler, rays_per_pixel, integrator="path"):
        self.mixed_world = scene.world(True, sampler, rays_per_pixel, integrator)
        self.real_world = scene.world(False, sampler, rays_per_pixel, integrator)
        self.mask_integrator = Mask(mi.Properties())

    def mask(self, seed):
        return _pixels(mi.render(self.mixed_world, integrator=self.mask_integrator, seed=seed))[..., :1]

    def mixed(self, seed):
        return _pixels(mi.render(self.mixed_world, seed=seed))

    def real(self, seed):
        return _pixels(mi.render(self.real_world, seed=seed))


def _pixels(image):
    return np.array(image, np.float64)[..., :3]
