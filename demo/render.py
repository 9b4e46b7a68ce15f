# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Renders the demo's pictures with Blender (3.4, Cycles on the CPU):

    blender -b --factory-startup -P demo/render.py -- views --out DIR
    blender -b --factory-startup -P demo/render.py -- sequence --out DIR [--path P] [--light L] [--object O] ...
    blender -b --factory-startup -P demo/render.py -- companions --out DIR [--path P] [--light L] [--object O] ...

`views` writes posed RGBA pictures of the object alone, with transforms_train.json and transforms_test.json
(OpenGL camera axes: x right, y up, z back; pixels are counted from corners). `sequence` writes the frames of a moving
camera, masks of the object and sequence.json (ROS optical axes: x right, y down, z forward; pixel centres are
integers). `companions` writes what two further cameras see of the same sequence: depth_NNN.npy, the exact depth [m]
before a depth camera beside the moving one; side_NNN.png of a camera that stands still; and companions.json. T_A_B
takes points from frame B to frame A. O: object, W: world, R: room, C: camera_optical, D: depth_optical,
S: side_camera_optical, G: OpenGL camera.
"""
import argparse
import json
import math
import os
import sys

import bpy
import cv2
import numpy as np
from mathutils import Matrix, Vector

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from scene import tabletop, toy_kiosk  # noqa: E402
from scene.shapes import place  # noqa: E402

OPTICAL_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # its own inverse
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
MARGIN_M = 0.01  # between the object and its box, where a field is learnt


# ---------------------------------------------------------------------------------------------- scene and camera

def start(width, height, focal_px, samples, transparent):
    """An empty scene with a pinhole camera, whose principal point is the picture's middle."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 3
    scene.cycles.diffuse_bounces = 3
    scene.render.use_persistent_data = True
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.film_transparent = transparent
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA" if transparent else "RGB"
    scene.render.image_settings.compression = 15
    scene.view_settings.view_transform = "Standard"
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.sensor_width = "HORIZONTAL", 36.0
    camera.lens = focal_px / width * camera.sensor_width
    camera.clip_start, camera.clip_end = 0.01, 20.0
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    return scene


def add_object(T_W_O=np.eye(4)):
    """Builds the object, moves it to its place and returns its parts."""
    others = set(bpy.data.objects)
    toy_kiosk.build()
    parts = [thing for thing in bpy.data.objects if thing not in others]
    for part in parts:
        part.matrix_world = Matrix(T_W_O)
    bpy.context.view_layer.update()
    return parts


def vertices_O(parts):
    """[n][3] m. The meshes themselves are in the object's frame."""
    return np.array([v.co for part in parts for v in part.data.vertices])


def diameter_m(points):
    return max(float(np.linalg.norm(points - p, axis=1).max()) for p in points)


