#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tables of trials that were made by hand, against numbers that were worked out by hand."""
import csv
import glob
import importlib.util
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCRIPT = os.path.join(TOP, 'scripts', 'tabulate_trials')
sys.path.insert(0, os.path.join(TOP, 'scripts', 'lib'))
import detection_tables  # noqa: E402
import trial_statistics  # noqa: E402
import trial_tables  # noqa: E402
import trials  # noqa: E402

COLUMNS = ('experiment', 'scene', 'kind', 'method', 'loss', 'variant', 'condition', 'protocol', 'view', 'start',
           'start_deg', 'start_units', 'start_diameters', 'deg', 'units', 'diameters', 'pixels', 'outcome', 'score',
           'seconds', 'samples', 'engine')
TRACES = ('experiment', 'scene', 'kind', 'method', 'loss', 'variant', 'condition', 'view', 'start', 'stage', 'seconds',
          'samples', 'deg', 'units')
SIGHTINGS = ('experiment', 'scene', 'kind', 'method', 'loss', 'variant', 'condition', 'protocol', 'view', 'start',
             'instance', 'width', 'visible', 'deg', 'diameters', 'score')
FOUR = (('0.5', '0.005', '0.002'), ('4.9', '0.06', '0.02'), ('5.0', '0.04', '0.3'), ('', '', ''))  # errors
HAS_MATPLOTLIB = importlib.util.find_spec('matplotlib') is not None


def trial(start=0, errors=('0.5', '0.005', '0.002'), **others):
    row = dict(experiment='table1', scene='chair', kind='synthetic', method='multiple', loss='l2', variant='',
               condition='clean', protocol='paper', view='3', start=str(start), start_deg='13', start_units='0.2',
               start_diameters='0.1', deg=errors[0], units=errors[1], diameters=errors[2],
               pixels='1' if errors[0] else '', outcome='refined' if errors[0] else 'diverged', score='0.8',
               seconds='0.5', samples='1000000', engine='cpu')
    return dict(row, **others)


def scores(share, **others):
    """Ten trials of which this many in ten are good."""
    return [trial(i, ('0.1', '0.001', '0.001') if i < 10 * share else ('9', '0.2', '0.2'), **others) for i in range(10)]


def traced(seconds, deg, start=0, method='multiple'):
    return [dict(experiment='table1', scene='chair', kind='synthetic', method=method, loss='l2', variant='',
                 condition='clean', view='3', start=str(start), stage=str(i), seconds=str(s), samples=str(1000 * i),
                 deg=d, units=d) for i, (s, d) in enumerate(zip(seconds, deg))]


def content(path):
    with open(path, 'rb') as file:
        return file.read()


