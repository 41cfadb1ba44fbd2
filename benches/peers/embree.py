#!/usr/bin/env python3
"""CPU traversal beside Embree 4's rtcIntersect1 and rtcOccluded1 and obvhs' own traversals, on the same rays, alternating in one run.

    pip install embreex numpy
    python3 benches/peers/embree.py [--rounds N] [--threads N ...] [--robust] [--isa ISA] [--write docs/traversal.md]

Needs a C compiler: a loop of a few lines calls the Embree that the embreex wheel bundles, one ray at a time, so that no Python
runs while the clock does. Prints a table of Mrays/s with the ratios of mixray to Embree and to the faster of obvhs' two trees; exits with 1
if mixray's and Embree's hit counts differ by more than one in a thousand.
"""

import argparse
import ctypes
import glob
import importlib.metadata
import importlib.util
import os
import platform
import shlex
import subprocess
import sys
import tempfile
import threading

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
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
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
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
    *hits = found;
    *distance = sum;
    return (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
}
"""

TRIANGLE_GEOMETRY = 0
INDEX_BUFFER, VERTEX_BUFFER = 0, 1
FORMAT_UINT3, FORMAT_FLOAT3 = 0x5003, 0x9003
SCENE_FLAG_ROBUST = 4

# Rays timed together, CHUNK in examples/traversal_peer.rs: less than two milliseconds.
CHUNK = 2048


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


def embree_times(library, scene, loop, rays, kind, threads):
    """Processor seconds of each chunk, hits, and the sum of their distances. Each thread takes every `threads`-th chunk."""
    function = library.rtcIntersect1 if kind == "closest" else library.rtcOccluded1
    chunks = [rays[first : first + CHUNK] for first in range(0, len(rays), CHUNK)]
    results = []

    def run(thread):
        for chunk in chunks[thread::threads]:
            hits, distance = ctypes.c_size_t(), ctypes.c_double()
            # The interpreter's lock is not held in the call.
            seconds = loop(
                function,
                scene.scene,
                ctypes.c_void_p(chunk.ctypes.data),
                ctypes.c_size_t(len(chunk)),
                ctypes.c_int(kind == "any"),
                ctypes.byref(hits),
                ctypes.byref(distance),
            )
            results.append((thread, seconds, hits.value, distance.value))

    others = [threading.Thread(target=run, args=(thread,)) for thread in range(1, threads)]
    for other in others:
        other.start()
    run(0)
    for other in others:
        other.join()
    results.sort(key=lambda result: result[0])
    return np.array([result[1] for result in results]), sum(r[2] for r in results), sum(r[3] for r in results)


class RustSide:
    """examples/traversal_peer, which writes the meshes and rays to `folder`."""

    def __init__(self, root, folder):
        command = ["cargo", "run", "--release", "--quiet", "--example", "traversal_peer", "--", folder]
        self.process = subprocess.Popen(command, cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.names = []
        while (line := self.process.stdout.readline().strip()) != "ready":
            if not line:
                sys.exit("embree.py: the Rust side ended early")
            self.names.append(line)

    def times(self, tracer, kind, name, order, threads):
        self.process.stdin.write(f"{tracer} {kind} {name} {order} {threads}\n")
        self.process.stdin.flush()
        hits, distance, *seconds = self.process.stdout.readline().split()
        return np.array(seconds, float), int(hits), float(distance)

    def end(self):
        self.process.stdin.close()
        self.process.wait()


OBVHS = ("obvhs-bvh2", "obvhs-cwbvh")
COLUMNS = ("mesh", "rays", "query", "mixray", "Embree", "obvhs", "mixray / Embree", "of medians", "mixray / obvhs")


def measure(library, loop, rust, scene, rays, kind, name, order, threads, rounds):
    """One row of the table, and what mixray and Embree disagree about."""
    runs = {tracer: [] for tracer in ("mixray", "embree", *OBVHS)}
    for _ in range(rounds + 1):
        for tracer in runs:
            if tracer == "embree":
                runs[tracer].append(embree_times(library, scene, loop, rays, kind, threads))
            else:
                runs[tracer].append(rust.times(tracer, kind, name, order, threads))
    disagreements = []
    ours, theirs = runs["mixray"][0], runs["embree"][0]
    if abs(ours[1] - theirs[1]) > 1e-3 * len(rays):
        disagreements.append(f"hits differ: {ours[1]} and {theirs[1]}")
    if kind == "closest" and abs(ours[2] - theirs[2]) > 2e-3 * ours[2]:
        disagreements.append(f"distances differ: {ours[2]} and {theirs[2]}")
    # What else uses the caches can only slow a chunk down: each chunk's least time counts. The first alternation warms up.
    times = {tracer: np.array([run[0] for run in results[1:]]) for tracer, results in runs.items()}
    rate = {tracer: threads * len(rays) / np.min(seconds, axis=0).sum() / 1e6 for tracer, seconds in times.items()}
    medians = np.median(times["embree"], axis=0).sum() / np.median(times["mixray"], axis=0).sum()
    obvhs = max(rate[tracer] for tracer in OBVHS)
    figures = (rate["mixray"], rate["embree"], obvhs, rate["mixray"] / rate["embree"], medians, rate["mixray"] / obvhs)
    return (name, order, kind, *(f"{figure:.2f}" for figure in figures)), disagreements


def processor():
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def page(arguments, mode, tables):
    """The tables as a page of documentation."""
    command = shlex.join(["python3", "benches/peers/embree.py", *sys.argv[1:]])
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    lines = [
        "# Traversal on the CPU",
        "",
        "Closest-hit and any-hit rays of mixray (watertight), of Embree 4 (`rtcIntersect1`, `rtcOccluded1`) and of obvhs (the faster of its",
        "BVH2 and CWBVH traversals, preset `medium`) on the same rays, one at a time, alternating in one run. Rates are in millions of rays a",
        f"processor second, times the threads; each chunk of {CHUNK} rays counts with its least time of {arguments.rounds} alternations, and \"of medians\"",
        "is the ratio to Embree by each chunk's median time, which feels what else used the caches. Coherent rays come from a pinhole camera row by row, incoherent",
        "ones leave the camera's hits in cosine-distributed directions in random order.",
        "",
        "Written by",
        "",
        "    " + command,
        "",
        f"on {processor()}, {os.cpu_count()} cores, load average at the end {load}; Embree of embreex {importlib.metadata.version('embreex')} in {mode}.",
    ]
    for threads, rows in tables:
        lines += ["", f"## {'One thread' if threads == 1 else f'{threads} threads'}", ""]
        lines += ["| " + " | ".join(COLUMNS) + " |", "| --- | --- | --- |" + " ---: |" * (len(COLUMNS) - 3)]
        lines += ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15, help="alternations (default 15)")
    parser.add_argument("--threads", type=int, nargs="+", default=[1], help="a table for each of these numbers of threads (default 1)")
    parser.add_argument("--robust", action="store_true", help="Embree's robust mode")
    parser.add_argument("--isa", help="instructions that Embree may use, such as avx2 (default: all, AVX-512 included)")
    parser.add_argument("--write", metavar="FILE", help="write the tables to this Markdown file as well")
    arguments = parser.parse_args()
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    library = load_embree()
    device = ctypes.c_void_p(library.rtcNewDevice(f"isa={arguments.isa}".encode() if arguments.isa else None))
    mode = ("robust" if arguments.robust else "default") + " mode, " + (arguments.isa or "all instructions")
    agreed, tables = True, []
    with tempfile.TemporaryDirectory() as folder:
        source, binary = os.path.join(folder, "loop.c"), os.path.join(folder, "loop.so")
        with open(source, "w") as file:
            file.write(LOOP)
        subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", binary, source], check=True)
        loop = ctypes.CDLL(binary).run
        loop.restype = ctypes.c_double
        rust = RustSide(root, folder)
        scenes, rays = {}, {}
        for name in rust.names:
            corners = np.fromfile(os.path.join(folder, name + ".triangles"), np.float32)
            scenes[name] = EmbreeScene(library, device, corners, arguments.robust)
            for order in ("coherent", "incoherent"):
                rays[name, order] = np.fromfile(os.path.join(folder, f"{name}.{order}"), np.float32).reshape(-1, 8)
        widths = (13, 10, 7, 7, 7, 7, 15, 10, 14)
        for threads in arguments.threads:
            print(f"Mrays/s on {threads} thread(s), each chunk's least time of {arguments.rounds} alternations; Embree in {mode}")
            print("  ".join(column.ljust(width) for column, width in zip(COLUMNS, widths)))
            rows = []
            for name, order in rays:
                for kind in ("closest", "any"):
                    row, disagreements = measure(
                        library, loop, rust, scenes[name], rays[name, order], kind, name, order, threads, arguments.rounds
                    )
                    rows.append(row)
                    print("  ".join(cell.ljust(width) for cell, width in zip(row, widths)), *disagreements, flush=True)
                    agreed = agreed and not disagreements
            tables.append((threads, rows))
        rust.end()
    if arguments.write:
        with open(arguments.write, "w") as file:
            file.write(page(arguments, mode, tables))
    sys.exit(0 if agreed else 1)


if __name__ == "__main__":
    main()
