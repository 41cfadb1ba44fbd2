"""The extension's conversions against closed forms, and its report, without Blender: python3 -m unittest discover blender/tests"""

import importlib.util
import json
import math
import struct
import tomllib
import unittest
from pathlib import Path



def module(name):
    """A file of the package that does not want `bpy`, as the package itself does."""
    path = Path(__file__).resolve().parents[1] / "mixray" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


convert, report = module("convert"), module("report")

IDENTITY = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
WHITE = [1.0, 1.0, 1.0]


def at(x, y, z):
    return [[*row[:3], t] for row, t in zip(IDENTITY[:3], (x, y, z))] + [IDENTITY[3]]


class Cameras(unittest.TestCase):
    def camera(self, **changes):
        given = {"lens_mm": 50.0, "sensor_width_mm": 36.0, "sensor_height_mm": 24.0, "sensor_fit": "AUTO", "shift": (0.0, 0.0), "size": (720, 480)}
        return convert.intrinsics(**{**given, **changes})

    def test_focal_lengths_by_fit(self):
        self.assertEqual(self.camera(), {"fx": 1000.0, "fy": 1000.0, "cx": 360.0, "cy": 240.0})
        # The sensor's width lies along the longer side, or where it is told.
        self.assertEqual(self.camera(size=(480, 720))["fx"], 1000.0)
        self.assertAlmostEqual(self.camera(size=(480, 720), sensor_fit="HORIZONTAL")["fx"], 50.0 / 36.0 * 480.0)
        self.assertAlmostEqual(self.camera(sensor_fit="VERTICAL")["fx"], 1000.0)
        self.assertAlmostEqual(self.camera(sensor_fit="VERTICAL", sensor_height_mm=48.0)["fx"], 500.0)

    def test_shift_moves_the_centre_against_it(self):
        shifted = self.camera(shift=(0.1, 0.2))
        self.assertEqual((shifted["cx"], shifted["cy"]), (360.0 - 72.0, 240.0 + 144.0))

    def test_pixels_that_are_not_square(self):
        wide = self.camera(pixel_aspect=1.25)
        self.assertEqual((wide["fx"], wide["fy"]), (1000.0, 800.0))

    def test_axes(self):
        self.assertEqual(convert.point_y_up((1.0, 2.0, 3.0)), [1.0, 3.0, -2.0])
        # A camera above Blender's origin looks down: mixray's -Y.
        pose = convert.without_scale(convert.matrix_y_up([[2.0 * value for value in row[:3]] + row[3:] for row in at(0, 0, 5)]))
        self.assertEqual([row[3] for row in pose[:3]], [0.0, 5.0, 0.0])
        self.assertEqual([-row[2] for row in pose[:3]], [0.0, -1.0, 0.0])
        self.assertAlmostEqual(convert.view_depth(pose, (0.3, 1.0, 0.4)), 4.0)

    def test_blades(self):
        five = convert.lens(lens_mm=50.0, f_number=2.0, focus_distance_m=1.0, blades=5, rotation_rad=math.radians(10.0))
        self.assertAlmostEqual(five["blade_rotation_deg"], 46.0)
        self.assertEqual(convert.lens(lens_mm=50.0, f_number=2.0, focus_distance_m=1.0, blades=2, rotation_rad=1.0)["aperture"], "disc")


class Lights(unittest.TestCase):
    def test_quads_have_the_power(self):
        quad = convert.area_light(at(0, 0, 2), color=WHITE, power_w=10.0, shape="RECTANGLE", size_x=2.0, size_y=0.5)
        # Lambertian: power = pi area radiance.
        self.assertAlmostEqual(quad["radiance"][0] * math.pi * 1.0, 10.0)
        self.assertEqual(quad["corner"], [-1.0, 2.0, -0.25])
        u, v = quad["edge_u"], quad["edge_v"]
        down = u[2] * v[0] - u[0] * v[2]
        self.assertLess(down, 0.0)

    def test_mirrored_lamps_shine_the_same_way(self):
        mirrored = at(0, 0, 2)
        mirrored[0][0] = -1.0
        quad = convert.area_light(mirrored, color=WHITE, power_w=10.0, shape="SQUARE", size_x=1.0, size_y=9.0)
        u, v = quad["edge_u"], quad["edge_v"]
        self.assertLess(u[2] * v[0] - u[0] * v[2], 0.0)

    def test_discs_keep_their_area(self):
        disc = convert.area_light(at(0, 0, 2), color=WHITE, power_w=10.0, shape="DISK", size_x=2.0, size_y=0.1)
        self.assertAlmostEqual(disc["radiance"][0], 10.0 / (math.pi * math.pi))

    def test_points_and_bulbs_have_one_intensity(self):
        point = convert.point_light(at(1, 2, 3), color=[1.0, 0.5, 0.0], power_w=4.0 * math.pi)
        self.assertEqual(point["position"], [1.0, 3.0, -2.0])
        self.assertEqual(point["intensity"], [1.0, 0.5, 0.0])
        bulb = convert.bulb(at(1, 2, 3), color=WHITE, power_w=4.0 * math.pi, radius_m=0.2)
        self.assertAlmostEqual(bulb["material"]["emissive"][0] * math.pi * 0.04, 1.0)

    def test_spots_keep_the_flux_of_their_cone(self):
        spot = convert.spot_light(at(0, 0, 1), color=WHITE, power_w=4.0 * math.pi, angle_rad=1.2, blend=0.4)
        outer, inner = (math.cos(math.radians(spot[key])) for key in ("outer_deg", "inner_deg"))

        def flux(falloff, low, high):
            step = (1.0 - low) / 20000
            cosines = (low + (i + 0.5) * step for i in range(20000))
            return step * sum(falloff(min(max((c - low) / (high - low), 0.0), 1.0)) for c in cosines)

        ours = flux(lambda t: t * t, outer, inner)
        cycles = flux(lambda t: t * t * (3.0 - 2.0 * t), outer, outer + (1.0 - outer) * 0.4)
        self.assertAlmostEqual(ours / cycles, 1.0, places=5)
        self.assertNotAlmostEqual(flux(lambda t: t * t, outer, outer + (1.0 - outer) * 0.4) / cycles, 1.0, places=2)

    def test_suns_and_skies(self):
        sun = convert.sun(at(0, 0, 9), color=WHITE, irradiance=3.0)
        self.assertEqual((sun["direction"], sun["irradiance"]), ([0.0, -1.0, 0.0], [3.0, 3.0, 3.0]))
        self.assertAlmostEqual(convert.environment_rotation_deg(math.radians(30.0)), -120.0)
        self.assertAlmostEqual(convert.environment_rotation_deg(math.radians(30.0), True), -60.0)


