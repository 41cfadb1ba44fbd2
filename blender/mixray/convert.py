"""From Blender's numbers to mixray's, in plain Python: nothing here knows `bpy`, so that it is tested without Blender.

Matrices are four rows of four numbers. Blender's world has Z up, mixray's has Y up; both cameras look along their -Z with +Y up.
Colours are linear Rec.709. Pixels count from the top left corner, the first pixel's centre at (0.5, 0.5).
"""

import json
import math
import struct


def point_y_up(point):
    """(x, y, z) of Blender's world in mixray's."""
    x, y, z = point
    return [x, z, -y]


def matrix_y_up(rows):
    """A world-from-anything matrix of Blender's world as one of mixray's."""
    x, y, z, w = (list(row) for row in rows)
    return [x, z, [-value for value in y], w]


def without_scale(rows):
    """A camera's pose: its columns of unit length, as Blender takes a camera that is scaled."""
    lengths = [math.sqrt(sum(rows[i][j] ** 2 for i in range(3))) for j in range(3)]
    return [[*(row[j] / lengths[j] for j in range(3)), row[3]] for row in rows[:3]] + [[0.0, 0.0, 0.0, 1.0]]


def intrinsics(*, lens_mm, sensor_width_mm, sensor_height_mm, sensor_fit, shift, size, pixel_aspect=1.0):
    """fx, fy, cx, cy of a perspective camera.

    `size`: pixels; `pixel_aspect`: height of a pixel over its width; `shift`: Blender's, in units of the side that the sensor fits.
    """
    width, height = size
    tall = height * pixel_aspect
    fits_width = sensor_fit == "HORIZONTAL" or (sensor_fit == "AUTO" and width >= tall)
    sensor_mm = sensor_height_mm if sensor_fit == "VERTICAL" else sensor_width_mm
    side = width if fits_width else tall
    fx = lens_mm / sensor_mm * side
    return {
        "fx": fx,
        "fy": fx / pixel_aspect,
        "cx": 0.5 * width - shift[0] * side,
        "cy": 0.5 * height + shift[1] * side / pixel_aspect,
    }


def lens(*, lens_mm, f_number, focus_distance_m, blades, rotation_rad):
    """[lens] of an open aperture. A polygon of Cycles has the middle of a side, mixray's a corner, at its angle of rotation."""
    table = {
        "f_number": f_number,
        "focal_length_mm": lens_mm,
        "focus_distance_m": focus_distance_m,
        "aperture": "disc",
    }
    if blades >= 3:
        table["aperture"] = blades
        table["blade_rotation_deg"] = math.degrees(rotation_rad) + 180.0 / blades
    return table


def view_depth(world_from_camera, point):
    """Distance of a point along the view axis."""
    return sum(-world_from_camera[i][2] * (point[i] - world_from_camera[i][3]) for i in range(3))


def scaled(color, factor):
    return [factor * channel for channel in color]


def area_light(world_from_light, *, color, power_w, shape, size_x, size_y):
    """A quad of the same area and power: radiance = power / (pi area). It shines along the light's -Z."""
    if shape in ("SQUARE", "DISK"):
        size_y = size_x
    if shape in ("DISK", "ELLIPSE"):
        size_x, size_y = (side * 0.5 * math.sqrt(math.pi) for side in (size_x, size_y))
    m = matrix_y_up(world_from_light)
    u = [m[i][0] * size_x for i in range(3)]
    v = [-m[i][1] * size_y for i in range(3)]
    normal = _cross(u, v)
    if sum(normal[i] * m[i][2] for i in range(3)) > 0.0:
        u, v = v, u
    area = math.sqrt(sum(n * n for n in normal))
    return {
        "kind": "quad",
        "corner": [m[i][3] - 0.5 * (u[i] + v[i]) for i in range(3)],
        "edge_u": u,
        "edge_v": v,
        "radiance": scaled(color, power_w / (math.pi * area)),
    }


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _position(world_from_light):
    return [row[3] for row in matrix_y_up(world_from_light)[:3]]


