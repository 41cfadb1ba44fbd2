import json
import math
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

HERE = Path(bpy.context.space_data.text.filepath if getattr(bpy.context.space_data, "text", None) else __file__).parent
SCENE = json.loads(SCENE)
NUMBERS = (HERE / SCENE["numbers"]).read_bytes()


def numbers(place, kind="f4"):
    """An array of the file beside the script."""
    offset, count = place
    return np.frombuffer(NUMBERS, "<" + kind, count, offset)


def image(name, entry, pixels, *, is_srgb, is_float=False):
    """A packed image of RGB or RGBA rows from the bottom."""
    made = bpy.data.images.new(name, entry["width"], entry["height"], alpha=True, float_buffer=is_float)
    made.colorspace_settings.name = "sRGB" if is_srgb else ("Linear Rec.709" if is_float else "Non-Color")
    rgba = np.ones((entry["width"] * entry["height"], 4), np.float32)
    pixels = pixels.reshape(len(rgba), -1)
    rgba[:, : pixels.shape[1]] = pixels
    made.pixels.foreach_set(rgba.ravel())
    made.pack()
    return made


def link(scene, name, data, matrix):
    thing = bpy.data.objects.new(name, data)
    thing.matrix_world = Matrix(matrix)
    scene.collection.objects.link(thing)
    return thing


def build_camera(scene, entry):
    render, data = scene.render, bpy.data.cameras.new("camera")
    render.resolution_x, render.resolution_y, render.resolution_percentage = entry["width"], entry["height"], 100
    aspect = entry["pixel_aspect"]
    render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, 1.0 / aspect), max(1.0, aspect)
    data.sensor_fit, data.sensor_width, data.lens = "HORIZONTAL", entry["sensor_width_mm"], entry["lens_mm"]
    data.shift_x, data.shift_y = entry["shift"]
    data.clip_start, data.clip_end = 1e-3, 1e6
    focus = entry["depth_of_field"]
    if focus:
        dof = data.dof
        dof.use_dof, dof.aperture_fstop, dof.focus_distance = True, focus["f_number"], focus["focus_distance_m"]
        dof.aperture_blades, dof.aperture_rotation = focus["blades"], math.radians(focus["rotation_deg"])
    scene.camera = link(scene, "camera", data, entry["matrix"])
    return data


def build_photo(camera, entry):
    if entry["kind"] == "codes":
        photo = image("photo", entry, numbers(entry["pixels"], "u1") / np.float32(255.0), is_srgb=True)
    else:
        photo = image("photo", entry, numbers(entry["pixels"]), is_srgb=False, is_float=True)
    background = camera.background_images.new()
    background.image = photo
    camera.show_background_images = True


def build_world(scene, entry):
    scene.world = bpy.data.worlds.new("environment")
    scene.world.use_nodes = True
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    background = next(node for node in nodes if node.type == "BACKGROUND")
    if entry is None:
        background.inputs["Strength"].default_value = 0.0
        return
    background.inputs["Strength"].default_value = entry["strength"]
    if "color" in entry:
        background.inputs["Color"].default_value = (*entry["color"], 1.0)
        return
    texture, mapping, coordinates = (nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord"))
    texture.image = image("environment", entry, numbers(entry["pixels"]), is_srgb=False, is_float=True)
    mapping.inputs["Rotation"].default_value[2] = math.radians(entry["mapping_rotation_deg"])
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], background.inputs["Color"])


def build_light(scene, entry):
    light = bpy.data.lights.new(entry["name"], entry["kind"])
    light.color, light.energy = entry["color"], entry["power_w"]
    if entry["kind"] == "SUN":
        light.angle = 0.0
    elif entry["kind"] == "AREA":
        light.shape = "RECTANGLE"
        light.size, light.size_y = entry["size"]
    else:
        light.shadow_soft_size = 0.0
    if entry["kind"] == "SPOT":
        light.spot_size, light.spot_blend = math.radians(entry["angle_deg"]), entry["blend"]
    thing = link(scene, entry["name"], light, entry["matrix"])
    # The mixray extension's, where it is installed.
    if hasattr(thing, "mixray"):
        thing.mixray.is_added = entry["is_added"]


def build_mesh(entry):
    mesh = bpy.data.meshes.new(entry["name"])
    triangles = numbers(entry["triangles"], "u4").reshape(-1, 3)
    mesh.from_pydata(numbers(entry["positions"]).reshape(-1, 3), [], triangles)
    corners = triangles.ravel()
    for index, uvs in enumerate(entry["uvs"]):
        uv = numbers(uvs).reshape(-1, 2)[corners].copy()
        uv[:, 1] = 1.0 - uv[:, 1]
        mesh.uv_layers.new(name=f"UV{index}").data.foreach_set("uv", uv.ravel())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(triangles), bool))
    mesh.normals_split_custom_set(numbers(entry["normals"]).reshape(-1, 3)[corners])
    # The object has the material.
    mesh.materials.append(None)
    return mesh


