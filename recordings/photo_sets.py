# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Photos of an object on a table as a hand-held telephone takes them, with Blender (3.4, Cycles on the CPU).
scripts/make_photo_set runs it:

    blender -b --factory-startup -P photo_sets.py -- --seed 1 --table wood --out DIR [--part 0 --of 2]

DIR/photos has the photos; truth.json beside that folder says where they were taken, and masks/ what of them is the
object. The photos have a lens' distortion, noise and JPEG's losses. What is there already is kept.
T_A_B takes points from frame B to frame A. C: camera (x right, y down, z forward), W: see photo_table.py.
"""
import argparse
import math
import os
import sys

import bpy
import cv2
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
TOP = os.path.dirname(HERE)
sys.path[:0] = [HERE, os.path.join(TOP, "demo"), os.path.join(TOP, "scripts", "lib")]
import kinds  # noqa: E402
import photo_table  # noqa: E402
import render as demo  # noqa: E402
import room  # noqa: E402
from lights import Lights  # noqa: E402
from visibility import Surface  # noqa: E402

FOCAL = 0.8            # over the image's width
OVERSCAN = 1.12        # of the pinhole image that the lens bends
MASK_SAMPLES = 3
NOISE = 0.008          # of white
BOARD_GAP_MM = 12      # between object and board
BOARD = "charuco:7x10:25:18:5X5_100"


def lens(seed, width, height):
    """Pinhole and distortion of one telephone: fx, fy, cx, cy (pixel centres are integers), k1, k2, p1, p2."""
    random = np.random.RandomState(seed + 31)
    focal = FOCAL * width * random.uniform(0.95, 1.05)
    middle = (np.array((width, height)) - 1) / 2 + random.uniform(-0.004, 0.004, 2) * width
    return [focal, focal, *middle, random.uniform(-0.06, 0.06), random.uniform(-0.06, 0.02),
            *random.uniform(-3e-4, 3e-4, 2)]


def ideal_camera(parameters, width, height):
    """(width, height, cx, cy) of the larger pinhole image with the same focal length that is rendered."""
    w, h = (2 * math.ceil(OVERSCAN * side / 2) for side in (width, height))
    return w, h, (w - 1) / 2, (h - 1) / 2


def bending(parameters, width, height):
    """Maps for cv2.remap from the rendered pinhole image to that of the lens."""
    fx, fy, cx, cy = parameters[:4]
    _, _, ix, iy = ideal_camera(parameters, width, height)
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 1, 2).astype(np.float64)
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    rays = cv2.undistortPointsIter(pixels, K, np.array(parameters[4:]), None, None, (cv2.TERM_CRITERIA_EPS +
                                   cv2.TERM_CRITERIA_COUNT, 60, 1e-9)).reshape(height, width, 2)
    return (rays[..., 0] * fx + ix).astype(np.float32), (rays[..., 1] * fy + iy).astype(np.float32)


def placed_board(args, low, high):
    """Puts the board below the object or beside it. @param low, high: the object's box [m]. @return T_W_B or None"""
    random = np.random.RandomState(args.seed + 7)
    turn = random.uniform(-180, 180)
    if args.board == "none":
        return None
    if args.board == "below":
        return photo_table.add_board(BOARD, *random.uniform(-20, 20, 2), turn)
    reach = 1000 * max(np.linalg.norm(corner[:2]) for corner in (low, high)) + BOARD_GAP_MM + 100
    return photo_table.add_board(BOARD, reach * math.cos(math.radians(turn)), reach * math.sin(math.radians(turn)), turn)


