#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs the node for long with all that happens to it in use, and checks that nothing grows. For scripts/soak."""
import argparse
import hashlib
import json
import os
import shutil
import sys
import time

import actionlib
import numpy as np
import rospy
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from nerf_pose_refiner.msg import RegisterAction, RegisterGoal
from sensor_msgs.msg import Image

from faults.graph import NODE, descriptors, of_process, wait_until
from faults.player import SIXTY_HZ
from run_faults import TRAINING_STEPS, make_world, train
from soak_verdict import verdict
from svg_plot import svg

CYCLE_S = 60
TRAINING_S = 12  # of an object, beside tracking; its views are judged after that
REGISTRATION_S = 300  # at most, on a busy machine
ALLOCATED = 'allocated memory of the process [MiB]'
IMAGES = ('arrived images', 'images lost before', 'images with camera_info', 'refused images', 'skipped images',
          'refined images', 'dropped images')


def blank(image, info):
    """The object is gone."""
    image.data = bytes(len(image.data))
    return [(image, info)]


class Cycle:
    """What happens in each cycle, second by second; at its end all is as it was at its beginning."""

    def __init__(self, world):
        self.world = world
        self.overlay = None
        self.registered = 0  # objects
        self.action = actionlib.SimpleActionClient(NODE + '/register', RegisterAction)
        self.action.wait_for_server()
        self.steps = {2: self.gone, 5: self.here, 10: self.look, 15: self.look_away, 18: self.configure,
                      20: self.register, 24: self.cancel, 28: self.register, 40: self.swap, 43: self.swap_back,
                      46: self.disable, 47: self.enable, 50: self.reset, 51: self.begin}

    def at(self, second):
        self.steps.get(second, lambda: None)()

    def gone(self):
        self.world.player.alter, self.world.player.visible = blank, False

    def here(self):
        self.world.player.alter, self.world.player.visible = None, True

    def look(self):
        self.overlay = rospy.Subscriber(NODE + '/overlay/image_raw', Image, lambda image: None)

    def look_away(self):
        self.overlay.unregister()

    def configure(self):
        for value in (0.4, 0.5):
            self.world.call('tracker/set_parameters', Reconfigure,
                            config=Config(doubles=[DoubleParameter('min_score', value)]))

    def register(self):
        self.action.send_goal(RegisterGoal(name='learned', dataset='toy_kiosk', max_seconds=TRAINING_S,
                                           force_retrain=True))

    def cancel(self):
        self.action.cancel_goal()

    def swap(self):
        if not self.action.wait_for_result(rospy.Duration(REGISTRATION_S)):
            raise RuntimeError('the registration has not ended after %d s' % REGISTRATION_S)
        done = self.action.get_result()
        self.registered += bool(done and done.success)
        self.world.choose('twin')
        self.begin()

    def swap_back(self):
        self.world.choose('toy_kiosk')
        self.begin()

    def disable(self):
        self.world.enable(False)

    def enable(self):
        self.world.enable(True)
        self.begin()

    def reset(self):
        self.world.reset()

    def begin(self):
        self.world.send_initial_pose()


def control_ms():
    """Time of a fixed computation: how busy the machine is."""
    begin = time.perf_counter()
    hashlib.sha256(bytes(2000000)).digest()
    return 1e3 * (time.perf_counter() - begin)


def measure(world, begin, before):
    """One line of the log, from the time and the line before it. Quantiles are of the images refined since then."""
    pid, allocated = world.pid(), allocated_mib(world)
    with world.watcher.changed:
        refined = [s for s, _ in world.watcher.statuses if s.latency_s > 0]
        wrong = sum(not p.right for p in world.watcher.poses)
        poses = len(world.watcher.poses)
    world.watcher.forget()
    latency = [1e3 * s.latency_s for s in refined] or [0]
    return {'minutes': (time.monotonic() - begin) / 60, 'memory [MiB]': of_process(pid, 'VmRSS') / 1024,
            'allocated [MiB]': before.get('allocated [MiB]', 0) if allocated is None else allocated,
            'descriptors': descriptors(pid), 'threads': of_process(pid, 'Threads'), 'refined': len(refined),
            'poses': poses, 'wrong': wrong, 'latency p50 [ms]': float(np.percentile(latency, 50)),
            'latency p95 [ms]': float(np.percentile(latency, 95)),
            'refinement p50 [ms]': 1e3 * float(np.median([s.refinement_s for s in refined] or [0])),
            'control [ms]': control_ms()}


