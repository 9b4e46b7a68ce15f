# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Another box for what photos_to_object made: the frame that its --box means, and how it is to be called again.

The frame is the board's where there was one; the dataset has the same. Otherwise it is that of COLMAP's poses, which is
not the dataset's, whose z = 0 is the table and whose unit was chosen; its axes lie anyhow to the table.

steps.json keeps what the steps found, and a hash of their options, not the options. Those that can be told are told;
for the others a person is asked. The poses stay only if the options of their steps do.
"""
import dataclasses
import hashlib
import json
import os
import re
import shlex

import numpy as np

from photos import box_choice
from photos.board import DEFAULT as DEFAULT_BOARD
from photos.box_choice import Cameras, choice_of
from photos.colmap import largest_part
from photos.common import InputError, read_json, require
from photos.job import find_sources
from photos.steps import file_states

RELIABLE_VIEWS = 3      # that see a point
ALIGNED = 1e-6          # of the cameras' distances: so near are the cameras of one reconstruction in two frames
DEFAULT_SIDE = 1280     # of --max-side
ENDING = '_object'      # of the folder, by default
ON_BOARD = 'scale and frame are those of the board'  # so object_region.py begins to say it
IN_BOX = 'the box was given'                         # and so it says that no table was looked for
DIGITS = 6


@dataclasses.dataclass
class Similarity:
    """A point x of one world is scale * R x + t in another."""
    scale: float
    R: np.ndarray
    t: np.ndarray

    def points(self, x):
        return self.scale * x @ self.R.T + self.t

    def cameras(self, cameras):
        return Cameras(cameras.R @ self.R.T, self.points(cameras.centre))

    def inverse(self):
        return Similarity(1 / self.scale, self.R.T, -self.R.T @ self.t / self.scale)


@dataclasses.dataclass
class Made:
    """How photos_to_object is to be called again."""
    source: str = 'SOURCE'
    words: list = dataclasses.field(default_factory=list)     # options that are known
    unknown: list = dataclasses.field(default_factory=list)   # sentences on those that are not


def aligned(source, target):
    """The Similarity from the world of some cameras to that of the same ones, None where they are others. Single poses
    may differ, for wrong ones are solved again after COLMAP: so medians, and no mean."""
    turns = np.einsum('nji,njk->nik', target.R, source.R)
    cosines = np.einsum('nij,mij->nm', turns, turns)
    middle = int(np.argmax(np.median(cosines, axis=1)))
    R = turns[middle]
    a, b = ((cameras.centre - cameras.centre[middle]) for cameras in (source, target))
    lengths = np.linalg.norm(a, axis=1)
    apart = lengths > 1e-9
    if np.count_nonzero(apart) < 2:
        return None
    scale = float(np.median(np.linalg.norm(b, axis=1)[apart] / lengths[apart]))
    t = np.median(target.centre - scale * source.centre @ R.T, axis=0)
    found = Similarity(scale, R, t)
    offset = np.median(np.linalg.norm(found.points(source.centre) - target.centre, axis=1))
    return found if scale > 0 and offset < ALIGNED * scale * np.median(lengths[apart]) else None


def reconstructions(folder):
    """COLMAP's, the last one first: a folded model was solved again in parts_2, parts_3."""
    top = os.path.join(folder, 'colmap')
    names = [name for name in (os.listdir(top) if os.path.isdir(top) else ()) if re.fullmatch(r'parts(_\d+)?', name)]
    for name in sorted(names, reverse=True):
        yield largest_part(os.path.join(top, name))[0]


def reconstruction_of(folder, contents, cameras):
    """(reconstruction from which a dataset was made, Similarity to the dataset's frame); (None, None): of none."""
    names = [os.path.splitext(os.path.basename(str(frame.get('file_path'))))[0]
             for content in contents.values() for frame in content['frames']]
    for found in reconstructions(folder):
        numbers = {os.path.splitext(name)[0].replace(os.sep, '_'): i for i, name in enumerate(found.names)}
        if not set(names) <= set(numbers):
            continue
        chosen = [numbers[name] for name in names]
        move = aligned(Cameras(found.R[chosen], found.centres()[chosen]), cameras)
        if move:
            return found, move
    return None, None


def reliable_points(reconstruction):
    views = reconstruction.photos_of_points()
    return reconstruction.xyz[views >= min(RELIABLE_VIEWS, views.max(initial=0))]


def choice_of_output(folder):
    done = read_json(os.path.join(folder, 'steps.json'))
    try:
        require(done['photos']['result'][0], 'no photo')
        facts = done['object']['result'] if 'object' in done else {}
        board, metric = str(facts.get('frame', '')).startswith(ON_BOARD), facts.get('metres_per_unit', 0) > 0
    except (KeyError, TypeError, IndexError, AttributeError, InputError) as error:
        raise InputError(f"'{folder}/steps.json' is damaged ({error}): run photos_to_object again") from error
    dataset = os.path.join(folder, 'dataset')
    contents = box_choice.transforms_in(dataset) if os.path.isdir(dataset) else {}
    if not contents:
        return choice_without_dataset(folder, done)
    cameras, present = box_choice.cameras_in(dataset, contents), box_choice.present_box(dataset, contents)
    found, move = reconstruction_of(folder, contents, cameras)
    require(found or 'board' in done, f"the dataset in '{folder}' was not made from the poses in colmap: run "
            'photos_to_object again')
    words, up = [], np.array([0, 0, 1.0])
    if not found:  # of --poses board
        points, words = box_choice.points_of_photos(dataset, contents, cameras), ['--poses', 'board']
    elif board:
        points = move.points(reliable_points(found))
    else:
        points, back = reliable_points(found), move.inverse()
        cameras, present = back.cameras(cameras), back.points(present)
        up = None if facts.get('frame') == IN_BOX else move.R[2]
    if board or not found:
        words += ['--board', known_board(done)]
    elif metric:
        words += ['--metres-per-unit', f'{move.scale:.9g}']
    choice = choice_of(folder, cameras, points, present, up)
    choice.made = made_with(folder, done, words)
    return choice


