# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Reads and merges what the tool evaluate wrote: trials, traces and the records of its runs, in shards or whole."""
import csv
import glob
import json
import math
import os
import re

TRIAL_TEXT = ('experiment', 'scene', 'kind', 'method', 'loss', 'variant', 'condition', 'protocol', 'view', 'start',
              'outcome', 'engine')
TRIAL_NUMBERS = ('start_deg', 'start_units', 'start_diameters', 'seconds', 'samples', 'score')
TRIAL_ERRORS = ('deg', 'units', 'diameters', 'pixels')  # empty without a pose: infinite
TRIAL_COLUMNS = TRIAL_TEXT + TRIAL_NUMBERS + TRIAL_ERRORS
TRIAL_KEY = ('experiment', 'scene', 'method', 'loss', 'variant', 'condition', 'protocol', 'view', 'start')
TRACE_TEXT = ('experiment', 'scene', 'kind', 'method', 'loss', 'variant', 'condition', 'view', 'start', 'stage')
TRACE_NUMBERS = ('seconds', 'samples')
TRACE_ERRORS = ('deg', 'units')
TRACE_COLUMNS = TRACE_TEXT + TRACE_NUMBERS + TRACE_ERRORS
TRACE_KEY = ('experiment', 'scene', 'method', 'loss', 'variant', 'condition', 'view', 'start')
SIGHTING_TEXT = ('experiment', 'scene', 'kind', 'method', 'loss', 'variant', 'condition', 'protocol', 'view', 'start',
                 'instance')  # the last is empty for a pose without an instance
SIGHTING_NUMBERS = ('width', 'visible', 'deg', 'diameters', 'score')
NAN_WHEN_EMPTY = ('score', 'width', 'visible')  # say nothing about the error, so they are not infinite


def natural(text):
    """A sort key by which r_2 stands before r_10."""
    return [(0, int(part), '') if part.isdigit() else (1, 0, part) for part in re.split(r'(\d+)', text) if part]


def complete_lines(path, notes):
    """Lines of a file, without a last one that a stopped run left unfinished."""
    with open(path, newline='', encoding='utf-8') as file:
        lines = file.read().splitlines(keepends=True)
    if lines and not lines[-1].endswith('\n'):
        notes.append('%s: line %d is half written and was left out' % (os.path.basename(path), len(lines)))
        lines.pop()
    return lines


def number(text, column):
    """A cell's number. Raises ValueError for what is none, for NaN and for a negative one."""
    if not text:
        if column in NAN_WHEN_EMPTY:
            return math.nan
        if column in TRIAL_ERRORS:
            return math.inf
        raise ValueError('%s is empty' % column)
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value) or (value < 0 and column not in NAN_WHEN_EMPTY):
        raise ValueError('%s is "%s", not a number from 0 up' % (column, text))
    return value


def read_rows(path, text, numbers, notes):
    """Rows of one CSV file as dicts, numbers converted. Raises ValueError with file, line and what is wrong."""
    name = os.path.basename(path)
    lines = complete_lines(path, notes)
    if not lines:
        return []
    reader = csv.reader(lines)
    header = next(reader)
    missing = [column for column in text + numbers if column not in header]
    if missing:
        raise ValueError('%s: no column %s; there are: %s' % (name, ', '.join(missing), ', '.join(header)))
    rows = []
    for cells in reader:
        if len(cells) != len(header):
            raise ValueError('%s: line %d has %d cells, the header has %d' % (
                name, reader.line_num, len(cells), len(header)))
        row = dict(zip(header, cells))
        try:
            row.update((column, number(row[column], column)) for column in numbers)
        except ValueError as error:
            raise ValueError('%s: line %d: %s' % (name, reader.line_num, error)) from None
        rows.append(row)
    return rows


def key_of(row, key):
    return tuple(row[column] for column in key)


def sort_key(row, key):
    return [natural(row[column]) for column in key]


