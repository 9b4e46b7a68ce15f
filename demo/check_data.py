#!/usr/bin/python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks the demo's data against itself: files, poses, silhouettes, stamps and the initial pose's error.

The object's shape is carved out of the training silhouettes by their poses (a visual hull). Projected into pictures
that had no part in it - the test views, the frames of the bag - it must cover the object there, and it must not be
displaced: half a pixel, the usual mistake between the conventions for pixels, would show.
"""
import argparse
import glob
import json
import os
import sys

import cv2
import numpy as np
import rosbag
from geometry_msgs.msg import Pose

OPTICAL_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
VOXEL_M = 0.0015
SHIFT_PX = 0.25  # what the hull itself may be off by, on average over the views; half of the mistake to be found
MIB = 2**20
MAX_BAG_MIB = 4
DEPTH_TOPIC, SIDE_TOPIC = "/camera/depth/image", "/side_camera/image/compressed"
failures = 0


def check(good, text):
    global failures
    failures += not good
    print("%s  %s" % ("ok  " if good else "FAIL", text))


def load(path):
    with open(path) as file:
        return json.load(file)


# ------------------------------------------------------------------------------------------------ projection

def project(points_O, T_C_O, fx, fy, cx, cy):
    """[n][2] px; pixel centres are integers."""
    seen = points_O @ T_C_O[:3, :3].T + T_C_O[:3, 3]
    return seen[:, :2] / seen[:, 2:] * [fx, fy] + [cx, cy]


def silhouette(points_O, T_C_O, camera, shape):
    """What voxels cover. Pictured at three times the size, where a voxel is as large as a few pixels, so that filled
    voxels make a silhouette true to a third of a pixel."""
    zoom = 3
    fx, fy, cx, cy = camera
    uv = project(points_O, T_C_O, zoom * fx, zoom * fy, (cx + 0.5) * zoom - 0.5, (cy + 0.5) * zoom - 0.5)
    uv = np.round(uv).astype(int)
    large = np.zeros((zoom * shape[0], zoom * shape[1]), np.uint8)
    inside = (uv >= 0).all(axis=1) & (uv[:, 0] < large.shape[1]) & (uv[:, 1] < large.shape[0])
    large[uv[inside, 1], uv[inside, 0]] = 255
    large = cv2.morphologyEx(large, cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    return cv2.resize(large, shape[::-1], interpolation=cv2.INTER_AREA) > 127


def overlap(a, b):
    return (a & b).sum() / max(1, (a | b).sum())


def centre_of(mask):
    """Of the convex outline [px]: a hull fills hollows that no silhouette shows, which must not count as a shift."""
    moments = cv2.moments(cv2.convexHull(np.argwhere(mask)[:, ::-1].astype(np.float32)))
    return np.array([moments["m10"], moments["m01"]]) / moments["m00"]


# ------------------------------------------------------------------------------------------------ training views

def read_views(folder, split):
    """Camera (fx, fy, cx, cy; pixel centres are integers) and a list of (T_C_O, RGBA picture)."""
    transforms = load(os.path.join(folder, "transforms_%s.json" % split))
    camera = (transforms["fl_x"], transforms["fl_y"], transforms["cx"] - 0.5, transforms["cy"] - 0.5)
    views = []
    for frame in transforms["frames"]:
        picture = cv2.imread(os.path.join(folder, frame["file_path"]), cv2.IMREAD_UNCHANGED)
        assert picture is not None and picture.shape == (transforms["h"], transforms["w"], 4), frame["file_path"]
        views.append((OPTICAL_FROM_OPENGL @ np.linalg.inv(np.array(frame["transform_matrix"])), picture))
    return transforms, camera, views


def carve(transforms, camera, views):
    """Centres of the voxels [n][3] that no training view calls empty."""
    low, high = np.array(transforms["aabb"])
    axes = [np.arange(l + VOXEL_M / 2, h, VOXEL_M) for l, h in zip(low, high)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    for T_C_O, picture in views:
        column, row = np.round(project(points, T_C_O, *camera)).astype(int).T
        seen = picture[row.clip(0, transforms["h"] - 1), column.clip(0, transforms["w"] - 1), 3]
        points = points[seen > 127]
    return points


def check_views(folder):
    model = load(os.path.join(folder, "object.json"))
    transforms, camera, train = read_views(folder, "train")
    _, _, test = read_views(folder, "test")
    check(len(train) >= 60 and len(test) == 8, "%d training and %d test views" % (len(train), len(test)))
    files = glob.glob(os.path.join(folder, "*", "*.png"))
    total = sum(map(os.path.getsize, files)) / MIB
    check(total <= 4.0, "views take %.2f MiB" % total)
    low, high = np.array(transforms["aabb"])
    box = np.array(model["bounding_box"])
    check((low < box[0]).all() and (high > box[1]).all(), "the aabb is larger than the object")
    check(0.15 < model["diameter"] < np.linalg.norm(box[1] - box[0]), "diameter %.3f m" % model["diameter"])

    eyes = np.array([np.linalg.inv(T_C_O)[:3, 3] for T_C_O, _ in train]) - box.mean(axis=0)
    elevations = np.degrees(np.arcsin(eyes[:, 2] / np.linalg.norm(eyes, axis=1)))
    check(elevations.min() < -10 and elevations.max() > 75, "elevations %.0f..%.0f deg"
          % (elevations.min(), elevations.max()))
    borders = [np.concatenate([p[0, :, 3], p[-1, :, 3], p[:, 0, 3], p[:, -1, 3]]).max() for _, p in train + test]
    check(max(borders) == 0, "the object touches no picture's edge")
    shares = [(p[..., 3] > 127).mean() for _, p in train]
    check(min(shares) > 0.1, "the object covers %.0f..%.0f %% of the views" % (100 * min(shares), 100 * max(shares)))
    colours = np.concatenate([p[..., :3][p[..., 3] == 255] for _, p in train])
    check(60 < colours.mean() < 180 and (colours == 255).all(axis=1).mean() < 0.001,
          "colours: mean %.0f of 255, none burnt out" % colours.mean())

    hull = carve(transforms, camera, train)
    ious, shifts = [], []
    for T_C_O, picture in test:
        mask = picture[..., 3] > 127
        guess = silhouette(hull, T_C_O, camera, mask.shape)
        ious.append(overlap(mask, guess))
        shifts.append(centre_of(guess) - centre_of(mask))
    shift = np.mean(shifts, axis=0)
    check(min(ious) > 0.94, "test silhouettes against the hull: IoU %.3f at least" % min(ious))
    check(np.abs(shift).max() < SHIFT_PX, "mean displacement %+.2f, %+.2f px" % tuple(shift))
    return model, hull


# ------------------------------------------------------------------------------------------------ bag

def matrix(pose):
    q = pose.orientation
    w, v = q.w, np.array([q.x, q.y, q.z])
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    T = np.eye(4)
    T[:3, :3] = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    T[:3, 3] = pose.position.x, pose.position.y, pose.position.z
    return T


def angle_deg(R):
    return np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1)))


def read_bags(*paths):
    """Messages by topic, with their times of recording. Transforms of /tf are sorted by child frame."""
    messages = {}
    for path in paths:
        size = os.path.getsize(path) / MIB
        check(size < MAX_BAG_MIB, "%s takes %.2f MiB" % (os.path.basename(path), size))
        with rosbag.Bag(path) as bag:
            for topic, message, recorded in bag.read_messages():
                if topic == "/tf":
                    for transform in message.transforms:
                        messages.setdefault("to " + transform.child_frame_id, []).append((transform, recorded))
                else:
                    messages.setdefault(topic, []).append((message, recorded))
    return messages


def of_topics(messages, *topics):
    return ([m for m, _ in messages.get(topic, [])] for topic in topics)


def camera_of(info):
    """fx, fy, cx, cy"""
    return (info.K[0], info.K[4], info.K[2], info.K[5])


def decoded(image):
    return cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_UNCHANGED)


def check_messages(messages):
    """Stamps, frames and pictures. Returns the camera (fx, fy, cx, cy), the pictures' shape, and the poses T_C_O: the
    true ones and the one to start from."""
    images, infos, truths, starts, transforms = of_topics(
        messages, "/camera/image/compressed", "/camera/camera_info", "/ground_truth/object_pose", "/initial_pose",
        "to ground_truth_object")
    check(len(images) >= 64 and len(starts) == 1, "%d images, %d initial pose" % (len(images), len(starts)))
    stamps = [m.header.stamp for m in images]
    check(stamps == [m.header.stamp for m in infos] == [m.header.stamp for m in truths]
          == [m.header.stamp for m in transforms], "images, camera_info, truth and tf have equal stamps")
    steps_s = {round((b - a).to_sec(), 6) for a, b in zip(stamps, stamps[1:])}
    check(steps_s == {0.1}, "10 Hz")
    check({m.header.frame_id for m in images + infos + truths + starts} == {"camera_optical"}, "frame camera_optical")
    first_recorded = messages["/initial_pose"][0][1]
    check(starts[0].header.stamp == stamps[0] and first_recorded <= stamps[0], "the initial pose is the first image's")

    info = infos[0]
    shape = (info.height, info.width)
    check({decoded(m).shape for m in images} == {(*shape, 3)}, "pictures are %d x %d BGR" % shape[::-1])
    return camera_of(info), shape, [matrix(m.pose) for m in truths], matrix(starts[0].pose)


def check_motion(poses, start, model):
    centre_O = np.mean(model["bounding_box"], axis=0)
    eyes = np.array([np.linalg.inv(T)[:3, 3] for T in poses]) - centre_O
    azimuths = np.degrees(np.unwrap(np.arctan2(eyes[:, 1], eyes[:, 0])))
    check(np.ptp(azimuths) >= 70, "sweep of %.0f deg" % np.ptp(azimuths))
    turns = [angle_deg(b[:3, :3] @ a[:3, :3].T) for a, b in zip(poses, poses[1:])]
    check(max(turns) < 2.0, "%.2f deg a frame, %.2f at most" % (np.mean(turns), max(turns)))
    off_deg = angle_deg(start[:3, :3] @ poses[0][:3, :3].T)
    off_share = np.linalg.norm((start - poses[0])[:3] @ np.append(centre_O, 1)) / model["diameter"]
    check(10 <= off_deg <= 15 and 0.10 <= off_share <= 0.15,
          "initial pose is off by %.1f deg and %.1f %% of the diameter" % (off_deg, 100 * off_share))


def check_silhouettes(sequence_folder, camera, shape, poses, start, hull):
    """The masks that came with the frames against the hull at the true poses: where the object is, and what hides it."""
    masks = [cv2.imread(os.path.join(sequence_folder, "masks", "mask_%03d.png" % i), cv2.IMREAD_GRAYSCALE)
             for i in range(len(poses))]
    ious, shifts, diameters = [], [], []
    for T_C_O, mask in zip(poses, masks):
        guess = silhouette(hull, T_C_O, camera, shape)
        ious.append(overlap(mask > 0, guess))
        shifts.append(centre_of(guess) - centre_of(mask))
        outline = np.argwhere(mask > 0).astype(float)
        corners = cv2.convexHull(outline.astype(np.float32))[:, 0]
        diameters.append(np.linalg.norm(corners[:, None] - corners[None], axis=2).max())
    shift = np.mean(shifts, axis=0)
    check(min(ious) > 0.94, "masks against the hull at the true poses: IoU %.3f at least" % min(ious))
    check(np.abs(shift).max() < SHIFT_PX, "mean displacement %+.2f, %+.2f px" % tuple(shift))
    wrong = overlap(masks[0] > 0, silhouette(hull, start, camera, shape))
    check(wrong < 0.85, "and at the initial pose: IoU %.3f" % wrong)
    check(min(diameters) > 140 and max(diameters) < 230, "the object measures %.0f..%.0f px"
          % (min(diameters), max(diameters)))
    hidden = np.array([(mask == 128).sum() / (mask > 0).sum() for mask in masks])
    occluded = np.flatnonzero(hidden >= 0.10)
    check(12 <= len(occluded) == np.ptp(occluded) + 1 and max(hidden) <= 0.25 and hidden[0] == 0,
          "frames %d..%d are hidden by 10 %% or more (%.0f %% at most); frames %d..%d by anything"
          % (occluded[0], occluded[-1], 100 * max(hidden), *np.flatnonzero(hidden)[[0, -1]]))


# ------------------------------------------------------------------------------------------------ further cameras

def check_companions(messages):
    """Stamps, frames and sizes. Returns places by frame: T_R_C of each image, T_C_D and T_R_S."""
    stamps = [m.header.stamp for m, _ in messages["/camera/image/compressed"]]
    for frame, topic, info_topic in (("depth_optical", DEPTH_TOPIC, "/camera/depth/camera_info"),
                                     ("side_camera_optical", SIDE_TOPIC, "/side_camera/camera_info")):
        images, infos = of_topics(messages, topic, info_topic)
        check(stamps == [m.header.stamp for m in images] == [m.header.stamp for m in infos],
              "%s and its camera_info have the images' stamps" % topic)
        check({m.header.frame_id for m in images + infos} == {frame}, "frame " + frame)
        shape = (infos[0].height, infos[0].width)
        sizes = {decoded(m).shape[:2] if topic == SIDE_TOPIC else (m.height, m.width) for m in images}
        check(sizes == {shape}, "%d x %d, f = %.0f px" % (*shape[::-1], infos[0].K[0]))
    parents = {"camera_optical": "room", "side_camera_optical": "room", "depth_optical": "camera_optical"}
    check({topic[3:] for topic in messages if topic.startswith("to ")} == {*parents, "ground_truth_object"},
          "TF has the cameras' places and the truth, and nothing else")
    places = {}
    for child, parent in parents.items():
        transforms = messages["to " + child]
        check([m.header.stamp for m, _ in transforms] == stamps and all(r <= m.header.stamp for m, r in transforms)
              and {m.header.frame_id for m, _ in transforms} == {parent}, "TF %s -> %s at each stamp" % (parent, child))
        places[child] = [transform_matrix(m.transform) for m, _ in transforms]
    for child in ("side_camera_optical", "depth_optical"):
        check(np.ptp(places[child], axis=0).max() == 0, child + " stands still")
    return places


def transform_matrix(transform):
    return matrix(Pose(transform.translation, transform.rotation))


def front_m(points_O, T_D_O, camera, shape):
    """Depth of the nearest voxel in each pixel [m]; infinite where there is none."""
    depth = np.full(shape, np.inf)
    u, v = np.round(project(points_O, T_D_O, *camera)).astype(int).T
    inside = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    np.minimum.at(depth, (v[inside], u[inside]), (points_O[inside] @ T_D_O[2, :3] + T_D_O[2, 3]))
    return depth


def check_depth(messages, places, poses, hull):
    """Depth against the hull at the true poses. A hull fills hollows: there, the object is farther away."""
    info = messages["/camera/depth/camera_info"][0][0]
    images, = of_topics(messages, DEPTH_TOPIC)
    check({(m.encoding, m.step, m.is_bigendian) for m in images} == {("16UC1", 2 * info.width, 0)},
          "depth is 16UC1, in millimetres")
    shape, camera = (info.height, info.width), camera_of(info)
    holes, offsets_m, agreements, beside = [], [], [], []
    for message, T_C_D, T_C_O in zip(images, places["depth_optical"], poses):
        measured_m = np.frombuffer(message.data, "<u2").reshape(shape) / 1000
        holes.append((measured_m == 0).mean())
        for T_D_O, shares in ((np.linalg.inv(T_C_D) @ T_C_O, agreements), (T_C_O, beside)):
            front = front_m(hull, T_D_O, camera, shape) - VOXEL_M / 2
            on_object = np.isfinite(front) & (measured_m > 0)
            off_m = measured_m[on_object] - front[on_object]
            shares.append((abs(off_m) < 0.01).mean())
            if shares is agreements:
                offsets_m.append(np.median(off_m))
    check(0.08 < min(holes) and max(holes) < 0.25, "holes: %.0f..%.0f %%" % (100 * min(holes), 100 * max(holes)))
    offset_mm = 1000 * np.median(offsets_m)
    check(abs(offset_mm) < 2.5, "depth of the object against the hull: %+.1f mm" % offset_mm)
    check(np.mean(agreements) > 0.6 and np.mean(agreements) > np.mean(beside) + 0.02,
          "%.0f %% of its pixels within 10 mm; from the colour camera's place %.0f %%"
          % (100 * np.mean(agreements), 100 * np.mean(beside)))


def check_side_camera(messages, places, poses, hull, mask):
    """The side camera's mask against the hull at the true poses, by the places that TF tells."""
    camera = camera_of(messages["/side_camera/camera_info"][0][0])
    ious, shifts, angles_deg = [], [], []
    for T_R_S, T_R_C, T_C_O in zip(places["side_camera_optical"], places["camera_optical"], poses):
        T_S_C = np.linalg.inv(T_R_S) @ T_R_C
        guess = silhouette(hull, T_S_C @ T_C_O, camera, mask.shape)
        ious.append(overlap(mask > 0, guess))
        shifts.append(centre_of(guess) - centre_of(mask))
        views_O = [np.linalg.inv(T)[:3, 2] for T in (T_C_O, T_S_C @ T_C_O)]
        angles_deg.append(np.degrees(np.arccos(views_O[0] @ views_O[1])))
    shift = np.mean(shifts, axis=0)
    check(set(np.unique(mask)) == {0, 255}, "the side camera sees the whole object")
    check(min(ious) > 0.92, "its mask against the hull: IoU %.3f at least" % min(ious))
    check(np.abs(shift).max() < SHIFT_PX, "mean displacement %+.2f, %+.2f px" % tuple(shift))
    check(60 < min(angles_deg) and max(angles_deg) < 105, "it looks from %.0f..%.0f deg aside"
          % (min(angles_deg), max(angles_deg)))


