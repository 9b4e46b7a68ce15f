#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs the tool `evaluate` as scripts/reproduce does: whole, in shards, interrupted.

    test_evaluate.py FOLDER_FOR_FILES TRAIN EVALUATE [unittest arguments]
"""
import csv
import json
import os
import shutil
import subprocess
import sys
import unittest

FOLDER, TRAIN, EVALUATE = sys.argv[1:4]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'test', 'support'))
from kiosk_model import put_kiosk_model  # noqa: E402

SCENES = os.path.join(TOP, 'demo', 'data')
PLAN = {'seed': 3, 'experiments': [
    {'name': 'near', 'methods': ['alignment'], 'protocol': 'robot', 'conditions': ['clean', 'discs'],
     'views': 1, 'starts': 2, 'traces': True, 'variants': [{'label': 'few', 'hypotheses': 8}]}]}
TIMED = ('seconds',)  # what may differ from run to run


def path(name):
    return os.path.join(FOLDER, name)


def run(*arguments):
    return subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=300)


def evaluate(output, *arguments):
    plan = () if '--experiments' in arguments else ('--experiments', path('plan.json'))
    return run(EVALUATE, SCENES, '--models', path('models'), *plan, '-o', path(output), '--scene', 'toy_kiosk',
               *arguments)


def dicts(output, table):
    """All lines of a folder's tables."""
    lines = []
    for name in os.listdir(path(output)):
        if name.startswith(table):
            with open(os.path.join(path(output), name), newline='', encoding='utf-8') as file:
                lines += list(csv.DictReader(file))
    return lines


def rows(output, table):
    """The same without times, in any order."""
    return sorted(tuple(v for k, v in row.items() if k not in TIMED) for row in dicts(output, table))


class Evaluate(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        os.makedirs(path('models'))
        with open(path('plan.json'), 'w', encoding='utf-8') as file:
            json.dump(PLAN, file)
        put_kiosk_model(TRAIN, FOLDER, path('models/toy_kiosk.safetensors'))

    def test_shards_make_what_one_run_makes_and_nothing_is_run_twice(self):
        self.assertEqual(evaluate('one', '--pictures', '1').returncode, 0)
        self.assertEqual(sorted(os.listdir(path('one/pictures'))),
                         [f'near_toy_kiosk_{condition}_alignment_0.png' for condition in ('clean', 'discs')])
        one = rows('one', 'trials')
        self.assertEqual(len(one), 4)  # 2 conditions, 2 starts
        self.assertGreater(len(rows('one', 'traces')), 4 * 3)
        for shard in ('0/2', '1/2'):
            result = evaluate('two', '--shard', shard)
            self.assertEqual(result.returncode, 0, result)
        self.assertEqual(rows('two', 'trials'), one)
        self.assertEqual(rows('two', 'traces'), rows('one', 'traces'))

        again = evaluate('one')
        self.assertIn('4 trials, 0 of them new', again.stdout)
        # As after a power cut: the last line is not whole.
        table = os.path.join(path('one'), 'trials-0-of-1.csv')
        with open(table, 'r+', encoding='utf-8') as file:
            file.truncate(os.path.getsize(table) - 20)
        self.assertIn('4 trials, 1 of them new', evaluate('one').stdout)
        self.assertEqual(rows('one', 'trials'), one)

    def test_a_variants_profile_names_its_model(self):
        variants = [{'label': 'own', 'hypotheses': 4}, {'label': 'other', 'hypotheses': 4, 'profile': 'paper'}]
        plan = {'experiments': [{'name': 'shapes', 'methods': ['alignment'], 'protocol': 'robot', 'views': 1,
                                 'starts': 1, 'variants': variants}]}
        with open(path('shapes.json'), 'w', encoding='utf-8') as file:
            json.dump(plan, file)
        result = evaluate('shapes', '--experiments', path('shapes.json'))
        self.assertEqual(result.returncode, 1)
        self.assertIn('toy_kiosk.paper.safetensors', result.stderr)
        shutil.copy(path('models/toy_kiosk.safetensors'), path('models/toy_kiosk.paper.safetensors'))
        self.assertEqual(evaluate('shapes', '--experiments', path('shapes.json')).returncode, 0)
        one, other = ({k: v for k, v in row.items() if k not in TIMED + ('variant',)}
                      for row in dicts('shapes', 'trials'))
        self.assertEqual(one, other)

    def test_errors_are_told(self):
        for arguments, code, word in ((('--only', 'nothing'), 2, "no experiment 'nothing'"),
                                      (('--shard', '3/3'), 2, '3/3'), (('--scene', 'moon'), 2, 'moon')):
            result = evaluate('errors', *arguments)
            self.assertEqual(result.returncode, code, result)
            self.assertIn(word, result.stderr)
        result = run(EVALUATE, SCENES, '--models', FOLDER, '--experiments', path('plan.json'), '-o',
                     path('errors'))
        self.assertEqual(result.returncode, 1)
        self.assertIn('toy_kiosk.safetensors', result.stderr)


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
