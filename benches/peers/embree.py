#!/usr/bin/env python3
"""CPU traversal beside Embree 4's rtcIntersect1 and rtcOccluded1, on the same rays, alternating in one run.

    pip install embreex numpy
    python3 benches/peers/embree.py [--rounds N] [--robust]

Needs a C compiler: a loop of a few lines calls the Embree that the embreex wheel bundles, one ray at a time, so that no Python
runs while the clock does. Prints a table of Mrays/s on one thread, the ratio mixray / Embree and that of the medians; exits with 1 if the two
sides' hit counts differ by more than one in a thousand.
"""

import argparse
import ctypes
import glob
import importlib.util
import os
import subprocess
import sys
import tempfile

import numpy as np

LOOP = r"""
#include <stddef.h>
#include <string.h>
#include <time.h>

/* RTCRay and RTCRayHit of Embree 4.3 and later: 12 words of ray, 9 of hit, padded to 16 bytes. */
typedef struct __attribute__((aligned(16))) {
    float org[3], tnear, dir[3], time, tfar;
    unsigned mask, id, flags;
    float ng[3], u, v;
    unsigned prim, geom, inst[2];
    unsigned spare[11];
} RayHit;

typedef void (*Trace)(void *scene, void *ray, void *arguments);

double run(Trace trace, void *scene, const float *rays, size_t count, int any, size_t *hits, double *distance) {
    struct timespec start, end;
    size_t found = 0;
    double sum = 0.0;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (size_t i = 0; i < count; i++) {
        const float *r = rays + 8 * i;
        RayHit ray;
        memcpy(ray.org, r, 4 * sizeof(float));
        memcpy(ray.dir, r + 4, 3 * sizeof(float));
        ray.time = 0.0f;
        ray.tfar = r[7];
        ray.mask = ~0u;
        ray.id = 0;
        ray.flags = 0;
        ray.geom = ray.inst[0] = ray.inst[1] = ~0u;
        trace(scene, &ray, NULL);
        if (any ? ray.tfar < 0.0f : ray.geom != ~0u) {
            found++;
            if (!any) sum += ray.tfar;
        }
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    *hits = found;
    *distance = sum;
    return (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
}
"""

TRIANGLE_GEOMETRY = 0
INDEX_BUFFER, VERTEX_BUFFER = 0, 1
FORMAT_UINT3, FORMAT_FLOAT3 = 0x5003, 0x9003
SCENE_FLAG_ROBUST = 4

# Rays timed together, CHUNK in examples/traversal_peer.rs: about a millisecond.
CHUNK = 4096


def load_embree():
    spec = importlib.util.find_spec("embreex")
    if spec is None:
        sys.exit("embree.py: embreex is not installed: pip install embreex")
    bundled = os.path.join(os.path.dirname(os.path.dirname(spec.origin)), "embreex.libs")
    for name in ("libtbb*", "libembree4*"):
        for path in glob.glob(os.path.join(bundled, name)):
            library = ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL)
    for name in ("rtcNewDevice", "rtcNewScene", "rtcNewGeometry"):
        getattr(library, name).restype = ctypes.c_void_p
    return library


