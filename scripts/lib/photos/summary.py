# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What came out, in figures and in sentences of advice."""
import os

import numpy as np

from photos.common import count
from photos.missing import direction_advice, summary

GOOD_PSNR_DB = 26
FEW_PHOTOS = 30
POOR_AGREEMENT = 0.85     # of a mask with what the others say
UNLIKE_DB = 6             # below the median photo: something is wrong with this one
HIGH_ERROR_PX = 1.5
HIGH_SIGMA = 0.003
LARGE_SPREAD = 0.1        # of the exposures


def held_out_psnr_db(facts):
    """Mean over the held-out photos, on the object; None without a model."""
    values = [row['psnr_object_db'] for row in facts.get('quality', ()) if row['held_out'] and row['psnr_object_db']]
    return float(np.mean(values)) if values else None


def size_text(facts):
    size = np.array(facts['size'])
    if facts['metres_per_unit'] > 0:
        return ' x '.join(f'{1000 * facts["metres_per_unit"] * s:.0f}' for s in size) + ' mm'
    return ' : '.join(f'{s / size.max():.2f}' for s in size) + ' (scale unknown)'


def unlike_photos(facts):
    """Photos that the model shows much worse than the others."""
    rows = [row for row in facts.get('quality', ()) if row['psnr_object_db'] is not None]
    if not rows:
        return []
    usual = np.median([row['psnr_object_db'] for row in rows])
    return [row['source'] for row in rows if row['psnr_object_db'] < usual - UNLIKE_DB]


def exposure_spread(facts):
    """How much the exposures of the photos differed; 0 also where they were not compared."""
    return facts.get('model', {}).get('exposure_spread') or 0


def named(sources):
    return ', '.join(sources[:4]) + (' ..' if len(sources) > 4 else '')


def advice(facts):
    """Sentences for the user, the most important first; none where all is well."""
    sentences = []
    psnr = held_out_psnr_db(facts)
    if psnr is not None and psnr < GOOD_PSNR_DB:
        sentences.append(f'The model shows held-out photos with {psnr:.1f} dB, {GOOD_PSNR_DB} dB is good: take sharper '
                         'photos in even light with fixed exposure and focus, or more of them.')
    text = summary(facts['missing'], facts['photos'])
    if text:
        sentences.append(text + '.')
    for source, why in facts['wrong'].items():
        done = 'its pose was solved again' if source in facts['solved_again'] else 'it was left out'
        sentences.append(f'{source}: {why}; {done}.')
    if facts['folded']:
        sentences.append('The object looks the same from two sides, and photos of one side were left out: put something '
                         'with texture beside it and take photos in between.')
    poor = [view['source'] for view in facts['views'] if view['mask_agreement'] < POOR_AGREEMENT and not view['mask_drawn']]
    if poor:
        sentences.append(f"The masks of {count(len(poor), 'photo')} do not agree with the others ({named(poor)}): look at "
                         'them below. A background of another colour helps.')
    if exposure_spread(facts) > LARGE_SPREAD:
        sentences.append('The exposure of the photos differs, or the object was turned in the light: fix exposure and white '
                         'balance, and move the camera instead of the object.')
    unlike = unlike_photos(facts)
    if unlike:
        sentences.append(f'The model does not look like {named(unlike)}: take these photos out if the object, the light or '
                         'the exposure was changed in them.')
    sentences += direction_advice(np.array([view['azimuth_deg'] for view in facts['views']]),
                                  np.array([view['elevation_deg'] for view in facts['views']]))
    if facts['posed'] < FEW_PHOTOS:
        sentences.append(f"{facts['posed']} photos are few: 40 to 100 give a better model.")
    if facts['error_px'] > HIGH_ERROR_PX:
        sentences.append(f"Points lie {facts['error_px']:.1f} px beside their place: the photos are blurred, the object "
                         'was moved, or the camera changed its focus.')
    if facts['metres_per_unit'] == 0:
        sentences.append('The scale is unknown, and the node refuses such a model: put a board into the scene (make_board), '
                         'or give --length or --metres-per-unit.')
    if facts['scale_sigma'] > HIGH_SIGMA:
        sentences.append(f"The scale is uncertain by {100 * facts['scale_sigma']:.1f} %: let more photos see the board, "
                         'and keep it flat.')
    return sentences


def figures(facts):
    """[(what, value as text)] for people."""
    psnr = held_out_psnr_db(facts)
    rows = [('photos with a pose', f"{facts['posed']} of {facts['photos']}"),
            ('reprojection error, median', f"{facts['error_px']:.2f} px"),
            ('size of the object', size_text(facts)),
            ('frame', facts['frame'])]
    if facts['scale_sigma'] > 0:
        rows.append(('scale, standard deviation', f"{100 * facts['scale_sigma']:.2f} %"))
    if psnr is not None:
        held_out = sum(row['held_out'] for row in facts['quality'])
        rows.append((f'PSNR on the object, {count(held_out, "held-out photo")}', f'{psnr:.1f} dB'))
        rows.append(('opacity beside the object', f"{100 * np.mean([r['alpha_outside'] for r in facts['quality']]):.1f} %"))
    spread = exposure_spread(facts)
    if spread > 0:
        rows.append(('exposure of the photos', f'differed by {100 * spread:.0f} %: each got a gain; the figures above are '
                     'with it'))
    rows.append(('time', ', '.join(f'{step} {seconds:.0f} s' for step, seconds in facts['seconds'].items())))
    return rows


def summary_of(facts, output):
    lines = [f"{facts['name']}: {os.path.join(output, 'report.html')}"]
    lines += [f'  {what}: {value}' for what, value in figures(facts)]
    lines += ['  - ' + sentence for sentence in advice(facts)]
    if 'model' in facts:
        lines.append(f"  model: {os.path.join(output, facts['name'] + '.safetensors')}")
    else:
        lines.append(f"  dataset: {os.path.join(output, 'dataset')}")
    return '\n'.join(lines)