class InFolder(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def write(self, name, rows, columns=COLUMNS, tail=''):
        os.makedirs(os.path.dirname(self.path(name)), exist_ok=True)
        with open(self.path(name), 'w', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, columns, lineterminator='\n', extrasaction='ignore')
            writer.writeheader()
            writer.writerows(rows)
            file.write(tail)

    def tabulate(self, *arguments, plots=False):
        return subprocess.run([sys.executable, SCRIPT, *arguments, *([] if plots else ['--no-plots'])],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, timeout=120)

    def refused(self, *words):
        result = self.tabulate(self.folder)
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertNotIn('Traceback', result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def rows(self, table):
        with open(self.path('tables', table + '.json'), encoding='utf-8') as file:
            return json.load(file)['rows']

    def page(self):
        with open(self.path('tables', 'results.md'), encoding='utf-8') as file:
            return file.read()


class Statistics(unittest.TestCase):
    def test_wilson(self):
        # z^2 = 3.841459; 0 of 10: up to z^2 / (10 + z^2); 5 of 10: 0.5 -+ z / (1 + z^2 / 10) sqrt(1/40 + z^2 / 400)
        for share, count, low, high in ((0, 10, 0, 0.277533), (1, 10, 0.722467, 1), (0.5, 10, 0.236593, 0.763407),
                                        (0.98, 100, 0.929988, 0.994498)):
            found = trial_statistics.wilson(share, count)
            self.assertAlmostEqual(found[0], low, 5)
            self.assertAlmostEqual(found[1], high, 5)

    def test_percentiles(self):
        self.assertEqual(trial_statistics.percentile([4, 1, 3, 2], 0.5), 2.5)
        self.assertAlmostEqual(trial_statistics.percentile([4, 1, 3, 2], 0.9), 3.7)
        self.assertEqual(trial_statistics.percentile([1, math.inf, 2], 0.5), 2)
        for values in ([1, math.inf], [math.inf] * 2, [1, math.inf, math.inf, math.inf]):
            self.assertEqual(trial_statistics.percentile(values, 0.5), math.inf)

    def test_natural_order(self):
        self.assertEqual(sorted(['r_10', 'r_2', 'a', '7'], key=trials.natural), ['7', 'a', 'r_2', 'r_10'])

    def test_order_of_losses(self):
        with open(os.path.join(TOP, 'scripts', 'lib', 'paper_results.json'), encoding='utf-8') as file:
            table2 = json.load(file)['table2']
        self.assertEqual(trial_tables.order_of(table2['synthetic']['units005']),
                         'relative_l2 > mape > log_l1 > l1 = smooth_l1 > smape > l2')
        self.assertEqual(trial_tables.order_of({'l1': 0.5, 'l2': 0.4, 'mape': 0.9, 'smape': 0.5}),
                         'mape > l1 = smape > l2')


class Tables(InFolder):
    def test_shares_and_errors(self):
        self.write('trials-1-of-1.csv', [trial(i, errors) for i, errors in enumerate(FOUR)])
        self.assertEqual(self.tabulate(self.folder).returncode, 0)
        ours, paper = self.rows('table1_synthetic')[:2]
        self.assertEqual(ours['trials'], 4)
        for name, share in (('deg5', 0.5), ('units005', 0.5), ('joint_units', 0.25), ('deg1', 0.25),
                            ('units001', 0.25), ('tight_units', 0.25), ('diameters005', 0.5), ('joint_diameters', 0.5)):
            self.assertEqual(ours[name], share, name)
        self.assertAlmostEqual(ours['median_deg'], 4.95)  # of 0.5, 4.9, 5 and infinity
        self.assertAlmostEqual(ours['median_units'], 0.05)
        self.assertIsNone(ours['p90_deg'])
        self.assertEqual((ours['median_s'], ours['median_samples']), (0.5, 1e6))
        self.assertEqual((paper['source'], paper['deg5'], paper['units005']), ('paper', 1.0, 1.0))
        self.assertIn('| chair | multiple | 4.95 | none | 0.05 | none |', self.page())
        self.assertIn('| chair | multiple (paper) | 25 | 1.00 | 1.00 |', self.page())
        with open(self.path('tables', 'table1_synthetic.csv'), newline='', encoding='utf-8') as file:
            self.assertEqual(next(csv.DictReader(file))['p90_deg'], '')

    def test_means_over_scenes(self):
        self.write('trials-1-of-1.csv', scores(1) + scores(0.6, scene='mic') +
                   scores(0.5, scene='fern', kind='forward_facing') + scores(1, scene='own', method='single'))
        self.tabulate(self.folder)
        rows = {(row['scene'], row['method'], row['source']): row for row in self.rows('table1_synthetic')}
        mean = rows['mean of chair, mic', 'multiple', 'ours']  # the third scene was not tried that way
        self.assertAlmostEqual(mean['deg5'], 0.8)
        self.assertEqual(mean['trials'], 20)
        self.assertAlmostEqual(mean['deg5_low'], trial_statistics.wilson(0.8, 20)[0])
        self.assertAlmostEqual(rows['mean', 'multiple', 'paper']['units005'], 0.92)  # (1.00 + 0.84) / 2
        self.assertEqual(rows['chair', 'inerf', 'paper']['deg5'], 0.44)  # was not tried here
        self.assertEqual(rows['mean of all 8', 'single', 'paper']['units005'], 0.62)  # as printed; 0.615 before
        self.assertFalse([key for key in rows if key[0] in ('fern', 'mean of own')])
        self.assertNotIn(('own', 'single', 'paper'), rows)
        self.assertEqual([row['scene'] for row in self.rows('table1_forward_facing')][:2], ['fern', 'fern'])

    def test_robot_protocol_counts_in_diameters(self):
        self.write('trials-1-of-1.csv', [
            trial(i, errors, experiment='robot', protocol='robot', method='alignment', loss='', condition=condition)
            for i, errors in enumerate(FOUR) for condition in ('photo', 'clean')])
        self.tabulate(self.folder)
        page = self.page()
        self.assertIn('| scene | condition | method | trials | < 5 deg | < 0.05 d | jointly |', page)
        self.assertIn('| < 5 deg, < 0.05 u |', page)
        self.assertNotIn('(paper)', page)
        self.assertEqual([row['condition'] for row in self.rows('robot_synthetic')], ['clean', 'photo'])

    def test_losses_beside_the_papers(self):
        shared = dict(experiment='losses', method='single', condition='paper_noise')
        self.write('trials-1-of-1.csv', [row for scene, first, second in (('chair', 0.9, 0.4), ('mic', 0.7, 0.8))
                                         for loss, share in (('l2', first), ('mape', second))
                                         for row in scores(share, scene=scene, loss=loss, **shared)])
        self.tabulate(self.folder)
        rows = {(row['bound'], row['scene'], row['source']): row for row in self.rows('losses_synthetic')}
        self.assertEqual(rows['< 5 deg', 'chair', 'ours']['order'], 'l2 > mape')
        self.assertEqual(rows['< 5 deg', 'mic', 'ours']['order'], 'mape > l2')
        self.assertAlmostEqual(rows['jointly', 'mean', 'ours']['l2'], 0.8)
        self.assertAlmostEqual(rows['jointly', 'mean', 'ours']['mape'], 0.6)
        self.assertEqual(rows['< 0.05 u', 'mean', 'paper']['order'],
                         'mape > l2')
        self.assertIn('| mean (paper) | 0.71 | 0.82 | mape > l2 |', self.page())

    def test_best_loss_against_l2(self):
        shared = dict(experiment='noise', condition='discs')
        self.write('trials-1-of-1.csv', scores(0.6, loss='l2', **shared) + scores(0.9, loss='mape', **shared) +
                   scores(0.7, experiment='noise', condition='gaussian', method='alignment', loss=''))
        self.tabulate(self.folder)
        best, = self.rows('noise_synthetic_best_loss')
        self.assertEqual((best['condition'], best['best'], best['best_share'], best['l2_share']),
                         ('discs', 'mape', 0.9, 0.6))
        self.assertIn('| scene | method | loss | gaussian | discs |', self.page())
        self.assertIn('| chair | discs | multiple | mape | 0.90 | 0.60 | +0.30 |', self.page())

    def test_variants_in_the_order_of_their_numbers(self):
        self.write('trials-1-of-1.csv', [trial(experiment='ablation', variant=label) for label in (
            'hypotheses=16', '', 'hypotheses=4')])
        self.tabulate(self.folder)
        self.assertEqual([row['variant'] for row in self.rows('ablation_synthetic')],
                         ['', 'hypotheses=4', 'hypotheses=16'])
        self.assertIn('| scene | variant | method |', self.page())


class Merging(InFolder):
    def test_two_shards_are_as_one_run(self):
        rows = [trial(i, FOUR[i % 4], scene=scene, view=view) for scene in ('chair', 'mic') for view in ('2', '10')
                for i in range(5)]
        traces = [row for i in range(4) for row in traced((0, 1, 2), ('9', '4', '1'), i)]
        self.write('one/trials-1-of-1.csv', rows)
        self.write('one/traces-1-of-1.csv', traces, TRACES)
        for shard in (0, 1):
            self.write('two/trials-%d-of-2.csv' % (shard + 1), rows[1 - shard::2])
            self.write('two/traces-%d-of-2.csv' % (shard + 1), traces[6 * shard:6 * shard + 6], TRACES)
            self.write('apart%d/trials-%d-of-2.csv' % (shard, shard + 1), rows[1 - shard::2])
            self.write('apart%d/traces-%d-of-2.csv' % (shard, shard + 1), traces[6 * shard:6 * shard + 6], TRACES)
        contents = []
        for folders in (['one'], ['two'], ['apart1', 'apart0']):
            result = self.tabulate(*map(self.path, folders), plots=HAS_MATPLOTLIB and folders != ['apart1', 'apart0'])
            self.assertEqual((result.returncode, result.stderr), (0, ''))
            files = sorted(glob.glob(self.path(folders[0], 'tables', '*')))
            contents.append({os.path.basename(name): content(name) for name in files})
        self.assertEqual(contents[0], contents[1])
        if HAS_MATPLOTLIB:
            self.assertIn('error_over_time_table1_chair_clean.svg', contents[0])
            self.assertIn('recall_table1_mic_clean.png', contents[0])
        tables = {name: text for name, text in contents[0].items() if name.startswith('table1')}
        self.assertEqual(tables, {name: contents[2][name] for name in tables})

    def test_the_first_of_two_counts(self):
        self.write('trials-1-of-2.csv', [trial(errors=('1', '1', '1'))])
        self.write('trials-2-of-2.csv', [trial(errors=('2', '2', '2')), trial(1, ('3', '3', '3'))])
        result = self.tabulate(self.folder)
        self.assertIn('1 trials were there more than once', result.stderr)
        self.assertEqual(self.rows('table1_synthetic')[0]['median_deg'], 2)  # of 1 and 3

    def test_a_missing_shard_is_told(self):
        self.write('trials-2-of-3.csv', [trial()])
        result = self.tabulate(self.folder)
        self.assertEqual(result.returncode, 0)
        self.assertIn('1 of 3 shards are there (2)', result.stderr)
        self.assertIn('- 1 of 3 shards are there', self.page())

    def test_a_half_written_line_is_left_out(self):
        self.write('trials-1-of-1.csv', [trial(0), trial(1)], tail='table1,chair,synth')
        result = self.tabulate(self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('trials-1-of-1.csv: line 4 is half written', result.stderr)
        self.assertEqual(self.rows('table1_synthetic')[0]['trials'], 2)

    def test_a_trace_that_was_begun_anew(self):
        self.write('traces-1-of-1.csv', traced((0, 1), ('9', '8')) + traced((0, 1, 2), ('9', '4', '')), TRACES)
        (first, rows), = trials.read_traces([self.folder], [])
        self.assertEqual([row['deg'] for row in rows], [9, 4, math.inf])
        self.assertEqual(first['stage'], '0')

    def test_the_records_of_runs(self):
        self.write('trials-1-of-1.csv', [trial()])
        with open(self.path('run.json'), 'w', encoding='utf-8') as file:
            json.dump({'command': 'evaluate scenes', 'commit': 'abc', 'date': '2026-01-02', 'engine': 'CPU',
                       'experiments_checksum': '7'}, file)
        self.tabulate(self.folder)
        self.assertIn('| `evaluate scenes` | abc | 2026-01-02 | CPU |', self.page())
        self.tabulate(self.folder, '--commit', 'def', '--date', 'today')
        self.assertIn('| `evaluate scenes` | def | today | CPU |', self.page())


class Refusals(InFolder):
    def test_no_trials(self):
        self.refused('no trials-*.csv', 'has evaluate run?')
        self.write('trials-1-of-1.csv', [])
        self.refused('no trials in trials-1-of-1.csv: only headers')

    def test_a_missing_column(self):
        self.write('trials-1-of-1.csv', [trial()], [name for name in COLUMNS if name not in ('deg', 'engine')])
        self.refused('trials-1-of-1.csv: no column engine, deg; there are: experiment, scene')

    def test_a_torn_line(self):
        self.write('trials-1-of-1.csv', [trial()], tail='table1,chair\n')
        self.refused('trials-1-of-1.csv: line 3 has 2 cells, the header has 22')

    def test_what_is_no_number(self):
        for column, text, words in (('deg', 'nan', 'deg is "nan"'), ('units', '-1', 'units is "-1"'),
                                    ('seconds', '', 'seconds is empty'), ('samples', 'many', 'samples is "many"')):
            self.write('trials-1-of-1.csv', [trial(0), trial(1, **{column: text})])
            self.refused('trials-1-of-1.csv: line 3: ' + words)

    def test_runs_of_different_experiments(self):
        self.write('trials-1-of-1.csv', [trial()])
        for shard in (1, 2):
            with open(self.path('run-%d.json' % shard), 'w', encoding='utf-8') as file:
                json.dump({'experiments_checksum': shard}, file)
        self.refused('different experiment files (checksums 1, 2)')


@unittest.skipUnless(HAS_MATPLOTLIB, 'no matplotlib')


class Detection(InFolder):
    def setUp(self):
        super().setUp()
        detected = dict(experiment='detect', method='detection', loss='', protocol='robot')
        self.trials = [trial(view='0', condition='group', **detected), trial(view='1', condition='group', **detected),
                       trial(view='0', condition='absent', errors=('', '', ''), **detected)]
        group = dict(detected, scene='chair', kind='synthetic', variant='', condition='group', start='0', width='0.22',
                     visible='0.65', score='0.9')
        nobodys = dict(group, instance='', width='', visible='', deg='', diameters='')
        self.sightings = [
            dict(group, view='0', instance='0', deg='1', diameters='0.01'),
            dict(group, view='0', instance='1', deg='9', diameters='0.01'),  # found, and wrong
            dict(nobodys, view='0'),
            dict(group, view='1', instance='0', deg='', diameters='', score=''),  # not found
            dict(group, view='1', instance='1', deg='4', diameters='0.049', width='0.28', visible='1'),
            dict(nobodys, view='0', condition='absent')]

    def read(self, rows):
        self.write('a/trials-0-of-1.csv', self.trials)
        self.write('a/instances-0-of-1.csv', rows, SIGHTINGS)
        notes = []
        return trials.read_trials([self.path('a')], notes), trials.read_sightings([self.path('a')], notes)

    def test_recall_and_precision(self):
        table, = detection_tables.tables_of(*self.read(self.sightings))
        group, absent = table.rows
        self.assertEqual((group['condition'], group['images'], group['instances']), ('group', 2, 4))
        self.assertEqual((group['poses'], group['wrong']), (4, 2))
        self.assertEqual((group['recall'], group['precision']), (0.5, 0.5))
        self.assertEqual((absent['images'], absent['instances'], absent['poses'], absent['wrong']), (1, 0, 1, 1))
        self.assertIn('| chair | absent | 1 | 0 |  | 1 | 1 | 0.00 [0.00, 0.79] |', table.markdown())

    def test_a_trial_that_was_written_again_counts_once(self):
        _, sightings = self.read(self.sightings[:3] + self.sightings)
        self.assertEqual(sorted(map(len, sightings.values())), [1, 2, 3])

    def test_recall_by_size_and_visibility(self):
        _, sightings = self.read(self.sightings)
        rows = [row for of_trial in sightings.values() for row in of_trial]
        self.assertEqual([(round(p[0], 3), round(p[1], 3), p[4]) for p in detection_tables.recall_by(rows, 'width')],
                         [(0.225, 0.333, 3), (0.275, 1, 1)])
        self.assertEqual([(round(p[0], 3), p[4]) for p in detection_tables.recall_by(rows, 'visible')],
                         [(0.65, 3), (0.95, 1)])

    @unittest.skipUnless(HAS_MATPLOTLIB, 'matplotlib is not installed')
    def test_page_and_plot(self):
        self.read(self.sightings)
        subprocess.run([SCRIPT, self.path('a')], check=True, capture_output=True)
        page = content(self.path('a', 'tables', 'results.md')).decode()
        self.assertIn('## What detection found (a) synthetic scenes', page)
        self.assertIn('(instances_detect.png)', page)
        self.assertTrue(os.path.exists(self.path('a', 'tables', 'instances_detect.svg')))


class Plots(unittest.TestCase):
    def test_errors_are_held_between_stages(self):
        from trial_plots import held
        rows = [{'seconds': s, 'deg': deg} for s, deg in enumerate((9, 4, math.inf, 1))]
        self.assertEqual(held(rows, 'seconds', 'deg', [0.5, 1, 2.5, 3, 9]), [9, 4, 4, 1, 1])
        self.assertIsNone(held(rows[2:3], 'seconds', 'deg', [1]))


if __name__ == '__main__':
    unittest.main()