def _direction(world_from_light):
    axis = [-row[2] for row in matrix_y_up(world_from_light)[:3]]
    length = math.sqrt(sum(a * a for a in axis))
    return [a / length for a in axis]


def point_light(world_from_light, *, color, power_w):
    return {
        "kind": "point",
        "position": _position(world_from_light),
        "intensity": scaled(color, power_w / (4.0 * math.pi)),
    }


def bulb(world_from_light, *, color, power_w, radius_m):
    """A point light with a radius: a ball that shines, for [[real]]. Its intensity is radiance times pi radius^2."""
    radiance = scaled(color, power_w / (4.0 * math.pi) / (math.pi * radius_m**2))
    return {
        "shape": "sphere",
        "segments": 64,
        "translation": _position(world_from_light),
        "scale": radius_m,
        "material": {"base_color": [0.0, 0.0, 0.0], "specular": 0.0, "emissive": radiance},
    }


def spot_light(world_from_light, *, color, power_w, angle_rad, blend):
    """The penumbra is smoothstep in Cycles and a square in mixray: the inner angle is that of the same flux."""
    cos_outer = math.cos(0.5 * angle_rad)
    cos_inner = cos_outer + 0.75 * (1.0 - cos_outer) * blend
    outer_deg = math.degrees(0.5 * angle_rad)
    return {
        "kind": "spot",
        "position": _position(world_from_light),
        "direction": _direction(world_from_light),
        "intensity": scaled(color, power_w / (4.0 * math.pi)),
        "inner_deg": min(math.degrees(math.acos(cos_inner)), outer_deg * (1.0 - 1e-6)),
        "outer_deg": outer_deg,
    }


def sun(world_from_light, *, color, irradiance):
    return {
        "kind": "directional",
        "direction": _direction(world_from_light),
        "irradiance": scaled(color, irradiance),
    }


def environment_rotation_deg(mapping_rotation_z_rad, texture_mapping=False):
    """The centre column of Blender's equirectangular images looks along +X; a Mapping node turns directions, or as "Texture" the image."""
    turned = mapping_rotation_z_rad if texture_mapping else -mapping_rotation_z_rad
    return math.degrees(turned) - 90.0


def clip_intrinsics(*, focal_px, principal_px, size, pixel_aspect=1.0):
    """fx, fy, cx, cy of a movie clip's camera, whose principal point counts from the bottom left corner."""
    return {
        "fx": focal_px,
        "fy": focal_px * pixel_aspect,
        "cx": principal_px[0],
        "cy": size[1] - principal_px[1],
    }


