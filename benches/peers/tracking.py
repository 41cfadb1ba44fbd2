#!/usr/bin/env python3
"""`mixray track` beside OpenCV's ArUco and chessboard functions, on the same frames in one run.

    pip install opencv-python numpy
    python3 benches/peers/tracking.py [--mixray target/release/mixray] [--data ../shared/data] [--write docs/tracking.md]

Two real videos, and synthetic frames whose camera is known: a lens that distorts, three blurs, gamma 2.2, noise of two codes. Prints the table;
exits with 1 where a bar is missed.
"""

import argparse
import json
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

WIDTH, HEIGHT = 640, 480
K = np.array([[698.2, 0, 312.7], [0, 698.0, 255.2], [0, 0, 1]])
D = np.array([-0.276, 0.194, 0, 0, 0.0])
COLUMNS, ROWS, SIDE, GAP = 3, 4, 0.04, 0.02
INNER = (6, 4)


def square_binary(number):
    """BoofCV's 3 x 3 code: true is white; the lower left corner is black."""
    cells = np.ones((3, 3), bool)
    cells[2, 0] = False
    for bit, (y, x) in enumerate([(2, 1), (1, 0), (1, 1), (1, 2), (0, 1)]):
        cells[y, x] = not number >> bit & 1
    return cells


def grid_points():
    points = []
    for row in range(ROWS):
        for column in range(COLUMNS):
            x = (column - (COLUMNS - 1) / 2) * (SIDE + GAP) - SIDE / 2
            z = (row - (ROWS - 1) / 2) * (SIDE + GAP) - SIDE / 2
            points += [[x, 0, z], [x + SIDE, 0, z], [x + SIDE, 0, z + SIDE], [x, 0, z + SIDE]]
    return np.array(points)


def chessboard_points(square=0.03):
    columns, rows = INNER
    return np.array([[(x - (columns - 1) / 2) * square, 0, (y - (rows - 1) / 2) * square] for y in range(rows) for x in range(columns)])


# Synthetic frames


def rays(side):
    offsets = (np.arange(side) + 0.5) / side - 0.5
    xs = (np.arange(WIDTH)[:, None] + offsets).ravel()
    ys = (np.arange(HEIGHT)[:, None] + offsets).ravel()
    x, y = np.meshgrid((xs - K[0, 2]) / K[0, 0], (ys - K[1, 2]) / K[1, 1])
    u, v = x.copy(), y.copy()
    for _ in range(20):
        r = u * u + v * v
        c = 1 + D[0] * r + D[1] * r * r
        u, v = x / c, y / c
    return np.stack([u, v, np.ones_like(u)], -1)


def printed(x, z, marker):
    """Reflectance of the board; `marker(index, fx, fz)` says where ink is, by shares of the marker's side."""
    light = np.full(x.shape, 0.85, np.float32)
    light[(np.abs(x) > 0.11) | (np.abs(z) > 0.14)] = 0.25
    cx = x / (SIDE + GAP) + COLUMNS / 2 - GAP / 2 / (SIDE + GAP)
    cz = z / (SIDE + GAP) + ROWS / 2 - GAP / 2 / (SIDE + GAP)
    i, j = np.floor(cx), np.floor(cz)
    fx, fz = (cx - i) * (SIDE + GAP) / SIDE, (cz - j) * (SIDE + GAP) / SIDE
    inside = (i >= 0) & (i < COLUMNS) & (j >= 0) & (j < ROWS) & (fx < 1) & (fz < 1)
    index = (j[inside] * COLUMNS + i[inside]).astype(int)
    light[inside] = np.where(marker(index, fx[inside], fz[inside]), 0.85, 0.06)
    return light


def binary_marker(codes):
    codes = np.array(codes)

    def white(index, fx, fz):
        x, z = np.floor((fx - 0.25) * 6).astype(int), np.floor((fz - 0.25) * 6).astype(int)
        inner = (x >= 0) & (x < 3) & (z >= 0) & (z < 3)
        return inner & codes[index, z.clip(0, 2), x.clip(0, 2)]

    return white


def picture_marker(images):
    images = np.array(images)

    def white(index, fx, fz):
        n = images.shape[1]
        return images[index, (fz * n).astype(int), (fx * n).astype(int)]

    return white


