#!/usr/bin/env python3
"""Simulates farms of 1 to 1,000 workers from the seconds that a task's parts were measured to take, and draws docs/farm.svg.

    pip install matplotlib
    benches/farm/simulate.py --measure MIXRAY SHOT >seconds.json    # SHOT: of marker_shot.py; processor seconds on one thread
    benches/farm/simulate.py seconds.json docs/farm.svg

Model: an engine hands out one task after the other, each `dispatch_secs` after the one before at the earliest; a worker takes the next one
when it is free. A task starts, loads, renders and writes; the last step begins when all are done and looks at every frame, or merges
every part. A shared disk gives `disk_mib_per_sec` to all together.
"""
import heapq
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

FRAMES = 1000
WORKERS = [1, 3, 10, 30, 100, 300, 1000]
CHUNKS = [1, 4, 16, 64]
RANGES = [10, 30, 100, 300, 1000]


def processor_secs(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(mixray, shot):
    """Each from the difference of two runs, so that what both do cancels."""
    shot = pathlib.Path(shot)
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        start = processor_secs(mixray, "--version")
        video = [mixray, "sequence", shot / "video.toml", "--frames", shot / "frames", "--trajectory", shot / "poses.json", "--threads=1"]
        one = processor_secs(*video, "--range=0..1", "-o", out / "one")
        three = processor_secs(*video, "--range=0..3", "-o", out / "three")
        looked_at = [processor_secs(*video, f"--range=0..{count}", "-o", out / name) for count, name in ((1, "one"), (3, "three"))]
        still = [mixray, "render", shot / "still.toml", "--rpp=8", "--threads=1"]
        few = processor_secs(*still, "--range=0..1", "-o", out / "few.exr")
        more = processor_secs(*still, "--range=1..4", "-o", out / "more.exr")
        merged = [processor_secs(mixray, "merge", *parts, "-o", out / "merged.exr") for parts in ([out / "few.exr"], [out / "few.exr", out / "more.exr"])]
        frame = (three - one) / 2
        ray = (more - few) / 2
        seconds = {
            "start": start,
            "frame": frame,
            "frames_task_without_frames": one - frame,
            "look_at_frame": max(looked_at[1] - looked_at[0], 0) / 2,
            "ray_per_pixel": ray,
            "rays_task_without_rays": few - ray,
            "merge_without_parts": 2 * merged[0] - merged[1],
            "merge_part": merged[1] - merged[0],
            "part_mib": (out / "more.exr").stat().st_size / 2**20,
        }
    json.dump({name: round(value, 3) for name, value in seconds.items()}, sys.stdout, indent=2)


def makespan(workers, tasks, task_secs, dispatch_secs, read_secs):
    """Seconds until the last of `tasks` ends; `read_secs` of each are the shared disk's, one after the other."""
    free = [0.0] * min(workers, tasks)
    disk = handed = 0.0
    last = 0.0
    for _ in range(tasks):
        begin = max(heapq.heappop(free), handed)
        handed = begin + dispatch_secs
        disk = max(disk, begin) + read_secs
        end = max(begin + task_secs, disk)
        last = max(last, end)
        heapq.heappush(free, end)
    return last


def frames_secs(s, workers, chunk, dispatch_secs):
    tasks = -(-FRAMES // chunk)
    task = s["frames_task_without_frames"] + chunk * s["frame"]
    return makespan(workers, tasks, task, dispatch_secs, 0.0) + s["frames_task_without_frames"] + FRAMES * s["look_at_frame"]


def rays_secs(s, workers, ranges, rays, dispatch_secs, disk_mib_per_sec):
    task = s["rays_task_without_rays"] + rays / ranges * s["ray_per_pixel"]
    write = s["part_mib"] / disk_mib_per_sec
    return makespan(workers, ranges, task, dispatch_secs, write) + s["merge_without_parts"] + ranges * (s["merge_part"] + write)


def draw(seconds, path):
    import matplotlib

    matplotlib.use("svg")
    import matplotlib.pyplot as plt

    matplotlib.rcParams["svg.hashsalt"] = "mixray"
    dispatch, disk, rays = 0.05, 200.0, 16384
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    one = FRAMES * seconds["frame"] + seconds["frames_task_without_frames"]
    print(f"frames: {FRAMES}, one run {one:.0f} s; speed-up by workers and --chunk")
    print("| workers | " + " | ".join(f"--chunk {chunk}" for chunk in CHUNKS) + " |\n| --- |" + " --- |" * len(CHUNKS))
    table = {w: [one / frames_secs(seconds, w, c, dispatch) for c in CHUNKS] for w in WORKERS}
    for workers, row in table.items():
        print(f"| {workers} | " + " | ".join(f"{x:.1f}" for x in row) + " |")
    for index, chunk in enumerate(CHUNKS):
        axes[0].plot(WORKERS, [table[w][index] for w in WORKERS], marker=".", label=f"--chunk {chunk}")
    one = rays * seconds["ray_per_pixel"] + seconds["rays_task_without_rays"]
    print(f"\nstill: {rays} rays per pixel, one run {one:.0f} s; speed-up by --ranges, as many workers")
    speedup = [one / rays_secs(seconds, n, n, rays, dispatch, disk) for n in RANGES]
    print("| " + " | ".join(f"--ranges {n}" for n in RANGES) + " |\n|" + " --- |" * len(RANGES))
    print("| " + " | ".join(f"{x:.1f}" for x in speedup) + " |")
    axes[1].plot(RANGES, speedup, marker=".", label=f"{rays} rays per pixel")
    for axis, title, label in zip(axes, [f"simulation: video of {FRAMES} frames", "simulation: still"], ["workers", "--ranges, as many workers"]):
        axis.plot([1, 1000], [1, 1000], color="0.7", linewidth=0.8, label="ideal")
        axis.set(xscale="log", yscale="log", xlabel=label, ylabel="times as fast as one run", title=title)
        axis.grid(color="0.9")
        axis.legend()
    figure.savefig(path, metadata={"Date": None})


if sys.argv[1] == "--measure":
    measure(*sys.argv[2:])
else:
    draw(json.loads(pathlib.Path(sys.argv[1]).read_text()), sys.argv[2])