def build_material(entry, textures):
    made = bpy.data.materials.new(entry["name"] or "material")
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    plain = {
        "Base Color": entry["base_color"],
        "Metallic": entry["metallic"],
        "Roughness": entry["roughness"],
        "IOR": entry["ior"],
        "Alpha": entry["base_color"][3] if entry["has_alpha"] else 1.0,
        "Specular IOR Level": entry["specular_level"],
        "Specular Tint": (*entry["specular_tint"], 1.0),
        "Transmission Weight": entry["transmission"],
        "Coat Weight": entry["coat"],
        "Coat Roughness": entry["coat_roughness"],
    }
    emissive = entry["base_color"][:3] if entry["unlit"] else entry["emissive"]
    strength = max(emissive)
    if strength > 0.0:
        plain["Emission Color"] = (*(channel / strength for channel in emissive), 1.0)
        plain["Emission Strength"] = strength
    for name, value in plain.items():
        shader.inputs[name].default_value = value

    def texture(place):
        reference = entry[place]
        if reference is None:
            return None
        node, uv = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeUVMap")
        node.image, uv.uv_map = textures[reference["texture"]], f"UV{reference['uv_set']}"
        links.new(uv.outputs["UV"], node.inputs["Vector"])
        return node

    color, rough, normal, emission = (texture(f"{name}_texture") for name in ("base_color", "metallic_roughness", "normal", "emissive"))
    if color:
        links.new(times(made.node_tree, color.outputs["Color"], entry["base_color"]), shader.inputs["Base Color"])
        if entry["has_alpha"]:
            links.new(color.outputs["Alpha"], shader.inputs["Alpha"])
    if rough:
        channels = nodes.new("ShaderNodeSeparateColor")
        links.new(rough.outputs["Color"], channels.inputs["Color"])
        for channel, name in (("Green", "Roughness"), ("Blue", "Metallic")):
            factor = nodes.new("ShaderNodeMath")
            factor.operation, factor.inputs[1].default_value = "MULTIPLY", entry[name.lower()]
            links.new(channels.outputs[channel], factor.inputs[0])
            links.new(factor.outputs["Value"], shader.inputs[name])
    if normal:
        node = nodes.new("ShaderNodeNormalMap")
        node.inputs["Strength"].default_value = entry["normal_scale"]
        links.new(normal.outputs["Color"], node.inputs["Color"])
        links.new(node.outputs["Normal"], shader.inputs["Normal"])
    if emission and strength > 0.0:
        tint = [channel / strength for channel in emissive] + [1.0]
        links.new(times(made.node_tree, emission.outputs["Color"], tint), shader.inputs["Emission Color"])
    if entry["has_volume"]:
        add_thickness(made.node_tree)
    return made


def times(tree, socket, color):
    """A colour socket times a colour, as glTF has its factors."""
    if list(color[:3]) == [1.0, 1.0, 1.0]:
        return socket
    node = tree.nodes.new("ShaderNodeMix")
    node.data_type, node.blend_type = "RGBA", "MULTIPLY"
    node.inputs["Factor"].default_value = 1.0
    first, second = (s for s in node.inputs if s.type == "RGBA")
    second.default_value = (*color[:3], 1.0)
    tree.links.new(socket, first)
    return next(s for s in node.outputs if s.type == "RGBA")


def add_thickness(tree):
    """What tells Blender's glTF exporter that the mesh bounds a volume."""
    name = "glTF Material Output"
    group = bpy.data.node_groups.get(name)
    if group is None:
        group = bpy.data.node_groups.new(name, "ShaderNodeTree")
        group.interface.new_socket("Thickness", in_out="INPUT", socket_type="NodeSocketFloat")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs["Thickness"].default_value = 1.0


def build_geometry(scene, entry):
    textures = [
        image(t["name"], t, numbers(t["pixels"], "u1") / np.float32(255.0), is_srgb=t["is_srgb"]) for t in entry["textures"]
    ]
    materials = [build_material(material, textures) for material in entry["materials"]]
    meshes = [build_mesh(mesh) for mesh in entry["meshes"]]
    for thing in entry["objects"]:
        for part in thing["parts"]:
            made = link(scene, part["name"], meshes[part["mesh"]], part["matrix"])
            made.is_shadow_catcher = thing["is_real"]
            slot = made.material_slots[0]
            slot.link = "OBJECT"
            slot.material = None if part["material"] is None else materials[part["material"]]


def settings(scene, entry):
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.samples, cycles.seed, cycles.use_denoising = entry["samples"], entry["seed"], False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = entry["max_bounces"]
    cycles.sample_clamp_indirect = entry["clamp_indirect"]
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0


def main():
    scene = bpy.data.scenes.new(SCENE["name"])
    if bpy.context.window:
        bpy.context.window.scene = scene
    settings(scene, SCENE["settings"])
    camera = build_camera(scene, SCENE["camera"])
    if SCENE["photo"]:
        build_photo(camera, SCENE["photo"])
    build_world(scene, SCENE["environment"])
    for light in SCENE["lights"]:
        build_light(scene, light)
    build_geometry(scene, SCENE["geometry"])


main()
