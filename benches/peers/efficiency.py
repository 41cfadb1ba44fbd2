#!/usr/bin/env python3
"""Error per second of the composite: mixray, Mitsuba 3 and Blender's Cycles in turns, on the same scenes at equal rays. Mitsuba's light tracer
takes part where something virtual is smooth, Cycles where its scene can be built.

    pip install mitsuba numpy        (and LLVM 19: apt-get install libllvm19)
    pip install bpy                  (in the same Python, or in one named by --cycles-python)
    cargo build --release
    python3 benches/peers/efficiency.py room far --rays-per-pixel 49 --runs 6

Every contender renders each scene `--runs` times, with another seed each, one after the other. The squared error is the variance between its own
runs, so that no contender is judged by another's converged picture; *mean error* is the difference of the mean pictures from the reference of
tests/references/. CPU seconds count all threads and are the median of the runs, of rendering alone: without loading, compilation and the
trees, with mixray's pilot, with what Cycles does anew for each picture; without the mask, which is taken from the reference for Cycles. The last column leaves
out the worst 0.1% of each contender's pixels. A light tracer, which sees nothing smooth, is compared on the pixels without virtual objects. `--caustics` judges
only those of them that caustics change by a code or more, by two converged renders of mixray, of which one has black objects. `--write` replaces the scenes' rows in docs/benchmarks.md.
"""

import argparse
import copy
import sys
import tempfile
from pathlib import Path

import numpy as np

import mixray_run
from accuracy import Reference, cpu_secs, write_rows
from cycles_scene import CyclesScene, plane
from mitsuba_scene import Passes, Unsupported

# Rays per pixel of the pictures that tell where caustics are.
CONVERGED = 1024
PAGE = mixray_run.ROOT / "docs" / "benchmarks.md"


def mixray(reference, folder, rays_per_pixel, estimator, sampler):
    path = mixray_run.write_scene(reference.scene, folder)

    def render(seed):
        options = {"rays_per_pixel": rays_per_pixel, "seed": seed, "estimator": estimator, "sampler": sampler}
        # A PNG spares the real radiance that an EXR's planes need; the composite is read from an EXR of the same seed.
        _, stats = mixray_run.render(path, picture="out.png", **options)
        return mixray_run.rgb(mixray_run.render(path, **options)[0]), stats["seconds"]["cpu"]

    return render


def mitsuba(reference, rays_per_pixel, integrator):
    passes = Passes(reference.scene, "multijitter", rays_per_pixel, integrator)
    passes.mixed(0), passes.real(0)

    def render(seed):
        mask = passes.mask(1_000_000 + seed)
        start = cpu_secs()
        mixed, real = passes.mixed(1_000_000 + seed), passes.real(1_000_000 + seed)
        secs = cpu_secs() - start
        return reference.scene.composite(mask, mixed, real), secs

    return render


def cycles_two_passes(reference, cycles, rays_per_pixel):
    def render(seed):
        mixed, mixed_secs = cycles.render("mixed", rays_per_pixel, seed)
        real, real_secs = cycles.render("real", rays_per_pixel, seed)
        planes = (plane(p, "Combined") for p in (mixed, real))
        return reference.scene.composite(reference.mask, *planes), mixed_secs + real_secs

    return render


def cycles_catcher(reference, cycles, rays_per_pixel):
    def render(seed):
        planes, secs = cycles.render("catcher", rays_per_pixel, seed)
        over, factor = plane(planes, "Combined", "RGBA"), plane(planes, "Shadow Catcher")
        return over[..., :3] + (1.0 - over[..., 3:]) * reference.scene.photo * factor, secs

    return render


LIGHT_TRACER = "Mitsuba, two passes, ptracer"


