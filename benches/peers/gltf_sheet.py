#!/usr/bin/env python3
"""The sample glTF models by mixray and by Blender's Cycles, side by side on one contact sheet.

    pip install bpy pillow          # Blender as a Python module; it fixes the Python version (5.0 goes with 3.11)
    cargo build --release
    python3 benches/peers/gltf_sheet.py MODELS_FOLDER ENVIRONMENT.hdr OUT_FOLDER [--only NAME ...]

Both renderers read the model themselves (Blender through its own glTF importer), and see it from the same pinhole camera under the same
environment, against black. Each pair on OUT_FOLDER/sheet.png is mixray left, Cycles right; beside it stand the mean of each picture and the
RMSE between them, in linear radiance clipped at 1. The pictures stay out of the repository: some of the models may not be shown in it.

Known to differ: at grazing angles rough lobes are brighter in Cycles, which takes Smith's masking and shadowing together where glTF
multiplies them (up to 1.6 times on a fully rough metal); its dielectrics have the exact Fresnel factor, glTF's have Schlick's; its layers conserve
energy, glTF's can exceed it; coloured specular reflection takes its largest channel from what glTF transmits, channel by channel in Cycles; and
the importer leaves out vertex colours (the glass dish has some, and is up to a quarter darker with them).
"""

import argparse
import math
import subprocess
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from PIL import Image, ImageDraw

WIDTH, HEIGHT = 240, 180
BOUNCES = 32  # light that the rim of a glass dish guides along takes more than 8
MODES_WITH_TRIANGLES = ["04", "05", "06", "11", "12", "13", "14", "15"]


@dataclass
class View:
    """A model and where it is seen from."""

    path: str
    # From the model's centre to the camera.
    toward: tuple = (0.55, 0.35, 1.0)
    fov_deg: float = 35.0
    # Distance of the camera in radii of the model's bounding sphere, less than what shows all of it where a model is flat.
    fill: float = 1.0
    # Where the frame of the whole model would not do.
    position: tuple | None = None
    look_at: tuple | None = None


VIEWS = [
    View("AlphaBlendModeTest.glb", (0.0, 0.25, 1.0), fill=0.45),
    View("BoxInterleaved.glb"),
    View("BoxTextured.glb"),
    View("CesiumMilkTruck.glb"),
    View("ClearcoatTest.glb", (0.0, 0.0, 1.0), fill=0.55),
    View("DamagedHelmet.glb", fill=0.65),
    View("Duck.glb"),
    View("IridescentDishWithOlives.glb", (0.8, 0.5, 0.2), fill=0.6),
    View("PBR_Spheres.glb", (0.2, 0.1, 1.0), fill=0.9),
    View("TextureTransformTest/TextureTransformTest.gltf", (0.0, 0.0, 1.0), fill=0.75),
    View("box_sparse.glb"),
    View("cornellBox.glb", fov_deg=61.93, position=(0.0, 1.5, 4.5), look_at=(0.0, 1.5, 0.0)),
    View("stanford_bunny.glb"),
    View("Node_NegativeScale/Node_NegativeScale_01.gltf"),
    View("Node_NegativeScale/Node_NegativeScale_12.gltf"),
] + [View(f"Mesh_PrimitiveMode/Mesh_PrimitiveMode_{n}.gltf", (0.2, 0.1, 1.0)) for n in MODES_WITH_TRIANGLES]


def import_model(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(path))
    for thing in list(bpy.data.objects):
        if thing.type in ("CAMERA", "LIGHT"):
            bpy.data.objects.remove(thing)
    for material in bpy.data.materials:
        for node in material.node_tree.nodes if material.node_tree else []:
            if node.type == "BSDF_PRINCIPLED":
                node.distribution = "GGX"  # single scattering, as glTF has it
    give_default_material()


def give_default_material():
    """What names no material is a white, fully rough metal in glTF; the importer leaves it to Blender's default."""
    bare = [m for m in bpy.data.meshes if not any(m.materials)]
    if not bare:
        return
    material = bpy.data.materials.new("glTF default")
    principled = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    principled.distribution = "GGX"
    principled.inputs["Base Color"].default_value = (1, 1, 1, 1)
    principled.inputs["Metallic"].default_value = 1
    principled.inputs["Roughness"].default_value = 1
    for mesh in bare:
        mesh.materials.clear()
        mesh.materials.append(material)


def bounds():
    """In glTF's axes: Blender's importer turns Y up into Z up."""
    bpy.context.view_layer.update()
    corners = [
        thing.matrix_world @ vertex.co
        for thing in bpy.data.objects
        if thing.type == "MESH"
        for vertex in thing.data.vertices
    ]
    points = np.array([(c.x, c.z, -c.y) for c in corners])
    return points.min(axis=0), points.max(axis=0)


def frame(view):
    """Camera position and the point it looks at, in glTF's axes."""
    if view.position:
        return np.array(view.position), np.array(view.look_at)
    low, high = bounds()
    centre = (low + high) / 2
    toward = np.array(view.toward) / np.linalg.norm(view.toward)
    distance = view.fill * np.linalg.norm(high - low) / 2 / math.sin(math.radians(view.fov_deg) / 2)
    return centre + distance * toward, centre


