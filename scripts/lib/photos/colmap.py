# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Structure from motion by COLMAP's program: features, matching, mapping; with progress, a time limit and a log."""
import os
import re
import shutil
import signal
import subprocess
import sys
import threading

from photos import principal_point
from photos.common import require, whole_folder, write_text
from photos.intake import CUT_OUTS
from photos.pairs import pairs_of_database
from photos.reconstruction import move_principal_points, read_reconstruction

PROGRAM = 'colmap'
MAX_FEATURES = 4096
FEATURE_SIDE = 1600            # features are found at this size at most [px]
OVERLAP = 10                   # of a video's frames: matched with so many that follow, and with the 2nd, 4th, 8th ..
# Without EXIF: focal length over the larger side of a photo. Telephones have 0.7 to 0.85, webcams 0.8 to 1.1.
DEFAULT_FOCAL = 0.85
PROGRESS = (re.compile(r'Processed file \[(\d+)/(\d+)\]'), re.compile(r'Matching block \[(\d+)/(\d+)'),
            re.compile(r'Matching image \[(\d+)/(\d+)\]'), re.compile(r'Registering image #\d+ \((\d+)\)'))
LOG_LINES = 5                  # that an error quotes
NO_PAIRS = ('no two photos show the same thing from two places: take photos that overlap by two thirds, of something with '
            'texture (a newspaper below the object helps)')


class Colmap:
    """COLMAP with a log of what it says. @param limit_s of each command [s]; threads: 0 for all cores."""

    def __init__(self, log, limit_s, threads=0):
        require(shutil.which(PROGRAM), "COLMAP is not installed, which finds where photos were taken: sudo apt-get "
                "install --no-install-recommends colmap (or take the photos with a board: --poses board)")
        self.log, self.limit_s, self.threads = log, limit_s, threads

    def run(self, command, **options):
        """One of COLMAP's commands; `A__b=c` is the option --A.b c."""
        words = [PROGRAM, command]
        for name, value in options.items():
            words += ['--' + name.replace('__', '.'), str(value)]
        environment = {**os.environ, 'QT_QPA_PLATFORM': 'offscreen'}
        with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                              env=environment, start_new_session=True, errors='replace') as process:
            timer = threading.Timer(self.limit_s, os.killpg, (process.pid, signal.SIGKILL))
            timer.start()
            try:
                last = self.follow(process.stdout, command)
                status = process.wait()
            except BaseException:
                os.killpg(process.pid, signal.SIGKILL)
                raise
            finally:
                timed_out = not timer.is_alive()
                timer.cancel()
        require(not timed_out, f'colmap {command} took more than {self.limit_s:.0f} s: take fewer photos, or give '
                '--max-minutes')
        require(status == 0, f"colmap {command} failed (exit code {status}); '{self.log}' ends with: " + ' / '.join(last))

    def follow(self, lines, command):
        """Logs the lines and shows progress on a terminal. @return the last ones."""
        last = []
        with open(self.log, 'a', encoding='utf-8') as log:
            log.write(f'== {command}\n')
            for line in lines:
                log.write(line)
                if line.strip():
                    last = last[1 - LOG_LINES:] + [line.strip()]
                found = next(filter(None, (pattern.search(line) for pattern in PROGRESS)), None)
                if found and sys.stdout.isatty():
                    print('\r  ' + command.replace('_', ' ') + ' ' + '/'.join(found.groups()) + '   ', end='', flush=True)
        if sys.stdout.isatty():
            print('\r' + 60 * ' ' + '\r', end='', flush=True)
        return last

    def thread_option(self):
        return self.threads if self.threads > 0 else -1


def all_cut_out(photos, cameras):
    folders = [(os.path.join(photos, f'camera_{i}'), os.path.join(photos, CUT_OUTS, f'camera_{i}')) for i in range(cameras)]
    return all(os.path.isdir(masks) and len(os.listdir(masks)) == len(os.listdir(copies)) for copies, masks in folders)


