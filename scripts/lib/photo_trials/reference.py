# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The same photos with exact cameras, poses and masks: what a model could be at best."""
import os

import cv2
import numpy as np

from photos.common import read_json, whole_folder
from photos.dataset import PosedPhoto, undistorted, write_dataset
from photos.quality import RENDERED_SIDE, compared, measure, read_rendering
from photos.tools import find_tool, run_tool

MARGIN_M = 0.008


def write_reference(truth, found, folder):
    """A dataset of the photos that were found, in the board's frame (or the world's)."""
    T_B_W = np.eye(4) if truth.T_W_B is None else np.linalg.inv(truth.T_W_B)
    photos = []
    for photo in found:
        image, pinhole = undistorted(os.path.join(truth.folder, 'photos', photo.file), truth.camera)
        T_C_B = truth.T_C_W[photo.file] @ np.linalg.inv(T_B_W)
        mask = cv2.undistort(truth.mask(photo.file), truth.camera.matrix(), truth.camera.parameters[4:])
        photos.append(PosedPhoto(photo.name, photo.file, image, pinhole, T_C_B[:3, :3], T_C_B[:3, 3],
                                 np.where(mask >= 128, 255, 0).astype(np.uint8)))
    corners = np.array([[truth.box[i][0], truth.box[j][1], truth.box[k][2], 1] for i in (0, 1) for j in (0, 1)
                        for k in (0, 1)]) @ T_B_W.T
    write_dataset(photos, (corners[:, :3].min(axis=0) - MARGIN_M, corners[:, :3].max(axis=0) + MARGIN_M), 1.0, folder)


def reference_quality(truth, found, folder, training):
    """@param training (folder of the tools, options of train). @return rows of photos.quality"""
    os.makedirs(folder, exist_ok=True)
    tools, options = training
    dataset, model, renderings = (os.path.join(folder, name) for name in ('dataset', 'model.safetensors', 'renderings'))
    if not os.path.exists(model):
        write_reference(truth, found, dataset)
        run_tool(find_tool('train', tools), [dataset, '-o', model, *options])
    with whole_folder(renderings) as new:
        for part in ('train', 'test'):
            run_tool(find_tool('render', tools), [model, '--transforms', os.path.join(dataset, f'transforms_{part}.json'),
                                                  '-o', new, '--max-size', RENDERED_SIDE])
    return measure(dataset, renderings)


def quality_with_true_masks(output, photos, masks):
    """Renderings of photos_to_object beside its photos, on the pixels where the object truly is.
    @param photos held-out ones; masks theirs, as found. @return rows as of photos.quality"""
    rows = []
    for photo, mask in zip(photos, masks):
        rendering = read_rendering(os.path.join(output, 'renderings'), photo.name)
        size = rendering.shape[1], rendering.shape[0]
        image = cv2.imread(os.path.join(output, 'dataset', 'images', photo.name + '.jpg'))
        image, mask = (cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (image, mask))
        rows.append(compared(rendering, image, mask))
    return rows


def figures_of_masks(output, photos, masks):
    """Medians and the worst of: intersection over union of found and true masks, and the share of the object that is found.
    @param masks the true ones"""
    overlaps, shares = [], []
    for photo, mask in zip(photos, masks):
        found = cv2.imread(os.path.join(output, 'dataset', 'masks', photo.name + '.png'), cv2.IMREAD_GRAYSCALE) >= 128
        both = np.count_nonzero(found & (mask >= 128))
        overlaps.append(both / max(1, np.count_nonzero(found | (mask >= 128))))
        shares.append(both / max(1, np.count_nonzero(mask >= 128)))
    return {'mask_iou': round(float(np.median(overlaps)), 4), 'mask_iou_worst': round(min(overlaps), 4),
            'mask_share': round(float(np.median(shares)), 4), 'mask_share_worst': round(min(shares), 4)}


def report_of(output):
    return read_json(os.path.join(output, 'report.json'))
