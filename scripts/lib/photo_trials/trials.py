# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Each trial renders a set of photos, runs photos_to_object on it, and says which bars are missed."""
import dataclasses
import os
import subprocess

import numpy as np

from photo_trials import spoiled
from photo_trials.reference import figures_of_masks, quality_with_true_masks, reference_quality, report_of
from photo_trials.truth import mask_as_found, pose_errors, read_found, read_truth
from photos.common import InputError, require

SCRIPTS = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
MAX_TURN_DEG = 0.1
MAX_SHIFT_M = 0.0005
MAX_SCALE = 0.003
MAX_PSNR_LOSS_DB = 1.5
# Good sets that differ in everything: table and place of the board, by the seed.
GOOD = (('wood', 'beside'), ('cloth', 'below'), ('newspaper', 'beside'), ('marble', 'none'), ('plain', 'below'))


@dataclasses.dataclass
class Settings:
    what: str
    seed: int
    seeds: list
    cache: str
    tools: str
    jobs: int
    photos: int
    size: list
    train: list

    def training(self):
        return [f'--{word}' for word in self.train]

    def path(self, *names):
        return os.path.join(self.cache, *names)


def photo_set(settings, name, *options):
    """The folder of a rendered set."""
    folder = settings.path(f'{name}_{settings.seed}')
    command = [os.path.join(SCRIPTS, 'make_photo_set'), str(settings.seed), '--out', folder, '--jobs', str(settings.jobs),
               '--photos', str(settings.photos), '--size', *map(str, settings.size), *options]
    made = subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode == 0
    require(made and len(os.listdir(os.path.join(folder, 'photos'))) == settings.photos, f"no photos in '{folder}'")
    return folder


def make_object(settings, photos, output, *options):
    """Runs photos_to_object. @return its report"""
    os.makedirs(settings.cache, exist_ok=True)
    command = [os.path.join(SCRIPTS, 'photos_to_object'), photos, '-o', output, '--name', 'object', *options,
               *(['--tools', settings.tools] if settings.tools else []), *settings.training()]
    with open(output + '.log', 'w', encoding='utf-8') as log:
        if subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False).returncode != 0:
            with open(output + '.log', encoding='utf-8') as said:
                raise InputError(f'photos_to_object failed: {said.read().splitlines()[-1]}')
    return report_of(output)


def figures_of_poses(errors):
    """Medians and 90th percentiles, in degrees and millimetres."""
    figures = {'scale_percent': round(100 * errors['scale'], 3)}
    for name, factor in (('turn_deg', 1), ('shift_m', 1000), ('board_turn_deg', 1), ('board_shift_m', 1000)):
        if name in errors:
            shown = name.replace('_m', '_mm')
            figures[shown] = round(factor * float(np.median(errors[name])), 3)
            figures[shown + '_p90'] = round(factor * float(np.quantile(errors[name], 0.9)), 3)
    return figures


def missed(bars):
    """@param bars {sentence: whether it holds}"""
    return [text for text, holds in bars.items() if not holds]


def object_trial(settings):
    """No poses given: structure from motion, scale, plane, masks, object."""
    table, board = GOOD[(settings.seed - 1) % 3]
    folder = photo_set(settings, 'object', '--table', table, '--board', board)
    truth, output = read_truth(folder), settings.path(f'object_{settings.seed}_result')
    report = make_object(settings, os.path.join(folder, 'photos'), output, '--board', truth.board)
    found = read_found(os.path.join(output, 'dataset'))
    errors, aligned = pose_errors(truth, found)
    masks = [mask_as_found(truth, photo, T) for photo, T in zip(found, aligned)]
    held_out = [i for i, photo in enumerate(found) if photo.held_out]
    rows = quality_with_true_masks(output, [found[i] for i in held_out], [masks[i] for i in held_out])
    reference = [row for row in reference_quality(truth, found, settings.path(f'object_{settings.seed}_reference'),
                                                  (settings.tools, settings.training())) if row['held_out']]
    psnr, best = (float(np.mean([row['psnr_object_db'] for row in some])) for some in (rows, reference))
    figures = {'posed': len(found), 'photos': settings.photos, **figures_of_poses(errors), 'psnr_db': round(psnr, 2),
               'psnr_of_exact_db': round(best, 2), 'alpha_outside': round(float(np.mean([r['alpha_outside'] for r in rows])), 4),
               **figures_of_masks(output, found, masks), 'seconds': report['seconds']}
    return figures, missed({'poses': np.median(errors['turn_deg']) <= MAX_TURN_DEG, 'scale': errors['scale'] <= MAX_SCALE,
                            'psnr': psnr >= best - MAX_PSNR_LOSS_DB, 'all posed': len(found) == settings.photos})