def to_blender(v):
    return Vector((v[0], -v[2], v[1]))


def cycles(view, position, look_at, environment, out, samples):
    scene = bpy.context.scene
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "VERTICAL"
    data.angle_y = math.radians(view.fov_deg)
    distance = float(np.linalg.norm(look_at - position))
    data.clip_start, data.clip_end = distance * 1e-3, distance * 1e3
    camera = bpy.data.objects.new("camera", data)
    back = to_blender(position - look_at).normalized()
    right = Vector((0, 0, 1)).cross(back).normalized()
    up = back.cross(right)
    camera.matrix_world = Matrix.Translation(to_blender(position)) @ Matrix((right, up, back)).transposed().to_4x4()
    scene.collection.objects.link(camera)
    scene.camera = camera

    world = bpy.data.worlds.new("world")
    scene.world = world
    nodes, links = world.node_tree.nodes, world.node_tree.links
    coordinates = nodes.new("ShaderNodeTexCoord")
    mapping = nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = math.radians(-90)  # the centre column looks along glTF's -Z, not along +X
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(environment))
    background = next(n for n in nodes if n.type == "BACKGROUND")
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])

    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.film_transparent = True
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32"
    render.filepath = str(out)
    render.threads_mode, render.threads = "FIXED", 2
    c = scene.cycles
    c.device, c.samples, c.use_adaptive_sampling, c.use_denoising = "CPU", samples, False, False
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = BOUNCES
    c.transparent_max_bounces = 64
    c.blur_glossy, c.sample_clamp_indirect = 0.0, 0.0
    c.pixel_filter_type, c.filter_width = "BOX", 1.0
    bpy.ops.render.render(write_still=True)
    return read_pixels(out)


def read_pixels(path):
    """The RGB values as they stand in the file, first row on top."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    return np.array(image.pixels, np.float32).reshape(height, width, -1)[::-1, :, :3].copy()


def mixray(program, view, model, position, look_at, environment, folder, name, samples):
    def vector(v):
        return "[" + ", ".join(f"{x:.9g}" for x in v) + "]"

    scene = folder / f"{name}.toml"
    scene.write_text(
        f"""[camera]
width = {WIDTH}
height = {HEIGHT}
vertical_fov_deg = {view.fov_deg}
position = {vector(position)}
look_at = {vector(look_at)}
[environment]
image = "{environment}"
[[virtual]]
mesh = "{model}"
[render]
multiple_scattering = false
rays_per_pixel = {samples}
max_bounces = {BOUNCES + 1}
"""
    )
    out = folder / f"{name}.mixray.png"
    run = subprocess.run(
        [program, "render", scene, "-o", out, "--png-bits", "16", "--backend", "cpu"], capture_output=True, text=True
    )
    if run.returncode != 0:
        raise SystemExit(f"{name}: {run.stderr}")
    if run.stderr:
        print(name, run.stderr.strip())
    return decoded(read_pixels(out))


def decoded(x):
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def encoded(linear):
    x = np.clip(linear, 0.0, 1.0)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return Image.fromarray((x * 255 + 0.5).astype(np.uint8))


def sheet(pairs, path):
    columns, label = 2, 16
    rows = -(-len(pairs) // columns)
    canvas = Image.new("RGB", (columns * (2 * WIDTH + 12), rows * (HEIGHT + label + 4)), (40, 40, 40))
    draw = ImageDraw.Draw(canvas)
    for i, (name, text, ours, theirs) in enumerate(pairs):
        x, y = (i % columns) * (2 * WIDTH + 12) + 2, (i // columns) * (HEIGHT + label + 4)
        draw.text((x, y + 2), f"{name}   {text}", fill=(230, 230, 230))
        canvas.paste(encoded(ours), (x, y + label))
        canvas.paste(encoded(theirs), (x + WIDTH + 4, y + label))
    canvas.save(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", type=Path)
    parser.add_argument("environment", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="parts of the names of the models to render")
    parser.add_argument("--samples", type=int, default=64, help="rays per pixel of both renderers")
    parser.add_argument("--program", default="target/release/mixray")
    arguments = parser.parse_args()
    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    environment = arguments.environment.resolve()
    pairs = []
    for view in VIEWS:
        name = Path(view.path).stem
        if arguments.only and not any(part in name for part in arguments.only):
            continue
        model = (arguments.models / view.path).resolve()
        import_model(model)
        position, look_at = frame(view)
        ours = mixray(
            arguments.program, view, model, position, look_at, environment, out, name, arguments.samples
        )
        theirs = cycles(view, position, look_at, environment, out / f"{name}.cycles.exr", arguments.samples)
        a, b = np.clip(ours, 0, 1), np.clip(theirs, 0, 1)
        text = f"mean {a.mean():.4f} / {b.mean():.4f}, RMSE {np.sqrt(np.mean((a - b) ** 2)):.4f}"
        print(f"{name}: {text}", flush=True)
        pairs.append((name, text, ours, theirs))
        sheet(pairs, out / "sheet.png")
    print(out / "sheet.png")


if __name__ == "__main__":
    main()
