"""Decodes the Cryptomatte of an EXR file by the published specification (1.2.0), and compares an object's matte with a mask.

    python3 mattes.py RENDER.exr OBJECT MASK.exr

MASK.exr holds the mask in `mask.Y`. Prints the largest difference and the pixels that the object covers in part; exit code 1 if a difference is above
0.05, which two renders with other samples of 32 rays may have, their mean in such pixels above 0.005, or the file does not keep to the specification. Needs OpenEXR and numpy.
"""

import json
import sys

import numpy as np
import OpenEXR


def murmur3(data):
    """MurmurHash3_x86_32 with seed 0."""
    word = 0xFFFFFFFF
    turn = lambda x, by: (x << by | x >> (32 - by)) & word
    value = 0
    for at in range(0, len(data), 4):
        block = data[at : at + 4]
        mixed = int.from_bytes(block, "little") * 0xCC9E2D51 & word
        value ^= turn(mixed, 15) * 0x1B873593 & word
        if len(block) == 4:
            value = (turn(value, 13) * 5 + 0xE6546B64) & word
    value ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35), (16, 1)):
        value = (value ^ value >> shift) * factor & word
    return value


def to_float(value):
    """uint32_to_float32: exponents of 0 and 255 are avoided."""
    exponent = min(max(value >> 23 & 255, 1), 254)
    bits = value & 0x80000000 | exponent << 23 | value & 0x7FFFFF
    return np.array(bits, np.uint32).view(np.float32)


def channels_of(path):
    with OpenEXR.File(path, separate_channels=True) as file:
        return dict(file.header()), {name: channel.pixels for name, channel in file.channels().items()}


def matte(header, channels, name):
    key = f"cryptomatte/{murmur3(b'CryptoObject'):08x}"[: len("cryptomatte/") + 7]
    assert header[f"{key}/name"] == "CryptoObject", "name"
    assert header[f"{key}/hash"] == "MurmurHash3_32", "hash"
    assert header[f"{key}/conversion"] == "uint32_to_float32", "conversion"
    manifest = json.loads(header[f"{key}/manifest"])
    value = to_float(murmur3(name.encode()))
    assert manifest[name] == f"{value.view(np.uint32):08x}", "manifest"
    total, before = 0.0, None
    for layer in range(sum(name.endswith(".red") for name in channels)):
        for ids, coverage in (("red", "green"), ("blue", "alpha")):
            ids, coverage = (channels[f"CryptoObject{layer:02}.{plane}"] for plane in (ids, coverage))
            assert before is None or (coverage <= before).all(), "ranks fall"
            before = coverage
            total = total + np.where(ids == value, coverage, 0.0)
    return total


def main(render, name, mask):
    found = matte(*channels_of(render), name)
    truth = channels_of(mask)[1]["mask.Y"]
    worst = np.abs(found - truth).max()
    partly = (truth > 0.02) & (truth < 0.98)
    mean = np.abs(found - truth)[partly].mean()
    print(f"{name}: {worst:.5f} from the mask at most, {mean:.5f} in the mean of {partly.sum()} pixels in part")
    return int(not (worst < 0.05 and mean < 0.005))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
