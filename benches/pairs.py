"""Processor time of two builds of mixray, in turns, over the scenes of scenes/.

    python3 benches/pairs.py OLD NEW --scenes room,far --rays 4 --pairs 40

OLD and NEW are programs. Each pair renders a scene with both, the one that begins changing from pair to pair, on one thread of the CPU,
and counts user and system time of the process. Printed for each scene: the median of NEW / OLD with its 95% interval (percentile
bootstrap over pairs), the same of two runs of OLD where --control is given, and whether the pictures have the same bytes.
"""

import argparse
import os
import pathlib
import random
import statistics
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
RESAMPLES = 10_000


def cpu_secs(program, scene, rays, out):
    """User and system seconds of one render."""
    words = [program, "render", str(scene), "--rpp", str(rays), "--backend", "cpu", "--threads", "1"]
    words += ["-o", str(out)]
    process = os.fork()
    if process == 0:
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        os.dup2(silent, 2)
        os.execv(program, words)
    _, status, usage = os.wait4(process, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(words)}: exit status {status}")
    return usage.ru_utime + usage.ru_stime


def interval(ratios):
    """Median, and the ends of its 95% interval."""
    draw = random.Random(1)
    medians = sorted(
        statistics.median(draw.choices(ratios, k=len(ratios))) for _ in range(RESAMPLES)
    )
    return statistics.median(ratios), medians[RESAMPLES // 40], medians[-RESAMPLES // 40]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--scenes", default="room,far")
    parser.add_argument("--rays", type=int, default=4)
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--control", action="store_true", help="OLD against itself as well")
    args = parser.parse_args()
    old, new = (str(pathlib.Path(path).resolve()) for path in (args.old, args.new))
    others = {"NEW / OLD": new, **({"OLD / OLD": old} if args.control else {})}
    print("| scene | what | OLD, CPU s | median of ratios | 95% interval | pictures |")
    print("| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        pictures = [pathlib.Path(folder, name) for name in ("old.png", "new.png")]
        for scene in args.scenes.split(","):
            path = ROOT / "scenes" / scene / "scene.toml"
            secs = {what: [] for what in others}
            same = {}
            for pair in range(args.pairs):
                for what, other in others.items():
                    runs = [(old, pictures[0]), (other, pictures[1])]
                    if pair % 2:
                        runs.reverse()
                    taken = [cpu_secs(program, path, args.rays, out) for program, out in runs]
                    if pair % 2:
                        taken.reverse()
                    secs[what].append(taken)
                    same[what] = pictures[0].read_bytes() == pictures[1].read_bytes()
            for what, pairs in secs.items():
                middle, low, high = interval([after / before for before, after in pairs])
                before = statistics.median(before for before, _ in pairs)
                bytes_ = "same" if same[what] else "differ"
                print(
                    f"| {scene} | {what} | {before:.2f} | {middle:.4f} | {low:.4f} to {high:.4f} | {bytes_} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