def allocated_mib(world):
    """What the node says that it has allocated, from /diagnostics; None if it has not since the last line."""
    with world.watcher.changed:
        status, _ = world.watcher.diagnostics.get('engine', (None, 0))
    values = {v.key: v.value for v in status.values} if status else {}
    return float(values[ALLOCATED]) if ALLOCATED in values else None


def image_counts(world):
    """What the node says of the images, from /diagnostics; None before it has."""
    with world.watcher.changed:
        status, _ = world.watcher.diagnostics.get('tracking', (None, 0))
    if status is None:
        return None
    values = {v.key: v.value for v in status.values}
    return {name: int(values[name]) for name in IMAGES}


def count_images(world, first_sequence):
    """Stops the camera and waits until all images have gone through. @return counts, with `published`."""
    world.player.camera_on = False
    counts = {}

    def settled():
        before = dict(counts)
        world.watcher.forget()
        time.sleep(2.5)  # /diagnostics comes once a second
        counts.update(image_counts(world) or {})
        return counts and counts == before
    wait_until(settled, 30)
    counts['published'] = world.player.sequence - first_sequence
    return counts


def run(world, minutes):
    """@return measurements each second, and those at the end of each cycle."""
    cycle, begin = Cycle(world), time.monotonic()
    lines, cycles = [], []
    shown = ('minutes', 'memory [MiB]', 'allocated [MiB]', 'descriptors', 'threads', 'refined', 'poses', 'wrong',
             'latency p50 [ms]', 'control [ms]')
    print(' '.join(shown))
    # A cycle takes longer than its seconds where the machine is busy.
    while not cycles or time.monotonic() < begin + 60 * minutes:
        start = time.monotonic()
        done = {'refined': 0, 'poses': 0, 'wrong': 0}
        first = len(lines)
        for second in range(CYCLE_S):
            time.sleep(max(0.0, start + second - time.monotonic()))
            cycle.at(second)
            # What took longer is not made up for: the steps keep their distance.
            start = max(start, time.monotonic() - second - 1)
            lines.append(measure(world, begin, lines[-1] if lines else {}))
            for key in done:
                done[key] += lines[-1][key]
        least = {key: min(line[key] for line in lines[first:]) for key in ('descriptors', 'threads')}  # some come and go
        cycles.append({**lines[-1], **done, **least, 'cycle': len(cycles), 'registered': cycle.registered})
        print(' '.join('%*.*f' % (len(key), isinstance(cycles[-1][key], float), cycles[-1][key]) for key in shown), flush=True)
    return lines, cycles


def plot(lines):
    """@return SVG."""
    def curve(*names):
        return {name: [line[name] for line in lines] for name in names}
    return svg([line['minutes'] for line in lines], {
        'memory [MiB]': curve('memory [MiB]', 'allocated [MiB]'),
        'descriptors and threads': curve('descriptors', 'threads'),
        'images refined in a second': curve('refined', 'poses'),
        'latency [ms]': curve('latency p50 [ms]', 'latency p95 [ms]', 'refinement p50 [ms]'),
        'time of a fixed computation [ms]': curve('control [ms]')})


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--folder', required=True)
    parser.add_argument('--demo', required=True)
    parser.add_argument('--model', default='')
    parser.add_argument('--train', type=int, default=TRAINING_STEPS)
    parser.add_argument('--minutes', type=float, default=120)
    parser.add_argument('--nodelet', action='store_true')
    args = parser.parse_args()
    world = make_world(args, SIXTY_HZ)
    try:
        train(world, args)
        world.graph.stop_node()
        first_sequence = world.player.sequence
        world.start('world', {'register': {'accept_poor_data': True}})
        shutil.copy(os.path.join(world.models, 'toy_kiosk.safetensors'),
                    os.path.join(world.models, 'twin.safetensors'))
        world.ready()
        world.track()
        lines, cycles = run(world, args.minutes)
        counts = count_images(world, first_sequence)
    finally:
        world.graph.stop_all()
    problems = verdict(cycles, counts)
    with open(args.folder + '/soak.json', 'w', encoding='utf-8') as file:
        json.dump({'problems': problems, 'images': counts, 'cycles': cycles}, file, indent=1)
    with open(args.folder + '/soak.svg', 'w', encoding='utf-8') as file:
        file.write(plot(lines))
    print('objects registered: %d' % cycles[-1]['registered'])
    print('images: ' + ', '.join('%d %s' % (n, name.replace('images', '').strip()) for name, n in counts.items()))
    print('\n'.join(problems) or 'nothing has grown, and every image is accounted for')
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
