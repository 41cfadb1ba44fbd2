"""Lamps and the world as mixray's lights and environment."""

from . import convert


def color_of(light):
    """Colour of a lamp with its temperature and exposure, which Blender has from 4.5 on."""
    color = list(light.color)
    if getattr(light, "use_temperature", False):
        color = [c * t for c, t in zip(color, light.temperature_color)]
    return convert.scaled(color, 2.0 ** getattr(light, "exposure", 0.0))


def export_light(thing, matrix, report):
    """(table of the scene file, its entry) of a lamp: [[light]], or [[real]] and [[virtual]] for bulbs."""
    light = thing.data
    side = "virtual" if thing.mixray.is_added else "real"
    color, power_w = color_of(light), light.energy
    _note_what_is_lost(thing, report)
    if light.type == "POINT" and light.shadow_soft_size > 0.0:
        report.add(thing.name, "it is a ball that shines, and stops the light of other lamps")
        entry = convert.bulb(matrix, color=color, power_w=power_w, radius_m=light.shadow_soft_size)
        return side, {"name": thing.name, **entry}
    if light.type == "POINT":
        entry = convert.point_light(matrix, color=color, power_w=power_w)
    elif light.type == "SPOT":
        entry = convert.spot_light(matrix, color=color, power_w=power_w, angle_rad=light.spot_size, blend=light.spot_blend)
    elif light.type == "SUN":
        entry = convert.sun(matrix, color=color, irradiance=power_w)
    else:
        size_y = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
        entry = convert.area_light(matrix, color=color, power_w=power_w, shape=light.shape, size_x=light.size, size_y=size_y)
    return "light", {**entry, "side": side}


def _note_what_is_lost(thing, report):
    light, name = thing.data, thing.name
    if light.use_nodes and light.node_tree and not _is_plain(light.node_tree):
        report.add(name, "its shader nodes are not carried; colour and power are")
    if not getattr(light, "normalize", True):
        report.add(name, "its power is taken as normalised by its area")
    if not light.use_shadow:
        report.add(name, "it casts shadows in mixray")
    if light.type == "SPOT":
        if light.shadow_soft_size > 0.0:
            report.add(name, "the radius of a spot is not carried: its shadows are hard")
        if light.use_square:
            report.add(name, "its square cone is taken as round")
        if light.spot_blend > 0.0:
            report.add(name, "the penumbra of its cone has the same flux and another profile")
    if light.type == "SUN" and light.angle > 0.0:
        report.add(name, "the sun's angle is not carried: its shadows are hard")
    if light.type == "AREA":
        if light.shape in ("DISK", "ELLIPSE"):
            report.add(name, "its disc is taken as a rectangle of the same area")
        if light.spread < 3.14159:
            report.add(name, "its spread is taken as 180 degrees")


def _is_plain(tree):
    """A default emission alone."""
    for node in tree.nodes:
        if node.type not in ("EMISSION", "OUTPUT_LIGHT"):
            return False
        if node.type == "EMISSION" and (node.inputs["Strength"].default_value != 1.0 or min(node.inputs["Color"].default_value[:3]) < 1.0):
            return False
    return True


def export_world(world, image_path, report):
    """[environment], or None; `image_path` gives the file of an image as the scene file names it."""
    if world is None:
        return None
    tree = world.node_tree if world.use_nodes else None
    if tree is None:
        return {"radiance": list(world.color)}
    output = next((node for node in tree.nodes if node.type == "OUTPUT_WORLD" and node.is_active_output), None)
    surface = output and output.inputs["Surface"]
    if not surface or not surface.is_linked:
        return None
    if output.inputs["Volume"].is_linked:
        report.add(world.name, "its volume is not carried")
    background = surface.links[0].from_node
    if background.type != "BACKGROUND" or background.inputs["Strength"].is_linked:
        report.add(world.name, "its nodes are not carried: only a Background of a colour or of an Environment Texture is")
        return None
    strength, color = background.inputs["Strength"].default_value, background.inputs["Color"]
    if not color.is_linked:
        return {"radiance": list(color.default_value[:3]), "scale": strength}
    texture = color.links[0].from_node
    if texture.type != "TEX_ENVIRONMENT" or texture.image is None or texture.projection != "EQUIRECTANGULAR":
        report.add(world.name, "its colour is not carried: only a colour or an equirectangular Environment Texture is")
        return None
    if texture.image.colorspace_settings.name not in ("Linear Rec.709", "Linear", "Non-Color", "sRGB"):
        report.add(texture.image.name, f"its colour space {texture.image.colorspace_settings.name} is taken as linear Rec.709")
    return {
        "image": image_path(texture.image),
        "rotation_deg": _rotation_deg(texture, world.name, report),
        "scale": strength,
    }


def _rotation_deg(texture, name, report):
    """Of an Environment Texture whose directions may go through a Mapping node."""
    vector = texture.inputs["Vector"]
    if not vector.is_linked:
        return convert.environment_rotation_deg(0.0)
    mapping = vector.links[0].from_node
    if mapping.type != "MAPPING":
        if mapping.type != "TEX_COORD":
            report.add(name, "what turns its image is not carried: only the Z rotation of a Mapping node is")
        return convert.environment_rotation_deg(0.0)
    x, y, z = mapping.inputs["Rotation"].default_value
    moved = "Location" in mapping.inputs and any(mapping.inputs["Location"].default_value)
    if x or y or moved or tuple(mapping.inputs["Scale"].default_value) != (1.0, 1.0, 1.0):
        report.add(name, "of its Mapping only the Z rotation is carried")
    return convert.environment_rotation_deg(z, mapping.vector_type == "TEXTURE")
