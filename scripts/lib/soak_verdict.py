# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What scripts/soak concludes: whether anything has grown, and whether each image is accounted for."""
import numpy as np

UNPAIRED = 6  # images without camera_info, at most, each time that the node subscribes
WARM_UP = 0.25  # of the cycles, at least one
MEMORY_MIB = 4  # that the last third of the cycles may have more than the first one, after the warm-up
SIGNIFICANT = 2.33  # standard deviations: one series in a hundred without a trend has as much


def unaccounted(counts, cycles):
    """@param cycles their number: in each the node subscribes anew. @return counts that do not agree, as text."""
    problems = []
    if counts['arrived images'] + counts['images lost before'] != counts['published']:
        problems.append('%(published)d images were published, %(arrived images)d arrived, %(images lost before)d were '
                        'lost before' % counts)
    # When the node subscribes, images may come some moments before camera_info does.
    if counts['images with camera_info'] < counts['arrived images'] - UNPAIRED * (cycles + 1):
        problems.append('%(arrived images)d images arrived, %(images with camera_info)d with camera_info' % counts)
    ends = sum(counts[name] for name in ('refused images', 'skipped images', 'refined images', 'dropped images'))
    if ends != counts['images with camera_info']:
        problems.append('%d images were refined, dropped, refused or skipped, of %d'
                        % (ends, counts['images with camera_info']))
    return problems


def rises(values):
    """Whether a series has a trend upwards (Mann 1945). Resident memory scatters by more than a short run's leak: the C
    library keeps freed memory now in one heap, now in another."""
    n = len(values)
    pairs = sum(np.sign(values[j] - values[i]) for j in range(n) for i in range(j))
    return pairs > SIGNIFICANT * np.sqrt(n * (n - 1) * (2 * n + 5) / 18)


def verdict(cycles, counts):
    """@param cycles measurements at equal points. @return what does not hold, as text."""
    problems = unaccounted(counts, len(cycles))
    if sum(c['wrong'] for c in cycles):
        problems.append('%d wrong poses' % sum(c['wrong'] for c in cycles))
    if not cycles[-1]['registered']:
        problems.append('no object could be registered beside tracking')
    warm = cycles[max(1, int(WARM_UP * len(cycles))):]
    third = len(warm) // 3
    if not third:
        return problems + ['too short for what grows: at least five cycles are needed']

    def growth(name):
        return np.median([c[name] for c in warm[-third:]]) - np.median([c[name] for c in warm[:third]])
    for name, has_grown in (('allocated [MiB]', True), ('memory [MiB]', rises([c['memory [MiB]'] for c in warm]))):
        if has_grown and growth(name) > MEMORY_MIB:
            problems.append('%s has grown by %.1f' % (name, growth(name)))
    for name in ('descriptors', 'threads'):
        before, after = (min(c[name] for c in part) for part in (warm[:third], warm[-third:]))
        if after > before:
            problems.append('%s have grown from %d to %d' % (name, before, after))
    return problems
