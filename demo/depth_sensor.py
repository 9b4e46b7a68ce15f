# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What a stereo camera measures of a scene whose exact depth is known.

Its errors are made in the disparity: windows of pixels are matched, so that neighbours share their noise and edges of
near things grow; disparities come in steps; the second camera, which stands to the right, does not see what a near
thing hides from it; and some patches match nowhere.
"""
import cv2
import numpy as np

BASELINE_M = 0.05
NOISE_M = 0.002  # deviation of a pixel at NOISE_AT_M
NOISE_AT_M = 0.6
BIAS_PX = 0.02  # of all disparities: what calibration leaves
STEP_PX = 1 / 16  # of disparity
HOLES = 0.1  # fraction of the image, in patches, besides shadows
WINDOW_PX, PATCH_PX = 5, 15
NEAREST_M, FARTHEST_M = 0.2, 3.0


def smooth_noise(shape, window, random):
    """Normal numbers of deviation 1, each the mean over a window."""
    return cv2.blur(random.normal(size=shape), (window, window)) * window


def fattened(truth_m):
    """The nearer surface a pixel wider on either side, as matching windows makes it. 0, nothing, becomes infinite."""
    depth = np.where(truth_m > 0, truth_m, np.inf).astype(float)
    wide = np.pad(depth, ((0, 0), (1, 1)), mode="edge")
    return np.minimum(np.minimum(wide[:, :-2], wide[:, 2:]), depth)


def shadowed(disparity):
    """Which pixels something to the right of them, which is nearer, hides from the second camera."""
    there = np.arange(disparity.shape[1]) - disparity  # columns in the second image
    leftmost = np.minimum.accumulate(there[:, ::-1], axis=1)[:, ::-1]  # of a pixel and all to its right
    hidden = np.zeros(disparity.shape, bool)
    hidden[:, :-1] = there[:, :-1] >= leftmost[:, 1:]
    return hidden


def measured_mm(truth_m, focal_px, seed):
    """A depth image as REP-118 has it: uint16, millimetres, 0 where nothing was measured.

    @param truth_m [height][width] exact distances along the view; 0: nothing there
    """
    random = np.random.RandomState(seed)
    scale = focal_px * BASELINE_M  # disparity times depth [px m]
    true_px = scale / fattened(truth_m)
    patches = smooth_noise(truth_m.shape, PATCH_PX, random)
    noise_px = NOISE_M * scale / NOISE_AT_M**2 * smooth_noise(truth_m.shape, WINDOW_PX, random)
    found_px = STEP_PX * np.round((true_px + BIAS_PX + noise_px) / STEP_PX)
    depth_m = scale / np.maximum(found_px, STEP_PX)
    good = ~shadowed(true_px) & (patches >= np.quantile(patches, HOLES))
    good &= (NEAREST_M <= depth_m) & (depth_m <= FARTHEST_M)
    return np.where(good, np.round(1000 * depth_m), 0).astype(np.uint16)
