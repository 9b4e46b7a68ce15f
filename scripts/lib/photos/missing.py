# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Why photos have no pose, and from which directions there are none: in plain words."""
import collections

import numpy as np

from photos.common import count

BLURRED = 0.35           # of the median sharpness
FEW_FEATURES = 0.3       # of the median number of features
FEW_PARTNERS = 2
SECTORS = 12             # of azimuth
BANDS = ((-90, 10, 'from below'), (10, 35, 'from low'), (35, 65, 'from above'), (65, 90, 'from straight above'))
WANTED_BANDS = ('from low', 'from above')
MAX_GAP_DEG = 60


def reason(copy, facts):
    """@param facts {'sharpness': median of all, 'features': {..}, 'partners': {..}} of feature and partner counts."""
    features, usual = facts['features'].get(copy.name) or 0, np.median([n or 0 for n in facts['features'].values()])
    if copy.sharpness < BLURRED * facts['sharpness']:
        return 'too blurred'
    if features < FEW_FEATURES * usual:
        return 'too little texture in view'
    if facts['partners'].get(copy.name, 0) < FEW_PARTNERS:
        return 'they overlap too little with the others'
    return 'their place does not agree with the others'


def summary(reasons, total):
    """'12 of 60 photos have no pose: 8 too blurred (a.jpg, b.jpg ..)'. @param reasons {source: reason}; '' for none."""
    if not reasons:
        return ''
    by_reason = collections.defaultdict(list)
    for source, why in reasons.items():
        by_reason[why].append(source)
    parts = [f"{len(sources)} {why} ({', '.join(sources[:3])}{' ..' if len(sources) > 3 else ''})"
             for why, sources in sorted(by_reason.items(), key=lambda item: -len(item[1]))]
    verb = 'has' if len(reasons) == 1 else 'have'
    return f"{len(reasons)} of {count(total, 'photo')} {verb} no pose: {'; '.join(parts)}"


def angles(centres, middle):
    """(azimuth, elevation) of cameras around a point, z being up [deg]."""
    offset = centres - middle
    azimuth = np.degrees(np.arctan2(offset[:, 1], offset[:, 0]))
    return azimuth, np.degrees(np.arctan2(offset[:, 2], np.hypot(offset[:, 0], offset[:, 1])))


def largest_gap(azimuth):
    """(start, width) of the largest angle around the object without a photo [deg]."""
    around = np.sort(np.asarray(azimuth) % 360)
    gaps = np.diff(np.append(around, around[0] + 360))
    widest = int(np.argmax(gaps))
    return float(around[widest]), float(gaps[widest])


def direction_advice(azimuth, elevation):
    """Sentences on directions without photos."""
    advice = []
    for low, high, name in BANDS:
        inside = (elevation >= low) & (elevation < high)
        if name in WANTED_BANDS and not inside.any():
            advice.append(f'No photos {name} ({low} to {high} degrees above the table): take a round of them.')
    around = elevation < BANDS[-1][0]
    if around.any():
        start, gap = largest_gap(azimuth[around])
        if gap > MAX_GAP_DEG:
            advice.append(f'A gap of {gap:.0f} degrees around the object has no photos (from {start:.0f} degrees on, see '
                          'the drawing of directions): the object is not known from there.')
    return advice
