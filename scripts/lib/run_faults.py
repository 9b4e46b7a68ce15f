#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Provokes faults on a running graph and checks what must happen then. scripts/faults calls it."""
import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback

from faults.rows import all_rows, table

TRAINING_STEPS = 400
TRAINING_S = 300  # at most


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--folder', default='', help='for models and logs')
    parser.add_argument('--demo', default='', help='folder of the demo')
    parser.add_argument('--model', default='', help='of the toy kiosk; default: it is trained')
    parser.add_argument('--train', type=int, default=TRAINING_STEPS, help='steps of training')
    parser.add_argument('--only', default='', help='rows whose name or group matches')
    parser.add_argument('--fast', action='store_true', help='the subset for the tests')
    parser.add_argument('--nodelet', action='store_true')
    parser.add_argument('--repeat', type=int, default=1)
    parser.add_argument('--patience', type=float, default=1)
    parser.add_argument('--speed', type=float, default=1)
    parser.add_argument('--json', default='', help='file for the results')
    parser.add_argument('--table', action='store_true', help='print the list of rows as Markdown, and end')
    parser.add_argument('--child', action='store_true', help=argparse.SUPPRESS)
    return parser.parse_args()


def chosen(args):
    """Rows of full name `group.name`; those after which nothing can run come last."""
    rows = [r for r in all_rows() if re.search(args.only, '%s.%s' % (r.group, r.name)) and (r.fast or not args.fast)]
    order = {setup: i for i, setup in enumerate(dict.fromkeys(r.setup for r in rows))}
    # One setup after the other: a node is started as seldom as possible.
    return sorted(rows, key=lambda r: (r.last, order[r.setup], r.restarts))


def train(world, args):
    """A model of the demo's object, which is kept for the next time."""
    intact = os.path.join(args.folder, 'intact')
    os.makedirs(intact, exist_ok=True)
    model, trained = intact + '/toy_kiosk.safetensors', args.folder + '/trained_steps'
    if args.model:
        shutil.copy(args.model, model)
        return
    if os.path.exists(model) and os.path.exists(trained):
        with open(trained, encoding='utf-8') as file:
            if file.read() == str(args.train):
                return
    # By steps, not seconds: on a busy machine, a time limit leaves too few steps for a usable model.
    world.start('no_object', {'model_root': intact, 'register': {'steps': args.train}})
    reply = world.register(name='toy_kiosk', dataset='toy_kiosk', max_seconds=TRAINING_S, within=2 * TRAINING_S)
    if not reply.success:
        sys.exit('faults: the object was not learned: %s' % reply.message)
    with open(trained, 'w', encoding='utf-8') as file:
        file.write(str(args.train))


def make_world(args, rate):
    """A graph in which the recording is played at a rate. Imports need ROS."""
    import rospy
    from faults.graph import Graph
    from faults.player import Player
    from faults.recording import read_frames
    from faults.watcher import Watcher
    from faults.world import World
    from pose_evaluation import Target
    shutil.rmtree(args.folder + '/datasets', ignore_errors=True)
    shutil.copytree(args.demo + '/data', args.folder + '/datasets')  # rows spoil some of it
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the graph is stopped then, too
    graph = Graph(args.folder, args.nodelet)
    rospy.init_node('faults', disable_signals=True, disable_rosout=True)
    rospy.set_param('/use_sim_time', True)  # of the node: this program keeps the wall's time
    with open(args.demo + '/data/toy_kiosk/object.json', encoding='utf-8') as file:
        description = json.load(file)
    frames = read_frames(args.demo + '/toy_kiosk.bag')
    player = Player(frames, getattr(args, 'speed', 1), rate)
    target = Target(description['bounding_box'], description['diameter'], frames[0].info.K)
    return World(graph, player, Watcher(player, target), getattr(args, 'patience', 3))


def run_row(world, row):
    """@return why it failed, or ''."""
    from faults.world import Missed
    try:
        world.prepare(row)
        row.provoke(world)
        world.conclude(row)
        return ''
    except Missed as missed:
        world.setup = None  # the next row gets a node of its own
        return str(missed)
    except Exception:  # pylint: disable=broad-except
        world.setup = None
        return traceback.format_exc()


def run_rows(rows, args):
    """@return a record a row. Rows that end the graph each need a process of their own: see main."""
    from faults.gpu import gpu_is_there
    from faults.player import AS_RECORDED
    world = make_world(args, AS_RECORDED)
    records = []
    try:
        train(world, args)
        for row in rows:
            begin = time.monotonic()
            skipped = row.gpu and not gpu_is_there()
            problem = '' if skipped else run_row(world, row)
            records.append({'row': '%s.%s' % (row.group, row.name), 'nodelet': args.nodelet,
                            'seconds': round(time.monotonic() - begin, 1), 'problem': problem,
                            'result': 'skipped' if skipped else 'failed' if problem else 'passed'})
            print('%-8s %-36s %5.1f s  %s' % (records[-1]['result'], records[-1]['row'], records[-1]['seconds'],
                                              problem), flush=True)
    finally:
        world.graph.stop_all()
    return records


def in_process(args, only):
    """Runs rows in a process and a graph of their own. @return their records."""
    with tempfile.NamedTemporaryFile(suffix='.json') as file:
        command = [sys.executable, os.path.abspath(__file__), '--child', '--only', only, '--json', file.name]
        for name in ('folder', 'demo', 'model', 'train', 'patience', 'speed'):
            command += ['--' + name, str(getattr(args, name))]
        command += ['--nodelet'] * args.nodelet + ['--fast'] * args.fast
        ended = subprocess.run(command, check=False).returncode
        text = file.read()
        if not text:
            return [{'row': only, 'result': 'failed', 'problem': 'exit code %d' % ended, 'seconds': 0,
                     'nodelet': args.nodelet}]
        return json.loads(text)


def main():
    args = parse()
    if args.table:
        print(table())
        return 0
    rows = chosen(args)
    if not rows:
        sys.exit('faults: no row matches')
    if args.child:
        records = run_rows(rows, args)
    else:
        records = []
        for _ in range(args.repeat):
            names = ['%s.%s' % (r.group, r.name) for r in rows if not r.last]
            if names:
                records += in_process(args, '^(%s)$' % '|'.join(map(re.escape, names)))
            for row in rows:
                if row.last:
                    records += in_process(args, '^%s$' % re.escape('%s.%s' % (row.group, row.name)))
    if args.json:
        with open(args.json, 'w', encoding='utf-8') as file:
            json.dump(records, file, indent=1)
    count = {result: sum(r['result'] == result for r in records) for result in ('passed', 'failed', 'skipped')}
    if not args.child:
        print('%(passed)d passed, %(failed)d failed, %(skipped)d skipped' % count)
    return 1 if count['failed'] else 0


if __name__ == '__main__':
    sys.exit(main())
