#!/usr/bin/env python3
"""`mixray live` on the marker video, beside the tables of the papers of 2005 and 2006: a minute at 25 frames a second, and what each stage takes.

    python3 benches/peers/live.py [--mixray target/release/mixray] [--data ../shared/data] [--seconds 60] [--frames 24] [--threads 1] [--write docs/live.md]

Wants ffmpeg. A writer hands the frames over at their times; a reader takes what comes out. Then, without a clock, each frame waits for the one
before. Prints the tables; exits with 1 where a bar is missed.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

WIDTH, HEIGHT, RATE = 640, 480, 25
FRAME_BYTES = len(b"FRAME\n") + WIDTH * HEIGHT * 3 // 2

STAGES = {
    "none": "",
    "noise, added as it is missing": '[noise]\nprofile = "noise.toml"\n',
    "noise, textures of 2006": '[noise]\nprofile = "noise.toml"\nmethod = "textures"\n',
    "copies of 2006, without a minimum": '[motion_blur]\nmethod = "copies"\nmin_length_px = 0.1\n',
    "antialiasing of 2006": "[antialias]\n",
    "cartoon of 2005, 240 x 180, 7 iterations": "[cartoon]\n",
    "cartoon of 2005, 400 x 300, 9 iterations": "[cartoon]\nshrunk_width = 400\nshrunk_height = 300\niterations = 9\n",
}

PAPERS = """
| paper, Pentium 4 of 2.7 to 2.8 GHz, GeForce FX 6600 or 6800, 640 x 480 | frames a second | ms of the stage |
| --- | --- | --- |
| 2006, without stages | 29.78 | |
| 2006, noise textures | 29.33 | 0.5 (difference of periods) |
| 2006, copies, "typical fast motions" | 24.36 | 7.5 (difference of periods) |
| 2005, cartoon of 240 x 180, 5 / 7 / 9 iterations | 27.84 / 24.22 / 21.51 | 19 / 25 / 30 |
| 2005, cartoon of 400 x 300, 5 / 7 / 9 iterations | 16.68 / 13.37 / 11.12 | 44 / 59 / 74 |
"""


class Stream:
    """The video's frames, over and over."""

    def __init__(self, path):
        self.file = open(path, "rb")
        self.header = self.file.readline()
        self.count = (pathlib.Path(path).stat().st_size - len(self.header)) // FRAME_BYTES

    def frame(self, number):
        self.file.seek(len(self.header) + FRAME_BYTES * (number % self.count))
        return self.file.read(FRAME_BYTES)


def prepare(mixray, data, folder):
    def run(*words):
        subprocess.run(words, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    movie = (data / "webcam_marker_grid_video/movie.mp4").resolve()
    run("ffmpeg", "-i", movie, "-pix_fmt", "yuv420p", "-f", "yuv4mpegpipe", "video.y4m")
    run("ffmpeg", "-i", movie, "-frames:v", "1", "first.png")
    run(mixray, "track", "video.y4m", "--marker-size", "40mm", "-o", "poses.json", "--report", "track.json", "--scene", "board.toml")
    run(mixray, "noise", "estimate", "first.png", "-o", "noise.toml")
    text = (folder / "board.toml").read_text()
    # As docs/live.md advises: else the board's albedo is estimated from each frame.
    colour = 'material = { base_color = [0.7, 0.7, 0.7] }\n'
    text = text.replace('name = "board"\n', 'name = "board"\n' + colour)
    for index, stage in enumerate(STAGES.values()):
        (folder / f"scene{index}.toml").write_text(text + "\n" + stage)
    return Stream(folder / "video.y4m")


def begin(arguments, folder, index, *more):
    threads = ["--threads", arguments.threads] if arguments.threads else []
    words = [arguments.mixray, "live", f"scene{index}.toml", "--board", "track.json", "--intrinsics", "poses.yaml", "--backend", "cpu", "--stats", "stats.json", *threads, *more]
    return subprocess.Popen(words, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)


def memory_mib(process):
    status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024


def cpu_secs(process):
    words = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(words[11]) + int(words[12])) / 100


