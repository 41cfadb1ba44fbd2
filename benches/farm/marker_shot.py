#!/usr/bin/env python3
"""A shot of 24 frames of the hand-held marker video: frames, poses, and a scene for the video and for a still.

    pip install opencv-python-headless
    benches/farm/marker_shot.py ../shared/data/webcam_marker_grid_video SHOT
"""
import json
import pathlib
import sys

import cv2

FRAMES = 24

SCENE = """{photo}{camera}[environment]
radiance = [0.6, 0.6, 0.65]
[[light]]
kind = "directional"
direction = [0.4, -1, -0.3]
irradiance = [1.5, 1.4, 1.3]
[[real]]
name = "paper"
shape = "quad"
corner = [-0.3, 0, 0.3]
edge_u = [0.6, 0, 0]
edge_v = [0, 0, -0.6]
material = {{ base_color = [0.6, 0.6, 0.6] }}
[[virtual]]
shape = "sphere"
scale = 0.04
translation = [0, 0.04, 0]
material = {{ base_color = [0.8, 0.3, 0.1], roughness = 0.3 }}
[render]
rays_per_pixel = {rays}
max_bounces = 2
backend = "cpu"
"""


def main():
    data, shot = map(pathlib.Path, sys.argv[1:])
    (shot / "frames").mkdir(parents=True, exist_ok=True)
    video = cv2.VideoCapture(str(data / "movie.mp4"))
    for number in range(FRAMES):
        whole, frame = video.read()
        assert whole, f"frame {number} of the video cannot be read"
        cv2.imwrite(str(shot / "frames" / f"frame_{number:04}.png"), frame)
    poses = json.loads((data / "trajectory.json").read_text())
    (shot / "poses.json").write_text(json.dumps(poses))
    first = next(frame for frame in poses["frames"] if frame["camera_to_world_gltf"])
    rows = first["camera_to_world_gltf"]
    # Of the still: pixel centres count from 0 in the file, corners in a scene.
    rows = rows if isinstance(rows[0], list) else [rows[i : i + 4] for i in range(0, 16, 4)]
    lens = poses["distortion"]
    camera = (
        f"[camera]\nfx = {poses['fx']}\nfy = {poses['fy']}\ncx = {poses['cx'] + 0.5}\ncy = {poses['cy'] + 0.5}\n"
        f"distortion = [{lens['k1']}, {lens['k2']}, 0, 0, 0]\nworld_from_camera = {rows}\n"
    )
    (shot / "video.toml").write_text(SCENE.format(photo="", camera="", rays=2))
    photo = '[photo]\nimage = "frames/frame_0000.png"\n'
    (shot / "still.toml").write_text(SCENE.format(photo=photo, camera=camera, rays=32))


main()
