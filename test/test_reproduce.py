#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""scripts/reproduce among programs that only write down how they were called, and a line for each shard."""
import glob
import json
import os
import stat
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCRIPT = os.path.join(TOP, 'scripts', 'reproduce')
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
import run_record  # noqa: E402
import trials  # noqa: E402

TRAIN = '''while [ $# -gt 0 ]; do [ "$1" != -o ] || echo model >"$2"; shift; done
echo '{"psnr_db": 30}'
'''
EVALUATE = '''case $* in *--check-plan*) exit ;; esac
out='' shard=''
while [ $# -gt 0 ]; do
  case $1 in -o) out=$2 ;; --shard) shard=$2 ;; esac
  shift
done
file=$out/trials-${shard%%/*}-of-${shard##*/}.csv
echo '%s' >"$file"
echo "table1,chair,synthetic,alignment,,,clean,paper,0,${shard%%/*},cpu,refined,9,0.2,0.1,0.1,900,0.5,0.1,0.001,0.001,1" >>"$file"
''' % ','.join(trials.TRIAL_KEY[:2] + ('kind',) + trials.TRIAL_KEY[2:] + ('engine', 'outcome') + trials.TRIAL_NUMBERS +
               trials.TRIAL_ERRORS)


class Reproduce(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = os.path.realpath(temporary.name)
        self.out = self.path('out')
        self.program('train', TRAIN)
        self.program('evaluate', EVALUATE)
        self.program('draw_figure2', 'echo figure >"$1"')
        self.program('nvidia-smi', 'exit 1')
        for scene in ('nerf_synthetic/chair', 'nerf_synthetic/mic', 'photos/head'):
            self.scene(scene)
        self.plan(1)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def file(self, name, text=''):
        os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
        with open(self.path(name), 'w', encoding='utf-8') as file:
            file.write(text)

    def program(self, name, body):
        self.file('bin/' + name, '#!/bin/bash\necho "%s $*" >>"%s"\n%s' % (name, self.path('calls'), body))
        os.chmod(self.path('bin', name), stat.S_IRWXU)

    def scene(self, name):
        for part in ('train', 'test'):
            self.file('data/%s/transforms_%s.json' % (name, part), '{}')

    def plan(self, seed):
        self.file('plan.json', json.dumps({'seed': seed, 'experiments': [{'name': 'table1'}, {'name': 'robot'}]}))

    def reproduce(self, *options, data='data'):
        return subprocess.run([SCRIPT, '--programs', self.path('bin'), '--experiments', self.path('plan.json'),
                               '--no-plots', *options, self.path(data), self.out], stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=60,
                              env=dict(os.environ, PATH=self.path('bin') + ':/usr/bin:/bin'))

    def calls(self, name):
        """How a program was called, but for looks at the plan."""
        if not os.path.exists(self.path('calls')):
            return []
        with open(self.path('calls'), encoding='utf-8') as file:
            return [line.strip() for line in file if line.startswith(name) and '--check-plan' not in line]

    def refused(self, code, *words, **arguments):
        result = self.reproduce(*arguments.pop('options', ()), **arguments)
        self.assertEqual(result.returncode, code, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_trains_evaluates_and_tabulates(self):
        result = self.reproduce()
        self.assertEqual(result.returncode, 0, result.stderr)
        trained = self.calls('train')
        self.assertEqual([os.path.basename(call.split()[1]) for call in trained], ['chair', 'mic', 'head'])
        self.assertIn('--profile cpu --steps 4000 --backend cpu', trained[0])
        call, = self.calls('evaluate')
        self.assertIn('--backend cpu --shard 0/1', call)
        with open(self.path('out', 'tables', 'results.md'), encoding='utf-8') as file:
            page = file.read()
        self.assertIn('scripts/reproduce --programs', page)
        self.assertIn('| chair | alignment | 1 | 1.00', page)
        self.assertTrue(os.path.exists(self.path('out', 'tables', 'figure2.svg')))
        self.assertFalse(glob.glob(self.path('out', 'models', '*.log')))

    def test_what_is_there_is_not_done_again(self):
        self.reproduce()
        os.remove(self.path('out', 'models', 'mic.safetensors'))
        os.remove(self.path('calls'))
        self.assertEqual(self.reproduce().returncode, 0)
        call, = self.calls('train')
        self.assertIn('mic.safetensors', call)

    def test_profiles_of_variants_are_learned_too(self):
        self.file('plan.json', json.dumps({'experiments': [
            {'name': 'a', 'variants': [{'label': 'x'}, {'label': 'y', 'profile': 'paper'}]},
            {'name': 'b', 'variants': [{'profile': 'cpu'}, {'profile': 'paper'}]}, {'name': 'c'}]}))
        self.assertEqual(self.reproduce('--only', 'a').returncode, 0)
        self.assertEqual([call.split()[3].split('/')[-1] + ' ' + call.split()[5] for call in self.calls('train')], [
            name + ' ' + profile for scene in ('chair', 'mic', 'head')
            for name, profile in ((scene + '.safetensors', 'cpu'), (scene + '.paper.safetensors', 'paper'))])
        self.assertEqual(self.reproduce().returncode, 0)
        self.assertEqual(len(self.calls('train')), 6)  # "cpu" is what scenes are learned with on a CPU
        self.assertEqual(os.readlink(self.path('out', 'models', 'mic.cpu.safetensors')), 'mic.safetensors')

    def test_an_experiment_that_there_is_not_is_said_before_anything_is_learned(self):
        self.refused(1, "plan.json: no experiment 'tabel1'", options=('--only', 'tabel1'))
        self.assertEqual(self.calls('train'), [])

    def test_a_gpu_is_taken_where_one_is(self):
        self.program('nvidia-smi', 'exit 0')
        self.reproduce('--only', 'robot')
        self.assertIn('--profile gpu --steps 10000 --samples-per-step 262144 --backend cuda', self.calls('train')[0])
        self.assertIn('--backend cuda --shard 0/1 --only robot', self.calls('evaluate')[0])

    def test_the_last_shard_makes_the_tables(self):
        first = self.reproduce('--shard', '1/2')
        self.assertEqual(first.returncode, 0, first.stderr)
        self.assertIn('1 of 2 shards have ended', first.stderr)
        self.assertFalse(os.path.exists(self.path('out', 'tables')))
        self.assertEqual([os.path.basename(call.split()[1]) for call in self.calls('train')], ['mic', 'head', 'chair'])
        self.assertEqual(self.reproduce('--shard', '0/2').returncode, 0)
        with open(self.path('out', 'tables', 'table1_synthetic.json'), encoding='utf-8') as file:
            self.assertEqual(json.load(file)['rows'][0]['trials'], 2)

    def test_a_plan_that_makes_no_sense_is_told_before_anything_is_learned(self):
        self.program('evaluate', 'echo "experiments[0]: unknown key" >&2; exit 2')
        self.refused(2, 'experiments[0]: unknown key')
        self.assertEqual(self.calls('train'), [])
        self.program('evaluate', EVALUATE)
        self.plan(2)  # there are no trials of the first one
        self.assertEqual(self.reproduce().returncode, 0)

    def test_models_of_another_training_are_not_mixed_in(self):
        self.assertEqual(self.reproduce('--quick').returncode, 0)
        self.refused(1, "learned with 'cpu, profile cpu, --steps 500', not with 'cpu, profile cpu, --steps 4000'")

    def test_a_failed_training_ends_it(self):
        self.program('train', 'echo "no memory" >&2; exit 1')
        self.refused(1, 'no memory', 'chair: training failed')
        self.assertEqual(self.calls('evaluate'), [])

    def test_a_failed_evaluation_is_not_tabulated(self):
        self.program('evaluate', 'exit 3')
        self.assertEqual(self.reproduce().returncode, 3)
        self.assertFalse(os.path.exists(self.path('out', 'tables')))

    def test_trials_of_another_plan_are_not_mixed_in(self):
        self.assertEqual(self.reproduce().returncode, 0)
        self.plan(2)
        self.refused(1, 'holds trials of another plan')

    def test_scenes_that_cannot_be(self):
        self.scene('other/chair')
        self.refused(1, 'several scenes are called chair')
        self.file('empty/readme')
        self.refused(1, 'no scene below', data='empty')
        self.refused(1, 'there is no folder', data='none')

    def llff_scene(self, name):
        """Nine photos from cameras side by side; pictures in two sizes, of which the smaller are wanted."""
        os.makedirs(self.path('data', name, 'images_8'))
        self.file('data/%s/images/photo.txt' % name)
        rows = []
        for i in range(9):
            cv2.imwrite(self.path('data', name, 'images_8', '%d.png' % i), np.zeros((6, 8, 3), np.uint8))
            pose = np.array([[0, 1, 0, 0.1 * i, 48], [-1, 0, 0, 0, 64], [0, 0, 1, 0, 50]])  # down, right, back
            rows.append(list(pose.ravel()) + [2, 9])
        np.save(self.path('data', name, 'poses_bounds.npy'), np.array(rows))

    def test_llff_is_converted_once(self):
        self.llff_scene('nerf_llff_data/wall')
        self.scene('nerf_llff_data/wall')  # as such folders come, in another unit
        result = self.reproduce()
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('wall: converting', result.stderr)
        converted = self.path('out', 'scenes', 'wall', 'transforms_test.json')
        with open(converted, encoding='utf-8') as file:
            self.assertEqual(len(json.load(file)['frames']), 2)  # of nine the first and the last
        written = os.stat(converted).st_mtime_ns
        self.assertNotIn('converting', self.reproduce().stderr)
        self.assertEqual(os.stat(converted).st_mtime_ns, written)
        self.assertTrue(os.path.islink(self.path('out', 'scenes', 'chair')))

    def test_wrong_usage(self):
        for options in (('--shard', '2/2'), ('--shard', 'x'), ('--backend', 'gpu'), ('--what',)):
            self.refused(2, 'see --help', options=options)

    def test_photos_are_handed_on(self):
        for name in ('b.jpg', 'a.png', 'notes.txt'):
            self.file('photos/' + name)
        self.reproduce('--photos', self.path('photos'))
        self.assertIn('--photo %s --photo %s' % (self.path('photos', 'a.png'), self.path('photos', 'b.jpg')),
                      self.calls('evaluate')[0])


class Record(unittest.TestCase):
    def test_a_run_that_goes_on_after_a_change_names_both(self):
        self.assertEqual(run_record.with_earlier(None, 'b'), 'b')
        self.assertEqual(run_record.with_earlier('a', 'b'), 'a, b')
        self.assertEqual(run_record.with_earlier('a, b', 'b'), 'a, b')


if __name__ == '__main__':
    unittest.main()
