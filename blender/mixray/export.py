"""A shot as a scene file of mixray: scene.toml with its meshes, poses.json for a film, and report.txt of what is not carried."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import bpy

from . import convert, geometry, lights
from .camera import Camera
from .photograph import Photograph, image_file, relative
from .report import Report


@dataclass
class Shot:
    """What was written. Of a film: the folder of its `frames`, their `numbers` (first, last + 1), and of the first its name and the scene's frame."""

    scene_file: Path
    report: Report
    trajectory: Path | None = None
    frames: Path | None = None
    numbers: tuple[int, int] | None = None
    first_name: str | None = None
    first_frame: int | None = None

    def command(self, binary, output):
        """The command line that renders it."""
        if self.trajectory is None:
            return [binary, "render", str(self.scene_file), "-o", str(output)]
        return [
            *(binary, "sequence", str(self.scene_file), "--frames", str(self.frames)),
            *("--trajectory", str(self.trajectory), "--range", "{}..{}".format(*self.numbers)),
            *("--format", "exr", "--overwrite", "-o", str(output)),
        ]


def export_shot(context, folder):
    """Writes the present frame, or the scene's frame range, into `folder`; Refused says why it cannot."""
    scene, report = context.scene, Report()
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    photograph = Photograph(scene.camera, folder, report) if scene.camera else None
    size = (photograph and photograph.size) or _render_size(scene)
    camera = Camera(scene, size, report)
    _check_size(scene, camera, photograph, report)
    film = scene.mixray.is_sequence
    rest = {"scene": scene, "folder": folder, "report": report, "camera": camera}
    before = scene.frame_current
    try:
        if film:
            shot = _export_film(context, photograph, **rest)
        else:
            shot = _export_still(context, photograph, **rest)
    finally:
        scene.frame_set(before)
    (folder / "report.txt").write_text(report.text(), encoding="utf-8")
    return shot


def _export_still(context, photograph, *, scene, folder, report, camera):
    depsgraph = context.evaluated_depsgraph_get()
    intrinsics, lens = camera.tables()
    pose = camera.pose(depsgraph)
    if camera.clip:
        _report_reprojection(camera, camera.check_reprojection(intrinsics, scene.frame_current, pose), report)
    if scene.render.use_motion_blur:
        report.add(scene.name, "motion blur is carried for frame ranges only")
    image = photograph.prepare_still(scene)
    if image is None:
        intrinsics = {"width": camera.size[0], "height": camera.size[1], **intrinsics}
    document = _document(context, folder, report, animated=False)
    document = {
        **({"photo": {"image": image}} if image else {}),
        "camera": {**intrinsics, "world_from_camera": pose},
        **({"lens": lens} if lens else {}),
        **document,
    }
    return Shot(_write(folder, document), report)


def _export_film(context, photograph, *, scene, folder, report, camera):
    first, last = scene.frame_start, scene.frame_end
    names = photograph.prepare_frames(first, last)
    fps = scene.render.fps / scene.render.fps_base
    entries, squares, table, lens = [], [], None, None
    for frame, name in names.items():
        scene.frame_set(frame)
        now, lens = camera.tables()
        pose = camera.pose(context.evaluated_depsgraph_get())
        table = table or now
        entry = {"file": name, "time_secs": frame / fps, "world_from_camera": pose}
        if lens:
            entry["focus_distance_m"] = lens["focus_distance_m"]
        entries.append({**entry, "camera": now})
        if camera.clip:
            squares += camera.check_reprojection(now, frame, pose)
    if camera.clip:
        _report_reprojection(camera, squares, report)
    if camera.data.animation_data and camera.data.dof.use_dof:
        report.add(camera.data.name, "its aperture is that of the last frame; focus and focal length are carried frame by frame")
    trajectory = folder / "poses.json"
    size = {"width": camera.size[0], "height": camera.size[1]}
    for entry in entries:
        entry["camera"] = {**size, **entry["camera"]}
    trajectory.write_text(json.dumps({"frames_per_second": fps, "frames": entries}, indent=1), encoding="utf-8")
    scene.frame_set(first)
    document = _document(context, folder, report, animated=True)
    document = {
        **({"lens": lens} if lens else {}),
        **_shutter(scene, fps, report),
        **document,
    }
    numbers = [int("".join(c if c.isdigit() else " " for c in Path(name).stem).split()[-1]) for name in names.values()]
    return Shot(
        _write(folder, document),
        report,
        trajectory=trajectory,
        frames=photograph.frames,
        numbers=(min(numbers), max(numbers) + 1),
        first_name=names[min(names)],
        first_frame=min(names),
    )


