#!/usr/bin/env python3
"""Makes the converged references of tests/references/ with Mitsuba 3.

    pip install mitsuba numpy        (and LLVM 19: apt-get install libllvm19)
    python3 benches/peers/mitsuba_reference.py scenes/room/scene.toml --rays-per-pixel 8192 -o tests/references/room.exr

Two passes and a mask with the same seeds, in batches. The file holds, in half floats, what does not depend on the photograph:

    R, G, B           composite of Eq. 4 without its photograph: the whole is this + (1 - mask) * Ic
    mask.Y            the fraction of primary rays that meet virtual geometry first
    error.R, .G, .B   standard error of the composite, from the spread of the batches and the rounding to half floats

`--integrator ptracer` starts paths at the lights and finds what those from the camera miss. It sees nothing smooth, so that such a reference, marked
by the attribute `integrator`, speaks only of pixels that no virtual object touches.
"""

import argparse
import time

import numpy as np

from mitsuba_scene import Passes, PeerScene, mi

BATCH_RAYS_PER_PIXEL = 256


def half_rounding(values):
    """Standard error of rounding to half floats."""
    step = 2.0 ** (np.floor(np.log2(np.maximum(np.abs(values), 2.0**-14))) - 10.0)
    return step / np.sqrt(12.0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--shrink", type=int, default=2, help="divides the picture's sides (default 2)")
    parser.add_argument("--rays-per-pixel", type=int, required=True)
    parser.add_argument("--integrator", choices=["path", "ptracer"], default="path")
    parser.add_argument("-o", "--output", required=True)
    arguments = parser.parse_args()
    scene = PeerScene(arguments.scene, arguments.shrink)
    passes = Passes(scene, "multijitter", BATCH_RAYS_PER_PIXEL, arguments.integrator)
    batches = max(2, arguments.rays_per_pixel // BATCH_RAYS_PER_PIXEL)
    sums = [0.0, 0.0, 0.0]
    composite_sum = square_sum = 0.0
    start = time.time()
    for seed in range(batches):
        images = [passes.mask(seed), passes.mixed(seed), passes.real(seed)]
        sums = [total + image for total, image in zip(sums, images)]
        composite = scene.composite(*images)
        composite_sum = composite_sum + composite
        square_sum = square_sum + composite**2
    mask, mixed, real = (total / batches for total in sums)
    added = mask * mixed + (1.0 - mask) * (mixed - real)
    spread = np.maximum(square_sum / batches - (composite_sum / batches) ** 2, 0.0)
    error = np.hypot(np.sqrt(spread / (batches - 1)), half_rounding(added))
    planes = np.concatenate([added, mask, error], axis=-1).astype(np.float16)
    names = ["R", "G", "B", "mask.Y", "error.R", "error.G", "error.B"]
    bitmap = mi.Bitmap(planes, pixel_format=mi.Bitmap.PixelFormat.MultiChannel, channel_names=names)
    bitmap.metadata()["raysPerPixel"] = batches * BATCH_RAYS_PER_PIXEL
    bitmap.metadata()["integrator"] = arguments.integrator
    bitmap.metadata()["renderer"] = f"Mitsuba {mi.__version__}"
    bitmap.write(arguments.output)
    print(
        f"{arguments.output}: {batches * BATCH_RAYS_PER_PIXEL} rays per pixel, standard error {np.sqrt((error**2).mean()):.2e} RMS, "
        f"{time.time() - start:.0f} s"
    )


if __name__ == "__main__":
    main()
