# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""One object that is made from photos: what the user chose, where its files are, which steps are done."""
import dataclasses
import os

from photos.common import require, whole_folder
from photos.intake import ENDINGS as PHOTO_ENDINGS, Copy, copy_photos, list_photos
from photos.steps import Steps, file_states
from photos.video import extract_frames, is_video


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

        copies, self.cameras = self.steps.run('photos', [file_states(paths), self.options.max_side],
                                              [self.path('photos')], take)
        self.copies = [Copy(**copy) for copy in copies]

    def sources(self):
        """{name of a copy: the user's file}."""
        return {copy.name: copy.source for copy in self.copies}
