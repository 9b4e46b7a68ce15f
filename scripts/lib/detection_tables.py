# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What detection found in the images of trials: recall over instances, precision over poses, and by what they depend
on: an instance's size in the image and how much of it is visible."""
import math

from trial_statistics import groups, percentile, with_interval
from trial_tables import PARTS, Table, share_cell, sorting
from trials import TRIAL_KEY, key_of

BOUNDS = (('deg', 5), ('diameters', 0.05))  # of a right pose
BINS = {'width': (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.7), 'visible': (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)}


def is_right(sighting):
    return all(sighting[column] < bound for column, bound in BOUNDS)


def is_pose(sighting):
    return math.isfinite(sighting['deg']) or not sighting['instance']


def row_of(trials, sightings):
    """One row of the table. @param trials of the images. @param sightings in them"""
    instances = [one for one in sightings if one['instance']]
    poses = [one for one in sightings if is_pose(one)]
    right = sum(is_right(one) for one in instances)
    row = {'images': len(trials), 'instances': len(instances), 'poses': len(poses), 'wrong': len(poses) - right}
    if instances:
        row.update(with_interval('recall', right / len(instances), len(instances)))
    if poses:
        row.update(with_interval('precision', right / len(poses), len(poses)))
    for name, share in (('median_s', 0.5), ('p95_s', 0.95)):
        row[name] = percentile([trial['seconds'] for trial in trials], share)
    return row


def view_of(rows):
    head = ['scene', 'condition', 'images', 'instances', 'recall', 'poses', 'wrong', 'precision', 'median [s]',
            'p95 [s]']
    body = [[row['scene'], ' '.join(filter(None, (row['condition'], row['variant'])))] +
            [str(row['images']), str(row['instances']), share_cell(row, 'recall'), str(row['poses']),
             str(row['wrong']), share_cell(row, 'precision')] + ['%.2g' % row[name] for name in ('median_s', 'p95_s')]
            for row in rows]
    return ('Instances and poses, right within 5 deg and 0.05 d, each with its 95 % interval:', head, body)


def tables_of(trials, sightings):
    """A table for each experiment, protocol and kind of scene with detections.
    @param sightings {key of the trial: rows}, as read_sightings gives them"""
    tables = []
    detections = sorted((trial for trial in trials if trial['method'] == 'detection'), key=sorting)
    for (experiment, protocol, kind), part in groups(detections, ('experiment', 'protocol', 'kind')).items():
        rows = []
        for (scene, condition, variant), group in groups(part, ('scene', 'condition', 'variant')).items():
            found = [one for trial in group for one in sightings.get(key_of(trial, TRIAL_KEY), ())]
            rows.append(dict(scene=scene, condition=condition, variant=variant, **row_of(group, found)))
        name = '_'.join((experiment, protocol, kind, 'instances'))
        tables.append(Table((experiment, protocol), name, 'What detection found %s' % PARTS.get(kind, kind), rows,
                            [view_of(rows)]))
    return tables


def recall_by(sightings, column):
    """Recall in bins of a column: [(middle, recall, low, high, instances), ...], without empty bins."""
    edges, points = BINS[column], []
    for low, high in zip(edges, edges[1:]):
        inside = [one for one in sightings if one['instance'] and low <= one[column] and
                  (one[column] < high or high == edges[-1] == one[column])]
        if inside:
            row = with_interval('recall', sum(map(is_right, inside)) / len(inside), len(inside))
            points.append(((low + high) / 2, row['recall'], row['recall_low'], row['recall_high'], len(inside)))
    return points
