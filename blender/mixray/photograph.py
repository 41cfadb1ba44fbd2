"""What the camera took: the background image of the camera, or its clip, as files that mixray reads."""

import os
import re
from pathlib import Path

import bpy

from .report import Refused

READABLE = (".png", ".jpg", ".jpeg", ".exr", ".hdr")


def relative(path, folder):
    """As the scene file in `folder` names a file."""
    path = os.path.abspath(path)
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        # Another drive.
        return Path(path).as_posix()


def image_file(image, folder):
    """The file of an image as the scene file names it; what is packed, generated or of another format is written into `folder`."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "FILE" and not image.packed_file and path.lower().endswith(READABLE) and os.path.isfile(path):
        return relative(path, folder)
    copy = image.copy()
    try:
        copy.file_format = "OPEN_EXR" if image.is_float else "PNG"
        name = bpy.path.clean_name(image.name) + (".exr" if image.is_float else ".png")
        copy.save(filepath=str(folder / name))
    finally:
        bpy.data.images.remove(copy)
    return name


class Photograph:
    """Of a camera. `image`: what [photo] names, or None; `frames`: a folder of a clip's frames, or None."""

    def __init__(self, camera, folder, report):
        self.folder, self.report = folder, report
        self.image = self.frames = self.clip = self.source = None
        self.size = None
        self.frame_start, self.frame_offset = 1, 0
        backgrounds = [b for b in camera.data.background_images if self._of(b)]
        if not backgrounds:
            return
        if len(backgrounds) > 1:
            report.add(camera.name, f"of its background images the first alone, {self._of(backgrounds[0]).name}, is the photograph")
        self.source = self._of(backgrounds[0])
        self.size = tuple(self.source.size)
        if self.size[0] == 0:
            raise Refused(f"{self.source.name} cannot be read; correct its path, {self.source.filepath}")
        if self.source.source in ("SEQUENCE", "MOVIE"):
            self.clip = self.source
            user = self.clip if isinstance(self.clip, bpy.types.MovieClip) else backgrounds[0].image_user
            self.frame_start, self.frame_offset = user.frame_start, user.frame_offset

    def _of(self, background):
        if background.source == "MOVIE_CLIP":
            return background.clip
        return background.image

    def prepare_still(self, scene):
        """[photo]'s image: the file, or the clip's frame at the scene's."""
        if self.source is None:
            return None
        if self.clip is None:
            return image_file(self.source, self.folder)
        name = self._frame_file(scene.frame_current)
        if name is None:
            raise Refused(f"{self.clip.name} has no frame {scene.frame_current}; go to one of its frames, or correct the clip's start")
        return relative(self.frames / name, self.folder)

    def prepare_frames(self, first, last):
        """File names of a clip's frames by the scene's frame numbers; those before and behind the clip are left out."""
        if self.clip is None:
            raise Refused("a sequence needs a movie clip, an image sequence or a movie as the camera's background; give it one, or export a still")
        names = {}
        for frame in range(first, last + 1):
            name = self._frame_file(frame)
            if name is not None:
                names[frame] = name
        missing = last + 1 - first - len(names)
        if missing:
            self.report.add(self.clip.name, f"{missing} of the frames {first} to {last} lie outside of it and are not rendered")
        if not names:
            raise Refused(f"{self.clip.name} has none of the frames {first} to {last}; correct the scene's frame range or the clip's start")
        return names

    def _frame_file(self, frame):
        """Name in `frames` of the picture at a frame of the scene, None where there is none."""
        number = frame - self.frame_start + 1 + self.frame_offset
        if self.clip.source == "MOVIE":
            self._decode_movie()
            # The folder may hold frames of a longer movie that was there before.
            if not 1 <= number <= self.clip.frame_duration:
                return None
            name = f"{number:06}.png"
        else:
            first = Path(bpy.path.abspath(self.clip.filepath))
            self.frames = first.parent
            digits = re.search(r"(\d+)(?=\D*$)", first.name)
            if digits is None:
                raise Refused(f"{first.name} has no frame number in its name; number the frames")
            counted = str(int(digits[1]) + number - 1).zfill(len(digits[1]))
            name = first.name[: digits.start()] + counted + first.name[digits.end() :]
        return name if (self.frames / name).is_file() else None

    def _decode_movie(self):
        """A movie's frames as PNG files, once, by Blender's own decoder."""
        if self.frames is not None:
            return
        self.frames = self.folder / "frames"
        self.frames.mkdir(exist_ok=True)
        path = bpy.path.abspath(self.clip.filepath)
        made = bpy.data.scenes.new("mixray frames")
        try:
            editor = made.sequence_editor_create()
            strips = editor.strips if hasattr(editor, "strips") else editor.sequences
            strip = strips.new_movie("clip", path, 1, 1)
            render = made.render
            render.resolution_x, render.resolution_y = self.size
            render.resolution_percentage = 100
            render.image_settings.file_format = "PNG"
            render.image_settings.color_mode = "RGB"
            made.view_settings.view_transform = "Standard"
            made.frame_start, made.frame_end = 1, strip.frame_final_duration
            render.filepath = str(self.frames) + os.sep + "######"
            bpy.ops.render.render(animation=True, scene=made.name)
        finally:
            bpy.data.scenes.remove(made)
