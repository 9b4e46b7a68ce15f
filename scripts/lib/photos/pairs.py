# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Which photos may show the same: the coarse features of all pairs are compared, so that COLMAP matches all features of
likely pairs alone. (All pairs of 100 photos take it an hour on two cores.)"""
import numpy as np

from photos.colmap_database import read_features

COARSE = 500        # features of a photo, its largest
RATIO = 0.85        # to the second best match (Lowe 2004)
PARTNERS = 16       # of a photo
MIN_SCORE = 4       # common coarse features


def coarse(keypoints, descriptors):
    """Unit descriptors of the largest features, [n][128]."""
    size = np.abs(keypoints[:, 2] * keypoints[:, 5] - keypoints[:, 3] * keypoints[:, 4])
    chosen = descriptors[np.argsort(-size, kind='stable')[:COARSE]].astype(np.float32)
    return chosen / np.maximum(1e-9, np.linalg.norm(chosen, axis=1, keepdims=True))


def score(a, b):
    """How many features of two photos are each other's best and much better than the second best."""
    if min(len(a), len(b)) < 2:
        return 0
    cosine = a @ b.T
    best = np.argmax(cosine, axis=1)
    mutual = np.argmax(cosine, axis=0)[best] == np.arange(len(a))
    two = np.partition(cosine, -2, axis=1)[:, -2:]
    distance = np.sqrt(np.maximum(0, 2 - 2 * two))
    return int(np.count_nonzero(mutual & (distance[:, 1] < RATIO * distance[:, 0])))


def scores(features):
    """[photos][photos] of scores, symmetric. @param features [(keypoints, descriptors)]."""
    reduced = [coarse(*found) for found in features]
    table = np.zeros((len(reduced), len(reduced)), int)
    for i, a in enumerate(reduced):
        for j in range(i):
            table[i, j] = table[j, i] = score(a, reduced[j])
    return table


def likely_pairs(table):
    """Pairs (i, j), i < j: each photo with its best partners. @param table of scores."""
    pairs = set()
    for i, row in enumerate(table):
        for j in np.argsort(-row, kind='stable')[:PARTNERS]:
            if i != j and row[j] >= MIN_SCORE:
                pairs.add((min(i, int(j)), max(i, int(j))))
    return sorted(pairs)


def pairs_of_database(database):
    """Names of photos that may show the same: [(name, name)]."""
    names, features = read_features(database)
    return [(names[i], names[j]) for i, j in likely_pairs(scores(features))]
