# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Another box for what photos_to_object made: the frame that its --box means, and how it is to be called again.

The frame is the board's where there was one; the dataset has the same. Otherwise it is that of COLMAP's poses, which is
not the dataset's, whose z = 0 is the table and whose unit was chosen; its axes are not aligned with the table.
"""
import dataclasses
import os
import re
import shlex

import numpy as np

from photos import box_choice
from photos.box_choice import Cameras, choice_of
from photos.colmap import largest_part
from photos.common import InputError, read_json, require
from photos.job import OPTIONS_FILE, read_options, words_of

ALIGNED = 1e-6  # of the cameras' distances: two sets of poses that differ less are one, in two frames
AGAIN = 'run photos_to_object again: what is done already takes no time'


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


def choice_of_output(folder):
    options = read_options(folder)
    dataset = os.path.join(folder, 'dataset')
    contents = box_choice.transforms_in(dataset) if os.path.isdir(dataset) else {}
    shown = choice_of_dataset_made(folder, contents, options) if contents else None
    choice = shown or choice_without_dataset(folder, options)
    choice.made_with = options
    return choice


def choice_of_dataset_made(folder, contents, options):
    """A Choice, None where the dataset is of other poses than the folder has now."""
    made_with = object_step(folder)
    require(all(made_with.get(name) == getattr(options, name) for name in ('poses', 'board')),
            f"the dataset in '{folder}' was made with another --poses or --board than the last call gave: {AGAIN}")
    dataset = os.path.join(folder, 'dataset')
    cameras, present = box_choice.cameras_in(dataset, contents), box_choice.present_box(dataset, contents)
    if options.poses == 'board':
        points = box_choice.points_of_photos(dataset, contents, cameras)
        return choice_of(folder, cameras, points, present, np.array([0, 0, 1.0]))
    found, move = reconstruction_of(folder, contents, cameras)
    if not found:
        return None
    points = found.reliable_points()
    if options.board:
        return choice_of(folder, cameras, move.points(points), present, np.array([0, 0, 1.0]))
    back = move.inverse()
    up = None if made_with.get('box') else move.R[2]  # a given box has no table
    return choice_of(folder, back.cameras(cameras), points, back.points(present), up)


def object_step(folder):
    """The options with which the dataset was made."""
    path = os.path.join(folder, 'steps.json')
    try:
        return dict(read_json(path)['object']['result']['made_with'])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"'{path}' does not say how the dataset was made: {AGAIN}") from error


def choice_without_dataset(folder, options):
    """Where no box was found, or with other poses, there are poses all the same."""
    require(not options.board, f"'{folder}' has no dataset of its poses yet: give photos_to_object a --box in the frame of "
            'the board, whose middle is the origin [m]')
    found = next(reconstructions(folder), None)
    require(found, f"'{folder}' has no poses yet: run photos_to_object")
    return choice_of(folder, Cameras(found.R, found.centres()), found.reliable_points(), np.zeros((0, 3)))


def command(choice, box):
    """The words with which photos_to_object goes on."""
    options = dataclasses.replace(choice.made_with, box=[float(x) for corner in box for x in corner])
    return ['rosrun', 'nerf_pose_refiner', 'photos_to_object', *words_of(options)]


# Both kinds of folders

def is_output(folder):
    return any(os.path.isfile(os.path.join(folder, name)) for name in (OPTIONS_FILE, 'steps.json'))


def open_choice(folder):
    """@throws InputError naming what is missing."""
    folder = os.path.abspath(folder)
    above = os.path.dirname(folder)
    if os.path.basename(folder) == 'dataset' and is_output(above):
        folder = above  # its masks depend on the box, too
    if is_output(folder):
        return choice_of_output(folder)
    return box_choice.choice_of_dataset(folder)


def use_box(choice, first, second):
    """Ends the choice with two opposite corners. @return the message for the user. @throws InputError if it is refused."""
    box = box_choice.sorted_box(first, second)
    why = box_choice.refusal(box, choice.size)
    require(not why, why)
    if choice.made_with is None:
        return 'the box was written to ' + ' and '.join(box_choice.write_box(choice.folder, box))
    return f'Go on with\n\n    {shlex.join(command(choice, box))}\n'
