# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Trials to tables: one of every experiment and kind of scene, the paper's figures beside ours."""
import csv
import json
import math
import os

from trial_statistics import groups, mean_summary, share_of, summary, with_interval
from trials import natural

METHODS = ('inerf', 'single', 'multiple', 'alignment', 'keyframes', 'detection')
LOSSES = ('l1', 'l2', 'log_l1', 'relative_l2', 'mape', 'smape', 'smooth_l1')
KINDS = ('synthetic', 'forward_facing', 'masked')
CONDITIONS = ('clean', 'paper_noise', 'brightness', 'gaussian', 'poisson', 'discs', 'photo', 'occluder', 'light',
              'motion_blur', 'defocus', 'focal', 'placed', 'placed_robot', 'hidden', 'group', 'recoloured',
              'absent')
EXPERIMENTS = ('table1', 'losses', 'noise', 'robot', 'detect', 'hint', 'ablation', 'curves')
TITLES = {'table1': 'Table I', 'losses': 'Losses (Table II)', 'noise': 'Disturbed observations', 'robot':
          'Errors as robots have them', 'detect': 'Detection', 'hint': 'From an initial pose', 'ablation': 'Ablations',
          'curves': 'Optimisation curves'}
PARTS = {'synthetic': '(a) synthetic scenes', 'forward_facing': '(b) forward-facing scenes',
         'masked': '(c) photos with masks'}
SCALES = {'paper': ('units', 'u'), 'robot': ('diameters', 'd'), 'far': ('diameters', 'd')}  # what the protocol's bounds count in
MEAN = 'mean'


class Table:
    """rows: dicts with raw numbers (CSV, JSON); views: (caption, head, lines of cells) for the page."""

    def __init__(self, of, name, title, rows, views):
        """of: experiment and protocol."""
        self.experiment, self.protocol = of
        self.name, self.title, self.rows, self.views = name, title, rows, views

    def markdown(self):
        if not self.views:
            return ''
        lines = ['## ' + self.title, '']
        for caption, head, body in self.views:
            lines += [caption, ''] if caption else []
            lines += ['| %s |' % ' | '.join(cells) for cells in [head, ['---'] * len(head)] + body] + ['']
        return '\n'.join(lines)

    def write(self, folder):
        columns = list(dict.fromkeys(column for row in self.rows for column in row))
        with open(os.path.join(folder, self.name + '.csv'), 'w', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, columns, lineterminator='\n')
            writer.writeheader()
            writer.writerows({key: '' if value is None or value == math.inf else value for key, value in row.items()}
                             for row in self.rows)
        finite = [{key: None if value == math.inf else value for key, value in row.items()} for row in self.rows]
        with open(os.path.join(folder, self.name + '.json'), 'w', encoding='utf-8') as file:
            json.dump({'title': self.title, 'rows': finite}, file, indent=1, allow_nan=False)
            file.write('\n')


def family(experiment):
    """What an experiment's tables look like: losses_real as losses."""
    head = experiment.split('_')[0]
    return head if head in EXPERIMENTS else experiment


def rank(order, value):
    """Sort key: as in `order`, then the unknown ones by name."""
    return (order.index(value), []) if value in order else (len(order), natural(value))


def sorting(trial):
    """Scenes, then conditions, variants, methods and losses in the order in which tables show them."""
    return (natural(trial['scene']), rank(CONDITIONS, trial['condition']), natural(trial['variant']),
            rank(METHODS, trial['method']), rank(LOSSES, trial['loss']))


def share_cell(row, name):
    if row.get(name) is None:
        return ''
    if row.get(name + '_low') is None:
        return '%.2f' % row[name]
    return '%.2f [%.2f, %.2f]' % (row[name], row[name + '_low'], row[name + '_high'])


def number_cell(row, name):
    value = row.get(name)
    return '' if value is None else 'none' if math.isinf(value) else '%.3g' % value


