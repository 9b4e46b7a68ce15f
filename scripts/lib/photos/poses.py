# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Cameras and poses of a job's photos, checked: from COLMAP, or from a board alone."""
import os
import shutil

import cv2
import numpy as np

from photos import colmap, colmap_database, missing, pose_checks
from photos.board import Board, corner_points
from photos.board_poses import poses_from_board
from photos.common import InputError, count, require, say
from photos.reconstruction import read_reconstruction
from photos.targets import find_corners, parse_target

MIN_POSED = 8
MAX_FOLDS = 2  # so often a folded model is solved again with its largest group


def find_poses(job):
    """@return (reconstruction, facts): what is missing, wrong, left out, by the users' names of photos."""
    given = faults_of_given_model(job.options.source)
    reconstruction, facts = poses_of_board(job) if job.options.poses == 'board' else poses_of_colmap(job)
    facts['given_model'] = given
    for text in messages(facts, len(job.copies)):
        say('  ' + text)
    require(len(reconstruction.names) >= MIN_POSED,
            f'only {count(len(reconstruction.names), "photo")} of {len(job.copies)} have a pose, at least {MIN_POSED} are '
            'needed: take 40 to 100 that overlap by two thirds, sharp, all around the object')
    facts['posed'], facts['photos'] = len(reconstruction.names), len(job.copies)
    # Rounded: OpenCV's threads add up in any order, and facts are what later steps are made from.
    facts['error_px'] = round(float(np.median(reconstruction.errors())), 4)
    facts['focal_px'] = [round(camera.focal, 3) for camera in reconstruction.cameras]
    return reconstruction, facts


def faults_of_given_model(source):
    """What is wrong with a model of COLMAP that lies beside the photos: sentences. It is not used, for solving the photos
    again with one camera is safer than mending it."""
    folder = os.path.join(source, 'sparse', '0')
    if not os.path.isdir(folder):
        return []
    try:
        model = read_reconstruction(folder)
    except InputError as error:
        return [str(error)]
    return list(pose_checks.sentences(pose_checks.check(model), model.names))


def messages(facts, total):
    """Sentences on what was found."""
    if facts['given_model']:
        yield f"the model in sparse/0 is not used: {'; '.join(facts['given_model'])}. The photos are solved again"
    text = missing.summary(facts['missing'], total)
    if text:
        yield text
    if facts['other_groups']:
        yield (f"{count(len(facts['other_groups']), 'other group')} of photos ({', '.join(map(str, facts['other_groups']))}"
               ' photos) could not be joined to the largest: take photos in between')
    for group in facts['folded']:
        yield (f'the model was folded: {count(len(group), "photo")} ({", ".join(group[:3])} ..) show another side that '
               'looks the same, and were left out. Put something with texture beside the object, and take photos of both '
               'sides and in between')
    for source, why in facts['wrong'].items():
        yield f"{source}: {why}; {'its pose was solved again' if source in facts['solved_again'] else 'it is left out'}"


# COLMAP

def poses_of_colmap(job):
    database, photos = job.path('colmap', 'database.db'), job.path('photos')
    program = colmap.Colmap(job.path('colmap', 'log.txt'), 60 * job.options.max_minutes, job.options.threads)

    def features():
        shutil.rmtree(job.path('colmap'), ignore_errors=True)
        os.makedirs(job.path('colmap'))
        colmap.find_features(program, database, photos, job.cameras)

    def mapping(name, chosen):
        parts = job.path('colmap', name)
        job.steps.run('mapping' if chosen is None else 'mapping again', chosen, [parts],
                      lambda: colmap.map_photos(program, database, parts, (photos, chosen)))
        return colmap.largest_part(parts)

    job.steps.run('features', [], [database], features)
    job.steps.run('matching', [], [database], lambda: colmap.match(program, database, job.is_sequence))
    reconstruction, others = mapping('parts', None)
    facts = {'missing': reasons_of_missing(job, reconstruction, database), 'other_groups': others, 'folded': []}
    findings = pose_checks.check(reconstruction, job.is_sequence)
    for attempt in range(MAX_FOLDS):
        if not findings.groups:
            break
        names = [[reconstruction.names[i] for i in group] for group in findings.groups]
        facts['folded'] += [[job.sources()[name] for name in group] for group in names[1:]]
        reconstruction, _ = mapping(f'parts_{attempt + 2}', names[0])
        findings = pose_checks.check(reconstruction, job.is_sequence)
    require(not findings.groups, 'the object looks the same from several sides, so that the photos cannot be put together: '
            'put something with texture beside it')
    if findings.contradictions:
        sources = [job.sources()[name] for name in reconstruction.names]
        raise InputError(f'the model is folded: {pose_checks.contradiction_of(findings, sources)}. The object looks the same '
                         'from several sides: put something with texture beside it, and take the photos anew')
    return without_wrong(job, reconstruction, findings, facts)


def reasons_of_missing(job, reconstruction, database):
    facts = {'sharpness': float(np.median([copy.sharpness for copy in job.copies])),
             'features': colmap_database.feature_counts(database), 'partners': colmap_database.partner_counts(database)}
    return {copy.source: missing.reason(copy, facts) for copy in job.copies if copy.name not in reconstruction.names}


def without_wrong(job, reconstruction, findings, facts):
    sources = [job.sources()[name] for name in reconstruction.names]
    facts['wrong'] = {sources[i]: why for i, why in findings.wrong.items()}
    facts['solved_again'], facts['left_out'] = [], []
    if findings.wrong:
        reconstruction, solved, left_out = pose_checks.repaired(reconstruction, findings.wrong)
        facts['solved_again'], facts['left_out'] = [sources[i] for i in solved], [sources[i] for i in left_out]
    return reconstruction, facts


# Board

def read_copy(job, name):
    image = cv2.imread(job.path('photos', name), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"cannot read '{job.path('photos', name)}'")
    return image


def board_corners(job):
    """{name of a copy: {number: xy}} for all copies; a step, which is done once and not within another one."""
    if job.corners is not None:
        return job.corners
    target = parse_target(job.options.board)

    def find():
        return {copy.name: [[number, *xy] for number, xy in find_corners(target, read_copy(job, copy.name)).items()]
                for copy in job.copies}

    found = job.steps.run('board', [job.options.board], [], find)
    job.corners = {name: {number: (x, y) for number, x, y in corners} for name, corners in found.items()}
    return job.corners


def poses_of_board(job):
    require(job.options.board, '--poses board needs --board: what make_board printed')
    board = parse_target(job.options.board)
    require(isinstance(board, Board), '--poses board needs a ChArUco board: tags alone do not give exact poses')
    require(len(job.cameras) == 1, f'--poses board needs photos of one camera and size, these are of {len(job.cameras)}')
    corners = board_corners(job)
    names = [copy.name for copy in job.copies]
    found = poses_from_board(names, [corners[name] for name in names], corner_points(board),
                             {**job.cameras[0], 'parameters': None})
    sources = job.sources()
    left_out = {sources[name]: why for name, why in found.left_out.items()}
    return found.reconstruction, {'missing': left_out, 'other_groups': [], 'folded': [], 'wrong': {}, 'solved_again': [],
                                  'left_out': []}
