# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Prints the profiles of fields that a plan's variants ask for, a line each: plan_profiles.py PLAN [EXPERIMENT...]

Scenes are learned with these besides their own. With names of experiments, those of these alone; a name that the plan
does not have is an error."""
import json
import sys


def profiles(plan, wanted):
    """Sorted names. Raises ValueError for an experiment that there is not."""
    unknown = set(wanted) - {experiment['name'] for experiment in plan['experiments']}
    if unknown:
        raise ValueError('no experiment %s' % ', '.join("'%s'" % name for name in sorted(unknown)))
    found = {variant.get('profile') for experiment in plan['experiments'] if not wanted or experiment['name'] in wanted
             for variant in experiment.get('variants', ())}
    return sorted(found - {None, ''})


if __name__ == '__main__':
    try:
        with open(sys.argv[1], encoding='utf-8') as file:
            print('\n'.join(profiles(json.load(file), sys.argv[2:])))
    except (KeyError, TypeError, ValueError) as error:
        sys.exit('%s: %s' % (sys.argv[1], error))
