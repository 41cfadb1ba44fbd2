"""Puts a render together again from its photograph and its EXR layers, as a compositing program does (docs/compositing.md).

    python3 recompose.py PHOTO.png RENDER.exr RENDER.png [--without LAYER]

Prints how far, in 8-bit codes, the result is at most from the picture in the file, and how many codes of the PNG that mixray wrote are others than
docs/speckles.md says; exit code 1 if it is too far, or more than one in a hundred are. Needs OpenEXR, numpy and OpenCV (pip install OpenEXR numpy opencv-python-headless).
"""

import sys

import cv2
import numpy as np
import OpenEXR


def linear(path):
    """An sRGB picture of 8 bits as linear light."""
    codes = cv2.imread(path, cv2.IMREAD_COLOR)[..., ::-1] / 255.0
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


def codes(light):
    """Linear light as sRGB codes, not rounded."""
    light = np.clip(light, 0.0, 1.0)
    return 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def kept(found, own):
    """The codes of a PNG: the photograph's where the change is small, on average around and here; else the nearest."""
    change = found - own
    is_small = np.abs(change) < 2.5
    around = lambda values: cv2.boxFilter(values, -1, (9, 9), normalize=False, borderType=cv2.BORDER_CONSTANT)
    mean = around(np.where(is_small, change, 0.0)) / np.maximum(around(is_small.astype(np.float64)), 1.0)
    return np.where((np.abs(change) < 1.4) & (np.abs(mean) < 0.85), own, np.round(found))


def recompose(photo, layers):
    """The picture; `layers` are the channels of an EXR file, RGB and RGBA together."""
    virtual = layers["virtual"].astype(np.float64)
    real = photo * layers.get("ratio", 1.0)
    picture = (1.0 - virtual[..., 3:]) * real + virtual[..., :3] + layers.get("change", 0.0)
    return picture + layers.get("sharpness", 0.0) + layers.get("noise", 0.0)


def main(photo, exr, png, without=None):
    with OpenEXR.File(exr) as file:
        layers = {name: channel.pixels for name, channel in file.channels().items()}
    layers.pop(without, None)
    found = codes(recompose(linear(photo), layers))
    of_exr = np.abs(found - codes(layers["RGB"].astype(np.float64))).max()
    own, written = codes(linear(photo)), codes(linear(png))
    expected = kept(found, np.round(own))
    others = np.mean(np.abs(expected - written) > 0.1)
    farthest = np.abs(expected - written).max()
    # Half a code is the PNG's own rounding; only a code that is the photograph's may be farther off.
    off = np.abs(found - written)
    is_own = np.abs(np.round(own) - written) < 0.1
    far = np.any(off > np.where(is_own, 1.65, 0.75))
    print(f"{of_exr:.4f} codes from R, G and B of the file; {100 * others:.2f}% of the PNG's codes are others, by {farthest:.0f} at most")
    return int(of_exr > 0.25 or others > 0.01 or farthest > 1.1 or far)


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--without"]
    sys.exit(main(*words))