def check_bags(folder, sequence_folder, model, hull):
    messages = read_bags(*(os.path.join(folder, name) for name in ("toy_kiosk.bag", "toy_kiosk_companions.bag")))
    camera, shape, poses, start = check_messages(messages)
    check_motion(poses, start, model)
    check_silhouettes(sequence_folder, camera, shape, poses, start, hull)
    places = check_companions(messages)
    check_depth(messages, places, poses, hull)
    side_mask = cv2.imread(os.path.join(sequence_folder, "side_mask.png"), cv2.IMREAD_GRAYSCALE)
    check_side_camera(messages, places, poses, hull, side_mask)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", default=os.path.dirname(os.path.abspath(__file__)),
                        help="folder with data/ and the bags (default: this script's)")
    folder = parser.parse_args().data
    model, hull = check_views(os.path.join(folder, "data", "toy_kiosk"))
    check_bags(folder, os.path.join(folder, "data", "toy_kiosk_sequence"), model, hull)
    files = [f for f in glob.glob(os.path.join(folder, "**"), recursive=True) if os.path.isfile(f)]
    check(max(map(os.path.getsize, files)) < MAX_BAG_MIB * MIB, "no file of %d MiB or more" % MAX_BAG_MIB)
    sys.exit("%d checks failed" % failures if failures else 0)


if __name__ == "__main__":
    main()