def files_of(folders, pattern):
    return [path for folder in folders for path in sorted(glob.glob(os.path.join(folder, pattern)),
                                                          key=lambda path: natural(os.path.basename(path)))]


def note_missing_shards(paths, notes):
    """Says so where a run of n shards left fewer than n files."""
    shards = {}
    for path in paths:
        match = re.search(r'-(\d+)-of-(\d+)\.csv$', path)
        if match:
            shards.setdefault(int(match.group(2)), set()).add(int(match.group(1)))
    for count, found in sorted(shards.items()):
        if len(found) < count:
            notes.append('%d of %d shards are there (%s): the tables hold a part of the trials' % (
                len(found), count, ', '.join(map(str, sorted(found)))))


def read_trials(folders, notes):
    """All trials of the folders' shards, sorted by their keys; each once, the first wins.

    notes: a list that gets a sentence for all that was left out. Raises ValueError if there are none.
    """
    paths = files_of(folders, 'trials-*.csv') + files_of(folders, 'trials.csv')
    if not paths:
        raise ValueError('no trials-*.csv in %s: has evaluate run?' % ', '.join(folders))
    note_missing_shards(paths, notes)
    trials, repeated = {}, 0
    for path in paths:
        for row in read_rows(path, TRIAL_TEXT, TRIAL_NUMBERS + TRIAL_ERRORS, notes):
            key = key_of(row, TRIAL_KEY)
            repeated += key in trials
            trials.setdefault(key, row)
    if repeated:
        notes.append('%d trials were there more than once; the first of each counts' % repeated)
    if not trials:
        raise ValueError('no trials in %s: only headers' % ', '.join(map(os.path.basename, paths)))
    return sorted(trials.values(), key=lambda row: sort_key(row, TRIAL_KEY))


def read_traces(folders, notes):
    """Traces of all shards: a list of (first row, [row, ...]) a trial, in the order of their keys."""
    traces = {}
    for path in files_of(folders, 'traces-*.csv') + files_of(folders, 'traces.csv'):
        of_file = {}
        for row in read_rows(path, TRACE_TEXT, TRACE_NUMBERS + TRACE_ERRORS, notes):
            rows = of_file.setdefault(key_of(row, TRACE_KEY), [])
            if rows and row['seconds'] < rows[-1]['seconds']:
                rows = of_file[key_of(row, TRACE_KEY)] = []  # started again after an interruption
            rows.append(row)
        for key, rows in of_file.items():
            traces.setdefault(key, rows)
    return [(rows[0], rows) for rows in sorted(traces.values(), key=lambda rows: sort_key(rows[0], TRACE_KEY))]


def read_sightings(folders, notes):
    """What detection found, of all shards: {key of the trial: [row, ...]}. A trial that was written twice, after an
    interruption, counts once."""
    sightings = {}
    for path in files_of(folders, 'instances-*.csv') + files_of(folders, 'instances.csv'):
        of_file = {}
        for row in read_rows(path, SIGHTING_TEXT, SIGHTING_NUMBERS, notes):
            rows = of_file.setdefault(key_of(row, TRIAL_KEY), [])
            if row['instance'] == '0' and rows:
                rows = of_file[key_of(row, TRIAL_KEY)] = []
            rows.append(row)
        for key, rows in of_file.items():
            sightings.setdefault(key, rows)
    return sightings


def read_runs(folders):
    """The records that runs left (run*.json). Raises ValueError if they ran different experiments."""
    runs = []
    for path in files_of(folders, 'run*.json'):
        with open(path, encoding='utf-8') as file:
            try:
                run = json.load(file)
            except ValueError as error:
                raise ValueError('%s: %s' % (path, error)) from None
        if not isinstance(run, dict):
            raise ValueError('%s: not an object' % path)
        if run not in runs:
            runs.append(run)
    checksums = sorted({str(run['experiments_checksum']) for run in runs if run.get('experiments_checksum')})
    if len(checksums) > 1:
        raise ValueError('these runs are of different experiment files (checksums %s): tabulate them apart' %
                         ', '.join(checksums))
    return runs
