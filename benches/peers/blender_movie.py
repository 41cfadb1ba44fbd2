#!/usr/bin/env python3
"""A film that Blender tracked in a movie file, exported by the extension of blender/ and rendered by mixray: is every frame in its place?

    benches/peers/blender_movie.py [--mixray PROGRAM] [--rays N] [-o FOLDER]

Wants `ffmpeg`, and a Python with `bpy`, `numpy` and `OpenEXR`. Cycles renders the frames, ffmpeg makes a movie of them, which becomes the camera's clip.
Each frame that the extension decodes must be nearest to the frame that went in, and the mask of what is added lie over Cycles' of the same frame; in the
compositor the scene's frames must show the film's. The controls are other frames. Of a shorter movie none of the longer one's frames may be taken. Writes three frames of the film, and them as they were, to film.png.
Exit code 1 where a bound is missed.
"""

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

import blender_shots  # first: it finds the extension
import bpy
import mixray
from mixray.export import export_shot
from mixray.report import Refused
from mixray.results import Film, load_picture

import blender_scenes

LOOKED_AT = (1, 6, 12)
# The movie's first frame in the scene: not the number of a file.
BEGIN = 101


def picture(path):
    """Codes of a PNG file, rows from the top, RGB."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    codes = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(codes)
    width, height = image.size
    bpy.data.images.remove(image)
    return codes.reshape(height, width, -1)[::-1, :, :3].astype(np.float64) * 255.0


def movie_of(clip, folder):
    """The movie of a clip's frames, as a clip with the same tracks and the same solve."""
    path = folder / "plate.mp4"
    frames = ["-framerate", "30", "-i", str(folder / "plate_%04d.png")]
    subprocess.run(["ffmpeg", "-y", "-loglevel", "error", *frames, "-c:v", "libx264", "-crf", "4", "-pix_fmt", "yuv420p", str(path)], check=True)
    movie = bpy.data.movieclips.load(str(path))
    for name in ("sensor_width", "units", "focal_length", "k1", "k2"):
        setattr(movie.tracking.camera, name, getattr(clip.tracking.camera, name))
    for track in clip.tracking.tracks:
        same = movie.tracking.tracks.new(name=track.name, frame=1)
        for marker in track.markers:
            same.markers.insert_frame(marker.frame, co=marker.co)
    blender_scenes.solve(movie)
    movie.frame_start = BEGIN
    return movie


def leaves_out_what_is_not_there(scene, folder):
    """Whether an export of the movie's first five frames takes those alone, though the folder has more, and refuses a still behind them."""
    path = folder / "shorter.mp4"
    subprocess.run(["ffmpeg", "-y", "-loglevel", "error", "-i", str(folder / "plate.mp4"), "-frames:v", "5", "-c", "copy", str(path)], check=True)
    clip = bpy.data.movieclips.load(str(path))
    clip.frame_start = BEGIN
    camera = scene.camera
    camera.constraints.clear()
    camera.data.background_images[0].clip = clip
    shot = export_shot(bpy.context, folder / "shot")
    there = len(list(shot.frames.iterdir()))
    scene.mixray.is_sequence = False
    scene.frame_set(BEGIN + 5)
    try:
        export_shot(bpy.context, folder / "shot")
    except Refused as refusal:
        print(f"of a shorter movie frames {shot.numbers}, of {there} in the folder; {refusal}")
        return shot.numbers == (1, 6) and there == 12
    return False


def composited(scene, frame, folder):
    """What the compositor makes of a frame of the scene, linear RGB."""
    scene.frame_set(frame)
    scene.render.filepath = str(folder / "composited.exr")
    bpy.ops.render.render(write_still=True)
    return blender_shots.rgb(blender_shots.planes(scene.render.filepath))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--mixray", default=str(blender_shots.ROOT / "target" / "release" / "mixray"))
    parser.add_argument("--rays", type=int, default=36)
    parser.add_argument("-o", "--output", default="blender-movie")
    arguments = parser.parse_args()
    folder = Path(arguments.output).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    mixray.register()
    scene, clip = blender_scenes.tracked(folder)
    pinhole = blender_shots.distortion_map(clip, folder)
    cycles = blender_shots.Cycles(scene, folder, lambda pixels: blender_shots.bent(pixels, *pinhole))
    masks = {}
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        blender_shots.write_png(cycles.render("real"), folder / f"plate_{frame:04}.png")
        if frame in LOOKED_AT:
            masks[frame] = cycles.render("mask")
    movie = movie_of(clip, folder)
    scene.camera.constraints[0].clip = scene.camera.data.background_images[0].clip = movie
    scene.frame_start, scene.frame_end = BEGIN, BEGIN + 11
    scene.mixray.is_sequence = True
    shot = export_shot(bpy.context, folder / "shot")
    print(shot.report.text(), end="")

    plates = [picture(path) for path in sorted(folder.glob("plate_*.png"))]
    decoded = [picture(path) for path in sorted(shot.frames.iterdir())]
    rms = np.array([[np.sqrt(((a - b) ** 2).mean()) for b in plates] for a in decoded])
    own = np.diag(rms)
    beside = np.where(np.eye(len(plates), dtype=bool), np.inf, rms).min(1)
    print(f"{len(decoded)} of {len(plates)} frames, RMS from the one that went in {own.max():.2f} codes at most, from any other {beside.min():.2f} at least")
    met = rms.shape == (12, 12) and own.max() < 0.5 * beside.min()

    program = blender_shots.Mixray(arguments.mixray, arguments.rays)
    _, *command = shot.command(arguments.mixray, folder / "film")
    program.run(*command, "--rpp", arguments.rays)
    film = {frame: blender_shots.planes(folder / "film" / f"{frame:06}.exr") for frame in LOOKED_AT}
    for frame, other in zip(LOOKED_AT, (*LOOKED_AT[1:], LOOKED_AT[0])):
        right, wrong = (blender_shots.iou(film[at]["mask.Y"], masks[frame]) for at in (frame, other))
        print(f"frame {frame}: mask IoU {right:.4f}, that of frame {other} {wrong:.4f}")
        met &= right > 0.995 > wrong

    load_picture(scene, folder / "film" / "000001.exr", Film(BEGIN, 1, 12))
    scene.render.image_settings.color_mode = "RGB"
    for frame in LOOKED_AT:
        made = composited(scene, BEGIN - 1 + frame, folder)
        off = {at: np.abs(made - blender_shots.rgb(planes)).max() for at, planes in film.items()}
        others = min(error for at, error in off.items() if at != frame)
        print(f"frame {frame} in the compositor: {off[frame]:.2e} off, {others:.2e} from another one")
        met &= off[frame] < 1e-4 < others
    rows = [np.concatenate([blender_shots.rgb(planes) for planes in film.values()], 1)]
    rows.append((np.concatenate([plates[frame - 1] for frame in LOOKED_AT], 1) / 255.0) ** 2.2)
    blender_shots.write_png(np.concatenate(rows), folder / "film.png")
    met &= leaves_out_what_is_not_there(scene, folder)
    sys.exit(0 if met else 1)


if __name__ == "__main__":
    main()