def contenders(reference, arguments, folder):
    """Functions from a seed to a composite and its CPU seconds, and Cycles' process or none."""
    rays = arguments.rays_per_pixel
    found = {
        "mixray, direct, sobol": mixray(reference, folder, rays, "direct", "sobol"),
        "mixray, paper, jittered": mixray(reference, folder, rays, "paper", "jittered"),
        "Mitsuba, two passes, multijitter": mitsuba(reference, rays, "path"),
    }
    if reference.scene.has_caustics():
        found[LIGHT_TRACER] = mitsuba(reference, rays, "ptracer")
    try:
        cycles = CyclesScene(reference.scene, arguments.cycles_python, folder)
    except Unsupported as missing:
        print(f"{reference.name}: without Cycles, which has no twin of {missing}", file=sys.stderr)
        return found, None
    found["Cycles, two passes"] = cycles_two_passes(reference, cycles, rays)
    found["Cycles, shadow catcher"] = cycles_catcher(reference, cycles, rays)
    return found, cycles


def codes(linear):
    """8-bit sRGB codes, not rounded."""
    linear = np.clip(linear, 0.0, 1.0)
    return 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def caustic_pixels(reference, folder):
    scenes = [reference.scene, copy.copy(reference.scene)]
    scenes[1].toml = copy.deepcopy(reference.scene.toml)
    for entry in scenes[1].toml["virtual"]:
        entry["material"] = {"base_color": [0.0, 0.0, 0.0], "specular": 0.0}
    shown = []
    for scene in scenes:
        path = mixray_run.write_scene(scene, folder)
        shown.append(codes(mixray_run.rgb(mixray_run.render(path, rays_per_pixel=CONVERGED, seed=0)[0])))
    return (np.abs(shown[0] - shown[1]).max(-1) >= 1.0) & reference.background


def trimmed_mean(squared):
    """Of squared errors by pixel, without the worst 0.1%."""
    ordered = np.sort(squared, axis=None)
    return ordered[: len(ordered) - max(1, len(ordered) // 1000)].mean()


def measure(name, arguments, folder):
    reference = Reference(name)
    everywhere = np.full(reference.background.shape, True)
    judged_by_all = caustic_pixels(reference, folder) if arguments.caustics else everywhere
    turns, cycles = contenders(reference, arguments, folder)
    for render in turns.values():
        render(arguments.runs)
    images, secs = {n: [] for n in turns}, {n: [] for n in turns}
    for seed in range(arguments.runs):
        for contender, render in turns.items():
            image, cost = render(seed)
            images[contender].append(image)
            secs[contender].append(cost)
    if cycles:
        cycles.close()
    variance = {n: np.var(pictures, axis=0, ddof=1).mean(-1) for n, pictures in images.items()}
    cost = {n: np.median(seconds) for n, seconds in secs.items()}
    ours = next(iter(turns))
    rows = []
    for contender, pictures in images.items():
        judged = judged_by_all & (reference.background if contender == LIGHT_TRACER else everywhere)
        squared = variance[contender][judged]
        errors = (np.mean(pictures, axis=0) - reference.composite)[judged & reference.known]
        mean_error = errors.mean() / reference.composite[judged & reference.known].mean()
        dearer = cost[contender] / cost[ours]
        our_squared = variance[ours][judged]
        rows.append(
            [
                f"{name}, caustics" if arguments.caustics else name,
                contender,
                f"{np.sqrt(squared.mean()):.5f}",
                f"{100.0 * mean_error:+.3f}%",
                f"{cost[contender]:.2f}",
                f"{1.0 / (cost[contender] * squared.mean()):.3g}",
                f"{dearer * squared.mean() / our_squared.mean():.2f}",
                f"{dearer * trimmed_mean(squared) / trimmed_mean(our_squared):.2f}",
            ]
        )
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--rays-per-pixel", type=int, default=49)
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--cycles-python", default=sys.executable)
    parser.add_argument("--caustics", action="store_true")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    header = [
        "scene",
        "renderer",
        f"RMSE at {arguments.rays_per_pixel} rays per pixel",
        "mean error",
        "CPU secs",
        "1 / (CPU secs x MSE)",
        "mixray's over it",
        "without the worst 0.1%",
    ]
    for name in arguments.scenes:
        with tempfile.TemporaryDirectory() as folder:
            rows = measure(name, arguments, Path(folder))
        for row in [header, *rows]:
            print("| " + " | ".join(row) + " |", flush=True)
        if arguments.write:
            write_rows("efficiency", header, rows, PAGE)


if __name__ == "__main__":
    main()
