# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Measurements with bars, for scripts/check_bars: commands, what their output means, and bounds of the figures."""
import csv
import re
import subprocess
from collections import namedtuple

import numpy as np

# A bound of one figure of a measurement. A figure that equals `low` or `high` keeps it; None: no bound.
Bar = namedtuple('Bar', 'figure low high')

# `read` makes a dictionary of figures from what the command printed.
Measurement = namedtuple('Measurement', 'name command read bars')

# What bench/recorded_tracking prints of a recording.
TRACKING_LINE = re.compile(
    r'right (?P<right>\S+) of \d+, lost \d+; trusted (?P<trusted>\S+), wrong ones (?P<wrong>\d+); '
    r'median (?P<degrees>\S+) deg (?P<percent>\S+) %; error\^2/6 (?P<squared_error>\S+); '
    r'wall median (?P<median_ms>\S+) p95 (?P<p95_ms>\S+) '
    r'p99 (?P<p99_ms>\S+) ms')


def read_tracking(text):
    """@return share of right frames, median errors, times. @raise ValueError where there is no such line."""
    lines = TRACKING_LINE.findall(text)
    if not lines:
        raise ValueError('the output has no figures')
    return dict(zip(TRACKING_LINE.groupindex, map(float, lines[-1])))


def read_demo(path, frames):
    """Of the demo's poses.csv. Frames before the first good one do not count. @param frames in the bag."""
    with open(path, newline='', encoding='utf-8') as file:
        rows = [{key: float(value) for key, value in row.items() if key in ('frame', 'deg', 'diameters')}
                for row in csv.DictReader(file)]
    good = [row for row in rows if row['deg'] <= 2 and row['diameters'] <= 0.02]
    if not good:
        raise ValueError('no frame is within 2 degrees and 2 %')
    wanted = frames - good[0]['frame']
    return {'right': len(good) / wanted, 'degrees': float(np.median([row['deg'] for row in good])),
            'percent': 100 * float(np.median([row['diameters'] for row in good]))}


def measure(measurement, timeout_s):
    """Runs the command. @return its figures, and why there are none (or None)."""
    try:
        done = subprocess.run(measurement.command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              universal_newlines=True, timeout=timeout_s, check=False)
        if done.returncode != 0:
            last = (done.stderr.strip() or done.stdout.strip() or 'no message').splitlines()[-1]
            return {}, 'exit code %d: %s' % (done.returncode, last)
        return measurement.read(done.stdout), None
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        return {}, str(error)


def keeps(bar, value):
    return (bar.low is None or value >= bar.low) and (bar.high is None or value <= bar.high)


def bounds(bar):
    """In words: '>= 0.97', '0.7 to 1.4'."""
    if bar.low is None:
        return '<= %g' % bar.high
    return '>= %g' % bar.low if bar.high is None else '%g to %g' % (bar.low, bar.high)


def report(measurement, figures, problem):
    """@return lines of a table, and how many bars were missed: all of them where there are no figures."""
    lines, missed = [], 0
    for bar in measurement.bars:
        value = figures.get(bar.figure)
        kept = value is not None and keeps(bar, value)
        missed += not kept
        lines.append('%-44s %-14s %10s   %-10s %s' % (
            measurement.name, bar.figure, '-' if value is None else '%.3f' % value, bounds(bar),
            '' if kept else 'MISSED' if problem is None else 'MISSED: %s' % problem))
    return lines, missed
