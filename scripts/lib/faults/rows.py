# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The list of faults. A row is a function that provokes one fault and checks what must happen."""
import importlib
from collections import namedtuple

# In the order of the table. Each is a module of this package.
GROUPS = ('images', 'calibration', 'initial_poses', 'transforms', 'clock', 'models', 'registrations', 'processes',
          'services', 'parameters', 'gpu')

# `setup`: name in graph.SETUPS, of the node's parameters. `fast`: part of the subset for the tests.
# `restarts`: the row ends the node. `last`: nothing runs in this graph after it.
Row = namedtuple('Row', 'name group fault statement provoke setup fast restarts last gpu')

_rows = []


def row(fault, statement, setup='world', **flags):
    """Decorator of a row's function, which takes a World and raises where the statement does not hold.

    @param fault what happens, for the table. @param statement what must happen then."""
    def add(provoke):
        group = provoke.__module__.rsplit('.', 1)[-1]
        known = dict.fromkeys(('fast', 'restarts', 'last', 'gpu'), False)
        _rows.append(Row(provoke.__name__, group, fault, statement, provoke, setup, **{**known, **flags}))
        return provoke
    return add


def all_rows():
    """All rows, ordered by their groups."""
    for group in GROUPS:
        importlib.import_module('faults.' + group)
    return sorted(_rows, key=lambda r: GROUPS.index(r.group))


def table():
    """The rows as Markdown, a table a group."""
    lines = []
    for group in GROUPS:
        lines += ['## ' + group.replace('_', ' ').capitalize(), '',
                  '| row | fault | what must happen |', '| --- | --- | --- |']
        for r in all_rows():
            if r.group == group:
                marks = ' (fast)' * r.fast + ' (GPU)' * r.gpu
                lines.append('| `%s`%s | %s | %s |' % (r.name, marks, r.fault, r.statement))
        lines.append('')
    return '\n'.join(lines)
