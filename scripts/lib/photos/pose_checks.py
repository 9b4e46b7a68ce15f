# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Poses are not believed blindly: what tracks of points say against cameras and poses, and what is done about it."""
import dataclasses

import cv2
import numpy as np

from photos.common import count
from photos.geometry import angle_deg, focus

MIN_OBSERVATIONS = 15       # of a photo: fewer do not hold a pose
MAX_ERROR_PX = 3.0          # of a photo's median observation, at 1000 px
MAX_ERROR_RATIO = 4.0       # to the median photo's
MAX_FOCAL_SPREAD = 0.03     # of focal lengths of one camera
JUMP_RATIO = 8.0            # of a video's step to its neighbours' median step
PNP_INLIERS = 25            # that find a pose again
PNP_SHARE = 0.4             # of the photo's observations
PNP_ERROR_PX = 4.0
CLOSE_DEG = 25.0            # views so near show nearly the same
CLOSE_DISTANCE = 1.35       # ratio of their distances, at most
CLOSE_ROLL_DEG = 60.0       # of their upward directions
LOW_SHARE = 0.2             # of the common points that views so near usually have
MIN_LOW_PAIRS = 0.2         # of the close pairs: fewer are chance
MIN_GROUP = 0.12            # of the photos
MIN_BRIDGE = 0.5            # of a group's photos must be close to the other group
REGIONS = 4                 # along the points' extent
REGION_POINTS = 5           # of a region, that each of two photos sees ..
REGION_SHARE = 0.05         # .. and of these so many in common, else they see different things in one place
REGIONS_CLOSE_DEG = 20.0    # photos so near are compared
OTHER_THINGS = 0.1          # of what both see: the photos contradict each other
MIN_CONTRADICTIONS = 0.05   # of the close pairs ..
MIN_PAIRS = 4               # .. and so many: fewer are chance


@dataclasses.dataclass
class Findings:
    focal_spread: float                                # of one camera's photos, (max - min) / median
    wrong: dict = dataclasses.field(default_factory=dict)   # {index of a photo: reason}
    groups: list = dataclasses.field(default_factory=list)  # of a folded model: lists of photos; the largest first
    contradictions: list = dataclasses.field(default_factory=list)  # pairs of photos, the worst first

    def is_good(self):
        return not (self.wrong or self.groups or self.contradictions) and self.focal_spread <= MAX_FOCAL_SPREAD


def focal_spread(reconstruction):
    """The largest spread of focal lengths among photos of equal size."""
    focals = {}
    for i in reconstruction.camera_of:
        camera = reconstruction.cameras[i]
        focals.setdefault((camera.width, camera.height), []).append(camera.focal)
    return max((max(values) - min(values)) / float(np.median(values)) for values in focals.values())


def photo_errors(reconstruction):
    """Median reprojection error of each photo [px of a photo 1000 px wide or high]; infinite without observations."""
    errors = reconstruction.errors()
    medians = np.full(len(reconstruction.names), np.inf)
    for photo in range(len(medians)):
        of_photo = errors[reconstruction.photo_of == photo]
        camera = reconstruction.cameras[reconstruction.camera_of[photo]]
        if len(of_photo):
            medians[photo] = np.median(of_photo) * 1000 / max(camera.width, camera.height)
    return medians


def contradicted(reconstruction):
    """{photo: reason} of those that the tracks contradict."""
    found = {}
    observations = np.bincount(reconstruction.photo_of, minlength=len(reconstruction.names))
    medians = photo_errors(reconstruction)
    limit = max(MAX_ERROR_PX, MAX_ERROR_RATIO * float(np.median(medians)))
    for photo, (seen, error) in enumerate(zip(observations, medians)):
        if seen < MIN_OBSERVATIONS:
            found[photo] = f'only {count(int(seen), "point")} of the others seen'
        elif error > limit:
            found[photo] = f'the points that it sees lie {error:.0f} px beside where its pose puts them'
    return found