class EmbreeScene:
    def __init__(self, library, device, corners, robust):
        pointer, unsigned, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
        # Embree reads 16 bytes from the last vertex.
        self.corners = np.concatenate([corners.ravel(), np.zeros(4, np.float32)])
        count = corners.size // 3
        self.indices = np.concatenate([np.arange(count, dtype=np.uint32), np.zeros(4, np.uint32)])
        self.scene = pointer(library.rtcNewScene(device))
        if robust:
            library.rtcSetSceneFlags(self.scene, unsigned(SCENE_FLAG_ROBUST))
        geometry = pointer(library.rtcNewGeometry(device, TRIANGLE_GEOMETRY))

        def share(kind, layout, array, items):
            library.rtcSetSharedGeometryBuffer(
                geometry, unsigned(kind), unsigned(0), unsigned(layout), pointer(array.ctypes.data), size(0), size(12), size(items)
            )

        share(INDEX_BUFFER, FORMAT_UINT3, self.indices, count // 3)
        share(VERTEX_BUFFER, FORMAT_FLOAT3, self.corners, count)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self.scene, geometry)
        library.rtcCommitScene(self.scene)
        error = library.rtcGetDeviceError(device)
        if error:
            sys.exit(f"embree.py: Embree reports error {error}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="alternations (default 15)")
    parser.add_argument("--robust", action="store_true", help="Embree's robust mode")
    parser.add_argument("--isa", help="instructions that Embree may use, such as avx2 (default: all, AVX-512 included)")
    arguments = parser.parse_args()
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    library = load_embree()
    device = ctypes.c_void_p(library.rtcNewDevice(f"isa={arguments.isa}".encode() if arguments.isa else None))
    with tempfile.TemporaryDirectory() as folder:
        source, binary = os.path.join(folder, "loop.c"), os.path.join(folder, "loop.so")
        with open(source, "w") as file:
            file.write(LOOP)
        subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", binary, source], check=True)
        loop = ctypes.CDLL(binary).run
        loop.restype = ctypes.c_double
        command = ["cargo", "run", "--release", "--quiet", "--example", "traversal_peer", "--", folder]
        peer = subprocess.Popen(command, cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        names = []
        while (line := peer.stdout.readline().strip()) != "ready":
            if not line:
                sys.exit("embree.py: the mixray side ended early")
            names.append(line)

        def mixray(kind, name, order):
            peer.stdin.write(f"{kind} {name} {order}\n")
            peer.stdin.flush()
            hits, distance, *seconds = peer.stdout.readline().split()
            return np.array(seconds, float), int(hits), float(distance)

        def embree(scene, rays, kind):
            total_hits, total_distance, seconds = 0, 0.0, []
            hits, distance = ctypes.c_size_t(), ctypes.c_double()
            function = library.rtcIntersect1 if kind == "closest" else library.rtcOccluded1
            for first in range(0, len(rays), CHUNK):
                chunk = rays[first : first + CHUNK]
                seconds.append(
                    loop(
                        function,
                        scene.scene,
                        ctypes.c_void_p(chunk.ctypes.data),
                        ctypes.c_size_t(len(chunk)),
                        ctypes.c_int(kind == "any"),
                        ctypes.byref(hits),
                        ctypes.byref(distance),
                    )
                )
                total_hits += hits.value
                total_distance += distance.value
            return np.array(seconds), total_hits, total_distance

        mode = ("robust" if arguments.robust else "default") + " mode, " + (arguments.isa or "all instructions")
        print(f"Mrays/s on one thread, each chunk's fastest of {arguments.rounds} alternations; Embree in {mode}")
        print(f"{'mesh':<14} {'rays':<11} {'query':<8} {'mixray':>8} {'embree':>8} {'ratio':>6} {'medians':>7}")
        agreed = True
        for name in names:
            corners = np.fromfile(os.path.join(folder, name + ".triangles"), np.float32)
            scene = EmbreeScene(library, device, corners, arguments.robust)
            for order in ("coherent", "incoherent"):
                rays = np.fromfile(os.path.join(folder, f"{name}.{order}"), np.float32).reshape(-1, 8)
                for kind in ("closest", "any"):
                    ours, theirs = [], []
                    for _ in range(arguments.rounds + 1):
                        ours.append(mixray(kind, name, order))
                        theirs.append(embree(scene, rays, kind))
                    if abs(ours[0][1] - theirs[0][1]) > 1e-3 * len(rays):
                        agreed = False
                        print(f"hits differ: {ours[0][1]} and {theirs[0][1]}")
                    if kind == "closest" and abs(ours[0][2] - theirs[0][2]) > 2e-3 * ours[0][2]:
                        agreed = False
                        print(f"distances differ: {ours[0][2]} and {theirs[0][2]}")
                    # What else runs on the machine can only slow a chunk down: each chunk's fastest time counts. The first
                    # alternation warms up.
                    a, b = (np.array([run[0] for run in runs[1:]]) for runs in (ours, theirs))
                    a_rate, b_rate = (len(rays) / np.min(times, axis=0).sum() / 1e6 for times in (a, b))
                    medians = np.median(b, axis=0).sum() / np.median(a, axis=0).sum()
                    row = f"{a_rate:8.2f} {b_rate:8.2f} {a_rate / b_rate:6.2f} {medians:7.2f}"
                    print(f"{name:<14} {order:<11} {kind:<8} {row}", flush=True)
        peer.stdin.close()
        peer.wait()
    sys.exit(0 if agreed else 1)


if __name__ == "__main__":
    main()
