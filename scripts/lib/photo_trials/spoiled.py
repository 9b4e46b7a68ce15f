# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Reconstructions with faults that were put into them on purpose, and whether they are found and named."""
import dataclasses
import os

import numpy as np

from photos import colmap, pose_checks
from photos.geometry import angle_deg, exp_so3

FOCAL_SPREAD = 0.15    # standard deviation of wrong focal lengths
WRONG_SHARE = 0.1      # of the photos
WRONG_DEG = (4, 25)    # by how much wrong poses are turned around what they look at


def model_of(output):
    """The reconstruction that photos_to_object came to."""
    folder = os.path.join(output, 'colmap')
    parts = sorted(name for name in os.listdir(folder) if name.startswith('parts'))
    return colmap.largest_part(os.path.join(folder, parts[-1]))[0]


def faults(model):
    return list(pose_checks.sentences(pose_checks.check(model), model.names))


def with_focal_lengths(model, seed):
    """Each photo with a focal length of its own, from a place that makes up for it, as published models have it.
    @return (model, names of spoiled photos: none, for it is no single photo's fault)"""
    random = np.random.default_rng(seed)
    cameras, t = [], model.t.copy()
    depth = float(np.median(np.linalg.norm(model.centres() - np.median(model.xyz, axis=0), axis=1)))
    for i, camera in enumerate(model.camera_of):
        factor = float(np.exp(random.normal(0, FOCAL_SPREAD)))
        parameters = model.cameras[camera].parameters.copy()
        parameters[:2] *= factor
        cameras.append(dataclasses.replace(model.cameras[camera], parameters=parameters))
        t[i, 2] += (factor - 1) * depth
    return dataclasses.replace(model, cameras=cameras, camera_of=np.arange(len(t)), t=t), None


def with_wrong_poses(model, seed):
    """Some photos stand elsewhere, and look at the same. @return (model, indices of the spoiled photos)"""
    random = np.random.default_rng(seed)
    count = max(1, round(WRONG_SHARE * len(model.names)))
    spoiled = sorted(random.choice(len(model.names), count, replace=False).tolist())
    R, t = model.R.copy(), model.t.copy()
    middle = np.median(model.xyz, axis=0)
    for i in spoiled:
        axis = random.normal(size=3)
        turn = exp_so3(np.radians(random.uniform(*WRONG_DEG)) * axis / np.linalg.norm(axis))
        R[i], t[i] = R[i] @ turn, t[i] + R[i] @ (middle - turn @ middle)
    return dataclasses.replace(model, R=R, t=t), spoiled


def turn_deg(model, original, name):
    """Between a photo's orientations in two models of one world."""
    return float(angle_deg(model.R[model.names.index(name)].T @ original.R[original.names.index(name)]))


def judged(model, original, expected):
    """What the checks say of a model, and of what is solved again how far it is from before. @param original the model
    without faults; expected indices of photos, or None: the fault is the focal lengths'"""
    findings = pose_checks.check(model)
    named = sorted(findings.wrong)
    if expected is None:
        return {'found': findings.focal_spread > pose_checks.MAX_FOCAL_SPREAD, 'falsely named': [],
                'said': next(pose_checks.sentences(findings, model.names), '')}
    repaired, solved, left_out = pose_checks.repaired(model, findings.wrong)
    left = [turn_deg(repaired, original, model.names[photo]) for photo in solved]
    return {'found': set(expected) <= set(named), 'falsely named': sorted(set(named) - set(expected)),
            'spoiled': len(expected), 'solved again': len(solved), 'left out': len(left_out),
            'worst of solved again [deg]': round(max(left, default=0), 3)}
