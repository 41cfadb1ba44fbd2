#!/usr/bin/env python3
"""Error per second of the composite: mixray, Mitsuba 3 and Blender's Cycles in turns, on the same scenes at equal rays.

    pip install mitsuba numpy        (and LLVM 19: apt-get install libllvm19)
    pip install bpy                  (in the same Python, or in one named by --cycles-python)
    cargo build --release
    python3 benches/peers/efficiency.py room far --rays-per-pixel 49 --runs 6

Every contender renders each scene `--runs` times, with another seed each, one after the other. The squared error is the variance between its own
runs, so that no contender is judged by another's converged picture; *mean error* is the difference of the mean pictures from the reference of
tests/references/. CPU seconds count all threads and are the median of the runs, of rendering alone: without loading, compilation and the
trees, with mixray's pilot, with what Cycles does anew for each picture; without the mask, which is taken from the reference for Cycles. `--write` replaces the scenes' rows in
docs/benchmarks.md.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

import mixray_run
from accuracy import Reference, cpu_secs, write_rows
from cycles_scene import CyclesScene, plane
from mitsuba_scene import Passes

PAGE = mixray_run.ROOT / "docs" / "benchmarks.md"


def mixray(reference, folder, rays_per_pixel, estimator, sampler):
    path = mixray_run.write_scene(reference.scene, folder)

    def render(seed):
        options = {"rays_per_pixel": rays_per_pixel, "seed": seed, "estimator": estimator, "sampler": sampler}
        # A PNG spares the real radiance that an EXR's planes need; the composite is read from an EXR of the same seed.
        _, stats = mixray_run.render(path, picture="out.png", **options)
        return mixray_run.rgb(mixray_run.render(path, **options)[0]), stats["seconds"]["cpu"]

    return render


def mitsuba(reference, rays_per_pixel):
    passes = Passes(reference.scene, "multijitter", rays_per_pixel)
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


def measure(name, arguments, folder):
    reference = Reference(name)
    rays = arguments.rays_per_pixel
    cycles = CyclesScene(reference.scene, arguments.cycles_python, folder)
    contenders = {
        "mixray, direct, sobol": mixray(reference, folder, rays, "direct", "sobol"),
        "mixray, paper, jittered": mixray(reference, folder, rays, "paper", "jittered"),
        "Mitsuba, two passes, multijitter": mitsuba(reference, rays),
        "Cycles, two passes": cycles_two_passes(reference, cycles, rays),
        "Cycles, shadow catcher": cycles_catcher(reference, cycles, rays),
    }
    for render in contenders.values():
        render(arguments.runs)
    images, secs = {n: [] for n in contenders}, {n: [] for n in contenders}
    for seed in range(arguments.runs):
        for contender, render in contenders.items():
            image, cost = render(seed)
            images[contender].append(image)
            secs[contender].append(cost)
    cycles.close()
    rows, first = [], None
    for contender, pictures in images.items():
        pictures = np.array(pictures)
        squared, cost = pictures.var(0, ddof=1).mean(), np.median(secs[contender])
        efficiency = 1.0 / (cost * squared)
        first = first or efficiency
        mean_error = (pictures.mean(0) - reference.composite).mean() / reference.composite.mean()
        rows.append(
            [
                name,
                contender,
                f"{np.sqrt(squared):.5f}",
                f"{100.0 * mean_error:+.2f}%",
                f"{cost:.2f}",
                f"{efficiency:.3g}",
                f"{first / efficiency:.2f}",
            ]
        )
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--rays-per-pixel", type=int, default=49)
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--cycles-python", default=sys.executable)
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