def distortion(model, k, camera, size):
    """(OpenCV's coefficients, largest error of the conversion in pixels) of a movie clip's lens.

    `k`: of "POLYNOMIAL" k1 k2 k3; "BROWN" k1 k2 k3 k4 p1 p2; "DIVISION" and "NUKE" k1 k2. Polynomials go over as they are; the rest is
    fitted up to the picture's corners, as a quotient of polynomials of r^2.
    """
    if model == "POLYNOMIAL":
        return [k[0], k[1], 0.0, 0.0, k[2]], 0.0
    if model == "BROWN" and k[3] == 0.0:
        # Blender's pictures have y up.
        return [k[0], k[1], -k[4], k[5], k[2]], 0.0
    fx, fy, cx, cy = (camera[key] for key in ("fx", "fy", "cx", "cy"))
    corners = [((x - cx) / fx, (y - cy) / fy) for x in (0.0, size[0]) for y in (0.0, size[1])]
    farthest = max(math.hypot(*corner) for corner in corners)
    nuke_unit = 2.0 / size[0] * fx
    samples = []
    for i in range(1, 201):
        if model == "BROWN":
            r = 2.0 * farthest * i / 200
            factor = 1.0 + r**2 * (k[0] + r**2 * (k[1] + r**2 * (k[2] + r**2 * k[3])))
            if r * factor > farthest:
                break
            samples.append((r * r, factor))
            continue
        seen = farthest * i / 200
        s = (seen * nuke_unit) ** 2 if model == "NUKE" else seen**2
        factor = 1.0 + s * (k[0] + s * k[1])
        samples.append(((seen / factor) ** 2, factor))
    (k1, k2, k3), (k4, k5, k6) = fit_quotient(samples)
    error_px = 0.0
    for s, factor in samples:
        fitted = (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
        error_px = max(error_px, abs(fitted - factor) * math.sqrt(s) * max(fx, fy))
    p1, p2 = (-k[4], k[5]) if model == "BROWN" else (0.0, 0.0)
    return [k1, k2, p1, p2, k3, k4, k5, k6], error_px


def fit_quotient(samples):
    """Coefficients of s, s^2, s^3 above and below that make (1 + ...) / (1 + ...) go through (s, value), in the sense of least squares."""
    unit = max(s for s, _ in samples)
    rows, values = [], []
    for s, value in samples:
        t = s / unit
        rows.append([t, t**2, t**3, -value * t, -value * t**2, -value * t**3])
        values.append(value - 1.0)
    x = least_squares(rows, values)
    scale = [unit, unit**2, unit**3]
    return [a / u for a, u in zip(x[:3], scale)], [b / u for b, u in zip(x[3:], scale)]


def least_squares(rows, values):
    """By QR with modified Gram-Schmidt; a column that the others explain gets 0."""
    columns = [list(column) for column in zip(*rows)]
    n = len(columns)
    r = [[0.0] * n for _ in range(n)]
    b, beta = list(values), [0.0] * n
    for j in range(n):
        before = math.sqrt(sum(a * a for a in columns[j]))
        for i in range(j):
            r[i][j] = sum(p * q for p, q in zip(columns[i], columns[j]))
            columns[j] = [q - r[i][j] * p for p, q in zip(columns[i], columns[j])]
        length = math.sqrt(sum(a * a for a in columns[j]))
        if length <= 1e-9 * before:
            columns[j] = [0.0] * len(b)
            continue
        r[j][j] = length
        columns[j] = [a / length for a in columns[j]]
        beta[j] = sum(p * q for p, q in zip(columns[j], b))
        b = [q - beta[j] * p for p, q in zip(columns[j], b)]
    x = [0.0] * n
    for j in reversed(range(n)):
        if r[j][j] > 0.0:
            x[j] = (beta[j] - sum(r[j][i] * x[i] for i in range(j + 1, n))) / r[j][j]
    return x


def project(camera, coefficients, world_from_camera, point):
    """Pixel of a point of mixray's world, with OpenCV's model; None behind the camera."""
    depth = view_depth(world_from_camera, point)
    if depth <= 0.0:
        return None
    offset = [point[i] - world_from_camera[i][3] for i in range(3)]
    x = sum(world_from_camera[i][0] * offset[i] for i in range(3)) / depth
    y = -sum(world_from_camera[i][1] * offset[i] for i in range(3)) / depth
    k1, k2, p1, p2, k3, k4, k5, k6 = [*coefficients, *[0.0] * 8][:8]
    s = x * x + y * y
    radial = (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
    xd = x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x)
    yd = y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y
    return camera["fx"] * xd + camera["cx"], camera["fy"] * yd + camera["cy"]


def glb_document(data):
    """The JSON part of a .glb file's bytes."""
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length])


def toml(document):
    """The text of a scene file: tables, and lists of tables, of numbers, strings, lists and small tables."""
    lines = []
    for name, content in document.items():
        is_list = isinstance(content, list)
        for table in content if is_list else [content]:
            lines.append(f"[[{name}]]" if is_list else f"[{name}]")
            lines += [f"{key} = {_toml_value(value)}" for key, value in table.items()]
            lines.append("")
    return "\n".join(lines)


def _toml_value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