def samples_cell(row):
    return '' if row.get('median_samples') is None else '%.1f M' % (row['median_samples'] / 1e6)


def name_cells(row, names):
    """The words that name a row; the paper's rows are marked."""
    cells = [row[name] for name in names]
    if row['source'] == 'paper':
        cells[names.index('method')] += ' (paper)'
    return cells


def views_of(rows, names, protocol):
    """Two tables of the same rows: fractions; errors and cost. The other scale comes last."""
    scale, letter = SCALES.get(protocol, SCALES['paper'])
    other, other_letter = SCALES['robot' if scale == 'units' else 'paper']
    shares = (('< 5 deg', 'deg5'), ('< 0.05 ' + letter, scale + '005'), ('jointly', 'joint_' + scale),
              ('< 1 deg', 'deg1'), ('< 0.01 ' + letter, scale + '001'), ('jointly', 'tight_' + scale),
              ('< 5 deg, < 0.05 ' + other_letter, 'joint_' + other))
    errors = [('%s [%s]' % (of, unit), '%s_%s' % (of, error)) for error, unit in
              (('deg', 'deg'), (scale, letter), (other, other_letter)) for of in ('median', 'p90')]
    head = list(names) + ['trials']
    return [('Fraction of the trials, with its 95 % interval:', head + [heading for heading, _ in shares],
             [name_cells(row, names) + [number_cell(row, 'trials')] + [share_cell(row, name) for _, name in shares]
              for row in rows]),
            ('Errors and cost of a trial:', list(names) + [heading for heading, _ in errors] + [
                'median [s]', 'median samples'],
             [name_cells(row, names) + [number_cell(row, name) for _, name in errors] +
              [row.get('paper_s') or number_cell(row, 'median_s'), samples_cell(row)]
              for row in rows if row['source'] == 'ours' or row.get('paper_s')])]


def paper_rows(paper, kind, method, scenes, label):
    """The paper's row of Table I for one scene, or for the mean of several; none where it has no figure."""
    part = paper['table1'].get(kind)
    known = [scene for scene in scenes if part and scene.lower() in part['scenes']]
    if not known or method not in part['deg5']:
        return []
    row = {'source': 'paper', 'scene': label if known == scenes else '%s of %s' % (label, ', '.join(known)),
           'kind': kind, 'method': method, 'loss': 'l2', 'condition': 'clean', 'variant': '', 'trials': 25 * len(known)}
    for name in ('deg5', 'units005'):
        figures = [part[name][method][part['scenes'].index(scene.lower())] for scene in known]
        printed = part['printed_mean'][name][method]
        row[name] = printed if known == part['scenes'] else round(sum(figures) / len(figures), 6)
    if known == part['scenes']:  # the paper has one time for all
        row['paper_s'] = paper['seconds'].get(method)
    return [row]


def as_in_paper(row):
    return row['loss'] == 'l2' and row['condition'] == 'clean' and not row['variant']


def beside_paper(rows, paper, kind, scenes, label):
    """Rows, each (row, its scenes), with the paper's behind those of the same method; methods that were not tried on
    these scenes last."""
    found, tried = [], set()
    for row, of_row in rows:
        found.append(row)
        if as_in_paper(row):
            tried.add(row['method'])
            found += paper_rows(paper, kind, row['method'], of_row, label)
    for method in METHODS:
        if method not in tried:
            found += paper_rows(paper, kind, method, scenes, label)
    return found


