#!/usr/bin/env python3
"""Accuracy of mixray against converged references made with Mitsuba 3, and error at equal rays beside Mitsuba's own.

    pip install mitsuba numpy        (and LLVM 19: apt-get install libllvm19)
    cargo build --release
    python3 benches/peers/accuracy.py converge room --rays-per-pixel 256 --runs 4
    python3 benches/peers/accuracy.py equal-rays room --runs 8

A scene is a folder of scenes/ with a reference of the same name in tests/references/. With `--write` the table replaces the scene's rows
in docs/accuracy.md. `--images FOLDER` writes the difference from the reference, mean of the runs, amplified.
"""

import argparse
import re
import resource
import tempfile
from pathlib import Path

import numpy as np

import mixray_run
from mitsuba_scene import Passes, PeerScene, mi

PAGE = mixray_run.ROOT / "docs" / "accuracy.md"
BLOCK_PX = 8


class Reference:
    def __init__(self, name):
        layers, self.rays_per_pixel, integrator = read_reference(mixray_run.reference_file(name))
        path = mixray_run.scene_file(name)
        self.scene = PeerScene(path, PeerScene(path).height // layers["mask.Y"].shape[0])
        self.name = name
        mask = layers["mask.Y"][..., None]
        ic = 0.0 if self.scene.photo is None else self.scene.photo
        self.mask = mask
        self.composite = mixray_run.rgb(layers) + (1.0 - mask) * ic
        self.error = mixray_run.rgb(layers, "error")
        # Light tracers see nothing smooth.
        self.background = layers["mask.Y"] == 0.0
        self.known = self.background if integrator == "ptracer" else np.full(self.background.shape, True)


def read_reference(path):
    bitmap = mi.Bitmap(str(path))
    planes = np.array(bitmap).astype(np.float64)
    names = [field.name for field in bitmap.struct_()]
    metadata = bitmap.metadata()
    integrator = metadata["integrator"] if "integrator" in metadata else "path"
    return {name: planes[..., i] for i, name in enumerate(names)}, metadata["raysPerPixel"], integrator


def cpu_secs():
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


def mixray_composites(reference, runs, timed=False, **options):
    """Composites of seeds 0..runs, and the least CPU seconds of rendering alone, the pilot included, of as many runs that compute only the composite."""
    with tempfile.TemporaryDirectory() as folder:
        path = mixray_run.write_scene(reference.scene, Path(folder))
        images = [mixray_run.rgb(mixray_run.render(path, seed=seed, **options)[0]) for seed in range(runs)]
        times = range(runs if timed else 0)
        secs = [mixray_run.render(path, seed=seed, picture="out.png", **options)[1]["seconds"]["cpu"] for seed in times]
        return np.array(images), min(secs, default=None)


def mitsuba_composites(reference, runs, rays_per_pixel):
    """As above, in two passes; the mask's cost is left out, and so is the compilation, which the first run does."""
    passes = Passes(reference.scene, "multijitter", rays_per_pixel)
    images, secs = [], []
    # Seeds that the reference has not used.
    for seed in range(1_000_000, 1_000_000 + runs):
        mask = passes.mask(seed)
        start = cpu_secs()
        mixed, real = passes.mixed(seed), passes.real(seed)
        secs.append(cpu_secs() - start)
        images.append(reference.scene.composite(mask, mixed, real))
    return np.array(images), min(secs)


def blocks(image):
    """Sums over blocks of pixels."""
    height, width = (side // BLOCK_PX * BLOCK_PX for side in image.shape[:2])
    return image[:height, :width].reshape(height // BLOCK_PX, BLOCK_PX, width // BLOCK_PX, BLOCK_PX, -1).sum((1, 3))


def converge(reference, arguments):
    if arguments.virtual:
        reference.known &= reference.mask[..., 0] > 0.999
        reference.composite = reference.composite * reference.known[..., None]
    images, _ = mixray_composites(
        reference, arguments.runs, rays_per_pixel=arguments.rays_per_pixel, backend=arguments.backend, combine=arguments.combine
    )
    error = (images.mean(0) - reference.composite) * reference.known[..., None]
    scale = reference.composite.mean()
    mixray_error = (images * reference.known[..., None]).mean((1, 2, 3)).std(ddof=1) / np.sqrt(arguments.runs)
    reference_error = np.sqrt((reference.error**2 * reference.known[..., None]).sum()) / error.size
    variance = (images.var(0, ddof=1) / arguments.runs + reference.error**2) * reference.known[..., None]
    z = blocks(error) / np.sqrt(blocks(variance)).clip(1e-12)
    if arguments.images:
        amplified = np.clip(0.5 + arguments.gain * error, 0.0, 1.0)
        path = str(Path(arguments.images) / f"{reference.name}.png")
        mi.Bitmap((255.0 * amplified).astype(np.uint8)).write(path)
    percent = 100.0 / scale
    return (
        ["scene", "rays per pixel", "mean error", "standard error, mixray", "standard error, reference", "RMS of block z", "largest block z"],
        [
            [
                reference.name,
                f"{arguments.runs} x {arguments.rays_per_pixel}",
                f"{percent * error.mean():+.4f}%",
                f"{percent * mixray_error:.4f}%",
                f"{percent * reference_error:.4f}%",
                f"{np.sqrt((z**2).mean()):.2f}",
                f"{np.abs(z).max():.1f} of {z.size}",
            ]
        ],
    )


def equal_rays(reference, arguments):
    rays_per_pixel, runs = arguments.rays_per_pixel, arguments.runs
    contenders = {"Mitsuba, two passes, multijitter": mitsuba_composites(reference, runs, rays_per_pixel)}
    for estimator, sampler in [("direct", "sobol"), ("direct", "cmj"), ("paper", "jittered")]:
        contenders[f"mixray, {estimator}, {sampler}"] = mixray_composites(
            reference, runs, timed=True, rays_per_pixel=rays_per_pixel, estimator=estimator, sampler=sampler, backend=arguments.backend
        )
    known = reference.known
    noise = (reference.error[known] ** 2).mean()
    rows = []
    for name, (images, secs) in contenders.items():
        per_run = ((images - reference.composite)[:, known] ** 2).mean((1, 2)) - noise
        squared = per_run.mean()
        spread = per_run.std(ddof=1) / np.sqrt(runs)
        root = np.sqrt(squared)
        rows.append(
            [reference.name, name, f"{root:.5f} ± {spread / (2.0 * root):.5f}", f"{secs:.2f}", f"{1.0 / (secs * squared):.3g}"]
        )
    return ["scene", "renderer", f"RMSE at {rays_per_pixel} rays per pixel", "CPU secs", "1 / (CPU secs x MSE)"], rows


def write_rows(section, header, rows, path=PAGE):
    """Replaces the rows of a scene in the table between <!-- section --> and <!-- end -->."""
    page = path.read_text()
    pattern = re.compile(rf"(<!-- {section} -->\n)(.*?)(<!-- end -->)", re.DOTALL)
    kept = [line for line in pattern.search(page)[2].splitlines()[2:] if not line.startswith(f"| {rows[0][0]} |")]
    table = [header, ["---"] * len(header), *rows]
    lines = ["| " + " | ".join(row) + " |" for row in table] + kept
    path.write_text(pattern.sub(lambda match: match[1] + "\n".join(lines) + "\n" + match[3], page))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("check", choices=["converge", "equal-rays"])
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--rays-per-pixel", type=int, default=49)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--combine", default="robust", help="as mixray render takes it; mean has no bias")
    parser.add_argument("--virtual", action="store_true", help="only pixels that virtual objects cover wholly")
    parser.add_argument("--images")
    parser.add_argument("--gain", type=float, default=20.0)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        check = converge if arguments.check == "converge" else equal_rays
        header, rows = check(Reference(name), arguments)
        for row in [header, *rows]:
            print("| " + " | ".join(row) + " |", flush=True)
        if arguments.write:
            write_rows(arguments.check, header, rows)


if __name__ == "__main__":
    main()