class Lenses(unittest.TestCase):
    camera = {"fx": 900.0, "fy": 900.0, "cx": 640.0, "cy": 360.0}
    size = (1280, 720)

    def seen(self, coefficients, x, y):
        u, v = convert.project(self.camera, coefficients, IDENTITY, (x, -y, -1.0))
        return (u - 640.0) / 900.0, (v - 360.0) / 900.0

    def test_polynomials_go_over(self):
        k, error = convert.distortion("POLYNOMIAL", [-0.1, 0.02, 0.003], self.camera, self.size)
        self.assertEqual((k, error), ([-0.1, 0.02, 0.0, 0.0, 0.003], 0.0))
        x, _ = self.seen(k, 0.5, 0.0)
        self.assertAlmostEqual(x, 0.5 * (1.0 - 0.1 * 0.25 + 0.02 * 0.0625 + 0.003 * 0.015625))

    def test_division_is_undone_by_its_formula(self):
        k, error = convert.distortion("DIVISION", [-0.12, 0.01], self.camera, self.size)
        self.assertLess(error, 1e-3)
        for x, y in ((0.1, 0.2), (0.5, 0.3), (0.6, -0.35)):
            xd, yd = self.seen(k, x, y)
            s = xd * xd + yd * yd
            factor = 1.0 - 0.12 * s + 0.01 * s * s
            self.assertLess(math.hypot(xd / factor - x, yd / factor - y) * 900.0, 2e-3)

    def test_nuke_counts_in_half_widths(self):
        k, error = convert.distortion("NUKE", [0.05, 0.01], self.camera, self.size)
        self.assertLess(error, 1e-3)
        xd, _ = self.seen(k, 0.5, 0.0)
        s = (xd * 900.0 / 640.0) ** 2
        self.assertLess(abs(xd / (1.0 + 0.05 * s + 0.01 * s * s) - 0.5) * 900.0, 2e-3)

    def test_brown_with_its_fourth_coefficient(self):
        given = [-0.1, 0.03, -0.004, 0.001, 0.0, 0.0]
        k, error = convert.distortion("BROWN", given, self.camera, self.size)
        self.assertLess(error, 1e-2)
        x, _ = self.seen(k, 0.6, 0.0)
        s = 0.36
        self.assertLess(abs(x - 0.6 * (1.0 - 0.1 * s + 0.03 * s**2 - 0.004 * s**3 + 0.001 * s**4)) * 900.0, 1e-2)

    def test_principal_points_count_from_below(self):
        table = convert.clip_intrinsics(focal_px=900.0, principal_px=(640.0, 300.0), size=self.size, pixel_aspect=2.0)
        self.assertEqual(table, {"fx": 900.0, "fy": 1800.0, "cx": 640.0, "cy": 420.0})

    def test_least_squares_pass_over_what_is_explained(self):
        self.assertEqual(convert.least_squares([[1.0, 1.0], [2.0, 2.0]], [3.0, 6.0]), [3.0, 0.0])


class Files(unittest.TestCase):
    def test_scene_files_are_toml(self):
        document = {
            "camera": {"fx": 1.5, "distortion": [0.0, 1e-7]},
            "lens": {"focus_distance_m": math.inf, "aperture": 5},
            "real": [{"name": 'a "b" \u00e4', "material": {"emissive": [1.0, 2.0, 3.0]}}, {"name": "c", "flag": True}],
        }
        self.assertEqual(tomllib.loads(convert.toml(document)), document)

    def test_glb(self):
        text = json.dumps({"meshes": []}).encode()
        data = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text
        self.assertEqual(convert.glb_document(data), {"meshes": []})


class Reports(unittest.TestCase):
    def test_lines_are_said_once(self):
        made = report.Report()
        self.assertEqual(made.text(), "everything is carried\n")
        for how in ("hard shadows", "hard shadows", "round"):
            made.add("lamp", how)
        self.assertEqual(made.text(), "lamp: hard shadows\nlamp: round\n")

    def test_lines_fit_a_width(self):
        def width(words):
            return 10 * len(words)

        text = "lamp: the radius of a spot is not carried: its shadows are hard"
        for width_px in (120, 200, 10000):
            lines = report.wrapped(text, width_px, width)
            self.assertEqual(" ".join(lines), text)
            self.assertLessEqual(max(map(width, lines)), width_px)
            # None could be longer: the next line's first word does not fit in.
            for line, after in zip(lines, lines[1:]):
                self.assertGreater(width(f"{line} {after.split()[0]}"), width_px)
        self.assertEqual(len(report.wrapped(text, 10000, width)), 1)
        self.assertEqual(report.wrapped("a verylongword b", 30, width), ["a", "verylongword", "b"])


if __name__ == "__main__":
    unittest.main()
