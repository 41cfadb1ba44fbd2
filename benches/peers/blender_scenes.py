"""Three shots that Blender writes itself: an open aperture with blades, an animated object over a catcher, a tracked camera with distortion.

Each has a ground and a block that are real (catchers), and things that are added. The photograph is the real world as Cycles renders it.
"""

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

WIDTH, HEIGHT = 192, 144


def empty_scene(*, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.use_persistent_data = True
    scene.view_settings.view_transform = "Standard"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", samples
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 3
    cycles.sample_clamp_indirect, cycles.blur_glossy, cycles.light_sampling_threshold = 0.0, 0.0, 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.3, 0.4, 0.5, 1.0)
    return scene


def diffuse(name, color):
    """Lambertian on both sides of the glTF file."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.0
    return made


def box(name, *, centre, size, color, is_real=False):
    corners = [[(0.5 if i >> axis & 1 else -0.5) * size[axis] for axis in range(3)] for i in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return _mesh(name, corners, faces, centre, color, is_real)


def ground(color=(0.5, 0.45, 0.4)):
    s = 3.0
    return _mesh("ground", [(-s, -s, 0), (s, -s, 0), (s, s, 0), (-s, s, 0)], [(0, 1, 2, 3)], (0, 0, 0), color, True)


def ball(name, *, centre, radius, color):
    """A coarse ball under a subdivision modifier: modifiers must be applied."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=radius, location=centre)
    thing = bpy.context.object
    thing.name = name
    thing.data.materials.append(diffuse(name, color))
    thing.modifiers.new("smooth", "SUBSURF").render_levels = 1
    thing.modifiers["smooth"].levels = 1
    return thing


def _mesh(name, corners, faces, centre, color, is_real):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(c) for c in corners], [], faces)
    mesh.materials.append(diffuse(name, color))
    thing = bpy.data.objects.new(name, mesh)
    thing.location = centre
    thing.is_shadow_catcher = is_real
    bpy.context.scene.collection.objects.link(thing)
    return thing


def lamp(kind, *, location, target=(0.0, 0.0, 0.0), energy, **settings):
    light = bpy.data.lights.new(kind.lower(), kind)
    light.energy = energy
    for name, value in settings.items():
        setattr(light, name, value)
    thing = bpy.data.objects.new(kind.lower(), light)
    aim(thing, location, target)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def aim(thing, location, target):
    thing.location = location
    thing.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()


def tracked(folder):
    """A movie clip of twelve frames with a distorting lens, its markers, and Blender's own solve, which moves the camera; a soft box of light.

    Returns the scene and the clip; the frames' pictures are black until they are rendered.
    """
    scene = empty_scene(samples=256)
    scene.frame_start, scene.frame_end, scene.render.fps = 1, 12, 24
    ground()
    box("block", centre=(-0.5, 0.5, 0.3), size=(0.4, 0.4, 0.6), color=(0.6, 0.3, 0.2), is_real=True)
    box("cube", centre=(0.3, -0.1, 0.2), size=(0.4, 0.3, 0.4), color=(0.2, 0.5, 0.7))
    ball("ball", centre=(-0.3, -0.4, 0.2), radius=0.2, color=(0.8, 0.7, 0.2))
    lamp("AREA", location=(0.8, -0.8, 2.2), energy=80.0, shape="SQUARE", size=0.6)
    seen = camera(location=(0.0, -3.0, 1.2), target=(0.0, 0.0, 0.2), lens_mm=32.0)
    black = bpy.data.images.new("black", WIDTH, HEIGHT)
    black.file_format = "PNG"
    for frame in range(scene.frame_start, scene.frame_end + 1):
        black.filepath_raw = str(folder / f"plate_{frame:04}.png")
        black.save()
    clip = bpy.data.movieclips.load(str(folder / "plate_0001.png"))
    lens = clip.tracking.camera
    lens.sensor_width, lens.units, lens.focal_length = 36.0, "MILLIMETERS", 32.0
    lens.k1, lens.k2 = 0.1, -0.02
    points = _add_markers(clip, seen)
    solve(clip)
    bundles = [tuple(track.bundle) for track in clip.tracking.tracks]
    seen.matrix_world = _similarity(np.array(bundles), np.array([tuple(p) for p in points]))
    solver = seen.constraints.new("CAMERA_SOLVER")
    solver.use_active_clip, solver.clip = False, clip
    background = seen.data.background_images.new()
    background.source, background.clip = "MOVIE_CLIP", clip
    return scene, clip


def _add_markers(clip, seen):
    """Points of the scene where the lens shows them along a way of the camera, 0.02 px beside; returns the points."""
    random = np.random.default_rng(1)
    spread = random.uniform((-1.0, -1.0, 0.0), (1.0, 1.0, 0.8), (24, 3))
    points = [Vector(p) for p in spread.tolist()]
    focal, (k1, k2) = clip.tracking.camera.focal_length_pixels, (clip.tracking.camera.k1, clip.tracking.camera.k2)
    tracks = [clip.tracking.tracks.new(name=f"point {i}", frame=1) for i in range(len(points))]
    for frame in range(1, 13):
        way = (frame - 1) / 11
        aim(seen, (-0.8 + 1.6 * way, -3.0 + 0.3 * way, 1.2 + 0.2 * way), (0.0, 0.0, 0.2))
        bpy.context.view_layer.update()
        camera_from_world = seen.matrix_world.inverted()
        for track, point in zip(tracks, points):
            x, y, z = camera_from_world @ point
            x, y = x / -z, y / -z
            factor = 1.0 + (x * x + y * y) * (k1 + (x * x + y * y) * k2)
            off = random.normal(0.0, 0.02, 2)
            co = ((focal * x * factor + off[0]) / WIDTH + 0.5, (focal * y * factor + off[1]) / HEIGHT + 0.5)
            track.markers.insert_frame(frame, co=co)
    return points


