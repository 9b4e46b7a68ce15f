# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Renders recordings to measure tracking on, with Blender (3.4, Cycles on the CPU). scripts/make_recordings runs it:

    blender -b --factory-startup -P record.py -- object --object bottle --out DIR
    blender -b --factory-startup -P record.py -- truth --object bottle --kind light --seed 1 --out DIR
    blender -b --factory-startup -P record.py -- room --seed 1 --file room.png
    blender -b --factory-startup -P record.py -- frames --room room.png --out DIR [--part 0 --of 2]

`object` writes posed RGBA photos, the mesh and object.json; `truth` writes sequence.json; `room` renders the
background; `frames` renders the images that sequence.json names. Images that are there already are kept.
"""
import argparse
import json
import math
import os
import sys

import bpy
import cv2
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(os.path.dirname(HERE), "demo")]
import background  # noqa: E402
import kinds  # noqa: E402
import lights  # noqa: E402
import motion  # noqa: E402
import render as demo  # noqa: E402
import rig  # noqa: E402
import room  # noqa: E402
from stage import OBJECTS, Stage, build, restrict  # noqa: E402
from visibility import Surface, View  # noqa: E402

JPEG_QUALITY = 95
ROOM_SAMPLES = 6
LABEL_VISIBLE = 0.01  # of what is seen of the object: the label counts as visible from there on
BLUR_STEPS = 6        # of the background during an exposure


def write_object(args):
    thing = OBJECTS[args.object]
    size, focal_px = args.size, 2.0 * args.size
    scene = demo.start(size, size, focal_px, 1, transparent=True)
    kinds.quicken(scene, 0)
    surface = Surface(build(thing), thing.LABEL)
    lights.light_studio()
    points = surface.points()
    low, high, diameter = points.min(axis=0), points.max(axis=0), demo.diameter_m(points)
    os.makedirs(args.out, exist_ok=True)
    surface.write_obj(os.path.join(args.out, thing.NAME + ".obj"), thing.NAME)
    demo.write_json(os.path.join(args.out, "object.json"), {
        "name": thing.NAME, "bounding_box": [np.round(low, 4).tolist(), np.round(high, 4).tolist()],
        "diameter": round(diameter, 4), "symmetric_about_z_without_label": thing.LABEL is not None})
    camera = {"w": size, "h": size, "fl_x": focal_px, "fl_y": focal_px, "cx": size / 2, "cy": size / 2,
              "metres_per_unit": 1.0,
              "aabb": [np.round(low - demo.MARGIN_M, 3).tolist(), np.round(high + demo.MARGIN_M, 3).tolist()]}
    for split, count, phase in (("train", args.train, 0.0), ("test", args.test, 1.0)):
        os.makedirs(os.path.join(args.out, split), exist_ok=True)
        views = demo.hemisphere(count, phase, -88, 88)
        frames = [photo(scene, points, view, "%s/view_%03d.png" % (split, i), args.out) for i, view in enumerate(views)]
        demo.write_json(os.path.join(args.out, "transforms_%s.json" % split), {**camera, "frames": frames})


def photo(scene, points, view, name, folder):
    """Takes one photo, if it is not there. @param points of the object; @param view (azimuth, elevation).
    @return its entry in the transforms"""
    azimuth, elevation = view
    centre, diameter = (points.min(axis=0) + points.max(axis=0)) / 2, demo.diameter_m(points)
    distance = diameter * (2.5 + 0.2 * math.sin(7 * azimuth))  # not one sphere: scale is to be seen from distances
    T_W_G = demo.looking(centre + demo.around(azimuth, elevation, distance), centre)
    path = os.path.join(folder, name)
    if not os.path.exists(path):
        T_G_W = np.linalg.inv(T_W_G)
        seen = points @ T_G_W[:3, :3].T + T_G_W[:3, 3]
        size = scene.render.resolution_x
        pixels = seen[:, :2] / -seen[:, 2:] * [2 * size, -2 * size] + size / 2
        restrict(scene, pixels.min(axis=0) - 3, pixels.max(axis=0) + 3)
        demo.shoot(scene, T_W_G, path + ".part.png")
        demo.shrink(path + ".part.png")
        os.replace(path + ".part.png", path)
        print(name, flush=True)
    return {"file_path": name, "transform_matrix": np.round(T_W_G, 9).tolist()}


def write_truth(args):
    several = args.kind in rig.CAMERAS
    clock = rig if several else motion
    sequence = {"object": args.object, "kind": args.kind, "seed": args.seed, "seconds": args.seconds}
    if several:
        sequence["camera"] = args.camera
    stage = Stage(sequence)
    path, view = stage.trajectory, View(motion.WIDTH, motion.HEIGHT, motion.FOCAL_PX)
    frames = []
    for i, t in enumerate(clock.frame_times(args.seconds)):
        T_C_O = path.T_C_O(t)
        visible, label, label_px = view.visibility(stage.surface, T_C_O, stage.cover, stage.T_C_X(t))
        frame = {"index": i, "file": "frames/frame_%03d.jpg" % i, "time_s": round(float(t), 6),
                 "T_C_O": np.round(T_C_O, 9).tolist(), "size": round(float(path.size(t)), 4),
                 "visible_fraction": round(visible, 4)}
        if several:
            frame["T_W_C"] = np.round(path.T_W_C(t), 9).tolist()
        if OBJECTS[args.object].LABEL:
            frame.update(label_fraction=round(label, 4), label_px=round(label_px), label_visible=label >= LABEL_VISIBLE)
        frames.append(frame)
    os.makedirs(args.out, exist_ok=True)
    stage.surface.write_obj(os.path.join(args.out, "object.obj"), args.object)
    demo.write_json(os.path.join(args.out, "sequence.json"), {
        **sequence, "diameter": round(path.diameter, 4), "centre_O": np.round(path.centre_O, 5).tolist(),
        "width": motion.WIDTH, "height": motion.HEIGHT, "fx": motion.FOCAL_PX, "fy": motion.FOCAL_PX,
        "cx": motion.CX, "cy": motion.CY, "rate_hz": clock.RATE_HZ, "frames": frames})


def render_room(args):
    scene = demo.start(*background.SIZE, 1.0, ROOM_SAMPLES, transparent=False)
    room.furnish(args.seed)
    for part in bpy.data.objects:
        part.visible_shadow = False  # the sun has to get in
    lights.Lights(args.seed)
    kinds.quicken(scene, 0)
    background.set_panoramic(scene.camera.data)
    # The panorama's middle is the world's +x.
    demo.shoot(scene, demo.looking((0, 0, 0), (1, 0, 0)), args.file + ".part.png")
    os.replace(args.file + ".part.png", args.file)


def render_frames(args):
    with open(os.path.join(args.out, "sequence.json")) as file:
        sequence = json.load(file)
    os.makedirs(os.path.join(args.out, "frames"), exist_ok=True)
    waiting = [frame for frame in sequence["frames"][args.part::args.of]
               if not os.path.exists(os.path.join(args.out, frame["file"]))]
    if not waiting:
        return
    stage, panorama = Stage(sequence), background.Panorama(args.room)
    raw = os.path.join(args.out, "part_%d.png" % args.part)
    for frame in waiting:
        stage.pose(frame["time_s"])
        stage.scene.cycles.seed = frame["index"] + 1
        stage.scene.render.filepath = raw
        bpy.ops.render.render(write_still=True)
        moments = frame["time_s"] + stage.exposure(BLUR_STEPS if stage.kind.exposure_s else 1)
        behind = np.mean([panorama.seen_from(stage.trajectory.T_W_C(t)) for t in moments], axis=0)
        behind = behind * stage.lights.gain_bgr(frame["time_s"])
        image = background.composed(cv2.imread(raw, cv2.IMREAD_UNCHANGED), behind)
        path = os.path.join(args.out, frame["file"])
        seeds = (sequence["seed"], frame["index"]) + ((sequence["camera"],) if "camera" in sequence else ())
        cv2.imwrite(path + ".part.jpg", kinds.with_noise(image, stage.kind.noise, seeds),
                    [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        os.replace(path + ".part.jpg", path)
        print(frame["file"], flush=True)
    os.remove(raw)


def main():
    parser = argparse.ArgumentParser(prog="record.py", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    photos, truth, room_only, frames = (commands.add_parser(name) for name in ("object", "truth", "room", "frames"))
    for command in (photos, truth):
        command.add_argument("--object", choices=sorted(OBJECTS), required=True)
    photos.add_argument("--train", type=int, default=72, help="training photos")
    photos.add_argument("--test", type=int, default=8, help="held-out photos")
    photos.add_argument("--size", type=int, default=400, help="width and height [px]")
    truth.add_argument("--kind", choices=sorted(kinds.KINDS), required=True)
    truth.add_argument("--seconds", type=float, default=10.0)
    truth.add_argument("--camera", type=int, choices=range(3), default=0, help="which one of a rig")
    for command in (truth, room_only):
        command.add_argument("--seed", type=int, required=True)
    room_only.add_argument("--file", required=True, help="PNG to write")
    frames.add_argument("--room", required=True, help="PNG that `room` wrote")
    frames.add_argument("--part", type=int, default=0, help="render every --of-th frame, from this one on")
    frames.add_argument("--of", type=int, default=1)
    for command in (photos, truth, frames):
        command.add_argument("--out", type=os.path.abspath, required=True, help="folder")
    args = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    {"object": write_object, "truth": write_truth, "room": render_room, "frames": render_frames}[args.command](args)


if __name__ == "__main__":
    main()
