# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""From a folder of photos, or a video, to a model of the object and a report: the steps, in their order."""
import dataclasses
import os

import numpy as np

from photos import poses
from photos.common import locked, require, whole_folder
from photos.dataset import posed_photos, write_dataset
from photos.job import Job, write_options
from photos.missing import angles
from photos.object_masks import VERSION, drawn_masks, mask_photos, take_cut_outs, take_drawn_masks
from photos.object_region import find_region
from photos.point_cloud import with_points
from photos.quality import RENDERED_SIDE, SURE, measure
from photos.report import write_report
from photos.steps import file_states
from photos.targets import parse_target
from photos.tools import find_tool, run_tool
from photos.turntable import render_strip


def make_object(options):
    """All of it; another process that makes the same object is waited for. @return the facts of the report."""
    with locked(options.output):
        return run_steps(Job(options))


def run_steps(job):
    options = job.options
    if options.learn:
        find_tool('train', options.tools)  # before hours of work, as what else can be missing
    drawn = drawn_masks(options.masks) if options.masks else []
    write_options(options)
    job.take_photos()
    reconstruction, facts = poses.find_poses(job)
    if options.board:
        poses.board_corners(job)
    chosen = [options.poses, options.board, options.length, options.box, options.metres_per_unit, file_states(drawn),
              VERSION]
    facts = job.steps.run('object', [*chosen, facts], [job.path('dataset')],
                          lambda: find_object(job, reconstruction, facts, drawn))
    if options.learn:
        model = learn(job)
        quality = job.steps.run('quality', [RENDERED_SIDE, SURE], [job.path('renderings')],
                                lambda: compare(job, not model.get('exposure_spread')))
        facts = {**facts, 'model': model, 'quality': quality}
        job.steps.run('turntable', [], [job.path('turntable.jpg')], lambda: turntable(job, facts['box']))
    facts = {'name': options.name, **facts, 'seconds': job.steps.seconds}
    write_report(job, facts)
    return facts


def without_distortion(photos, reconstruction):
    """The reconstruction with the cameras of undistorted photos, which are one a photo."""
    return dataclasses.replace(reconstruction, cameras=[photo.camera for photo in photos],
                               camera_of=np.arange(len(photos)))


def find_object(job, reconstruction, facts, drawn):
    """Frame, scale, box and masks; writes the dataset. @param drawn paths of the user's masks.
    @return what is known of them."""
    target = {}, None
    if job.options.board:
        target = poses.board_corners(job), parse_target(job.options.board)
    photos = posed_photos(reconstruction, job.path('photos'), job.sources())
    if job.options.poses == 'board':
        reconstruction = with_points(without_distortion(photos, reconstruction), [photo.image for photo in photos])
    take_drawn_masks(photos, drawn)
    take_cut_outs(photos, job.path('photos'))
    region = find_region(job, reconstruction, target, photos)
    moved = region.reconstruction
    for photo, R, t in zip(photos, moved.R, moved.t):
        photo.R, photo.t = R, t
    agreements, box = mask_photos(photos, region)
    write_dataset(photos, box, region.metres_per_unit, job.path('dataset'))
    azimuth, elevation = angles(moved.centres(), 0.5 * (box[0] + box[1]))
    options = job.options
    return {**facts, 'made_with': {'poses': options.poses, 'board': options.board, 'box': options.box},
            'box': [corner.tolist() for corner in box], 'metres_per_unit': region.metres_per_unit,
            'scale_sigma': region.sigma, 'frame': region.origin, 'object_points': len(region.points),
            'size': (box[1] - box[0]).tolist(),
            'views': [{'name': photo.name, 'source': photo.source, 'azimuth_deg': float(a), 'elevation_deg': float(e),
                       'mask_agreement': agreement, 'mask_drawn': photo.mask is photo.drawn or photo.mask is photo.cut_out,
                       'error_px': error}
                      for photo, agreement, a, e, error in zip(photos, agreements, azimuth, elevation,
                                                               photo_errors(moved))]}


def photo_errors(reconstruction):
    """Median reprojection error of each photo [px]."""
    errors = reconstruction.errors()
    return [float(np.median(errors[reconstruction.photo_of == i])) if np.any(reconstruction.photo_of == i) else None
            for i in range(len(reconstruction.names))]


def learn(job):
    """Runs train. @return what it prints."""
    model = job.path(job.options.name + '.safetensors')
    tool = find_tool('train', job.options.tools)
    return job.steps.run('training', job.options.train, [model], lambda: run_tool(
        tool, [job.path('dataset'), '-o', model, '--name', job.options.name, *job.options.train]))


def renderer(job):
    """The program render and how it is to be called."""
    backend = [word for word in job.options.train if 'backend' in word]
    require(not backend or '=' in backend[0], 'write --backend=NAME')
    return [find_tool('render', job.options.tools), *backend]


def turntable(job, box):
    return render_strip(renderer(job), job.path(job.options.name + '.safetensors'), box, job.path('turntable.jpg'))


def compare(job, are_equal):
    """Renders all photos and measures how well each is shown. @param are_equal: the photos' exposures"""
    tool, *backend = renderer(job)
    model = job.path(job.options.name + '.safetensors')
    with whole_folder(job.path('renderings')) as folder:
        for part in ('train', 'test'):
            transforms = job.path('dataset', f'transforms_{part}.json')
            if os.path.exists(transforms):
                run_tool(tool, [model, '--transforms', transforms, '-o', folder, '--max-size', RENDERED_SIDE, *backend])
        return measure(job.path('dataset'), folder, are_equal)
