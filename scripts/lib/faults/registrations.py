# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Faults while an object is learned."""
import glob
import os
import re
import resource
import shutil
import signal
import threading

import actionlib
import rospy
from nerf_pose_refiner.msg import RegisterAction, RegisterGoal

from faults.graph import NODE, of_process, wait_until
from faults.rows import row
from faults.world import require

DATASET = 'toy_kiosk'


def leftovers(world):
    """Files of `~model_root` that are not the intact ones."""
    return sorted(set(os.listdir(world.models)) - set(os.listdir(world.graph.folder + '/intact')))


def client(kind=actionlib.SimpleActionClient):
    # By default it queues ten goals, and drops the others; all clients of a process share the queue.
    rospy.set_param('/actionlib_client_pub_queue_size', 100)
    c = kind(NODE + '/register', RegisterAction)
    c.wait_for_server()
    return c


def begin(c):
    """Starts a registration that takes long, and waits until it trains."""
    stages = []
    c.send_goal(RegisterGoal(name='slow', dataset=DATASET, max_seconds=600, force_retrain=True),
                feedback_cb=lambda feedback: stages.append(feedback.stage))
    require(wait_until(lambda: 'training' in stages, 60), 'the training does not begin')


@row('a dataset that does not exist', 'refused with its name within 1 s; tracking goes on')
def no_dataset(world):
    world.refused(world.register(name='new', dataset='no_such_folder', within=1), 'no_such_folder')
    world.expect_back()


@row('a dataset out of `~dataset_root`', 'refused within 1 s; tracking goes on')
def dataset_outside(world):
    world.refused(world.register(name='new', dataset='../..', within=1))
    world.refused(world.register(name='new', dataset='/etc', within=1))
    world.expect_back()


@row('a name that leads out of `~model_root`', 'refused within 1 s; tracking goes on')
def name_outside(world):
    world.refused(world.register(name='../new', dataset=DATASET, within=1))
    world.expect_back()


@row('NaN for the time and the scale', 'refused within 1 s; tracking goes on')
def nan_request(world):
    for field in ('max_seconds', 'metres_per_unit'):
        world.refused(world.register(name='new', dataset=DATASET, within=1, **{field: float('nan')}), field)
    world.expect_back()


@row('a registration is cancelled while it trains', 'ends within 3 s and leaves nothing behind; the old object is '
     'tracked all the time')
def cancelled(world):
    c = client()
    begin(c)
    world.expect_right_poses()
    c.cancel_goal()
    require(wait_until(lambda: c.get_state() == actionlib.GoalStatus.PREEMPTED, 3 * world.patience),
            'the goal does not end: state %d' % c.get_state())
    require(not leftovers(world), 'left behind: %s' % leftovers(world))
    world.expect_back()


@row('40 goals at once beside a registration (queues of actionlib hold 50)', 'each is refused with the progress of the '
     'running one, or for the goals that wait; threads as before; tracking goes on')
def goals(world):
    c = client()
    begin(c)
    threads = of_process(world.pid(), 'Threads')
    results = []
    others = client(actionlib.ActionClient)
    handles = [others.send_goal(RegisterGoal(name='other%d' % i, dataset=DATASET)) for i in range(40)]
    try:
        ended = wait_until(lambda: all(h.get_comm_state() == actionlib.CommState.DONE for h in handles),
                           10 * world.patience)
        results = [h for h in handles if h.get_comm_state() == actionlib.CommState.DONE]
        require(ended, '%d of 40 goals have an answer' % len(results))
        require(all(re.search('being registered|goals wait', h.get_result().message) for h in results), 'the reason is missing')
        more = of_process(world.pid(), 'Threads') - threads
        require(more < 5, '%d more threads' % more)
    finally:
        c.cancel_goal()
        c.wait_for_result()
    world.expect_back()


@row('40 identical goals at once', 'some join the registration, the rest is refused with a reason; at most 16 more '
     'threads; all end with it')
def identical_goals(world):
    c = client()
    begin(c)
    threads = of_process(world.pid(), 'Threads')
    others = client(actionlib.ActionClient)
    goal = RegisterGoal(name='slow', dataset=DATASET, max_seconds=600, force_retrain=True)
    handles = [others.send_goal(goal) for _ in range(40)]
    try:
        world.wait(2)
        more = of_process(world.pid(), 'Threads') - threads
        require(more <= 20, '%d more threads' % more)
    finally:
        c.cancel_all_goals()
        ended = wait_until(lambda: all(h.get_comm_state() == actionlib.CommState.DONE for h in handles),
                           20 * world.patience)
    require(ended, 'goals do not end')
    if any(h.get_result() and h.get_result().success for h in handles):  # a GPU has learned it meanwhile
        world.choose('toy_kiosk')
        world.track()
    world.expect_back()


@row('the process is killed (kill -9) while it trains, and starts again', 'no model, and no temporary file that stays; '
     'right poses with a new initial pose', restarts=True)
def killed(world):
    begin(client())
    world.kill()
    world.start('world')
    world.ready()
    require(not leftovers(world), 'left behind: %s' % leftovers(world))
    world.track()
    world.expect_back()


@row('`~model_root` cannot be written', 'refused before it trains, within 5 s, with a message that names it',
     setup='no_object', restarts=True)
def read_only(world):
    world.start('no_object', {'model_root': '/proc/nowhere'})
    world.ready()
    world.refused(world.register(name='new', dataset=DATASET, within=5), '/proc/nowhere')
    world.setup = None


@row('the disk is full when the model is saved (files are limited to 200 kB)', 'the reply says so; nothing stays behind; '
     'the node lives', setup='no_object', restarts=True)
def disk_full(world):
    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (200000, 200000))
    world.start('no_object', {'register': {'accept_poor_data': True}}, preexec=limit)
    world.ready()
    reply = world.register(name='new', dataset=DATASET, max_seconds=4)
    world.refused(reply)
    require(re.search('write|large|space', reply.message), 'another reason: %s' % reply.message)
    require(world.alive(), 'the node has ended')
    require(not glob.glob(world.models + '/new*'), 'left behind: %s' % leftovers(world))
    world.setup = None


@row('two registrations of one object at once', 'both succeed with one training, or one is refused with a reason',
     setup='no_object', restarts=True)
def at_once(world):
    world.start('no_object', {'register': {'accept_poor_data': True}})
    world.ready()
    replies = []
    threads = [threading.Thread(target=lambda: replies.append(
        world.register(name='new', dataset=DATASET, max_seconds=15, within=180)))
               for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    require(len(replies) == 2 and any(r.success for r in replies) and all(r.message for r in replies),
            'replies: %s' % [r.message for r in replies])
    world.setup = None


@row('photos that are no images', 'refused with the name of one within 5 s; tracking goes on')
def no_images(world):
    # A copy of the dataset's description beside files of zeros.
    folder = os.path.join(world.datasets, 'spoilt')
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(os.path.join(world.datasets, DATASET), folder)
    spoilt = [os.path.join(base, name) for base, _, names in os.walk(folder) for name in names
              if name.endswith(('.jpg', '.png'))]
    for path in spoilt:
        with open(path, 'wb') as file:
            file.write(bytes(1000))
    world.refused(world.register(name='new', dataset='spoilt', within=5))
    shutil.rmtree(folder)
    world.expect_back()
