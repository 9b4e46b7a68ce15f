# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Writes down what scripts/reproduce runs, run-I-of-N.json beside the trials: the header of their tables.

A folder holds the trials of one plan, with models of one training: one that holds others is refused."""
import argparse
import glob
import json
import os
import subprocess
import sys
import time
import zlib


def commit(top):
    """The checkout's commit, and whether it was changed; None where git knows none."""
    git = ('git', '-C', top)
    try:
        name = subprocess.run(git + ('rev-parse', '--short=12', 'HEAD'), stdout=subprocess.PIPE, check=True,
                              stderr=subprocess.DEVNULL, universal_newlines=True).stdout.strip()
        changed = subprocess.run(git + ('diff', '--quiet', 'HEAD'), stderr=subprocess.DEVNULL, check=False).returncode
    except (OSError, subprocess.CalledProcessError):
        return None
    return name + (' and changes' if changed else '')


def checksum(plan):
    """Of a plan's meaning: its layout does not count."""
    with open(plan, encoding='utf-8') as file:
        return '%08x' % zlib.crc32(json.dumps(json.load(file), sort_keys=True).encode())


def with_earlier(earlier, now):
    """Where a run goes on after a change, both stand in the record: 'a, b'."""
    return earlier if now in (earlier or '').split(', ') else '%s, %s' % (earlier, now) if earlier else now


def has_trials(folder):
    """Whether a table of trials has a line behind its header."""
    for path in glob.glob(os.path.join(folder, 'trials-*.csv')):
        with open(path, encoding='utf-8') as file:
            if sum(1 for _ in file) > 1:
                return True
    return False


def write(folder, shard, run):
    """Writes a record whole or not at all; what an earlier part of the same run wrote is kept in it."""
    name = os.path.join(folder, 'run-%d-of-%d.json' % tuple(shard))
    for path in glob.glob(os.path.join(folder, 'run*.json')):
        with open(path, encoding='utf-8') as file:
            earlier = json.load(file)
        same_plan = earlier.get('experiments_checksum') in (None, run['experiments_checksum'])
        if not same_plan and has_trials(folder):
            raise ValueError('%s holds trials of another plan (even one more start makes it another): choose another '
                             'folder; models and scenes may be copied there' % folder)
        if earlier.get('training') not in (None, run['training']):
            raise ValueError("the models in %s were learned with '%s', not with '%s': choose another folder" % (
                folder, earlier['training'], run['training']))
        if path == name and same_plan:
            for key in ('command', 'commit', 'date'):
                run[key] = with_earlier(earlier.get(key), run[key])
    with open(name + '.new', 'w', encoding='utf-8') as file:
        json.dump(run, file, indent=1)
        file.write('\n')
    os.rename(name + '.new', name)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder')
    parser.add_argument('--shard', nargs=2, type=int, required=True)
    parser.add_argument('--plan', required=True)
    parser.add_argument('--command', required=True)
    parser.add_argument('--training', required=True, help='how models are learned')
    parser.add_argument('--top', required=True, help='checkout that is run')
    parser.add_argument('--finished', action='store_true')
    args = parser.parse_args()
    try:
        write(args.folder, args.shard, {
            'command': args.command, 'commit': commit(args.top) or 'unknown',
            'training': args.training, 'date': time.strftime('%Y-%m-%d', time.gmtime()),
            'experiments_checksum': checksum(args.plan),
            'finished': args.finished})
    except (OSError, ValueError) as error:
        sys.exit('reproduce: %s' % error)


if __name__ == '__main__':
    main()
