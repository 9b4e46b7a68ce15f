# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Trials and traces to figures, PNG and SVG; the same input gives the same bytes."""
import bisect
import math
import os

import matplotlib
matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402 (after the choice of a backend without a display)

from detection_tables import recall_by
from trial_statistics import groups
from trial_tables import CONDITIONS, LOSSES, MEAN, METHODS, SCALES, family, rank, sorting
from trials import natural

matplotlib.rcParams.update({'svg.hashsalt': 'nerf_pose_refiner', 'svg.fonttype': 'none'})
COLOURS = {'inerf': '#b2182b', 'single': '#ef8a62', 'multiple': '#2166ac', 'alignment': '#1b7837',
           'keyframes': '#e08214', 'detection': '#762a83'}
AXES = {'deg': ('rotation [degrees]', (5, 1)), 'units': ('camera centre [units]', (0.05, 0.01)),
        'diameters': ("object's centre [diameters]", (0.05, 0.01))}
STYLES = ('-', '--', '-.', ':')
GRID_POINTS = 160


def save(figure, folder, name, saved):
    """Writes both files; `saved` gets the PNG's name."""
    figure.tight_layout()
    figure.savefig(os.path.join(folder, name + '.png'), dpi=110, metadata={'Software': None})
    figure.savefig(os.path.join(folder, name + '.svg'), metadata={'Date': None})
    pyplot.close(figure)
    saved.append(name + '.png')


def series_of(rows, first=lambda row: row):
    """Rows by what a curve stands for: (label, colour, style, rows); first: the row that tells the method."""
    found = {}
    for row in rows:
        head = first(row)
        found.setdefault((head['method'], head['loss'], head['variant']), []).append(row)
    series, styles = [], {}
    for (method, loss, variant), group in sorted(found.items(), key=lambda item: (
            rank(METHODS, item[0][0]), rank(LOSSES, item[0][1]), item[0][2])):
        several = len({key[1] for key in found if key[0] == method}) > 1
        label = ' '.join(filter(None, (method, loss if several else '', variant)))
        style = STYLES[styles.setdefault(method, 0) % len(STYLES)]
        styles[method] += 1
        series.append((label, COLOURS.get(method, '#555555'), style, group))
    return series


def held(rows, axis, error, grid):
    """A trace's error at each point of the grid: the last one known there, the start's before; without a pose the
    last pose counts. None if the trace has no error at all."""
    known = [(row[axis], row[error]) for row in rows if math.isfinite(row[error])]
    if not known:
        return None
    places = [place for place, _ in known]
    return [known[max(0, bisect.bisect_right(places, x) - 1)][1] for x in grid]


def log_grid(low, high):
    step = (math.log(high) - math.log(low)) / (GRID_POINTS - 1)
    return [math.exp(math.log(low) + i * step) for i in range(GRID_POINTS - 1)] + [high]


def draw_band(axis, traces, columns, start, look):
    """Mean of the traces and one standard deviation to both sides, up to where the last trace ends.
    @param columns (name of what the axis shows, name of the error)"""
    (place, error), (label, colour, style) = columns, look
    end = max(row[place] for trace in traces for row in trace)
    grid = log_grid(start, max(end, start * 1.001))
    values = [curve for curve in (held(trace, place, error, grid) for trace in traces) if curve]
    if not values:
        return
    means = [sum(column) / len(values) for column in zip(*values)]
    deviations = [math.sqrt(sum((v - mean) ** 2 for v in column) / len(values))
                  for column, mean in zip(zip(*values), means)]
    axis.plot(grid, means, color=colour, linestyle=style, label='%s (%d)' % (label, len(values)))
    axis.fill_between(grid, [max(0, m - d) for m, d in zip(means, deviations)],
                      [m + d for m, d in zip(means, deviations)], color=colour, alpha=0.15, linewidth=0)


