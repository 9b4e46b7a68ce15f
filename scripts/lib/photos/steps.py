# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Steps of a long program that are not done twice: what each was made of, and what it found, is kept in a file."""
import hashlib
import json
import os
import time

from photos.common import InputError, read_json, require, say, write_json


class Steps:
    """@param path of the JSON file. A step is done again when its inputs, or those of a step before, have changed, or
    when a file that it made is gone."""

    def __init__(self, path):
        self.path, self.key, self.seconds = path, '', {}
        try:
            self.done = read_json(path) if os.path.exists(path) else {}
        except InputError:
            self.done = {}  # a damaged file costs time, nothing else

    def run(self, name, inputs, outputs, function):
        """What `function` returns (JSON), or returned in an earlier run. @param outputs paths that it makes."""
        text = json.dumps([self.key, name, inputs], sort_keys=True)
        key = self.key = hashlib.sha256(text.encode()).hexdigest()
        entry = self.done.get(name, {})
        if entry.get('key') != key or not all(os.path.exists(output) for output in outputs):
            say(f'{name} ..')
            start = time.monotonic()
            result = json.loads(json.dumps(function()))  # the same, whether from memory or from the file
            require(self.key == key, f'a step within the step {name}')
            entry = {'key': key, 'seconds': round(time.monotonic() - start, 1), 'result': result}
            self.done[name] = entry
            write_json(self.path, self.done)
        self.seconds[name] = entry['seconds']
        return entry['result']


def file_states(paths):
    """Name, size and time of files: what changes when a file does."""
    return [[os.path.abspath(path), os.stat(path).st_size, os.stat(path).st_mtime_ns] for path in paths]