def board_trial(settings):
    """Poses of the board alone."""
    folder = photo_set(settings, 'board', '--board', 'beside', '--aim', '0.5', '--table', 'plain', '--room', '0',
                       '--distance', '0.5', '--elevations', '35', '60', '--samples', '6', '--upright', '3')
    truth, output = read_truth(folder), settings.path(f'board_{settings.seed}_result')
    make_object(settings, os.path.join(folder, 'photos'), output, '--board', truth.board, '--poses', 'board',
                '--no-training')
    found = read_found(os.path.join(output, 'dataset'))
    errors, _ = pose_errors(truth, found)
    figures = {'posed': len(found), 'photos': settings.photos, **figures_of_poses(errors)}
    return figures, missed({'turn': np.median(errors['board_turn_deg']) <= MAX_TURN_DEG,
                            'shift': np.median(errors['board_shift_m']) <= MAX_SHIFT_M,
                            'scale': errors['scale'] <= MAX_SCALE, 'all posed': len(found) == settings.photos})


def faults_of(report):
    return {name: report[name] for name in ('missing', 'wrong', 'folded', 'other_groups', 'given_model') if report[name]}


def good_trial(settings):
    """Good sets, without poses and with those of COLMAP: nothing is wrong with them."""
    table, board = GOOD[(settings.seed - 1) % len(GOOD)]
    folder = photo_set(settings, 'good', '--table', table, '--board', board)
    output = settings.path(f'good_{settings.seed}_result')
    options = ['--board', read_truth(folder).board] if board != 'none' else []
    report = make_object(settings, os.path.join(folder, 'photos'), output, '--no-training', *options)
    given = spoiled.model_of(output)
    alarms = {**faults_of(report), **({'as given': spoiled.faults(given)} if spoiled.faults(given) else {})}
    truth, found = read_truth(folder), read_found(os.path.join(output, 'dataset'))
    errors, aligned = pose_errors(truth, found)
    masks = figures_of_masks(output, found, [mask_as_found(truth, photo, T) for photo, T in zip(found, aligned)])
    return ({'table': table, 'board': board, **figures_of_poses(errors), **masks, 'alarms': alarms},
            missed({'no alarm': not alarms}))


def wrong_trial(settings):
    """A good set's model with faults put into it, and a set that folds by itself."""
    good_trial(settings)
    given = spoiled.model_of(settings.path(f'good_{settings.seed}_result'))
    figures, bars = {}, {}
    for name, spoil in (('focal lengths', spoiled.with_focal_lengths), ('wrong poses', spoiled.with_wrong_poses)):
        model, expected = spoil(given, settings.seed)
        result = spoiled.judged(model, given, expected)
        figures[name], bars[name] = result, result['found'] and not result['falsely named']
    folder = photo_set(settings, 'folded', '--object', 'twin', '--table', 'plain', '--board', 'none', '--room', '0',
                       '--elevations', '12', '24')
    output = settings.path(f'folded_{settings.seed}_result')
    try:
        report = make_object(settings, os.path.join(folder, 'photos'), output, '--no-training')
        errors, _ = pose_errors(read_truth(folder), read_found(os.path.join(output, 'dataset')))
        figures['folded'] = {'named': faults_of(report), 'posed': report['posed'], **figures_of_poses(errors)}
        worst = max(errors['turn_deg'])
        bars['folded'] = bool(worst < 2)  # what is left hangs together, or was never folded
    except InputError as error:
        figures['folded'], bars['folded'] = {'refused': str(error)}, True
    return figures, missed(bars)


TRIALS = {'object': object_trial, 'board': board_trial, 'good': good_trial, 'wrong': wrong_trial}
