"""Objects as glTF files: real ones, and virtual ones with their animation."""

import bpy

from . import convert
from .photograph import relative
from .report import Refused

SOLID = ("MESH", "CURVE", "SURFACE", "FONT")
PASSIVE = ("EMPTY", "ARMATURE", "LATTICE", "CAMERA", "LIGHT", "SPEAKER", "LIGHT_PROBE")
REAL, UNTEXTURED, VIRTUAL = "real", "real-from-photo", "virtual"


def sort_objects(scene, view_layer, report):
    """The view layer's objects that render, by the file that takes them."""
    real = scene.mixray.real_collection
    in_collection = set(real.all_objects) if real else set()
    groups = {REAL: [], UNTEXTURED: [], VIRTUAL: []}
    for thing in view_layer.objects:
        if thing.hide_render or thing.type in ("CAMERA", "LIGHT", "SPEAKER", "LIGHT_PROBE", "LATTICE"):
            continue
        if thing.type not in SOLID + PASSIVE:
            report.add(thing.name, f"a {thing.type.lower()} is not carried; convert it to a mesh")
            continue
        if not thing.visible_get():
            report.add(thing.name, "it is hidden in the viewport and left out")
            continue
        if len(thing.particle_systems):
            report.add(thing.name, "its particles are not carried; make instances real, or convert hair to a mesh")
        is_real = thing.is_shadow_catcher or thing in in_collection
        if is_real and _moves(thing):
            report.add(thing.name, f"it is real and stands still, as at frame {scene.frame_current}")
        if is_real and thing.type in SOLID and not any(slot.material for slot in thing.material_slots):
            groups[UNTEXTURED].append(thing)
        else:
            groups[REAL if is_real else VIRTUAL].append(thing)
        for slot in thing.material_slots:
            if slot.material is not None:
                _check_material(slot.material, report)
    return groups


def _moves(thing):
    """Something animates it, or what it hangs from."""
    while thing is not None:
        if thing.constraints or (thing.animation_data and (thing.animation_data.action or thing.animation_data.drivers)):
            return True
        thing = thing.parent
    return False


def _check_material(material, report):
    """Names what glTF's materials do not have."""
    name = f"material {material.name}"
    if not material.use_nodes or material.node_tree is None:
        return
    output = material.node_tree.get_output_node("CYCLES") or material.node_tree.get_output_node("ALL")
    if output is None or not output.inputs["Surface"].is_linked:
        report.add(name, "it has no surface")
        return
    for socket in ("Volume", "Displacement"):
        if output.inputs[socket].is_linked:
            report.add(name, f"its {socket.lower()} is not carried")
    shader = output.inputs["Surface"].links[0].from_node
    if shader.type not in ("BSDF_PRINCIPLED", "EMISSION"):
        report.add(name, f"a {shader.bl_label} node is not carried as such; use Principled BSDF")
        return
    for socket in shader.inputs:
        if socket.is_linked and socket.links[0].from_node.type not in ("TEX_IMAGE", "NORMAL_MAP", "SEPARATE_COLOR", "MIX", "MATH", "VERTEX_COLOR", "ATTRIBUTE"):
            report.add(name, f"{socket.name} comes from a {socket.links[0].from_node.bl_label} node, which is not carried; bake it")
    if shader.type == "BSDF_PRINCIPLED":
        for socket in ("Subsurface Weight", "Anisotropic", "Sheen Weight", "Thin Film Thickness"):
            if socket in shader.inputs and (shader.inputs[socket].is_linked or shader.inputs[socket].default_value > 0.0):
                report.add(name, f"{socket} is not carried")


def write_glb(context, things, path, *, animated):
    """Writes objects, modifiers applied, in mixray's axes; returns the name of the animation in the file, or None."""
    scene, view_layer = context.scene, context.view_layer
    selected, active = [t for t in view_layer.objects if t.select_get()], view_layer.objects.active
    frame_end = scene.frame_end
    try:
        for thing in view_layer.objects:
            thing.select_set(thing in things)
        # An animation repeats: its last frame is the first again, unless it goes on for one more.
        scene.frame_end = frame_end + 1 if animated else frame_end
        bpy.ops.export_scene.gltf(
            filepath=str(path),
            export_format="GLB",
            # Else a file with several scenes has all of them, and its default may be another one.
            use_active_scene=True,
            use_selection=True,
            use_renderable=True,
            export_apply=True,
            export_gn_mesh=True,
            export_yup=True,
            export_cameras=False,
            export_lights=False,
            export_tangents=False,
            export_animations=animated,
            export_animation_mode="SCENE",
            export_anim_scene_split_object=False,
            export_frame_range=True,
            export_force_sampling=True,
            export_current_frame=not animated,
            export_negative_frame="CROP",
        )
    finally:
        scene.frame_end = frame_end
        for thing in view_layer.objects:
            thing.select_set(thing in selected)
        view_layer.objects.active = active
    document = convert.glb_document(path.read_bytes())
    if not document.get("meshes"):
        path.unlink()
        raise Refused(f"{path.stem} objects have no surface: {', '.join(t.name for t in things)}")
    animations = document.get("animations", [])
    return animations[0].get("name", "0") if animations else None


def export_objects(context, folder, report, *, animated):
    """[[real]] and [[virtual]] of the scene file, their meshes written into `folder`."""
    groups = sort_objects(context.scene, context.view_layer, report)
    tables = {"real": [], "virtual": []}
    for group, things in groups.items():
        if not any(t.type in SOLID or t.instance_type == "COLLECTION" for t in things):
            continue
        path = folder / f"{group}.glb"
        animation = write_glb(context, things, path, animated=animated and group == VIRTUAL)
        entry = {"name": group, "mesh": relative(path, folder)}
        if animation is not None:
            entry["animation"] = animation
        tables["virtual" if group == VIRTUAL else "real"].append(entry)
    if animated:
        _note_shape_changes(groups[VIRTUAL], report)
    return tables


def _note_shape_changes(things, report):
    lasting = ("ARMATURE", "MIRROR", "SUBSURF", "BEVEL", "SOLIDIFY", "ARRAY", "TRIANGULATE", "WEIGHTED_NORMAL", "EDGE_SPLIT", "DECIMATE", "REMESH", "WELD", "SCREW", "SKIN", "BOOLEAN", "WIREFRAME", "MULTIRES", "SMOOTH_BY_ANGLE")
    for thing in things:
        changing = [m.name for m in thing.modifiers if m.show_render and m.type not in lasting]
        if changing:
            report.add(thing.name, f"{', '.join(changing)}: the shape stays that of the first frame")
        keys = getattr(thing.data, "shape_keys", None)
        if keys and thing.modifiers:
            report.add(thing.name, "modifiers are applied, so its shape keys do not move")
