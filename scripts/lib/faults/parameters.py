# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Parameters at their extremes, before the start and live."""
import rospy
from dynamic_reconfigure.msg import Config, DoubleParameter, IntParameter, StrParameter
from dynamic_reconfigure.srv import Reconfigure

from faults.graph import NODE
from faults.rows import row
from faults.world import require


def configured(world, group, **values):
    """Changes live parameters. @return name -> value that the server echoes."""
    config = Config()
    for name, value in values.items():
        kind, into = {str: (StrParameter, config.strs), int: (IntParameter, config.ints),
                      float: (DoubleParameter, config.doubles)}[type(value)]
        into.append(kind(name, value))
    echoed = world.call(group + 'set_parameters', Reconfigure, config=config).config
    return {p.name: p.value for kind in (echoed.strs, echoed.ints, echoed.doubles) for p in kind}


def stops_with(world, text, parameters):
    """A start with such parameters fails within 5 s; the log has the text."""
    world.start('world', parameters)
    world.setup = None
    if world.graph.nodelet:  # the manager stays, and the loader ends
        loader = world.graph.processes['node']
        require(loader.wait(5 * world.patience) is not None, 'the nodelet is loaded')
    else:
        require(world.graph.node.wait(5 * world.patience) != 0, 'exit code 0')
    world.expect_log(text)


STOPS = 'the start fails within 5 s; the log names the parameter'


@row('an unknown key in a group', STOPS, restarts=True)
def unknown_key(world):
    stops_with(world, 'tracker/no_such_key', {'tracker': {'no_such_key': 1}})


@row('a word where a number is needed', STOPS, restarts=True)
def wrong_type(world):
    stops_with(world, 'recover_s', {'recover_s': 'long'})


@row('a negative time', STOPS, restarts=True)
def negative(world):
    stops_with(world, 'image_timeout_s', {'image_timeout_s': -1.0})


@row('NaN', STOPS, restarts=True)
def not_a_number(world):
    stops_with(world, 'trust_score', {'tracker': {'trust_score': float('nan')}})


@row('a word that is not one of the choices', STOPS, restarts=True)
def unknown_choice(world):
    stops_with(world, 'initial_pose_policy', {'initial_pose_policy': 'rubbish'})


@row('an object that does not exist', 'the status names it within 3 s; the node lives', restarts=True)
def unknown_object(world):
    world.start('world', {'object': 'no_such_object'})
    world.expect(text='no_such_object', within=8)
    require(world.alive(), 'the node has ended')
    world.setup = None


@row('live: `initial_pose_policy` is set to rubbish', 'refused: the old value is echoed; tracking goes on', fast=True)
def rubbish_policy(world):
    echoed = configured(world, '', initial_pose_policy='rubbish')['initial_pose_policy']
    require(echoed == 'when_not_tracking', 'echoed: %s' % echoed)
    world.expect_back()


@row('live: `min_score` above `trust_score`', 'refused: the old value is echoed; tracking goes on')
def contradiction(world):
    echoed = configured(world, 'tracker/', min_score=1.0, trust_score=0.5)
    require(echoed['min_score'] <= echoed['trust_score'], 'echoed: %s' % echoed)
    world.expect_back()


@row('live: `trust_score` 1 and `min_score` 1, then as before', 'no wrong pose; right poses with a new initial pose')
def strictest(world):
    before = rospy.get_param(NODE + '/tracker')
    configured(world, 'tracker/', trust_score=1.0, min_score=1.0)
    world.wait(1)
    configured(world, 'tracker/', trust_score=before['trust_score'], min_score=before['min_score'])
    world.track()
    world.expect_back()


@row('live: the widest search, 180 degrees and 100 diameters', 'no wrong pose; right poses after the old values and a new '
     'initial pose')
def widest(world):
    before = rospy.get_param(NODE + '/tracker')
    configured(world, 'tracker/', rotation_deg=180.0, translation=100.0)
    world.wait(1)
    configured(world, 'tracker/', rotation_deg=before['rotation_deg'], translation=before['translation'])
    world.reset()
    world.track()
    world.expect_back()


@row('live: values beyond the limits', 'limited: tracking goes on')
def beyond(world):
    echoed = configured(world, 'overlay/', width_px=2**31 - 1, opacity=1e300)
    require(echoed['width_px'] < 2**20 and echoed['opacity'] <= 1, 'echoed: %s' % echoed)
    world.expect_back()


@row('live: 200 changes', 'tracking goes on')
def many_changes(world):
    for i in range(200):
        configured(world, 'overlay/', opacity=i / 200)
    world.expect_back()