def plot_error_over_time(traces, folder, saved):
    """A figure for each experiment, scene and condition: errors over seconds, and over field samples."""
    chosen = [rows for first, rows in traces if family(first['experiment']) in ('table1', 'curves') and len(rows) > 1]
    parts = {}
    for rows in chosen:
        parts.setdefault((rows[0]['experiment'], rows[0]['scene'], rows[0]['condition']), []).append(rows)
    for (experiment, scene, condition), part in parts.items():
        figure, axes = pyplot.subplots(2, 2, figsize=(11, 7))
        for column, (place, name) in enumerate((('seconds', 'time [s]'), ('samples', 'field samples'))):
            positive = [row[place] for rows in part for row in rows if row[place] > 0]
            if not positive:
                continue
            for line, error in enumerate(('deg', 'units')):
                axis = axes[line][column]
                for label, colour, style, rows in series_of(part, lambda rows: rows[0]):
                    draw_band(axis, rows, (place, error), min(positive) / 2, (label, colour, style))
                axis.axhline(AXES[error][1][0], color='black', linestyle=':', linewidth=1)
                axis.set(xscale='log', xlabel=name, ylabel=AXES[error][0])
                axis.set_ylim(bottom=0)
                axis.grid(True, alpha=0.4)
        axes[0][0].legend(loc='best', fontsize='small')
        figure.suptitle('%s, %s: mean and one standard deviation' % (scene, condition))
        save(figure, folder, '_'.join(('error_over_time', experiment, scene, condition)), saved)


def plot_recalls(trials, folder, saved):
    """Fraction of the trials with an error below the abscissa, a figure for each scene and condition."""
    chosen = [trial for trial in trials if family(trial['experiment']) in ('table1', 'robot')]
    for (experiment, scene, condition), part in groups(chosen, ('experiment', 'scene', 'condition')).items():
        figure, axes = pyplot.subplots(1, 3, figsize=(12, 3.8), sharey=True)
        for axis, (error, (name, bounds)) in zip(axes, AXES.items()):
            errors = [max(row[error], 1e-6) for row in part if math.isfinite(row[error])]
            ends = (min(errors) / 2, 2 * max(errors)) if errors else (0.01, 1)
            for label, colour, style, rows in series_of(part):
                finite = sorted(max(row[error], 1e-6) for row in rows if math.isfinite(row[error]))
                shares = [i / len(rows) for i in range(len(finite) + 1)]
                axis.step([ends[0]] + finite + [ends[1]], shares + shares[-1:], where='post', color=colour,
                          linestyle=style, label='%s (%d)' % (label, len(rows)))
            for bound in bounds:
                axis.axvline(bound, color='black', linestyle=':', linewidth=1)
            axis.set(xscale='log', xlabel=name, ylim=(0, 1.02))
            axis.grid(True, alpha=0.4)
        axes[0].set_ylabel('fraction of the trials')
        axes[0].legend(loc='lower right', fontsize='small')
        figure.suptitle('%s, %s' % (scene, condition))
        save(figure, folder, '_'.join(('recall', experiment, scene, condition)), saved)


def plot_losses(rows, name, folder, saved):
    """Bars of Table II's rows, with intervals; the mean over scenes or the only scene; the paper's as diamonds."""
    for (method, condition), part in groups(rows, ('method', 'condition')).items():
        figure, axes = pyplot.subplots(1, 2, figsize=(10, 3.8), sharey=True)
        for axis, bound in zip(axes, ('< 5 deg', '< 0.05 u')):
            ours = [row for row in part if row['bound'] == bound and row['source'] == 'ours'][-1]
            losses = [loss for loss in LOSSES if loss in ours]
            places = range(len(losses))
            axis.bar(places, [ours[loss] for loss in losses], color='#2166ac', label='%s (%d a loss)' % (
                'mean' if ours['scene'] == MEAN else ours['scene'], ours['trials']))
            axis.errorbar(places, [ours[loss] for loss in losses], fmt='none', ecolor='black', capsize=3, yerr=[
                [ours[loss] - ours[loss + '_low'] for loss in losses],
                [ours[loss + '_high'] - ours[loss] for loss in losses]])
            for row in part:
                if row['bound'] == bound and row['source'] == 'paper':
                    axis.plot(places, [row[loss] for loss in losses], 'D', color='#ef8a62', label='the paper')
            axis.set_xticks(list(places), losses, rotation=30, ha='right')
            axis.set(title=bound, ylim=(0, 1.02))
            axis.grid(True, axis='y', alpha=0.4)
        axes[0].set_ylabel('fraction of the trials')
        axes[0].legend(loc='lower left', fontsize='small')
        figure.suptitle('%s, %s' % (method, condition))
        save(figure, folder, '_'.join((name, method, condition)), saved)


