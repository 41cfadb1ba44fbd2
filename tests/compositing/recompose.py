"""Puts a render together again from its photograph and its EXR layers, as a compositing program does (docs/compositing.md).

    python3 recompose.py PHOTO.png RENDER.exr RENDER.png [--without LAYER]

Prints how far, in 8-bit codes, the result is at most from the picture in the file and from the PNG that mixray wrote; exit code 1 if it is too
far. Needs OpenEXR, numpy and OpenCV (pip install OpenEXR numpy opencv-python-headless).
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
    of_png = np.abs(found - codes(linear(png))).max()
    print(f"{of_exr:.4f} codes from R, G and B of the file, {of_png:.4f} from the PNG, of which half a code is its own rounding")
    return int(of_exr > 0.25 or of_png > 0.75)


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--without"]
    sys.exit(main(*words))
