#!/usr/bin/env python3
"""Runs the marker video (24 frames) and a still (16 ranges) through an engine, kills ten tasks of each at random moments, and compares with one run.

    pip install openjd-cli numpy opencv-python-headless openexr
    benches/farm/engines.py openjd MIXRAY SHOT OUT                  # SHOT: of marker_shot.py; OUT: a new folder
    eval "$(benches/farm/one_node_slurm.sh start /tmp/slurm)" && benches/farm/engines.py slurm MIXRAY SHOT OUT
"""
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time

import cv2
import numpy
import OpenEXR

KILLS = 10
# Rays per pixel: enough for a task to last some seconds, and to be hit.
VIDEO_RAYS, STILL_RAYS = 64, 1024
# Largest share of codes that may differ, each by one: means on a rounding edge.
EDGE_SHARE = 1e-5


def tasks_of(job):
    """Processes of tasks that work in the job's folder."""
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            folder = os.readlink(entry / "cwd")
        except OSError:
            continue
        is_task = len(words) > 1 and words[1] in (b"sequence", b"render") and words[0].endswith(b"mixray")
        if is_task and (folder == str(job) or any(str(job).encode() in word for word in words)):
            yield int(entry.name)


class Killer(threading.Thread):
    """Ends tasks at random moments, as the system does that runs out of memory; a moment at which none runs does not count."""

    def __init__(self, job, whole_secs):
        super().__init__(daemon=True)
        self.job, self.longest_secs, self.killed = job, whole_secs / KILLS, 0

    def run(self):
        moments = random.Random(1)
        while self.killed < KILLS:
            time.sleep(moments.uniform(0, self.longest_secs))
            tasks = list(tasks_of(self.job))
            if tasks:
                os.kill(moments.choice(tasks), signal.SIGKILL)
                self.killed += 1


def run_openjd(job, mixray):
    """The engine of the command line does not retry; whoever runs it does."""
    for tries in range(1, 100):
        command = ["openjd", "run", "template.json", "-p", f"Mixray={mixray}"]
        if subprocess.run(command, cwd=job, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0:
            return tries
    raise SystemExit("the job does not end")


def run_slurm(job, mixray):
    subprocess.run(["sh", "submit.sh"], cwd=job, check=True, env={**os.environ, "MIXRAY": mixray})
    while waiting := subprocess.run(["squeue", "--noheader", "--format=%r"], capture_output=True, text=True, check=True).stdout.split():
        if "DependencyNeverSatisfied" in waiting:
            raise SystemExit("Slurm does not begin the last step: it takes a task as failed")
        time.sleep(1)
    return 1


def run_job(engine, mixray, job, options, whole_secs):
    subprocess.run([mixray, "submit", *options, "--engine", engine, "-o", job], check=True)
    killer = Killer(job, whole_secs)
    killer.start()
    tries = {"openjd": run_openjd, "slurm": run_slurm}[engine](job, mixray)
    left = [str(path) for path in job.rglob(".mixray-*")]
    print(f"{job.name}: {killer.killed} tasks killed, {tries} runs of the engine; left half written: {left or 'nothing'}", flush=True)
    assert killer.killed == KILLS, "more rays, so that there is time to kill tasks"
    assert not left


def seconds(*command):
    """How long a command runs that says nothing."""
    start = time.monotonic()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return time.monotonic() - start


def channels(path):
    found = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: channel.pixels.astype(float) for name, channel in found.items()}


def distance(one, many):
    """Largest relative distance of two channels; what is infinite, such as the depth of the sky, must be so in both."""
    one, many = one[one != many], many[one != many]
    return (numpy.abs(one - many) / numpy.maximum(numpy.abs(one), 1e-6)).max(initial=0.0)


def main():
    engine, mixray, shot, out = sys.argv[1:]
    mixray, shot, out = (str(pathlib.Path(mixray).resolve()), pathlib.Path(shot).resolve(), pathlib.Path(out).resolve())
    out.mkdir()
    video = [str(shot / "video.toml"), "--frames", str(shot / "frames"), "--trajectory", str(shot / "poses.json"), "--rpp", str(VIDEO_RAYS)]
    still = [str(shot / "still.toml"), "--rpp", str(STILL_RAYS)]
    video_secs = seconds(mixray, "sequence", *video, "-o", str(out / "whole"))
    still_secs = seconds(mixray, "render", *still, "--range", f"0..{STILL_RAYS}", "-o", str(out / "whole.exr"))
    seconds(mixray, "merge", str(out / "whole.exr"), "--scene", str(shot / "still.toml"), "-o", str(out / "whole.png"), "-o", str(out / "merged.exr"))
    print(f"one run: video {video_secs:.0f} s, still {still_secs:.0f} s", flush=True)

    run_job(engine, mixray, out / "video", [*video, "--chunk", "4"], video_secs)
    run_job(engine, mixray, out / "still", [*still, "--ranges", "16"], still_secs)

    frames = sorted(path.name for path in (out / "whole").glob("*.png"))
    same = [name for name in frames if (out / "whole" / name).read_bytes() == (out / "video/output/frames" / name).read_bytes()]
    print(f"video: {len(same)} of {len(frames)} frames identical files")
    assert len(same) == len(frames) == 24
    first, other = ((out / "whole" / name).read_bytes() for name in frames[:2])
    assert first != other, "control: frames differ from each other"

    a, b = (cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(int) for path in (out / "whole.png", out / "still/output/picture.png"))
    differ = numpy.abs(a - b)
    print(f"still: codes that differ: {(differ > 0).mean():.2g} of all, by {differ.max()} at most")
    assert differ.max() <= 1 and (differ > 0).mean() <= EDGE_SHARE
    one, many = channels(out / "merged.exr"), channels(out / "still/output/picture.exr")
    assert one.keys() == many.keys()
    worst = max(distance(one[name], many[name]) for name in one)
    print(f"still: {len(one)} channels of the film's means differ by {worst / 2**-23:.2g} units in the last place at most")
    assert worst <= 2 * 2**-23
    seconds(mixray, "merge", *map(str, sorted((out / "still/output").glob("rays_*.exr"))[1:]), "-o", str(out / "fewer.exr"))
    fewer = channels(out / "fewer.exr")
    assert min(distance(one[name], fewer[name]) for name in "RGB") > 2 * 2**-23, "control: one part is missing"
    photo = cv2.imread(str(shot / "frames/frame_0000.png"), cv2.IMREAD_UNCHANGED).astype(int)
    assert numpy.abs(a - photo).max() > 1, "control: the photograph is another picture"


main()