def _document(context, folder, report, *, animated):
    """The tables that a still and a film have alike."""
    scene = context.scene
    tables = geometry.export_objects(context, folder, report, animated=animated)
    lamps = []
    depsgraph = context.evaluated_depsgraph_get()
    for instance in depsgraph.object_instances:
        thing = instance.object.original
        if thing.type != "LIGHT" or thing.hide_render:
            continue
        if animated and (thing.animation_data or thing.data.animation_data or thing.parent):
            report.add(thing.name, f"it stays as at frame {scene.frame_current}")
        table, entry = lights.export_light(thing, instance.matrix_world.copy(), report)
        if table == "light":
            lamps.append(entry)
        else:
            tables[table].append(entry)
    environment = lights.export_world(scene.world, lambda image: image_file(image, folder), report)
    _note_settings(scene, report)
    cycles = getattr(scene, "cycles", None)
    render = {
        "rays_per_pixel": scene.mixray.rays_per_pixel or (cycles.samples if cycles else 64),
        "max_bounces": (cycles.max_bounces if cycles else 3) + 1,
        "seed": cycles.seed if cycles else 0,
    }
    if cycles and cycles.sample_clamp_indirect > 0.0:
        render["clamp_indirect"] = cycles.sample_clamp_indirect
    return {
        **({"environment": environment} if environment else {}),
        "light": lamps,
        **tables,
        "render": render,
    }


def _write(folder, document):
    path = folder / "scene.toml"
    path.write_text(convert.toml(document), encoding="utf-8")
    return path


def _shutter(scene, fps, report):
    """[shutter] of a scene with motion blur."""
    render = scene.render
    if not render.use_motion_blur:
        return {}
    if render.motion_blur_position != "CENTER":
        report.add(scene.name, "its shutter opens about the frame's time, not from it on or up to it")
    shutter = {"exposure_secs": render.motion_blur_shutter / fps}
    cycles = getattr(scene, "cycles", None)
    if cycles and cycles.rolling_shutter_type == "TOP":
        open_share = cycles.rolling_shutter_duration
        shutter = {
            "exposure_secs": shutter["exposure_secs"] * open_share,
            "readout_secs": shutter["exposure_secs"] * (1.0 - open_share),
        }
    return {"shutter": shutter}


def _render_size(scene):
    percentage = scene.render.resolution_percentage
    return scene.render.resolution_x * percentage // 100, scene.render.resolution_y * percentage // 100


def _check_size(scene, camera, photograph, report):
    """The photograph decides on the picture's size."""
    size = _render_size(scene)
    if photograph.size and photograph.size != size:
        report.add(scene.name, "the picture has the photograph's size, {} x {}, not {} x {}".format(*photograph.size, *size))
    if camera.clip and camera.clip != photograph.clip:
        report.add(camera.clip.name, "it is not the camera's background: mixray needs the frames as the lens took them")
    if photograph.source is None:
        report.add(camera.object.name, "it has no background image: the picture is rendered without a photograph")


def _note_settings(scene, report):
    view = scene.view_settings
    if view.view_transform not in ("Standard", "Raw") or view.look not in ("None", ""):
        report.add("view transform", f"{view.view_transform} is not carried: mixray adds light to the photograph as it is, in sRGB or its profile")
    if view.exposure != 0.0 or view.gamma != 1.0:
        report.add("exposure and gamma", "not carried: the photograph's own exposure counts")
    if scene.unit_settings.scale_length != 1.0:
        report.add("unit scale", "a unit of Blender is taken as a metre")
    if scene.render.use_border:
        report.add("render region", "the whole picture is rendered")
    cycles = getattr(scene, "cycles", None)
    if cycles and cycles.film_exposure != 1.0:
        report.add("film exposure", f"not carried; exposure_ev = {math.log2(cycles.film_exposure):.3f} in [photo] is the like")


def _report_reprojection(camera, squares, report):
    if squares:
        error = math.sqrt(sum(squares) / len(squares))
        solved = camera.clip.tracking.reconstruction.average_error
        report.add(camera.clip.name, f"{len(squares)} markers reproject within {error:.4f} px (RMS); Blender's solve says {solved:.4f} px on average")