def find_features(colmap, database, photos, cameras):
    """Features of all photos; if all are cut out, those of the object alone. @param photos folder with camera_0, camera_1 ..;
    cameras [{width, height, focal_px}]."""
    for i, camera in enumerate(cameras):
        options = {}
        if camera['focal_px']:
            values = camera['focal_px'], camera['width'] / 2, camera['height'] / 2, 0, 0
            options['ImageReader__camera_params'] = ','.join(f'{value:.6g}' for value in values)
        if all_cut_out(photos, len(cameras)):
            options['ImageReader__mask_path'] = os.path.join(photos, CUT_OUTS)
        folder = f'camera_{i}'
        listed = database + f'.{folder}.txt'
        write_text(listed, ''.join(f'{folder}/{name}\n' for name in sorted(os.listdir(os.path.join(photos, folder)))))
        colmap.run('feature_extractor', database_path=database, image_path=photos, image_list_path=listed,
                   ImageReader__camera_model='RADIAL', ImageReader__single_camera=1,
                   ImageReader__default_focal_length_factor=DEFAULT_FOCAL, SiftExtraction__use_gpu=0,
                   SiftExtraction__max_num_features=MAX_FEATURES, SiftExtraction__max_image_size=FEATURE_SIDE,
                   SiftExtraction__num_threads=colmap.thread_option(), **options)


def match(colmap, database, is_sequence):
    """Frames of a video with their neighbours; of photos the pairs that may show the same."""
    common = {'database_path': database, 'SiftMatching__use_gpu': 0,
              'SiftMatching__num_threads': colmap.thread_option(), 'SiftMatching__guided_matching': 1}
    if is_sequence:
        colmap.run('sequential_matcher', SequentialMatching__overlap=OVERLAP, SequentialMatching__quadratic_overlap=1,
                   **common)
        return
    pairs = pairs_of_database(database)
    require(pairs, NO_PAIRS)
    listed = database + '.pairs.txt'
    write_text(listed, ''.join(f'{first} {second}\n' for first, second in pairs))
    colmap.run('matches_importer', match_list_path=listed, match_type='pairs', **common)


def map_photos(colmap, database, folder, chosen):
    """Poses and points. The folder gets a folder for each part of the photos that hang together.
    @param chosen (folder of the photos, names of those that are used or None for all)."""
    photos, names = chosen
    with whole_folder(folder) as parts:
        options = {}
        if names is not None:
            options['image_list_path'] = database + '.chosen.txt'
            write_text(options['image_list_path'], ''.join(name + '\n' for name in names))
        colmap.run('mapper', database_path=database, image_path=photos, output_path=parts,
                   Mapper__num_threads=colmap.thread_option(), Mapper__ba_refine_principal_point=0,
                   Mapper__ba_global_function_tolerance=1e-6, Mapper__multiple_models=1, **options)
        for name in sorted(os.listdir(parts)):
            adjust_principal_points(colmap, os.path.join(parts, name))


def adjust_principal_points(colmap, part):
    """Adjusts all once more with the likely principal points instead of the images' middles, where the mapper keeps them:
    5 px beside the true one turn all cameras of a telephone's photos by a quarter of a degree."""
    freed = adjusted(colmap, part, 1)
    move_principal_points(part, principal_point.likely(read_reconstruction(part), read_reconstruction(freed)))
    shutil.rmtree(freed)
    result = adjusted(colmap, part, 0)
    shutil.rmtree(part)
    os.rename(result, part)


def adjusted(colmap, part, is_principal_point_free):
    """@return a folder beside it."""
    result = part + '.adjusted'
    os.mkdir(result)
    colmap.run('bundle_adjuster', input_path=part, output_path=result, BundleAdjustment__max_num_iterations=50,
               BundleAdjustment__refine_principal_point=is_principal_point_free)
    return result


def largest_part(folder):
    """(reconstruction of most photos, numbers of photos of the other parts). @throws InputError if there is none."""
    parts = [read_reconstruction(os.path.join(folder, name)) for name in sorted(os.listdir(folder))]
    require(parts, NO_PAIRS)
    parts.sort(key=lambda part: -len(part.names))
    return parts[0], [len(part.names) for part in parts[1:]]