class Studio:
    """The scene, its cameras and its lens."""

    def __init__(self, args):
        width, height = args.size
        self.parameters = lens(args.seed, width, height)
        ideal = ideal_camera(self.parameters, width, height)
        self.scene = demo.start(ideal[0], ideal[1], self.parameters[0], args.samples, transparent=True)
        photo_table.OBJECTS[args.object]()
        self.parts = list(bpy.context.scene.collection.objects)[1:]
        points = Surface([part for part in self.parts if part.type == "MESH"], None).points()
        self.low, self.high = points.min(axis=0), points.max(axis=0)
        photo_table.add_table(args.table, args.seed)
        self.T_W_B = placed_board(args, self.low, self.high)
        if args.room:
            room.furnish(args.seed)
        Lights(args.seed)
        kinds.quicken(self.scene, 0)
        self.maps = bending(self.parameters, width, height)
        self.others = [thing for thing in bpy.data.objects if thing.type == "MESH" and thing not in self.parts]

    def poses(self, args):
        random = np.random.RandomState(args.seed + 5)
        middle = (self.low + self.high) / 2
        if self.T_W_B is not None:
            middle = (1 - args.aim) * middle + args.aim * self.T_W_B[:3, 3]
        number = 0
        for azimuth, elevation, distance, shift, roll in photo_table.viewpoints(random, args.photos, args.elevations,
                                                                              args.distance):
            eye = middle + demo.around(azimuth, elevation, distance)
            number += 1
            upright = args.upright and number % args.upright == 0
            yield demo.looking(eye, middle + shift, roll + (math.pi / 2 if upright else 0))

    def rendered(self, T_W_G, path, seed):
        """The lens' image [h][w][4] of a pose: straight colours and alpha."""
        demo.shoot(self.scene, T_W_G, path, seed)
        image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
        os.remove(path)
        return cv2.remap(image, *self.maps, cv2.INTER_CUBIC)

    def photo(self, T_W_G, folder, number):
        name = "photo_%03d" % number
        path = os.path.join(folder, "photos", name + ".jpg")
        if os.path.exists(path):
            return
        temporary = os.path.join(folder, ".%s.png" % name)
        seen = self.rendered(T_W_G, temporary, number + 1)
        sky = np.array((150, 146, 140))  # what is behind all things, where there is no room
        alpha = seen[..., 3:].astype(float) / 255
        image = kinds.with_noise(seen[..., :3] * alpha + sky * (1 - alpha), NOISE, (number, 17))
        for thing in self.others:
            thing.hide_render = True
        samples, self.scene.cycles.samples = self.scene.cycles.samples, MASK_SAMPLES
        mask = self.rendered(T_W_G, temporary, 1)[..., 3]
        self.scene.cycles.samples = samples
        for thing in self.others:
            thing.hide_render = False
        cv2.imwrite(os.path.join(folder, "masks", name + ".png"), mask)
        cv2.imwrite(temporary + ".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 93])
        os.replace(temporary + ".jpg", path)
        print("photos/%s.jpg" % name, flush=True)


def write_truth(studio, args, poses):
    fx, fy, cx, cy, *distortion = studio.parameters
    demo.write_json(os.path.join(args.out, "truth.json"), {
        "object": args.object, "table": args.table, "seed": args.seed, "board": BOARD if args.board != "none" else "",
        "width": args.size[0], "height": args.size[1], "fx": fx, "fy": fy, "cx": cx, "cy": cy, "distortion": distortion,
        "bounding_box": [studio.low.tolist(), studio.high.tolist()],
        "T_W_B": None if studio.T_W_B is None else studio.T_W_B.tolist(),
        "photos": [{"file": "photo_%03d.jpg" % i, "T_C_W": (demo.OPTICAL_FROM_OPENGL @ np.linalg.inv(T)).tolist()}
                   for i, T in enumerate(poses)]})


def main():
    parser = argparse.ArgumentParser(prog="photo_sets.py", description=__doc__.split("\n")[0])
    parser.add_argument("--object", choices=sorted(photo_table.OBJECTS), default="toy_kiosk")
    parser.add_argument("--table", choices=photo_table.TABLES, default="wood")
    parser.add_argument("--board", choices=("beside", "below", "none"), default="beside")
    parser.add_argument("--room", type=int, default=1, help="0: nothing stands around the table")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--aim", type=float, default=0, help="0: at the object, 1: at the board")
    parser.add_argument("--photos", type=int, default=44)
    parser.add_argument("--size", type=int, nargs=2, default=(1280, 960), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--elevations", type=float, nargs="+", default=(22, 46), help="of the rounds [deg]")
    parser.add_argument("--distance", type=float, default=0.46, help="of the camera from the object's middle [m]")
    parser.add_argument("--upright", type=int, default=0, help="every so many photos the camera is turned by 90 degrees")
    parser.add_argument("--samples", type=int, default=3, help="paths a pixel: few are noise at edges")
    parser.add_argument("--part", type=int, default=0, help="every --of-th photo, from this one on")
    parser.add_argument("--of", type=int, default=1)
    parser.add_argument("--out", type=os.path.abspath, required=True, help="folder")
    args = parser.parse_args(sys.argv[sys.argv.index("--") + 1:])
    studio = Studio(args)
    poses = list(studio.poses(args))
    for folder in ("photos", "masks"):
        os.makedirs(os.path.join(args.out, folder), exist_ok=True)
    write_truth(studio, args, poses)
    for i in range(args.part, len(poses), args.of):
        studio.photo(poses[i], args.out, i)


if __name__ == "__main__":
    main()