def experiment_rows(trials, paper):
    """A row for every scene, condition, variant, method and loss, and their means over the scenes.

    paper: its results, for what is to stand beside them; None: nothing is.
    """
    names = ('scene', 'condition', 'variant', 'method', 'loss')
    kind = trials[0]['kind']
    found = [dict(zip(names, values), source='ours', kind=kind, **summary(group))
             for values, group in groups(sorted(trials, key=sorting), names).items()]
    all_scenes = list(dict.fromkeys(row['scene'] for row in found))
    means = []
    for values, group in groups(sorted(found, key=lambda row: sorting(row)[1:]), names[1:]).items():
        scenes = [row['scene'] for row in group]
        if len(scenes) > 1:
            label = MEAN if scenes == all_scenes else '%s of %s' % (MEAN, ', '.join(scenes))
            means.append((dict(zip(names, (label,) + values), source='ours', kind=kind, **mean_summary(group)), scenes))
    if not paper:
        return found + [row for row, _ in means]
    rows = []
    for (scene,), group in groups(found, ('scene',)).items():
        rows += beside_paper([(row, [scene]) for row in group], paper, kind, [scene], scene)
    if means:
        rows += beside_paper(means, paper, kind, all_scenes, MEAN)
    if kind in paper['table1']:
        everything = paper['table1'][kind]['scenes']
        for method in METHODS:
            rows += paper_rows(paper, kind, method, everything, 'mean of all %d' % len(everything))
    return rows


def varying(rows, names):
    """Of these columns, scene, method, and what tells rows apart; that alignment has no loss tells nothing."""
    values = {name: {row[name] for row in rows if row['source'] == 'ours'} for name in names}
    return [name for name in names if name in ('scene', 'method') or len(values[name] - (
        {''} if name == 'loss' else set())) > 1]


def best_losses(rows, scale):
    """Of every scene, condition, variant and method with several losses: the best one against L2."""
    found = []
    for (scene, condition, variant, method), group in groups(
            [row for row in rows if row['loss']], ('scene', 'condition', 'variant', 'method')).items():
        shares = {row['loss']: row['joint_' + scale] for row in group}
        if len(shares) < 2 or 'l2' not in shares:
            continue
        best = max(shares, key=lambda loss: (shares[loss], -LOSSES.index(loss) if loss in LOSSES else -99))
        found.append({'scene': scene, 'condition': condition, 'variant': variant, 'method': method, 'best': best,
                      'best_share': shares[best], 'l2_share': shares['l2'], 'gain': shares[best] - shares['l2']})
    return found


def noise_views(rows, protocol):
    """Joint fractions: a line for each scene, method and loss, a column for each condition; and the best losses."""
    scale, letter = SCALES.get(protocol, SCALES['paper'])
    conditions = sorted({row['condition'] for row in rows}, key=lambda name: rank(CONDITIONS, name))
    names = [name for name in ('scene', 'variant', 'method', 'loss') if name != 'variant' or any(
        row['variant'] for row in rows)]
    body = []
    for values, group in groups(rows, names).items():
        cells = {row['condition']: share_cell(row, 'joint_' + scale) for row in group}
        body.append(list(values) + [cells.get(condition, '') for condition in conditions])
    views = [('Fraction of the trials under 5 deg and 0.05 %s jointly, with its 95 %% interval:' % letter,
              names + conditions, body)]
    best = best_losses(rows, scale)
    if best:
        views.append(('The best loss against L2, jointly:', ['scene', 'condition', 'method', 'best loss', 'fraction',
                                                             'L2', 'gain'],
                      [[row['scene'], row['condition'], ' '.join(filter(None, (row['method'], row['variant']))),
                        row['best'], '%.2f' % row['best_share'], '%.2f' % row['l2_share'], '%+.2f' % row['gain']]
                       for row in best]))
    return views, best


def order_of(shares):
    """Losses from the best to the worst: 'mape > l1 = l2'; shares: {loss: share}."""
    text, last = '', None
    for loss in sorted(shares, key=lambda loss: (-shares[loss], rank(LOSSES, loss))):
        text += ('' if last is None else ' = ' if shares[loss] == last else ' > ') + loss
        last = shares[loss]
    return text