def looking(eye, target, roll=0.0):
    """T_W_G of a camera at `eye` that has `target` in its middle, upright but for `roll` (rad)."""
    turn = (Vector(target) - Vector(eye)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    return np.array(Matrix.Translation(eye) @ turn @ Matrix.Rotation(roll, 4, "Z"))


def around(azimuth, elevation, distance):
    return np.array([math.cos(azimuth) * math.cos(elevation), math.sin(azimuth) * math.cos(elevation),
                     math.sin(elevation)]) * distance


def shoot(scene, T_W_G, path, seed=1):
    """Renders one picture. @param seed of the noise: frames of a sequence must not share it, as a camera's do not."""
    scene.camera.matrix_world = Matrix(T_W_G)
    scene.cycles.seed = seed
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def write_json(path, content):
    with open(path, "w") as file:
        json.dump(content, file, indent=1)
        file.write("\n")


# ---------------------------------------------------------------------------------------------- training views

def hemisphere(count, phase, below_deg=-15.0, above_deg=85.0):
    """Directions (azimuth, elevation), spread evenly by the Fibonacci spiral."""
    low, high = math.sin(math.radians(below_deg)), math.sin(math.radians(above_deg))
    return [(phase + i * GOLDEN_ANGLE, math.asin(low + (high - low) * (i + 0.5) / count)) for i in range(count)]


def render_views(args):
    size, focal_px = args.size, 2.0 * args.size
    scene = start(size, size, focal_px, args.samples, transparent=True)
    points = vertices_O(add_object())
    tabletop.light("studio")
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2
    for split, count, phase in (("train", args.train, 0.0), ("test", args.test, 1.0)):
        os.makedirs(os.path.join(args.out, split), exist_ok=True)
        frames = []
        for i, (azimuth, elevation) in enumerate(hemisphere(count, phase)):
            distance = 0.60 + 0.04 * math.sin(2.4 * i + phase)  # not one sphere: scale is to be seen from distances
            T_W_G = looking(centre + around(azimuth, elevation, distance), centre)
            name = "%s/view_%03d.png" % (split, i)
            path = os.path.join(args.out, name)
            if not (args.resume and os.path.exists(path)):
                shoot(scene, T_W_G, path)
                shrink(path)
            frames.append({"file_path": name, "transform_matrix": np.round(T_W_G, 9).tolist()})
            print("%s: %d of %d" % (split, i + 1, count), flush=True)
        write_json(os.path.join(args.out, "transforms_%s.json" % split), {
            "w": size, "h": size, "fl_x": focal_px, "fl_y": focal_px, "cx": size / 2, "cy": size / 2,
            "metres_per_unit": 1.0,
            "aabb": [np.round(low - MARGIN_M, 3).tolist(), np.round(high + MARGIN_M, 3).tolist()],
            "frames": frames})
    write_json(os.path.join(args.out, "object.json"), {
        "name": toy_kiosk.NAME,
        "frame": "origin: centre of the underside; z up; the counter looks along -y; the barrel stands at +x; metres",
        "bounding_box": [np.round(low, 4).tolist(), np.round(high, 4).tolist()],
        "diameter": round(diameter_m(points), 4)})


def shrink(path):
    """Rewrites a picture as small as PNG can: nothing under full transparency, and 7 bits of colour, for the eighth
    is the renderer's noise."""
    rgba = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    colour = np.clip((rgba[..., :3].astype(np.int32) + 1) // 2 * 2, 0, 255).astype(np.uint8)
    rgba[..., :3] = np.where(rgba[..., 3:] > 0, colour, 0)
    cv2.imwrite(path, rgba, [cv2.IMWRITE_PNG_COMPRESSION, 9])


# ---------------------------------------------------------------------------------------------- sequence

def sway(s, *terms):
    """The unsteadiness of a hand: a few slow waves. @param terms (amplitude, waves in the sequence, phase)"""
    return sum(a * math.sin(2 * math.pi * waves * s + phase) for a, waves, phase in terms)


# Paths: s in 0..1 -> azimuth (deg, -90 is in front of the table), elevation (deg), distance (m).
PATHS = {
    "sweep": lambda s: (-134 + 90 * s + sway(s, (0.9, 3.1, 0.4)), 27 + sway(s, (8, 0.9, -0.9), (0.7, 4.3, 1.0)),
                        0.535 + sway(s, (0.045, 1.1, 0.3), (0.006, 3.7, 2.0))),
    "return": lambda s: (-50 - 84 * s + sway(s, (1.1, 2.7, 1.4)), 36 + sway(s, (11, 0.7, 0.6), (0.8, 3.9, 0.2)),
                         0.58 + sway(s, (0.06, 0.8, 2.3), (0.006, 4.1, 0.5))),
    "approach": lambda s: (-100 + 30 * s + sway(s, (0.8, 2.9, 0.0)), 22 + 28 * s + sway(s, (0.7, 4.1, 1.0)),
                           0.72 - 0.24 * s + sway(s, (0.006, 3.3, 0.0))),
}
T_W_O = np.array(place(0.015, -0.010, 0.0, turn=24.0))  # on the table [m]


def camera_at(s, path, centre_W):
    """T_W_G at moment s of a path."""
    azimuth, elevation, distance = PATHS[path](s)
    eye = centre_W + around(math.radians(azimuth), math.radians(elevation), distance)
    target = centre_W + np.array([sway(s, (0.016, 1.7, 0.5), (0.003, 5.3, 0.0)), sway(s, (0.012, 2.1, 2.0)),
                                  sway(s, (0.010, 1.3, 1.0), (0.003, 4.7, 0.7))])
    return looking(eye, target, roll=math.radians(sway(s, (2.5, 1.2, 0.3), (0.6, 4.4, 0.0))))


def mask_of(scene, parts, T_W_G, K, width, height, box_O):
    """The object's silhouette by casting one ray through each pixel's centre: 255 seen, 128 behind something, 0 not."""
    mask = np.zeros((height, width), np.uint8)
    if not parts:
        return mask
    names = {part.name for part in parts}
    graph = bpy.context.evaluated_depsgraph_get()
    eye, turn = Vector(T_W_G[:3, 3]), Matrix(T_W_G[:3, :3].tolist())
    corners = np.array([[box_O[i][0], box_O[j][1], box_O[k][2], 1] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    seen = (OPTICAL_FROM_OPENGL @ np.linalg.inv(T_W_G) @ T_W_O @ corners.T)[:3]
    u, v = (K @ seen)[:2] / seen[2]
    for y in range(max(0, int(v.min())), min(height, int(v.max()) + 2)):
        for x in range(max(0, int(u.min())), min(width, int(u.max()) + 2)):
            direction = turn @ Vector(((x - K[0, 2]) / K[0, 0], -(y - K[1, 2]) / K[1, 1], -1.0)).normalized()
            origin, value = eye, 255
            while True:
                hit, where, _, _, thing, _ = scene.ray_cast(graph, origin, direction)
                if not hit:
                    break
                if thing.name in names:
                    mask[y, x] = value
                    break
                origin, value = where + 1e-5 * direction, 128
    return mask


def furnish(args):
    """The table with all that stands on it. Returns the object's parts, its box in frame O, and its centre."""
    parts = add_object(T_W_O)
    points = vertices_O(parts)
    box_O = [points.min(axis=0), points.max(axis=0)]
    centre_W = (T_W_O @ np.append((box_O[0] + box_O[1]) / 2, 1))[:3]
    if args.object in ("absent", "exchanged"):
        for part in parts:
            bpy.data.objects.remove(part)
        parts = []
    if args.object == "covered":
        tabletop.cover()
    if args.object == "exchanged":
        tabletop.exchange()
    if args.occluder == "cup":
        tabletop.occlude()
    tabletop.furnish()
    tabletop.light(args.light)
    bpy.context.view_layer.update()
    return parts, box_O, centre_W


def frame_numbers(args):
    return range(args.first, args.frames if args.last is None else args.last + 1, args.every)


def intrinsics(width, height, focal_px):
    return np.array([[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]])


def described(width, height, focal_px):
    K = intrinsics(width, height, focal_px)
    return {"width": width, "height": height, "fx": focal_px, "fy": focal_px, "cx": K[0, 2], "cy": K[1, 2]}


def render_sequence(args):
    width, height, focal_px = 480, 360, 500.0
    scene = start(width, height, focal_px, args.samples, transparent=False)
    K = intrinsics(width, height, focal_px)
    parts, box_O, centre_W = furnish(args)
    for folder in ("frames", "masks"):
        os.makedirs(os.path.join(args.out, folder), exist_ok=True)
    frames = []
    for i in frame_numbers(args):
        T_W_G = camera_at(i / (args.frames - 1), args.path, centre_W)
        mask = mask_of(scene, parts, T_W_G, K, width, height, box_O)
        cv2.imwrite(os.path.join(args.out, "masks/mask_%03d.png" % i), mask, [cv2.IMWRITE_PNG_COMPRESSION, 9])
        path = os.path.join(args.out, "frames/frame_%03d.png" % i)
        if not args.masks_only and not (args.resume and os.path.exists(path)):
            shoot(scene, T_W_G, path, seed=i + 1)
        T_C_O = OPTICAL_FROM_OPENGL @ np.linalg.inv(T_W_G) @ T_W_O
        hidden = float((mask == 128).sum()) / max(1, (mask > 0).sum())
        frames.append({"index": i, "T_C_O": np.round(T_C_O, 9).tolist(), "hidden_fraction": round(hidden, 4)})
        print("frame %d of %d: %.0f %% hidden" % (i + 1, args.frames, 100 * hidden), flush=True)
    write_json(os.path.join(args.out, "sequence.json"), {
        "path": args.path, "light": args.light, "object": args.object, "occluder": args.occluder,
        **described(width, height, focal_px), "rate_hz": 10.0, "frames": frames})


# ---------------------------------------------------------------------------------------------- further cameras

DEPTH_CAMERA = (240, 180, 225.0)  # width, height, focal length [px]
SIDE_CAMERA = (320, 240, 400.0)
T_C_D = np.array(Matrix.Translation((-0.015, 0.0, 0.002)) @ Matrix.Rotation(math.radians(0.6), 4, (0.3, 0.9, 0.3)))
T_W_R = np.array(Matrix.Translation((-0.75, -0.55, 0.0)))  # the room's frame: a corner of the table


def side_camera(centre_W):
    """T_W_G of a camera above and behind the table: 67 to 101 degrees aside of the moving one."""
    eye = centre_W + around(math.radians(30), math.radians(58), 0.62)
    return looking(eye, centre_W + np.array([0.018, -0.012, 0.006]), roll=math.radians(4))


def depth_before(scene, T_W_D):
    """[height][width] distances along the view of what the rays through the pixels' centres hit [m]; 0: nothing."""
    width, height, focal_px = DEPTH_CAMERA
    depth = np.zeros((height, width), np.float32)
    graph = bpy.context.evaluated_depsgraph_get()
    eye = Vector(T_W_D[:3, 3])
    v, u = np.mgrid[:height, :width]
    K = intrinsics(*DEPTH_CAMERA)
    rays_D = np.stack([(u - K[0, 2]) / focal_px, (v - K[1, 2]) / focal_px, np.ones_like(u)], axis=-1)
    lengths = np.linalg.norm(rays_D, axis=-1)
    rays_W = rays_D / lengths[..., None] @ T_W_D[:3, :3].T
    for y in range(height):
        for x, ray in enumerate(rays_W[y].tolist()):
            hit, where, *_ = scene.ray_cast(graph, eye, ray)
            if hit:
                depth[y, x] = (where - eye).length / lengths[y, x]
    return depth


def render_companions(args):
    scene = start(*SIDE_CAMERA, args.samples, transparent=False)
    parts, box_O, centre_W = furnish(args)
    T_W_G = side_camera(centre_W)
    T_W_S = T_W_G @ OPTICAL_FROM_OPENGL
    os.makedirs(args.out, exist_ok=True)
    mask = mask_of(scene, parts, T_W_G, intrinsics(*SIDE_CAMERA), *SIDE_CAMERA[:2], box_O)
    cv2.imwrite(os.path.join(args.out, "side_mask.png"), mask, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    frames = []
    for i in frame_numbers(args):
        T_W_C = camera_at(i / (args.frames - 1), args.path, centre_W) @ OPTICAL_FROM_OPENGL
        depth_path, side_path = (os.path.join(args.out, name % i) for name in ("depth_%03d.npy", "side_%03d.png"))
        if not (args.resume and os.path.exists(depth_path)):
            np.save(depth_path, depth_before(scene, T_W_C @ T_C_D))
        if not (args.resume and os.path.exists(side_path)):
            shoot(scene, T_W_G, side_path, seed=1001 + i)
        frames.append({"index": i, "T_R_C": np.round(np.linalg.inv(T_W_R) @ T_W_C, 9).tolist()})
        print("companions of frame %d of %d" % (i + 1, args.frames), flush=True)
    write_json(os.path.join(args.out, "companions.json"), {
        "depth": {**described(*DEPTH_CAMERA), "T_C_D": np.round(T_C_D, 9).tolist()},
        "side": {**described(*SIDE_CAMERA), "T_R_S": np.round(np.linalg.inv(T_W_R) @ T_W_S, 9).tolist()},
        "frames": frames})


# ---------------------------------------------------------------------------------------------- command line

def main():
    parser = argparse.ArgumentParser(prog="render.py", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    views = commands.add_parser("views", help="posed RGBA pictures of the object alone")
    views.add_argument("--train", type=int, default=64, help="training views")
    views.add_argument("--test", type=int, default=8, help="held-out views")
    views.add_argument("--size", type=int, default=320, help="width and height [px]")
    views.add_argument("--samples", type=int, default=128, help="paths a pixel")
    sequence = commands.add_parser("sequence", help="a camera that moves around the object on a table")
    sequence.add_argument("--masks-only", action="store_true", help="poses and masks, no pictures")
    companions = commands.add_parser("companions", help="depth and a camera from the side for such a sequence")
    for command in (sequence, companions):
        command.add_argument("--path", choices=sorted(PATHS), default="sweep")
        command.add_argument("--light", choices=sorted(tabletop.LIGHTS), default="warm")
        command.add_argument("--object", choices=("present", "absent", "covered", "exchanged"), default="present")
        command.add_argument("--occluder", choices=("cup", "none"), default="cup")
        command.add_argument("--frames", type=int, default=76)
        command.add_argument("--every", type=int, default=1, help="only every n-th of these frames, for a look")
        command.add_argument("--first", type=int, default=0, help="only from this frame on")
        command.add_argument("--last", type=int, help="only up to this frame")
        command.add_argument("--samples", type=int, default=64, help="paths a pixel")
    for command in (views, sequence, companions):
        command.add_argument("--out", required=True, help="folder to write to")
        command.add_argument("--resume", action="store_true", help="keep pictures that are there already")
    args = parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])
    args.out = os.path.abspath(args.out)
    {"views": render_views, "sequence": render_sequence, "companions": render_companions}[args.command](args)


if __name__ == "__main__":
    main()