def jumps(reconstruction):
    """{photo: reason} of frames of a video that lie far from the frames before and after them."""
    centres = reconstruction.centres()
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    found = {}
    for i in range(1, len(centres) - 1):
        usual = np.median(np.delete(steps[max(0, i - 6):i + 6], [min(i, 6) - 1, min(i, 6)]))
        skipped = np.linalg.norm(centres[i + 1] - centres[i - 1])
        if min(steps[i - 1], steps[i]) > JUMP_RATIO * usual and skipped < 0.5 * min(steps[i - 1], steps[i]):
            found[i] = 'it lies far from the frames before and after it'
    return found


# Folded models: an object that looks the same from two sides is put together as one side, and cameras of both sides
# come to lie in one place. Close views then share points of what looks the same, and none of what surrounds it, be it
# all that the photos show beside it or the object's other sides.

def common_shares(reconstruction):
    """[photos][photos]: points that two photos share, of those that the poorer one has."""
    n = len(reconstruction.names)
    seen = np.zeros((n, len(reconstruction.xyz)), np.float32)
    seen[reconstruction.photo_of, reconstruction.point_of] = 1
    own = seen.sum(axis=1)
    return seen @ seen.T / np.maximum(1, np.minimum(own[:, None], own[None, :]))


def close_pairs(reconstruction):
    """(first, second, angle [deg]) of photos that look from one direction at one distance, upright alike."""
    to_camera = reconstruction.centres() - focus(reconstruction)
    distance = np.linalg.norm(to_camera, axis=1)
    direction = to_camera / distance[:, None]
    angle = np.degrees(np.arccos(np.clip(direction @ direction.T, -1, 1)))
    ratio = distance[:, None] / distance[None, :]
    turn = angle_deg(np.einsum('aij,bkj->abik', reconstruction.R, reconstruction.R))
    close = (angle < CLOSE_DEG) & (ratio < CLOSE_DISTANCE) & (ratio > 1 / CLOSE_DISTANCE) & (turn < CLOSE_ROLL_DEG)
    first, second = np.nonzero(np.triu(close, 1))
    return first, second, angle[first, second]


def usual_shares(angles, shares):
    """What views at each angle usually share: a line through the upper quartiles of near and far pairs. Nearer views share
    more, whatever the near pairs here do."""
    near = angles < np.median(angles)
    points = [(np.median(angles[half]), np.quantile(shares[half], 0.75)) for half in (near, ~near) if half.any()]
    at, usual = map(np.array, zip(*points))
    return np.interp(angles, at, np.maximum.accumulate(usual[::-1])[::-1])


def components(n, edges):
    """Lists of the nodes that hang together, the largest first."""
    parent = np.arange(n)

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for a, b in edges:
        parent[root(a)] = root(b)
    groups = {}
    for i in range(n):
        groups.setdefault(root(i), []).append(i)
    return sorted(groups.values(), key=lambda group: -len(group))


def folded_groups(reconstruction):
    """Groups of photos that look from the same places and yet share no points, each a real side of a folded object;
    none in a good model."""
    n = len(reconstruction.names)
    first, second, angles = close_pairs(reconstruction)
    if len(first) < n:
        return []
    shares = common_shares(reconstruction)[first, second]
    low = shares < LOW_SHARE * usual_shares(angles, shares)
    if np.mean(low) < MIN_LOW_PAIRS:
        return []
    groups = [group for group in components(n, zip(first[~low], second[~low])) if len(group) >= max(4, MIN_GROUP * n)]
    if len(groups) < 2:
        return []
    number = np.full(n, -1)
    for i, group in enumerate(groups):
        number[group] = i
    between = low & (number[first] >= 0) & (number[second] >= 0) & (number[first] != number[second])
    bridged = np.unique(np.concatenate((first[between], second[between])))
    smaller = min(len(group) for group in groups[:2])
    return groups if len(bridged) >= MIN_BRIDGE * smaller else []


def regions_of(points):
    """The number of the cube that each point lies in."""
    middle = np.median(points, axis=0)
    size = 2 * np.median(np.abs(points - middle).max(axis=1)) / REGIONS
    return np.unique(np.floor((points - middle) / size).astype(int), axis=0, return_inverse=True)[1].ravel()


