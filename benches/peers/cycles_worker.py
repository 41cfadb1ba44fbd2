#!/usr/bin/env python3
"""Renders worlds in Blender's Cycles on request; `cycles_scene.py` starts it with a Python that has `bpy`, and talks to it in lines of JSON.

The first line names the folder of world.json and meshes.npz. Then each request, {"world", "samples", "seed", "out"}, is answered with the CPU
seconds of all threads. `world` is "mixed", "real" or "catcher": Cycles' shadow catcher, which gives a factor on the photograph.
"""

import json
import math
import resource
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix


def material(description):
    made = bpy.data.materials.new("material")
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    shader = nodes.new("ShaderNodeBsdfDiffuse" if description["kind"] == "diffuse" else "ShaderNodeBsdfGlossy")
    shader.inputs["Color"].default_value = (*description["color"], 1.0)
    shader.inputs["Roughness"].default_value = 0.0
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    return made


def add_mesh(scene, positions, normals, faces, description):
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(positions.tolist(), [], faces.tolist())
    mesh.normals_split_custom_set_from_vertices(normals.tolist())
    mesh.materials.append(material(description))
    thing = bpy.data.objects.new("mesh", mesh)
    scene.collection.objects.link(thing)
    return thing


def add_quad_light(scene, entry):
    corner, u, v = (np.array(entry[key]) for key in ("corner", "edge_u", "edge_v"))
    width, height = np.linalg.norm(u), np.linalg.norm(v)
    light = bpy.data.lights.new("light", "AREA")
    light.shape, light.size, light.size_y = "RECTANGLE", width, height
    strength = max(entry["radiance"])
    light.color = [c / strength for c in entry["radiance"]]
    # Blender's watts: what a Lambertian emitter sends out.
    light.energy = math.pi * width * height * strength
    thing = bpy.data.objects.new("light", light)
    # It shines along its -Z.
    matrix = np.eye(4)
    matrix[:3] = np.stack([u / width, -v / height, -np.cross(u, v) / (width * height), corner + (u + v) / 2], axis=1)
    thing.matrix_world = Matrix(matrix.tolist())
    scene.collection.objects.link(thing)
    return thing


def add_camera(scene, camera):
    data = bpy.data.cameras.new("camera")
    data.sensor_fit = "VERTICAL"
    data.angle_y = math.radians(camera["vertical_fov_deg"])
    data.clip_start, data.clip_end = 1e-3, 1e6
    if camera["aperture_radius_m"] > 0.0:
        data.dof.use_dof = True
        data.dof.focus_distance = camera["focus_distance_m"]
        # Blender's f-number speaks of a lens in millimetres.
        data.dof.aperture_fstop = data.lens / (2000.0 * camera["aperture_radius_m"])
    thing = bpy.data.objects.new("camera", data)
    thing.matrix_world = Matrix(camera["world_from_camera"])
    scene.collection.objects.link(thing)
    scene.camera = thing


def settings(scene, world):
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = world["width"], world["height"], 100
    render.use_persistent_data = True
    render.threads_mode, render.threads = "FIXED", world["threads"]
    image = render.image_settings
    image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_depth, image.use_exr_interleave = "OPEN_EXR_MULTILAYER", "32", True
    c = scene.cycles
    c.device, c.use_adaptive_sampling, c.use_denoising = "CPU", False, False
    bounces = world["max_bounces"] - 1
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = bounces
    c.min_light_bounces = bounces
    c.blur_glossy, c.sample_clamp_direct, c.sample_clamp_indirect = 0.0, 0.0, 0.0
    c.light_sampling_threshold = 0.0
    c.pixel_filter_type, c.filter_width = "BOX", 1.0


def background(scene, radiance):
    world = bpy.data.worlds.new("world")
    scene.world = world
    node = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    node.inputs["Color"].default_value = (*radiance, 1.0)


def build(folder):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    world = json.loads((folder / "world.json").read_text())
    arrays = np.load(folder / "meshes.npz")
    settings(scene, world)
    background(scene, world["background"])
    add_camera(scene, world["camera"])
    lights = [add_quad_light(scene, entry) for entry in world["lights"]]
    things = {"real": [], "virtual": []}
    for i, mesh in enumerate(world["meshes"]):
        parts = (arrays[f"{part}_{i}"] for part in ("positions", "normals", "faces"))
        things[mesh["side"]].append(add_mesh(scene, *parts, mesh["material"]))
    return scene, things, lights


def arrange(scene, things, lights, which):
    catcher = which == "catcher"
    for thing in things["virtual"]:
        thing.hide_render = which == "real"
    for thing in things["real"]:
        thing.is_shadow_catcher = catcher
    for light in lights:
        light.visible_camera = not catcher
    scene.render.film_transparent = catcher
    for layer in scene.view_layers:
        layer.cycles.use_pass_shadow_catcher = catcher
        layer.update_render_passes()


def cpu_secs():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def main():
    # What Blender prints would be taken for answers.
    answers = open(3, "w", buffering=1)
    scene, things, lights = build(Path(json.loads(sys.stdin.readline())))
    for line in sys.stdin:
        request = json.loads(line)
        arrange(scene, things, lights, request["world"])
        scene.cycles.samples, scene.cycles.seed = request["samples"], request["seed"]
        scene.render.filepath = request["out"]
        # Without it the old number of samples stays in force.
        scene.update_tag()
        scene.view_layers[0].update()
        start = cpu_secs()
        bpy.ops.render.render(write_still=True)
        answers.write(json.dumps(cpu_secs() - start) + "\n")


if __name__ == "__main__":
    main()
