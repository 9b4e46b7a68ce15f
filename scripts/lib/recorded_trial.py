# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs a tracker of others over a recording of recordings/ and counts how often it is right.

The tracker is a program that reads lines and answers each with one line:

    reset R00 R01 R02 tx R10 ... tz    ->  ok                       the pose at the last image, 3 x 4, row by row [m]
    track IMAGE                        ->  pose R00 ... tz SECONDS  what it found, and the time that it took
"""
import json
import os
import subprocess

import numpy as np

MAX_DEG, MAX_DIAMETERS = 5.0, 0.05


class Recording:
    """What sequence.json says."""

    def __init__(self, folder):
        self.folder = folder
        with open(os.path.join(folder, 'sequence.json'), encoding='utf-8') as file:
            self.about = json.load(file)
        self.frames = self.about['frames']
        self.centre_O = np.array(self.about['centre_O'])
        self.truth = [np.array(frame['T_C_O']) for frame in self.frames]

    def image(self, i):
        return os.path.join(self.folder, self.frames[i]['file'])

    def errors(self, i, T_C_O):
        """Angle [degrees], and the offset of the object's centre [diameters]. Where the label that breaks a symmetry is
        out of sight, turns about the object's z are free."""
        R, R_true = T_C_O[:3, :3], self.truth[i][:3, :3]
        offset = T_C_O[:3] - self.truth[i][:3]
        diameters = np.linalg.norm(offset @ np.append(self.centre_O, 1)) / self.about['diameter']
        if self.frames[i].get('label_visible', True):
            sine, cosine = np.linalg.norm(R - R_true) / np.sqrt(8), (np.sum(R * R_true) - 1) / 2
            angle = 2 * np.arcsin(min(1, sine)) if cosine > 0 else np.arccos(np.clip(cosine, -1, 1))
        else:
            axis, true_axis = R[:, 2], R_true[:, 2]
            angle = np.arctan2(np.linalg.norm(np.cross(axis, true_axis)), axis @ true_axis)
        return float(np.degrees(angle)), float(diameters)


class Tracker:
    """A program that answers as described above; leaving the context ends it."""

    def __init__(self, command):
        self.program = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, universal_newlines=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.program.stdin.close()
        self.program.stdout.close()
        self.program.wait()

    def _ask(self, line, answer):
        """@return the words that follow `answer`."""
        self.program.stdin.write(line + '\n')
        self.program.stdin.flush()
        words = self.program.stdout.readline().split()
        if not words or words[0] != answer:
            raise RuntimeError('the tracker answered %r to %r' % (' '.join(words), line[:60]))
        return words[1:]

    def reset(self, T_C_O):
        self._ask('reset ' + ' '.join('%.9g' % v for v in T_C_O[:3].ravel()), 'ok')

    def track(self, image):
        """@return T_C_O, seconds"""
        *pose, seconds = (float(word) for word in self._ask('track ' + image, 'pose'))
        return np.vstack([np.reshape(pose, (3, 4)), [0, 0, 0, 1]]), seconds


def run(recording, tracker, every=1, resets=True):
    """Tracks every so many-th frame, from the truth of the first one. After a wrong pose it starts from the truth
    again, if there are resets. @return one row a tracked frame: index, degrees, diameters, right, seconds"""
    rows = []
    # The first image makes the tracker's pictures of the object, as a first pose does.
    tracker.reset(recording.truth[0])
    tracker.track(recording.image(0))
    tracker.reset(recording.truth[0])
    for i in range(every, len(recording.frames), every):
        T_C_O, seconds = tracker.track(recording.image(i))
        degrees, diameters = recording.errors(i, T_C_O)
        right = degrees <= MAX_DEG and diameters <= MAX_DIAMETERS
        rows.append({'index': i, 'degrees': degrees, 'diameters': diameters, 'right': right, 'seconds': seconds})
        if resets and not right:
            tracker.reset(recording.truth[i])
    return rows


def summary(rows):
    """Share of right poses; medians of the right ones' errors; median and 95th percentile of the time."""
    right = [row for row in rows if row['right']] or [{'degrees': np.nan, 'diameters': np.nan}]
    seconds = [row['seconds'] for row in rows]
    return {'frames': len(rows), 'right': float(np.mean([row['right'] for row in rows])),
            'degrees': float(np.median([row['degrees'] for row in right])),
            'diameters': float(np.median([row['diameters'] for row in right])),
            'median_ms': 1e3 * float(np.median(seconds)), 'p95_ms': 1e3 * float(np.percentile(seconds, 95))}