def contradicting_pairs(reconstruction):
    """Close photos that see points in the same places, but others, worst first; none in a good model. Which side of the
    object each photo of such a model shows cannot be told: some show what is the same on both."""
    first, second, angles = close_pairs(reconstruction)
    pairs = [pair for pair, angle in zip(zip(first.tolist(), second.tolist()), angles) if angle < REGIONS_CLOSE_DEG]
    seen = np.zeros((len(reconstruction.names), len(reconstruction.xyz)), bool)
    seen[reconstruction.photo_of, reconstruction.point_of] = True
    region = regions_of(reconstruction.xyz)

    def count_of(points):
        return np.bincount(region[points], minlength=region.max() + 1)
    counts, contradictions = [count_of(points) for points in seen], {}
    for i, j in pairs:
        fewer, common = np.minimum(counts[i], counts[j]), count_of(seen[i] & seen[j])
        fewer[fewer < REGION_POINTS] = 0
        other = fewer[common <= REGION_SHARE * fewer].sum() / max(1, fewer.sum())
        if other > OTHER_THINGS:
            contradictions[i, j] = other
    if len(contradictions) < max(MIN_CONTRADICTIONS * len(pairs), MIN_PAIRS):
        return []
    return sorted(contradictions, key=lambda pair: -contradictions[pair])


def check(reconstruction, is_sequence=False):
    """What is wrong with a reconstruction."""
    findings = Findings(focal_spread(reconstruction), contradicted(reconstruction))
    if is_sequence:
        for photo, reason in jumps(reconstruction).items():
            findings.wrong.setdefault(photo, reason)
    findings.groups, findings.contradictions = folded_groups(reconstruction), contradicting_pairs(reconstruction)
    return findings


def contradiction_of(findings, names):
    i, j = findings.contradictions[0]
    return f'{names[i]} and {names[j]} show different things in the same place'


def sentences(findings, names):
    """What is wrong, in words; none if all is well."""
    if findings.focal_spread > MAX_FOCAL_SPREAD:
        yield f'focal lengths of one camera differ by {100 * findings.focal_spread:.0f} %'
    for group in findings.groups[1:]:
        yield f'it is folded: {count(len(group), "photo")} ({names[group[0]]} ..) show another side that looks the same'
    if findings.contradictions:
        yield f'it is folded: {contradiction_of(findings, names)}'
    for photo, why in findings.wrong.items():
        yield f'{names[photo]}: {why}'


# Repair

def pose_again(reconstruction, photo, trusted):
    """(R, t) of a photo from points that other photos hold, or None. @param trusted [points] of bool."""
    held = (reconstruction.photo_of == photo) & trusted[reconstruction.point_of]
    if np.count_nonzero(held) < PNP_INLIERS:
        return None
    camera = reconstruction.cameras[reconstruction.camera_of[photo]]
    limit = PNP_ERROR_PX * max(camera.width, camera.height) / 1000
    points, pixels = reconstruction.xyz[reconstruction.point_of[held]], reconstruction.xy[held] - 0.5
    cv2.setRNGSeed(1)
    found, r, t, inliers = cv2.solvePnPRansac(points, pixels, camera.matrix(), camera.parameters[4:],
                                              iterationsCount=2000, reprojectionError=limit, flags=cv2.SOLVEPNP_EPNP)
    if not found or inliers is None or len(inliers) < max(PNP_INLIERS, PNP_SHARE * np.count_nonzero(held)):
        return None
    r, t = cv2.solvePnPRefineLM(points[inliers[:, 0]], pixels[inliers[:, 0]], camera.matrix(), camera.parameters[4:], r, t)
    return cv2.Rodrigues(r)[0], t[:, 0]


def repaired(reconstruction, wrong):
    """Poses of the wrong photos from the points of the others; those for which that fails are left out.
    @return (reconstruction, indices solved again, indices left out)."""
    good = ~np.isin(reconstruction.photo_of, list(wrong))
    trusted = np.bincount(reconstruction.point_of[good], minlength=len(reconstruction.xyz)) >= 2
    R, t, solved, left_out = reconstruction.R.copy(), reconstruction.t.copy(), [], []
    for photo in wrong:
        pose = pose_again(reconstruction, photo, trusted)
        if pose is None:
            left_out.append(photo)
        else:
            R[photo], t[photo] = pose
            solved.append(photo)
    kept = [i for i in range(len(reconstruction.names)) if i not in left_out]
    return dataclasses.replace(reconstruction, R=R, t=t).of_photos(kept), solved, left_out