def paced(arguments, folder, stream, number_of=lambda number: number):
    """A real-time stream of these of the video's frames; the statistics, and the memory at a sixth, half and the end of it."""
    process = begin(arguments, folder, 0, "--rpp", "16")
    reader = threading.Thread(target=lambda: [None for _ in iter(lambda: process.stdout.read(1 << 20), b"")])
    reader.start()
    process.stdin.write(stream.header)
    frames = arguments.seconds * RATE
    memory = {}
    start = time.monotonic()
    for number in range(frames):
        time.sleep(max(0.0, start + number / RATE - time.monotonic()))
        process.stdin.write(stream.frame(number_of(number)))
        process.stdin.flush()
        if number in (frames // 6, frames // 2, frames - 1):
            memory[number] = memory_mib(process)
    process.stdin.close()
    reader.join()
    if process.wait() != 0:
        sys.exit("mixray live failed")
    return json.loads((folder / "stats.json").read_text())["total"], list(memory.values())


def in_step(arguments, folder, stream, index, coarsest=1):
    """One frame after the other, every fifth of the video, as coarse as may be; seconds by part over all frames, and of processor time after the first two,
    before which nothing is known of what frames take."""
    process = begin(arguments, folder, index, "--rpp", "1", "--fps", "100000", "--coarsest", str(coarsest))
    process.stdin.write(stream.header)
    for number in range(arguments.frames):
        process.stdin.write(stream.frame(100 + 5 * number))
        process.stdin.flush()
        if number == 0:
            process.stdout.read(len(stream.header))
        process.stdout.read(FRAME_BYTES)
        if number == 1:
            first = cpu_secs(process)
    used = cpu_secs(process) - first
    process.stdin.close()
    if process.wait() != 0:
        sys.exit("mixray live failed")
    return json.loads((folder / "stats.json").read_text())["seconds"], used / (arguments.frames - 2)


def measure(arguments, folder):
    stream = prepare(arguments.mixray, arguments.data, folder)
    total, memory = paced(arguments, folder, stream)
    load = os.getloadavg()[0]
    period_ms = 1e3 / RATE
    frames, age, wait = total["frames"], total["age"], total["wait"]
    # Each frame's work is the same where the camera rests.
    rests, _ = paced(arguments, folder, stream, lambda _: 100)
    bar = rests["work_ms"] + 1.5 * period_ms
    moving_bar = total["work_ms"] + 1.5 * period_ms
    good = age["p95_ms"] <= moving_bar and rests["age"]["p95_ms"] <= bar and max(wait["p95_ms"], rests["wait"]["p95_ms"]) <= 1.5 * period_ms and max(memory) <= 1.1 * memory[0]
    written = frames["rendered"] + frames["held"] + frames["passed_through"]
    spread = lambda of: f"{of['median_ms']:.0f}, {of['p95_ms']:.0f}, {of['most_ms']:.0f} ms"
    lines = [f"| {arguments.seconds} s at {RATE} frames a second | bar | |", "| --- | --- | --- |"]
    lines += [f"| {what} | {limit} | {found} |" for what, limit, found in [
        ("the machine: cores, and what asks for one", "", f"{os.cpu_count()}, {load:.0f}"),
        ("frames: arrived, written, dropped", "", f"{frames['arrived']}, {written}, {frames['dropped']}"),
        ("work a frame, mean; rays per pixel; sides divided by", "", f"{total['work_ms']:.0f} ms; {total['rays_per_pixel']:.2f}; {total['coarseness']:.1f}"),
        ("work a frame: median, p95, most", "", spread(total["work"])),
        ("age: median, p95, most", f"p95: work + 1.5 periods, {moving_bar:.0f} ms", spread(age)),
        ("of it waiting: median, p95, most", f"p95: 1.5 periods, {1.5 * period_ms:.0f} ms", spread(wait)),
        ("the camera at rest: work a frame, mean, p95; sides divided by", "", f"{rests['work_ms']:.0f}, {rests['work']['p95_ms']:.0f} ms; {rests['coarseness']:.1f}"),
        ("the camera at rest: age, median, p95, most", f"p95: work + 1.5 periods, {bar:.0f} ms", spread(rests["age"])),
        ("the camera at rest: of it waiting: median, p95, most", f"p95: 1.5 periods, {1.5 * period_ms:.0f} ms", spread(rests["wait"])),
        (f"memory after {arguments.seconds // 6}, {arguments.seconds // 2}, {arguments.seconds} s", "flat", ", ".join(f"{mib:.0f}" for mib in memory) + " MiB"),
    ]]
    lines += ["", "| stage, at one ray per pixel | processor ms of a frame | of which the stage |", "| --- | --- | --- |"]
    beside = {}
    for index, name in enumerate(STAGES):
        seconds, used = in_step(arguments, folder, stream, index)
        parts = {part: 1e3 * secs / arguments.frames for part, secs in seconds.items()}
        own = {part: parts.pop(part) for part in list(parts) if part not in ("decode", "track", "edit", "render", "composite", "write")}
        stage, others = sum(own.values()), sum(parts.values())
        # Processor time by the shares of the wall's, which other programs stretch.
        scale = 1e3 * used / (stage + others)
        beside = {part: scale * ms for part, ms in parts.items()} if index == 0 else beside
        lines.append(f"| {name} | {1e3 * used:.0f} | {scale * stage:.0f} |")
    of_which = ", ".join(f"{part} {ms:.0f}" for part, ms in beside.items())
    coarser = ", ".join(f"{1e3 * in_step(arguments, folder, stream, 0, divisor)[1]:.0f}" for divisor in (2, 3, 4))
    lines += ["", f"Without stages, processor ms by part: {of_which} (composite: with the filter). With sides divided by 2, 3 and 4: {coarser} ms in all.", *PAPERS.rstrip().split("\n")]
    return "\n".join(lines) + "\n", good


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mixray", type=lambda path: str(pathlib.Path(path).resolve()), default=str(root / "target/release/mixray"))
    parser.add_argument("--data", type=pathlib.Path, default=root / "../shared/data")
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--frames", type=int, default=24, help="of each stage")
    parser.add_argument("--threads")
    parser.add_argument("--write", type=pathlib.Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        table, good = measure(arguments, pathlib.Path(folder))
    print(table)
    if arguments.write:
        page = arguments.write.read_text()
        pattern = re.compile(r"(<!-- live -->\n)(.*?)(<!-- end -->)", re.DOTALL)
        arguments.write.write_text(pattern.sub(lambda m: m.group(1) + table + m.group(3), page))
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
