# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What many trials come to: fractions with intervals, percentiles, times. An error may be infinite: no pose was found."""
import math

Z95 = 1.959963984540054  # of the normal distribution, two-sided
SHARES = (  # name, what must hold together: (error, what it must be below)
    ('deg5', (('deg', 5),)), ('units005', (('units', 0.05),)), ('diameters005', (('diameters', 0.05),)),
    ('joint_units', (('deg', 5), ('units', 0.05))), ('joint_diameters', (('deg', 5), ('diameters', 0.05))),
    ('deg1', (('deg', 1),)), ('units001', (('units', 0.01),)), ('diameters001', (('diameters', 0.01),)),
    ('tight_units', (('deg', 1), ('units', 0.01))), ('tight_diameters', (('deg', 1), ('diameters', 0.01))))
ERRORS = ('deg', 'units', 'diameters')


def wilson(share, count):
    """Wilson's 95 % interval of a fraction of `count` trials (Wilson 1927; Brown et al., Stat. Sci. 2001)."""
    if count < 1:
        raise ValueError('an interval of no trials')
    square = Z95 * Z95
    middle = (share + square / (2 * count)) / (1 + square / count)
    half = Z95 / (1 + square / count) * math.sqrt(share * (1 - share) / count + square / (4 * count * count))
    # At the ends the interval ends there, too; rounding must not say otherwise.
    return (0.0 if share == 0 else middle - half), (1.0 if share == 1 else middle + half)


def percentile(values, share):
    """As the library's percentile(): linear between neighbours, infinite beyond the finite ones."""
    values = sorted(values)
    position = share * (len(values) - 1)
    below = int(position)
    rest = position - below
    if rest == 0 or math.isinf(values[below]):
        return values[below]
    if math.isinf(values[below + 1]):
        return math.inf
    return values[below] + rest * (values[below + 1] - values[below])


def within(trial, bounds):
    return all(trial[column] < bound for column, bound in bounds)


def share_of(trials, bounds):
    return sum(within(trial, bounds) for trial in trials) / len(trials)


def with_interval(name, share, count):
    low, high = wilson(share, count)
    return {name: share, name + '_low': low, name + '_high': high}


def summary(trials):
    """One row of a table: number of trials, fractions with 95 % intervals, errors, median time and field samples."""
    row = {'trials': len(trials)}
    for name, bounds in SHARES:
        row.update(with_interval(name, share_of(trials, bounds), len(trials)))
    for error in ERRORS:
        for name, share in (('median', 0.5), ('p90', 0.9)):
            row['%s_%s' % (name, error)] = percentile([trial[error] for trial in trials], share)
    row['median_s'] = percentile([trial['seconds'] for trial in trials], 0.5)
    row['median_samples'] = percentile([trial['samples'] for trial in trials], 0.5)
    return row


def mean_summary(rows):
    """The mean over scenes, each with the same weight. The intervals are those of one sample of all trials: no
    narrower than those of the strata that the scenes are. Of times and errors: the mean of the scenes' figures."""
    count = sum(row['trials'] for row in rows)
    mean = {'trials': count}
    for name, _ in SHARES:
        mean.update(with_interval(name, sum(row[name] for row in rows) / len(rows), count))
    for name in rows[0]:
        if name.startswith(('median_', 'p90_')):
            mean[name] = sum(row[name] for row in rows) / len(rows)
    return mean


def groups(trials, columns):
    """Trials by the values of columns, in the order in which they come: {values: trials}."""
    found = {}
    for trial in trials:
        found.setdefault(tuple(trial[column] for column in columns), []).append(trial)
    return found
