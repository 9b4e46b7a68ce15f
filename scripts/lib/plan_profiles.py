# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Prints the profiles of fields that a plan's variants ask for, a line each: plan_profiles.py PLAN [EXPERIMENT...]

Scenes are learned with these besides their own. With names of experiments, those of these alone."""
import json
import sys


def profiles(plan, wanted):
    """Sorted names."""
    found = {variant.get('profile') for experiment in plan['experiments'] if not wanted or experiment['name'] in wanted
             for variant in experiment.get('variants', ())}
    return sorted(found - {None, ''})


if __name__ == '__main__':
    with open(sys.argv[1], encoding='utf-8') as file:
        for profile in profiles(json.load(file), sys.argv[2:]):
            print(profile)