def choice_without_dataset(folder, done):
    """Where no box was found, there may be poses all the same."""
    require('board' not in done, f"'{folder}' has no dataset yet: give photos_to_object a --box in the frame of the "
            'board, whose middle is the origin [m]')
    found = next(reconstructions(folder), None)
    require(found, f"'{folder}' has neither poses nor a dataset yet: run photos_to_object")
    choice = choice_of(folder, Cameras(found.R, found.centres()), reliable_points(found), np.zeros((0, 3)))
    choice.made = made_with(folder, done, [])
    choice.made.unknown.append('Repeat --board, --metres-per-unit and --length, if they were given.')
    return choice


# How it was made

def key_of(previous, name, inputs):
    """As Steps.run makes it."""
    return hashlib.sha256(json.dumps([previous, name, inputs], sort_keys=True).encode()).hexdigest()


def known_board(done):
    """The board of make_board, if it was that one."""
    keys = [entry.get('key') for entry in done.values()]
    found = done.get('board', {}).get('key')
    return DEFAULT_BOARD if any(key_of(key, 'board', [DEFAULT_BOARD]) == found for key in keys) else 'BOARD'


def near(folder):
    """Paths where the photos of a folder may be: beside it, or, of --many, in the folder beside the one above it."""
    parents = [os.path.dirname(os.path.abspath(folder))]
    if parents[0].endswith(ENDING):
        parents.append(parents[0][:-len(ENDING)])
    for parent in parents:
        for name in sorted(os.listdir(parent)) if os.path.isdir(parent) else ():
            yield os.path.join(parent, name)


def source_of(folder, done):
    """(SOURCE, --max-side) if its photos are found and are what they were; None otherwise."""
    copies, cameras = done['photos']['result']
    first = copies[0]['source'].split(', frame ')[0]  # of a video
    sides = {DEFAULT_SIDE} | {max(camera['width'], camera['height']) for camera in cameras}
    for path in near(folder):
        if os.path.basename(path) != first and not any(
                os.path.isfile(os.path.join(path, *inside, first)) for inside in ((), ('images',))):
            continue
        try:
            states = file_states(find_sources(path))
        except (InputError, OSError):
            continue
        for side in sides:
            if key_of('', 'photos', [states, side]) == done['photos']['key']:
                return path, side
    return None


def made_with(folder, done, words):
    """@param words options that are known already."""
    made = Made(words=list(words))
    found = source_of(folder, done)
    if found:
        made.source, side = found
        if side != DEFAULT_SIDE:
            made.words += ['--max-side', str(side)]
    else:
        made.unknown.append('SOURCE: the photos or the video, as they were given before; repeat --max-side, if it was '
                            'given. Otherwise the poses are found anew, and the box does not suit them.')
    if 'BOARD' in words:
        made.unknown.append('BOARD: the board, as it was given before. With another one the box is in another frame.')
    report = os.path.join(folder, 'report.json')
    name = read_json(report).get('name') if os.path.exists(report) else None
    if name and name != os.path.splitext(os.path.basename(made.source))[0]:
        made.words += ['--name', name]
    made.unknown.append('Repeat --masks, --profile, --max-seconds, --steps, --backend, --tools and --no-training, if '
                        'they were given.')
    return made


def number(value):
    """As argparse takes it also where it is negative: without an exponent."""
    return np.format_float_positional(value, precision=DIGITS, fractional=False, trim='-')


def command(choice, box):
    """The words with which photos_to_object goes on."""
    return ['rosrun', 'nerf_pose_refiner', 'photos_to_object', choice.made.source, '-o', choice.folder, '--box',
            *(number(x) for corner in box for x in corner), *choice.made.words]


# Both kinds of folders

def open_choice(folder):
    """@throws InputError naming what is missing."""
    folder = os.path.abspath(folder)
    require(os.path.isdir(folder), f"there is no folder '{folder}'")
    above = os.path.dirname(folder)
    if os.path.basename(folder) == 'dataset' and os.path.isfile(os.path.join(above, 'steps.json')):
        folder = above  # its masks depend on the box, too
    if os.path.isfile(os.path.join(folder, 'steps.json')):
        return choice_of_output(folder)
    return box_choice.choice_of_dataset(folder)


def use_box(choice, first, second):
    """Ends the choice with two opposite corners. @return what there is to tell. @throws InputError if it is refused."""
    box = box_choice.sorted_box(first, second)
    why = box_choice.refusal(box, choice.size)
    require(not why, why)
    if choice.made is None:
        return 'the box was written to ' + ' and '.join(box_choice.write_box(choice.folder, box))
    text = shlex.join(command(choice, box))
    return '\n'.join(['Go on with', '', '    ' + text, '', *choice.made.unknown])
