# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What COLMAP's database knows of each photo: features and verified matches."""
import contextlib
import sqlite3
import urllib.parse

import numpy as np

MAX_IMAGES = 2147483647  # a pair's number is the first image's times this, plus the second's
MIN_MATCHES = 30         # of a pair that says anything


def query(database, command):
    with contextlib.closing(sqlite3.connect(f'file:{urllib.parse.quote(database)}?mode=ro', uri=True)) as connection:
        return connection.execute(command).fetchall()


def feature_counts(database):
    """{photo: number of features}."""
    return {name: rows or 0 for name, rows in
            query(database, 'SELECT name, rows FROM images LEFT JOIN keypoints USING (image_id)')}


def partner_counts(database):
    """{photo: number of photos that it has verified matches with}."""
    names = dict(query(database, 'SELECT image_id, name FROM images'))
    partners = dict.fromkeys(names.values(), 0)
    for pair, in query(database, f'SELECT pair_id FROM two_view_geometries WHERE rows >= {MIN_MATCHES}'):
        for photo in divmod(pair, MAX_IMAGES):
            partners[names[photo]] += 1
    return partners


def read_features(database):
    """(names, [(keypoints [n][6]: x, y and a 2 x 2 matrix of shape, descriptors [n][128])])."""
    rows = query(database, 'SELECT name, keypoints.rows, keypoints.cols, keypoints.data, descriptors.data FROM images '
                 'JOIN keypoints USING (image_id) JOIN descriptors USING (image_id) ORDER BY name')
    features = []
    for _, count, columns, keypoints, descriptors in rows:
        shapes = np.frombuffer(keypoints or b'', np.float32).reshape(count, columns)
        features.append((shapes, np.frombuffer(descriptors or b'', np.uint8).reshape(count, 128)))
    return [row[0] for row in rows], features