def loss_rows(trials, paper):
    """Table II: a row for each method, condition, bound and scene, their mean and the paper's."""
    bounds = (('deg5', '< 5 deg', (('deg', 5),)), ('units005', '< 0.05 u', (('units', 0.05),)),
              ('joint_units', 'jointly', (('deg', 5), ('units', 0.05))))
    kind, rows = trials[0]['kind'], []
    figures = paper['table2'].get(kind, {})
    for (condition, method), part in groups(sorted(trials, key=lambda t: sorting(t)[1:4]),
                                            ('condition', 'method')).items():
        scenes = groups(sorted(part, key=lambda t: natural(t['scene'])), ('scene',))
        papers_own = method == 'single' and condition == ('paper_noise' if kind == 'synthetic' else 'clean')
        for name, heading, bound in bounds:
            found = []
            for (scene,), of_scene in scenes.items():
                of_loss = {loss: group for (loss,), group in groups(of_scene, ('loss',)).items()}
                shares = {loss: share_of(group, bound) for loss, group in of_loss.items()}
                found.append(('ours', scene, shares, {loss: len(group) for loss, group in of_loss.items()}))
            common = [loss for loss in LOSSES if all(loss in shares for _, _, shares, _ in found)]
            if len(found) > 1:
                found.append(('ours', MEAN, {loss: sum(shares[loss] for _, _, shares, _ in found) / len(found)
                                             for loss in common},
                              {loss: sum(counts[loss] for *_, counts in found) for loss in common}))
            if papers_own and name in figures:
                found.append(('paper', MEAN, {loss: figures[name][loss] for loss in common}, {}))
            for source, scene, shares, counts in found:
                row = {'source': source, 'kind': kind, 'condition': condition, 'method': method, 'bound': heading,
                       'scene': scene}
                for loss, share in sorted(shares.items(), key=lambda item: rank(LOSSES, item[0])):
                    row.update(with_interval(loss, share, counts[loss]) if loss in counts else {loss: share})
                rows.append(dict(row, trials=max(counts.values(), default=None), order=order_of(shares)))
    return rows


def loss_views(rows):
    losses = [loss for loss in LOSSES if any(loss in row for row in rows)]
    return [('%s, %s, %s:' % (method, condition, bound), ['scene'] + losses + ['order'],
             [[row['scene'] + (' (paper)' if row['source'] == 'paper' else '')] +
              [share_cell(row, loss) for loss in losses] + [row['order']] for row in part])
            for (method, condition, bound), part in groups(rows, ('method', 'condition', 'bound')).items()]


def tables_of(trials, paper):
    """All tables, in the order of the page."""
    protocols = groups(trials, ('experiment', 'protocol'))
    tables = []
    for (experiment, protocol, kind), part in sorted(
            groups(trials, ('experiment', 'protocol', 'kind')).items(),
            key=lambda item: (rank(EXPERIMENTS, family(item[0][0])), natural(item[0][0]), item[0][1],
                              rank(KINDS, item[0][2]))):
        several = sum(key[0] == experiment for key in protocols) > 1
        name = '_'.join([experiment] + [protocol] * several + [kind])
        kin = family(experiment)
        title = TITLES.get(kin, experiment) + (', %s' % experiment if kin not in (experiment, 'losses') else '')
        title += ' ' + PARTS.get(kind, kind)
        title += ' (protocol %s)' % protocol if several else ''
        if kin == 'losses':
            rows = loss_rows(part, paper)
            tables.append(Table((experiment, protocol), name, title, rows, loss_views(rows)))
            continue
        rows = experiment_rows(part, paper if kin == 'table1' and protocol == 'paper' else None)
        if kin == 'noise':
            views, best = noise_views(rows, protocol)
            tables.append(Table((experiment, protocol), name, title, rows, views))
            if best:
                tables.append(Table((experiment, protocol), name + '_best_loss', '', best, []))
        else:
            names = varying(rows, ('scene', 'condition', 'variant', 'method', 'loss'))
            tables.append(Table((experiment, protocol), name, title, rows, views_of(rows, names, protocol)))
    return tables
