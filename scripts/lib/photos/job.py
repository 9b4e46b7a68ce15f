# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""One object that is made from photos: what the user chose, where its files are, which steps are done."""
import dataclasses
import os

import numpy as np

from photos.common import InputError, read_json, require, whole_folder, write_json
from photos.intake import ENDINGS as PHOTO_ENDINGS, Copy, copy_photos, list_photos
from photos.steps import Steps, file_states
from photos.video import extract_frames, is_video

OPTIONS_FILE = 'options.json'
DIGITS = 6  # of numbers in a command line


@dataclasses.dataclass
class Options:
    """What a user can choose; photos_to_object --help describes each."""
    source: str
    output: str
    name: str
    poses: str = 'colmap'
    board: str = ''
    metres_per_unit: float = 0
    length: list = dataclasses.field(default_factory=list)
    box: list = dataclasses.field(default_factory=list)
    masks: str = ''
    max_side: int = 1280
    max_minutes: float = 60
    threads: int = 0
    tools: str = ''
    learn: bool = True
    train: list = dataclasses.field(default_factory=list)  # options for train


def number(value):
    """As argparse takes it also where it is negative: without an exponent."""
    return np.format_float_positional(value, precision=DIGITS, fractional=False, trim='-')


def default_name(source):
    return os.path.splitext(os.path.basename(source))[0]


def words_of(options):
    """The words of a command line that photos_to_object reads as these options."""
    words = [options.source, '-o', options.output]
    if options.name != default_name(options.source):
        words += ['--name', options.name]
    for field in dataclasses.fields(Options):
        value, word = getattr(options, field.name), '--' + field.name.replace('_', '-')
        if field.name in ('source', 'output', 'name', 'learn', 'train') or not value or value == field.default:
            continue
        values = value if isinstance(value, list) else [value]
        words += [word, *(number(x) if isinstance(x, float) else str(x) for x in values)]
    return words + options.train + ([] if options.learn else ['--no-training'])


def write_options(options):
    """Keeps them beside the results, for choose_box: words_of() calls the program again."""
    write_json(os.path.join(options.output, OPTIONS_FILE), dataclasses.asdict(options))


def read_options(folder):
    path = os.path.join(folder, OPTIONS_FILE)
    require(os.path.exists(path), f"'{folder}' does not hold {OPTIONS_FILE}, which photos_to_object writes: run it again")
    content = read_json(path)
    try:
        return dataclasses.replace(Options(**content), output=os.path.abspath(folder))  # it may have been moved
    except TypeError as error:
        raise InputError(f"'{path}' is damaged ({error}): run photos_to_object again") from error


def has_photos(names):
    return any(name.lower().endswith(PHOTO_ENDINGS) for name in names)


def find_sources(source):
    """Paths of the photos, or of the one video."""
    if os.path.isfile(source):
        require(is_video(source), f"'{source}' is neither a folder of photos nor a video")
        return [source]
    require(os.path.isdir(source), f"there is no folder or video '{source}'")
    names = sorted(os.listdir(source))
    videos = [name for name in names if is_video(name)]
    if videos and not has_photos(names):
        require(len(videos) == 1, f"'{source}' holds {len(videos)} videos: name one of them")
        return [os.path.join(source, videos[0])]
    inside = os.path.join(source, 'images')  # a project of COLMAP or nerfstudio
    return list_photos(inside if not has_photos(names) and os.path.isdir(inside) else source)


class Job:
    """Every file of it is below options.output; nothing else is written."""

    def __init__(self, options):
        self.options = options
        self.steps = Steps(self.path('steps.json'))
        self.copies, self.cameras, self.is_sequence = [], [], False
        self.corners = None  # of the board, once they were looked for

    def path(self, *names):
        return os.path.join(self.options.output, *names)

    def take_photos(self):
        """The first step: the photos, or a video's sharp frames, as copies."""
        paths = find_sources(self.options.source)
        self.is_sequence = is_video(paths[0])

        def take():
            with whole_folder(self.path('photos')) as folder:
                if self.is_sequence:
                    copies, cameras = extract_frames(paths[0], folder, self.options.max_side)
                else:
                    copies, cameras = copy_photos(paths, folder, self.options.max_side)
            return [[copy._asdict() for copy in copies], cameras]

        # Copies of PNGs that an older version made lack the masks that their alpha says.
        cut_outs = ['alpha'] if any(path.lower().endswith('.png') for path in paths) else []
        copies, self.cameras = self.steps.run('photos', [file_states(paths), self.options.max_side, *cut_outs],
                                              [self.path('photos')], take)
        self.copies = [Copy(**copy) for copy in copies]

    def sources(self):
        """{name of a copy: the user's file}."""
        return {copy.name: copy.source for copy in self.copies}