def solve(clip):
    """Blender's solver works in a clip editor alone."""
    tracked_object = clip.tracking.objects[0]
    tracked_object.keyframe_a, tracked_object.keyframe_b = 1, 12
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    area.type = "CLIP_EDITOR"
    area.spaces.active.clip = clip
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region, space_data=area.spaces.active):
        bpy.ops.clip.solve_camera()


def _similarity(points, targets):
    """The rotation, scale and translation that bring points to targets best (Umeyama 1991)."""
    p, t = points - points.mean(0), targets - targets.mean(0)
    u, s, vt = np.linalg.svd(t.T @ p)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ flip @ vt
    scale = (s * np.diag(flip)).sum() / (p**2).sum()
    matrix = np.eye(4)
    matrix[:3, :3] = scale * rotation
    matrix[:3, 3] = targets.mean(0) - scale * rotation @ points.mean(0)
    return Matrix(matrix.tolist())


def camera(*, location, target, lens_mm):
    data = bpy.data.cameras.new("camera")
    data.lens = lens_mm
    thing = bpy.data.objects.new("camera", data)
    aim(thing, location, target)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.scene.camera = thing
    return thing


def aperture():
    """An open aperture of three blades, turned, a shifted sensor, a focus object; a rectangle of light that is scaled, a spot and a coloured sky."""
    scene = empty_scene(samples=256)
    ground()
    box("block", centre=(-0.45, 0.5, 0.25), size=(0.5, 0.5, 0.5), color=(0.6, 0.3, 0.2), is_real=True)
    box("cube", centre=(0.25, -0.2, 0.15), size=(0.3, 0.3, 0.3), color=(0.2, 0.5, 0.7))
    focus = ball("ball", centre=(-0.35, -0.35, 0.2), radius=0.2, color=(0.8, 0.7, 0.2))
    ball("far ball", centre=(0.9, 1.6, 0.2), radius=0.2, color=(0.7, 0.2, 0.6))
    # Small and far out of focus: it shows the aperture's shape.
    ball("bead", centre=(0.4, -1.4, 0.75), radius=0.012, color=(0.9, 0.9, 0.9))
    area = lamp("AREA", location=(1.2, -0.6, 2.4), energy=60.0, shape="RECTANGLE", size=0.8, size_y=0.5, color=(1.0, 0.9, 0.8))
    area.scale = (1.5, 0.5, 1.0)
    lamp("SPOT", location=(-1.8, -0.8, 2.0), energy=120.0, shadow_soft_size=0.0, spot_size=math.radians(50), spot_blend=0.3)
    seen = camera(location=(0.3, -2.2, 1.0), target=(0.0, 0.0, 0.2), lens_mm=40.0)
    data = seen.data
    data.shift_x, data.shift_y = 0.06, -0.04
    data.dof.use_dof, data.dof.focus_object, data.dof.aperture_fstop = True, focus, 0.4
    data.dof.aperture_blades, data.dof.aperture_rotation = 3, math.radians(20)
    return scene


def animated():
    """A block that turns and moves over the ground, carried by an empty, for eight frames; the camera moves too; a sun and a bulb."""
    scene = empty_scene(samples=256)
    scene.frame_start, scene.frame_end, scene.render.fps = 1, 8, 24
    ground()
    box("block", centre=(-0.5, 0.6, 0.2), size=(0.4, 0.4, 0.4), color=(0.6, 0.3, 0.2), is_real=True)
    carrier = bpy.data.objects.new("carrier", None)
    scene.collection.objects.link(carrier)
    cube = box("cube", centre=(0.5, 0.0, 0.2), size=(0.4, 0.3, 0.4), color=(0.2, 0.5, 0.7))
    cube.parent = carrier
    for frame, angle, x in ((1, 0.0, -0.2), (8, 1.4, 0.3)):
        carrier.rotation_euler = (0.0, 0.0, angle)
        carrier.location = (x, -0.2, 0.0)
        carrier.keyframe_insert("rotation_euler", frame=frame)
        carrier.keyframe_insert("location", frame=frame)
    lamp("SUN", location=(1.0, -1.0, 3.0), energy=2.0, angle=0.0, color=(1.0, 0.95, 0.9))
    lamp("POINT", location=(-0.8, -0.6, 1.4), energy=30.0, shadow_soft_size=0.1)
    seen = camera(location=(0.2, -2.6, 1.2), target=(0.0, 0.0, 0.2), lens_mm=35.0)
    for frame, x in ((1, 0.2), (8, 0.6)):
        aim(seen, (x, -2.6, 1.2), (0.0, 0.0, 0.2))
        seen.keyframe_insert("location", frame=frame)
        seen.keyframe_insert("rotation_euler", frame=frame)
    return scene