def chessboard_print(x, z, square=0.03):
    light = np.full(x.shape, 0.85, np.float32)
    i, j = np.floor(x / square + (INNER[0] + 1) / 2), np.floor(z / square + (INNER[1] + 1) / 2)
    inside = (i >= 0) & (i <= INNER[0]) & (j >= 0) & (j <= INNER[1])
    light[inside & ((i + j) % 2 == 0)] = 0.06
    light[(np.abs(x) > 0.135) | (np.abs(z) > 0.105)] = 0.25
    return light


def looking(distance, azimuth, height, roll):
    """At the board's middle: rotation and translation, camera from board."""
    eye = distance * np.array([np.cos(height) * np.cos(azimuth), np.sin(height), np.cos(height) * np.sin(azimuth)])
    z = -eye / np.linalg.norm(eye)
    x = np.cross(z, [0, 1, 0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    rotation = np.stack([np.cos(roll) * x + np.sin(roll) * y, np.cos(roll) * y - np.sin(roll) * x, z])
    return rotation, -rotation @ eye


def by_hand(secs):
    """A camera that a hand moves to and fro while it goes around the board."""
    rotation, translation = looking(0.55, 0.4 + 0.8 * secs, np.radians(60 + 10 * np.sin(7 * secs)), 0.1 + 0.3 * np.sin(5 * secs))
    return rotation, translation + [0.04 * np.sin(8 * secs), 0.03 * np.cos(9 * secs), 0]


def row_by_row(secs, readout_secs):
    """Where the camera is at each row's own time."""
    rows = [by_hand(secs + readout_secs * (row / (HEIGHT - 1) - 0.5)) for row in range(HEIGHT)]
    return tuple(np.stack(part) for part in zip(*rows))


def views(count, seed, distances):
    """Rotation and translation, camera from board; the whole board is seen."""
    random = np.random.default_rng(seed)
    board = np.array([[x, 0, z] for x in (-0.12, 0.12) for z in (-0.12, 0.12)])
    found = []
    while len(found) < count:
        distance = distances(len(found), random)
        azimuth, height, roll = random.uniform(0, 2 * np.pi), np.radians(random.uniform(35, 85)), random.uniform(-np.pi, np.pi)
        rotation, translation = looking(distance, azimuth, height, roll)
        seen = project(board, rotation, translation)
        if (seen > 8).all() and (seen < [WIDTH - 9, HEIGHT - 9]).all():
            found.append((rotation, translation))
    return found


def project(points, rotation, translation, k=K, d=D):
    return cv2.projectPoints(np.asarray(points, float), cv2.Rodrigues(rotation)[0], translation, k, d)[0].reshape(-1, 2)


def render(folder, print_board, poses, seed, side=4, blurs=(0.5, 0.8, 1.2)):
    folder.mkdir()
    random = np.random.default_rng(seed)
    directions = rays(side)
    for index, (rotation, translation) in enumerate(poses):
        # One of the whole picture, or one for each of its rows.
        rotation, translation = rotation.reshape(-1, 3, 3), translation.reshape(-1, 3)
        if len(rotation) > 1:
            rotation, translation = rotation.repeat(side, 0), translation.repeat(side, 0)
        eye = -np.einsum("rji,rj->ri", rotation, translation)[:, None]
        ways = directions @ rotation
        reach = -eye[..., 1] / ways[..., 1]
        light = print_board(eye[..., 0] + reach * ways[..., 0], eye[..., 2] + reach * ways[..., 2])
        light[reach < 0] = 0.1
        light = light.reshape(HEIGHT, side, WIDTH, side).mean((1, 3)) * random.uniform(0.5, 1.0)
        light = cv2.GaussianBlur(light, (0, 0), random.choice(blurs))
        codes = 255 * np.clip(light, 0, 1) ** (1 / 2.2) + random.normal(0, 2, light.shape)
        cv2.imwrite(str(folder / f"{index:04}.png"), np.clip(np.round(codes), 0, 255).astype(np.uint8))


# Both programs


def processor_secs():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Mixray:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def track(self, video, *flags):
        poses, report = self.folder / "poses.json", self.folder / "track.json"
        line = [self.program, "track", str(video), "-o", str(poses), "--report", str(report), *map(str, flags)]
        start = processor_secs()
        done = subprocess.run(line, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{' '.join(line)}\n{done.stderr}")
        found = json.loads(report.read_text())
        found["secs"] = processor_secs() - start
        camera, k = found["camera"], found["camera"]["distortion"]
        found["k"] = np.array([[camera["fx"], 0, camera["cx"] - 0.5], [0, camera["fy"], camera["cy"] - 0.5], [0, 0, 1]])
        found["d"] = np.array([k["k1"], k["k2"], k["p1"], k["p2"], k["k3"]])
        found["points"] = np.array(found["board"]["points_m"])
        for frame in found["frames"]:
            # OpenCV's pixel centres.
            frame["seen"] = {int(p): np.array([x, y]) - 0.5 for p, x, y in frame["corners_px"]}
            if frame["world_from_camera"]:
                matrix = np.array(frame["world_from_camera"]) @ np.diag([1, -1, -1, 1.0])
                frame["r"], frame["t"] = matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3]
        return found


def aruco_dictionary(codes):
    doubled = [np.kron(code, np.ones((2, 2))).astype(np.uint8) for code in codes]
    rows = [cv2.aruco.Dictionary.getByteListFromBits(bits) for bits in doubled]
    return cv2.aruco.Dictionary(np.concatenate(rows), 6, 0)


def aruco_markers(frames, dictionary, border):
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(dictionary, parameters)
    found = []
    for frame in frames:
        corners, ids, _ = detector.detectMarkers(frame)
        ids = [] if ids is None else ids.ravel()
        found.append({int(i): c.reshape(4, 2) for i, c in zip(ids, corners)})
    return found


def flat(points):
    """OpenCV's calibration wants boards in z = 0."""
    return np.stack([points[:, 0], -points[:, 2], np.zeros(len(points))], 1).astype(np.float32)


def calibrated(seen, points):
    """OpenCV's own: a calibration on up to 60 frames that show most, then a pose for each frame; rms, lens, poses."""
    board = flat(points)
    full = sorted((f for f in seen if len(f) >= 8), key=len, reverse=True)
    full = full[:: max(1, len(full) // 60)][:60]
    objects = [board[list(f)] for f in full]
    pictures = [np.array(list(f.values()), np.float32) for f in full]
    _, k, d, _, _ = cv2.calibrateCamera(objects, pictures, (WIDTH, HEIGHT), None, None, flags=cv2.CALIB_FIX_K3)
    squares, poses = [], []
    for f in seen:
        if len(f) < 4:
            poses.append(None)
            continue
        corners = np.array(list(f.values()))
        ok, r, t = cv2.solvePnP(board[list(f)].astype(float), corners, k, d, flags=cv2.SOLVEPNP_IPPE)
        r, t = cv2.solvePnPRefineLM(board[list(f)].astype(float), corners, k, d, r, t)
        error = cv2.projectPoints(board[list(f)].astype(float), r, t, k, d)[0].reshape(-1, 2) - corners
        squares += list((error**2).sum(1))
        turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])
        poses.append((cv2.Rodrigues(r)[0] @ turn, t.ravel()))
    return np.sqrt(np.mean(squares)), poses


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def pose_errors(poses, truth):
    """Millimetres between the eyes, degrees between the rotations."""
    mm, degrees = [], []
    for pose, (r, t) in zip(poses, truth):
        if pose is not None:
            mm.append(1e3 * np.linalg.norm(pose[0].T @ pose[1] - r.T @ t))
            degrees.append(np.degrees(np.linalg.norm(cv2.Rodrigues(pose[0] @ r.T)[0])))
    return mm, degrees


def own_poses(found):
    return [(f["r"], f["t"]) if "r" in f else None for f in found["frames"]]


def mahalanobis(found, truth):
    values = []
    for frame, (r, t) in zip(found["frames"], truth):
        if "r" not in frame:
            continue
        covariance = np.array(frame["own_covariance"]) + np.array(frame["shared_covariance"])
        step = np.concatenate([cv2.Rodrigues(frame["r"] @ r.T)[0].ravel(), frame["t"] - t])
        values.append(step @ np.linalg.solve(covariance, step) / 6)
    return float(np.mean(values))


def corner_errors(found, truth, points, half_turn=False):
    errors = []
    for frame, (r, t) in zip(found, truth):
        if not frame:
            continue
        exact = project(points, r, t)
        own = np.array(list(frame.values()))
        error = own - exact[list(frame)]
        if half_turn and np.abs(error).mean() > 5:
            error = own - exact[::-1][list(frame)]
        errors += list(np.linalg.norm(error, axis=1))
    return rms(errors)


def by_corner(markers, ids):
    return [{4 * ids.index(i) + k: c[k] for i, c in f.items() if i in ids for k in range(4)} for f in markers]


def read_frames(path):
    video, frames = cv2.VideoCapture(str(path)), []
    while True:
        ok, frame = video.read()
        if not ok:
            return frames
        frames.append(frame)


def write_y4m(path, frames):
    with open(path, "wb") as out:
        out.write(b"YUV4MPEG2 W%d H%d F25:1 Ip A1:1 C420jpeg\n" % (WIDTH, HEIGHT))
        for frame in frames:
            out.write(b"FRAME\n" + cv2.cvtColor(frame, cv2.COLOR_BGR2YUV_I420).tobytes())


def write_lens(path):
    """As OpenCV has it."""
    path.write_text(f"%YAML:1.0\n---\nimage_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {K.ravel().tolist()}\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: {D.tolist()}\n")


def visible(found):
    """Markers whose corners all lie three pixels inside of the picture, by the poses found; how many were found, and how many in a wrong place."""
    there = seen = wrong = 0
    for frame in found["frames"]:
        if "r" not in frame:
            continue
        exact = project(found["points"], frame["r"], frame["t"], found["k"], found["d"])
        for first in found["board"]["first_point_of_marker"].values():
            corners = exact[first : first + 4]
            inside = (corners > 3).all() and (corners < [WIDTH - 4, HEIGHT - 4]).all()
            own = [frame["seen"].get(first + k) for k in range(4)]
            there += inside
            seen += inside and own[0] is not None
            wrong += own[0] is not None and np.abs(np.array(own) - corners).max() > 5
    return there, seen, wrong


def recall_of(markers, found):
    there = seen = wrong = 0
    for frame, own in zip(found["frames"], markers):
        exact = project(found["points"], frame["r"], frame["t"], found["k"], found["d"])
        for name, first in found["board"]["first_point_of_marker"].items():
            corners = exact[first : first + 4]
            if int(name) in own:
                off = np.abs(own[int(name)] - corners).max()
                wrong += off > 5
            if (corners > 3).all() and (corners < [WIDTH - 4, HEIGHT - 4]).all():
                there += 1
                seen += int(name) in own
    return there, seen, wrong


def held_out(found_even, frames):
    """Lens and board from even frames; in odd ones half of the markers give the pose, and predict the other half."""
    errors = []
    points, k, d = found_even["points"], found_even["k"], found_even["d"]
    for frame in frames[1::2]:
        ids = sorted({p // 4 for p in frame["seen"]})
        if len(ids) < 4:
            continue
        used = [4 * i + c for i in ids[::2] for c in range(4)]
        rest = [4 * i + c for i in ids[1::2] for c in range(4)]
        corners = np.array([frame["seen"][p] for p in used])
        ok, r, t = cv2.solvePnP(points[used], corners, k, d, cv2.Rodrigues(frame["r"])[0], frame["t"].reshape(3, 1).copy(), True)
        predicted = cv2.projectPoints(points[rest], r, t, k, d)[0].reshape(-1, 2)
        errors += list(np.linalg.norm(predicted - np.array([frame["seen"][p] for p in rest]), axis=1))
    return float(np.median(errors))


def jumps(poses):
    """Neighbouring frames whose rotations differ by more than 20 degrees."""
    pairs = [(a, b) for a, b in zip(poses, poses[1:]) if a is not None and b is not None]
    return sum(np.linalg.norm(cv2.Rodrigues(a[0] @ b[0].T)[0]) > np.radians(20) for a, b in pairs)


# Markers beside the middle of the board, where an object stands.
BESIDE = [4 * i + corner for i in (4, 7) for corner in range(4)]
BASE = 0.02 * np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1.0]])


def on_paper(points):
    """The object's base, from the board as its file has it to the paper as it was found."""
    nominal = grid_points()[BESIDE]
    plane = np.linalg.lstsq(np.stack([np.ones(len(nominal)), nominal[:, 0], nominal[:, 2]], 1), points[BESIDE], rcond=None)[0]
    return np.stack([np.ones(len(BASE)), BASE[:, 0], BASE[:, 2]], 1) @ plane


def drift(frames, poses, base, k, d):
    """Pixels from where the frame's own markers say that the middle of an object's base is to where the pose puts it: rms, and rms of its changes from frame to frame."""
    nominal, off = grid_points()[BESIDE][:, [0, 2]], []
    for frame, pose in zip(frames, poses):
        if pose is None or any(p not in frame["seen"] for p in BESIDE):
            off.append(None)
            continue
        plane = cv2.findHomography(nominal, np.array([frame["seen"][p] for p in BESIDE]))[0]
        paper = cv2.perspectiveTransform(BASE[:, [0, 2]].reshape(-1, 1, 2), plane).reshape(-1, 2)
        off.append((project(base, *pose, k, d) - paper).mean(0))
    changes = [b - a for a, b in zip(off, off[1:]) if a is not None and b is not None]
    return rms(np.linalg.norm([o for o in off if o is not None], axis=1)), rms(np.linalg.norm(changes, axis=1))


def poses_of_the_data(path, count):
    """Poses that came with the marker video; its world has the same middle, a quarter turn away, under which the base is the same."""
    poses = [None] * count
    for frame in json.loads(path.read_text())["frames"]:
        if frame["camera_to_world_gltf"]:
            matrix = np.array(frame["camera_to_world_gltf"]).reshape(4, 4) @ np.diag([1, -1, -1, 1.0])
            poses[frame["frame"]] = matrix[:3, :3].T, -matrix[:3, :3].T @ matrix[:3, 3]
    return poses


def measure(mixray, data, folder):
    rows = []

    def row(what, bar, value, text, peer, good):
        rows.append((what, bar, text, peer, good(value)))
        print(f"{what}: {text} (bar {bar}; OpenCV {peer}){'' if good(value) else '  MISSED'}", flush=True)

    (folder / "grid.toml").write_text(f'family = "square-binary-3x3"\n[grid]\ncolumns = {COLUMNS}\nrows = {ROWS}\nside_m = {SIDE}\ngap_m = {GAP}\n')
    (folder / "tags.toml").write_text((folder / "grid.toml").read_text().replace("square-binary-3x3", "apriltag-36h11"))
    (folder / "chess.toml").write_text(f"[chessboard]\ncolumns = {INNER[0]}\nrows = {INNER[1]}\nsquare_m = 0.03\n")
    grid, ids = grid_points(), list(range(12))
    codes = [square_binary(i) for i in ids]
    dictionary = aruco_dictionary(codes)

    frames = read_frames(data / "webcam_marker_grid_video/movie.mp4")
    write_y4m(folder / "grid.y4m", frames)
    write_y4m(folder / "even.y4m", frames[::2])
    peer = aruco_markers(frames, dictionary, 3)
    own = mixray.track(folder / "grid.y4m", "--board", folder / "grid.toml")
    there, seen, wrong = visible(own)
    _, peer_seen, peer_wrong = recall_of(peer, own)
    row("marker video: recall of visible markers", "99.5%", seen / there, f"{100 * seen / there:.2f}% of {there}", f"{100 * peer_seen / there:.2f}%", lambda v: v >= 0.995)
    row("marker video: wrong ids", "0", wrong, str(wrong), str(peer_wrong), lambda v: v == 0)
    peer_rms, peer_poses = calibrated(by_corner(peer, ids), grid)
    row("marker video: rms, board free", "0.20 px", own["rms_px"], f"{own['rms_px']:.3f} px", f"{peer_rms:.3f} px (flat board)", lambda v: v <= 0.20)
    even = mixray.track(folder / "even.y4m", "--board", folder / "grid.toml")
    row("marker video: held-out markers, median", "0.15 px", held_out(even, own["frames"]), f"{held_out(even, own['frames']):.3f} px", "-", lambda v: v <= 0.15)
    flips = jumps(own_poses(own))
    row("marker video: flips", "0", flips, str(flips), str(jumps(peer_poses)), lambda v: v == 0)
    came = poses_of_the_data(data / "webcam_marker_grid_video/trajectory.json", len(frames))
    same = [pose if other is not None else None for pose, other in zip(own_poses(own), came)]
    ours = drift(own["frames"], same, on_paper(own["points"]), own["k"], own["d"])
    theirs = drift(own["frames"], came, BASE, K, D)
    for what, value, other in zip(["off its place on the paper", "from frame to frame"], ours, theirs):
        row(f"marker video: base of an object, {what}, rms", "less than with the video's own poses", (value, other), f"{value:.3f} px", f"{other:.3f} px (the video's own poses)", lambda v: v[0] < v[1])
    timed = mixray.track(folder / "grid.y4m", "--board", folder / "grid.toml", "--threads", 1, "--gamma", 1.4)
    milliseconds = 1e3 * timed["secs"] / len(frames)
    start = time.thread_time()
    aruco_markers([cv2.cvtColor(f, cv2.COLOR_BGR2GRAY) for f in frames], dictionary, 3)
    peer_ms = 1e3 * (time.thread_time() - start) / len(frames)
    row("processor time a frame, all of it", "15 ms", milliseconds, f"{milliseconds:.1f} ms", f"{peer_ms:.1f} ms (detection)", lambda v: v <= 15)

    truth = views(36, 1, lambda _, random: random.uniform(0.42, 0.75))
    render(folder / "sgrid", lambda x, z: printed(x, z, binary_marker(codes)), truth, 2, 6)
    render(folder / "schess", chessboard_print, truth, 3, 6)
    pictures = [cv2.imread(str(p), 0) for p in sorted((folder / "sgrid").iterdir())]
    linear = [np.round(255 * (p / 255.0) ** 2.2).astype(np.uint8) for p in pictures]
    own = mixray.track(folder / "sgrid", "--board", folder / "grid.toml", "--board-flatness", "rigid")
    peers = [by_corner(aruco_markers(p, dictionary, 3), ids) for p in (pictures, linear)]
    error = corner_errors([f["seen"] for f in own["frames"]], truth, grid)
    row("synthetic corners, markers", "0.05 px", error, f"{error:.3f} px", " / ".join(f"{corner_errors(p, truth, grid):.2f}" for p in peers) + " px (codes / light)", lambda v: v <= 0.05)
    mm, degrees = pose_errors(own_poses(own), truth)
    peer_mm, peer_degrees = pose_errors(calibrated(peers[0], grid)[1], truth)
    row("synthetic poses, 0.42 to 0.75 m", "0.3 mm, 0.03 degrees", (rms(mm), rms(degrees)), f"{rms(mm):.3f} mm, {rms(degrees):.4f} degrees", f"{rms(peer_mm):.1f} mm, {rms(peer_degrees):.2f} degrees", lambda v: v[0] <= 0.3 and v[1] <= 0.03)
    row("flips in them", "0", sum(d > 5 for d in degrees), str(sum(d > 5 for d in degrees)), str(sum(d > 5 for d in peer_degrees)), lambda v: v == 0)
    squared = mahalanobis(own, truth)
    row("mean Mahalanobis^2 / 6", "0.5 to 1.5", squared, f"{squared:.2f}", "-", lambda v: 0.5 <= v <= 1.5)
    own = mixray.track(folder / "schess", "--board", folder / "chess.toml", "--board-flatness", "rigid")
    corners = []
    for p in sorted((folder / "schess").iterdir()):
        picture = cv2.imread(str(p), 0)
        ok, c = cv2.findChessboardCorners(picture, INNER)
        if ok:
            c = cv2.cornerSubPix(picture, c, (5, 5), (-1, -1), (3, 60, 1e-4))
        corners.append(dict(enumerate(c.reshape(-1, 2))) if ok else {})
    points = chessboard_points()
    error = corner_errors([f["seen"] for f in own["frames"]], truth, points, True)
    row("synthetic corners, chessboard", "0.025 px", error, f"{error:.4f} px", f"{corner_errors(corners, truth, points, True):.3f} px (cornerSubPix)", lambda v: v <= 0.025)

    write_lens(folder / "lens.yaml")
    held = ["--board", folder / "grid.toml", "--board-flatness", "rigid", "--intrinsics", folder / "lens.yaml", "--fix-intrinsics"]
    readout_secs, times = 0.020, np.arange(30) / 25
    render(folder / "rolling", lambda x, z: printed(x, z, binary_marker(codes)), [row_by_row(t, readout_secs) for t in times], 5, 4, (0.8,))
    write_y4m(folder / "rolling.y4m", [cv2.imread(str(p)) for p in sorted((folder / "rolling").iterdir())])
    # The first and the last two have fewer neighbours to tell their motion.
    inner = lambda found: pose_errors(own_poses(found)[2:-2], [by_hand(t) for t in times[2:-2]])
    given, without = (mixray.track(folder / "rolling.y4m", *held, *flag) for flag in (["--readout-time", "20ms"], []))
    (mm, degrees), (bad_mm, bad_degrees) = inner(given), inner(without)
    row("rolling shutter of 20 ms, hand held: poses", "0.3 mm, 0.03 degrees", (rms(mm), rms(degrees)), f"{rms(mm):.3f} mm, {rms(degrees):.4f} degrees; without `--readout-time` {rms(bad_mm):.1f} mm, {rms(bad_degrees):.2f} degrees", "-", lambda v: v[0] <= 0.3 and v[1] <= 0.03)
    found = mixray.track(folder / "rolling.y4m", *held, "--readout-time", "solve")["rows"]
    solved_ms, sigma_ms = 1e3 * found["readout_secs"], 1e3 * found["sigma_secs"]
    row("the same: readout time solved for", "20 ms within 3 standard deviations", (solved_ms, sigma_ms), f"{solved_ms:.2f} +- {sigma_ms:.2f} ms", "-", lambda v: abs(v[0] - 20) <= 3 * v[1])

    video = data / "webcam_chessboard_video/movie.mjpeg"
    own = mixray.track(video, "--board", folder / "chess.toml", "--board-flatness", "rigid")
    peer_found = sum(bool(cv2.findChessboardCorners(cv2.cvtColor(f, cv2.COLOR_BGR2GRAY), INNER)[0]) for f in read_frames(video))
    row("chessboard video: frames of 142", "120", own["frames_posed"], str(own["frames_posed"]), str(peer_found), lambda v: v >= 120)
    row("chessboard video: rms, board as its file", "0.10 px", own["rms_px"], f"{own['rms_px']:.3f} px", "-", lambda v: v <= 0.10)

    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36H11 if hasattr(cv2.aruco, "DICT_APRILTAG_36H11") else cv2.aruco.DICT_APRILTAG_36h11)
    images = [cv2.aruco.generateImageMarker(tags, i, 8) > 127 for i in ids]
    for distance, expected in [(1.0, 48), (1.4, 47), (1.9, 14)]:
        truth = views(4, 7, lambda _, __: distance)
        name = f"tags{distance}"
        render(folder / name, lambda x, z: printed(x, z, picture_marker(images)), truth, 8, 4, (0.8,))
        # The lens is given: four views of one distance determine none.
        own = mixray.track(folder / name, "--board", folder / "tags.toml", "--intrinsics", folder / "lens.yaml", "--fix-intrinsics", "--gamma", "2.2")
        count = sum(len(f["ids"]) for f in own["frames"])
        pictures = [cv2.imread(str(p), 0) for p in sorted((folder / name).iterdir())]
        peer_count = sum(len(f) for f in aruco_markers(pictures, tags, 1))
        row(f"36h11, {K[0, 0] * SIDE / distance:.0f} px a side straight on, of 48", f"{expected} (apriltag C)", count, str(count), str(peer_count), lambda v: v >= expected)
    return rows


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--mixray", default=root / "target/release/mixray")
    parser.add_argument("--data", type=pathlib.Path, default=root / "../shared/data")
    parser.add_argument("--write", type=pathlib.Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = measure(Mixray(str(arguments.mixray), pathlib.Path(folder)), arguments.data, pathlib.Path(folder))
    if arguments.write:
        table = "| on | bar | mixray | OpenCV " + cv2.__version__ + " |\n| --- | --- | --- | --- |\n"
        table += "".join(f"| {what} | {bar} | {text} | {peer} |\n" for what, bar, text, peer, _ in rows)
        page = arguments.write.read_text()
        pattern = re.compile(r"(<!-- tracking -->\n)(.*?)(<!-- end -->)", re.DOTALL)
        arguments.write.write_text(pattern.sub(lambda m: m.group(1) + table + m.group(3), page))
    sys.exit(0 if all(good for *_, good in rows) else 1)


if __name__ == "__main__":
    main()
