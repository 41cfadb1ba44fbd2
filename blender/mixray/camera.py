"""The camera of the scene, and the movie clip that solved it: intrinsics, lens, distortion, poses."""

from mathutils import Matrix, Vector

from . import convert
from .report import Refused


class Camera:
    """`clip` is the movie clip of a Camera Solver constraint, or None."""

    def __init__(self, scene, size, report):
        self.scene, self.size, self.report = scene, size, report
        self.object = scene.camera
        if self.object is None:
            raise Refused("the scene has no camera; add one, and make it the scene's")
        self.data = self.object.data
        if self.data.type != "PERSP":
            raise Refused(f"{self.object.name} is no perspective camera; mixray has no {self.data.type.lower()} camera: choose Perspective")
        self.clip = self._solved_clip()

    def _solved_clip(self):
        for constraint in self.object.constraints:
            if constraint.type != "CAMERA_SOLVER" or constraint.mute or not constraint.influence:
                continue
            clip = self.scene.active_clip if constraint.use_active_clip else constraint.clip
            if clip is None or not clip.tracking.reconstruction.is_valid:
                raise Refused(f"{self.object.name}: the clip of its Camera Solver has no solve; solve the camera motion, or remove the constraint")
            return clip
        return None

    def tables(self):
        """[camera] without its pose, and [lens] or None, at the present frame."""
        return self._intrinsics(), self._lens()

    def _intrinsics(self):
        if self.clip is None:
            data, render = self.data, self.scene.render
            return convert.intrinsics(
                lens_mm=data.lens,
                sensor_width_mm=data.sensor_width,
                sensor_height_mm=data.sensor_height,
                sensor_fit=data.sensor_fit,
                shift=(data.shift_x, data.shift_y),
                size=self.size,
                pixel_aspect=render.pixel_aspect_y / render.pixel_aspect_x,
            )
        solved = self.clip.tracking.camera
        if tuple(self.clip.size) != tuple(self.size):
            raise Refused(f"the clip {self.clip.name} has {self.clip.size[0]} x {self.clip.size[1]} pixels, the photograph {self.size[0]} x {self.size[1]}; use the clip as the camera's background")
        table = convert.clip_intrinsics(
            focal_px=solved.focal_length_pixels,
            principal_px=solved.principal_point_pixels,
            size=self.size,
            pixel_aspect=solved.pixel_aspect,
        )
        model = solved.distortion_model
        names = {
            "POLYNOMIAL": ("k1", "k2", "k3"),
            "DIVISION": ("division_k1", "division_k2"),
            "NUKE": ("nuke_k1", "nuke_k2"),
            "BROWN": ("brown_k1", "brown_k2", "brown_k3", "brown_k4", "brown_p1", "brown_p2"),
        }
        coefficients = [getattr(solved, name) for name in names[model]]
        table["distortion"], error_px = convert.distortion(model, coefficients, table, self.size)
        if error_px > 0.0:
            self.report.add(f"lens of {self.clip.name}", f"{model.lower()} model fitted by OpenCV's rational one, {error_px:.4f} px off at most")
        return table

    def _lens(self):
        dof = self.data.dof
        if not dof.use_dof:
            return None
        if dof.aperture_ratio != 1.0:
            self.report.add(self.object.name, "its anamorphic aperture is taken as round")
        return convert.lens(
            lens_mm=self.data.lens,
            f_number=dof.aperture_fstop,
            focus_distance_m=self.focus_distance_m(),
            blades=dof.aperture_blades,
            rotation_rad=dof.aperture_rotation,
        )

    def pose(self, depsgraph):
        """World-from-camera in mixray's world, at the frame of the dependency graph."""
        matrix = self.object.evaluated_get(depsgraph).matrix_world
        return convert.without_scale(convert.matrix_y_up(matrix))

    def focus_distance_m(self):
        """Along the view axis: to the focus object, or as set."""
        dof = self.data.dof
        if dof.focus_object is None:
            return dof.focus_distance
        if dof.focus_subtarget:
            self.report.add(self.object.name, f"the bone {dof.focus_subtarget} that it focuses on is taken as its object")
        pose = convert.without_scale(self.object.matrix_world)
        return convert.view_depth(pose, dof.focus_object.matrix_world.translation)

    def check_reprojection(self, table, frame, pose):
        """Squared distances, pixels, between the clip's markers and where mixray's camera sees the solved points at a frame."""
        squares = []
        clip_frame = frame - self.clip.frame_start + 1
        tracking_object = self.clip.tracking.objects[0]
        # Solved points are in the space that the constraint moves the camera in.
        parent = self.object.parent
        world = (parent.matrix_world @ self.object.matrix_parent_inverse if parent else Matrix()) @ self.object.matrix_basis
        for track in tracking_object.tracks:
            marker = track.markers.find_frame(clip_frame)
            if not track.has_bundle or marker is None or marker.mute:
                continue
            seen = convert.project(table, table["distortion"], pose, convert.point_y_up(world @ Vector(track.bundle)))
            if seen is not None:
                x, y = marker.co[0] * self.size[0], (1.0 - marker.co[1]) * self.size[1]
                squares.append((seen[0] - x) ** 2 + (seen[1] - y) ** 2)
        return squares