def plot_noise(rows, protocol, name, folder, saved):
    """A heat map for each scene and for their mean: joint fractions, by condition and by method and loss."""
    scale = SCALES.get(protocol, SCALES['paper'])[0]
    for (scene,), part in groups(rows, ('scene',)).items():
        conditions = sorted({row['condition'] for row in part}, key=lambda c: rank(CONDITIONS, c))
        found = {}
        for row in sorted(part, key=lambda row: sorting(row)[2:]):
            label = ' '.join(filter(None, (row['method'], row['loss'], row['variant'])))
            found.setdefault(label, {})[row['condition']] = row['joint_' + scale]
        cells = [[shares.get(condition, math.nan) for condition in conditions] for shares in found.values()]
        figure, axis = pyplot.subplots(figsize=(2.5 + 0.8 * len(conditions), 1.8 + 0.35 * len(found)))
        mesh = axis.pcolormesh(cells, cmap='RdYlGn', vmin=0, vmax=1, edgecolors='white')
        for y, line in enumerate(cells):
            for x, share in enumerate(line):
                if not math.isnan(share):
                    axis.text(x + 0.5, y + 0.5, '%.2f' % share, ha='center', va='center', fontsize='small')
        axis.set_xticks([x + 0.5 for x in range(len(conditions))], conditions, rotation=30, ha='right')
        axis.set_yticks([y + 0.5 for y in range(len(found))], list(found))
        axis.invert_yaxis()
        axis.set_title('%s: under 5 deg and 0.05 %s' % (scene, scale), fontsize='medium')
        figure.colorbar(mesh, ax=axis)
        save(figure, folder, '%s_%s' % (name, scene.replace(', ', '_').replace(' ', '_')), saved)


def plot_sightings(sightings, folder):
    """Recall of detection over the size of instances and over what is visible of them, a figure for each experiment.
    Returns the PNG files' names. @param sightings {key of the trial: rows}"""
    saved = []
    rows = [row for of_trial in sightings.values() for row in of_trial]
    labels = {'width': "object's diameter [widths of the image]", 'visible': 'visible part of the instance'}
    for (experiment,), part in sorted(groups(rows, ('experiment',)).items()):
        figure, axes = pyplot.subplots(1, 2, figsize=(11, 3.8), sharey=True)
        for axis, (column, label) in zip(axes, labels.items()):
            for (scene,), of_scene in sorted(groups(part, ('scene',)).items(), key=lambda item: natural(item[0][0])):
                points = recall_by(of_scene, column)
                if not points:
                    continue
                places, recalls, lows, highs, counts = zip(*points)
                axis.errorbar(places, recalls, fmt='o-', capsize=3, label='%s (%d)' % (scene, sum(counts)), yerr=[
                    [recall - low for recall, low in zip(recalls, lows)],
                    [high - recall for recall, high in zip(recalls, highs)]])
            axis.set(xlabel=label, ylim=(0, 1.02))
            axis.grid(True, alpha=0.4)
        axes[0].set_ylabel('fraction found')
        axes[0].legend(loc='lower right', fontsize='small')
        figure.suptitle('%s: instances found within 5 deg and 0.05 d' % experiment)
        save(figure, folder, 'instances_' + experiment, saved)
    return saved


def plot_all(trials, traces, tables, folder):
    """Draws everything into a folder. Returns the PNG files' names, in the order of the page."""
    saved = []
    plot_error_over_time(traces, folder, saved)
    plot_recalls(trials, folder, saved)
    for table in tables:
        if family(table.experiment) == 'losses':
            plot_losses(table.rows, table.name, folder, saved)
        elif family(table.experiment) == 'noise' and table.views:
            plot_noise(table.rows, table.protocol, table.name, folder, saved)
    return saved
