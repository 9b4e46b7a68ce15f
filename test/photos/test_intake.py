#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Tests of what takes photos and videos in: headers, sizes, cameras, sharp frames, and input that is of no use."""
import os
import struct
import subprocess
import sys
import tempfile
import unittest

import cv2
import numpy as np

import scenes  # noqa: F401 (the path)
from photos import intake, job, missing, steps, video
from photos.common import InputError, locked, whole_folder
from photos.image_header import read_header


def exif_block(orientation, model, focal_35mm):
    """A TIFF in an APP1 segment: orientation, model and, in the inner folder, the focal length."""
    name = model.encode() + b'\0'
    inner = 8 + 2 + 3 * 12 + 4
    text = inner + 2 + 12 + 4
    top = struct.pack('<H', 3) + struct.pack('<HHIHH', 0x0112, 3, 1, orientation, 0)
    top += struct.pack('<HHII', 0x0110, 2, len(name), text) + struct.pack('<HHII', 0x8769, 4, 1, inner) + bytes(4)
    folder = struct.pack('<H', 1) + struct.pack('<HHIHH', 0xA405, 3, 1, focal_35mm, 0) + bytes(4)
    tiff = b'II*\0' + struct.pack('<I', 8) + top + folder + name
    return b'\xff\xe1' + struct.pack('>H', len(tiff) + 8) + b'Exif\0\0' + tiff


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def path(self, name):
        return os.path.join(self.folder, name)

    def photo(self, name, width, height, described=None):
        """Blotches, upper left corner black. @param described orientation, model, focal length of EXIF."""
        noise = np.random.default_rng(1).uniform(0, 255, (12, 16, 3)).astype(np.uint8)
        image = cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
        image[:height // 4, :width // 4] = 0
        data = cv2.imencode(os.path.splitext(name)[1], image)[1].tobytes()
        if described:
            data = data[:2] + exif_block(*described) + data[2:]
        with open(self.path(name), 'wb') as file:
            file.write(data)
        return self.path(name)

    def copies(self, *paths, max_side=200):
        with whole_folder(self.path('copies')) as folder:
            return intake.copy_photos(list(paths), folder, max_side)


class Headers(InFolder):
    def test_sizes_and_exif(self):
        self.assertEqual(read_header(self.photo('a.png', 40, 30)), (40, 30, 1, '', 0))
        self.assertEqual(read_header(self.photo('a.jpg', 40, 30)), (40, 30, 1, '', 0))
        self.assertEqual(read_header(self.photo('b.jpg', 40, 30, (6, 'Phone 5', 26))), (40, 30, 6, 'Phone 5', 26))

    def test_damaged_exif_is_no_obstacle(self):
        data = bytearray(exif_block(6, 'Phone 5', 26))
        for position in range(10, len(data)):
            with open(self.photo('a.jpg', 40, 30), 'rb') as file:
                plain = file.read()
            spoiled = bytearray(data)
            spoiled[position] ^= 0xFF
            with open(self.path('b.jpg'), 'wb') as file:
                file.write(plain[:2] + bytes(spoiled) + plain[2:])
            self.assertEqual(read_header(self.path('b.jpg'))[:2], (40, 30))

    def test_what_is_no_photo_is_named(self):
        for name, data, message in (('a.heic', b'\0\0\0\x18ftypheic' + bytes(40), 'is HEIC.*convert it'),
                                    ('a.jpg', b'text', 'no JPEG or PNG'), ('b.jpg', b'\xff\xd8\xff\xe1\0', 'no JPEG or PNG')):
            with open(self.path(name), 'wb') as file:
                file.write(data)
            with self.assertRaisesRegex(InputError, f"{name}'.*{message}"):
                read_header(self.path(name))
        with self.assertRaisesRegex(InputError, 'No such file'):
            read_header(self.path('none.jpg'))


class Copies(InFolder):
    def test_one_shape_for_photos_of_one_camera(self):
        # The second is stored lying and turned by EXIF; the third was taken with the phone turned.
        wide = self.photo('a.jpg', 400, 300, (1, 'Phone', 27))
        turned = self.photo('b.jpg', 300, 400, (6, 'Phone', 27))
        high = self.photo('c.jpg', 300, 400, (1, 'Phone', 27))
        copies, cameras = self.copies(wide, turned, high)
        # 27 mm of 36 mm: 0.75 of the longer side.
        self.assertEqual(cameras, [{'width': 200, 'height': 150, 'focal_px': 150.0}])
        self.assertEqual([(copy.camera, copy.turned, copy.scale) for copy in copies],
                         [(0, False, 0.5), (0, False, 0.5), (0, True, 0.5)])
        for copy in copies:
            self.assertEqual(cv2.imread(self.path('copies/' + copy.name)).shape, (150, 200, 3))
        # A pixel of the user's photo in the copy that was turned clockwise: its upper left corner is upper right.
        self.assertEqual(intake.pixel_of_copy(copies[2], cameras[0], (0, 0)), (200, 0))
        self.assertEqual(intake.pixel_of_copy(copies[2], cameras[0], (20, 40)), (180, 10))
        black = cv2.imread(self.path('copies/' + copies[2].name))[2:30, 170:198]
        self.assertLess(black.max(), 40)

    def test_cameras_are_told_apart(self):
        copies, cameras = self.copies(self.photo('a.jpg', 400, 300), self.photo('b.jpg', 400, 300, (1, 'Other', 50)),
                                      self.photo('c.jpg', 320, 200))
        self.assertEqual([copy.camera for copy in copies], [0, 1, 2])
        self.assertEqual([camera['focal_px'] for camera in cameras], [None, 50 / 36 * 200, None])

    def test_what_needs_no_change_is_copied_without_loss(self):
        path = self.photo('a.jpg', 160, 120)
        copies, _ = self.copies(path)
        with open(path, 'rb') as one, open(self.path('copies/' + copies[0].name), 'rb') as two:
            self.assertEqual(one.read(), two.read())

    def test_large_photos_are_decoded_reduced(self):
        header = read_header(self.photo('a.jpg', 1600, 1200))
        self.assertEqual([intake.reduction(header, side) for side in (1600, 801, 800, 400, 200, 1)], [1, 1, 2, 4, 8, 8])
        self.assertEqual(intake.load(self.path('a.jpg'), header, 200).shape, (150, 200, 3))

    def test_photos_beyond_all_bounds_are_refused_before_they_are_decoded(self):
        data = bytearray(cv2.imencode('.png', np.zeros((4, 4), np.uint8))[1].tobytes())
        data[16:24] = struct.pack('>II', 20000, 20000)
        with open(self.path('a.png'), 'wb') as file:
            file.write(data)
        with self.assertRaisesRegex(InputError, "a.png' has 20000 x 20000 pixels: make it smaller, or a JPEG"):
            self.copies(self.path('a.png'))
        self.assertEqual(sorted(os.listdir(self.folder)), ['a.png'])  # nothing half written

    def test_folders_that_hold_no_set(self):
        with self.assertRaisesRegex(InputError, 'no photos'):
            job.find_sources(self.folder)
        self.photo('a.jpg', 40, 30)
        with self.assertRaisesRegex(InputError, 'holds 1 photo: take 40'):
            job.find_sources(self.folder)
        with self.assertRaisesRegex(InputError, 'no folder or video'):
            job.find_sources(self.path('none'))
        with self.assertRaisesRegex(InputError, 'neither a folder of photos nor a video'):
            job.find_sources(self.path('a.jpg'))

    def test_thinned(self):
        self.assertEqual(intake.thinned(list(range(10)), 4), [0, 2, 5, 7])
        self.assertEqual(intake.thinned([1, 2], 4), [1, 2])


class Videos(InFolder):
    def film(self, frames, sharp):
        """Some frames are sharp, the others blurred."""
        path = self.path('film.avi')
        writer = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*'MJPG'), 30, (160, 120))
        image = np.random.default_rng(1).uniform(0, 255, (120, 160, 3)).astype(np.uint8)
        for i in range(frames):
            writer.write(image if i in sharp else cv2.GaussianBlur(image, (0, 0), 3))
        writer.release()
        return path

    def test_the_sharpest_of_each_stretch(self):
        path = self.film(24, (1, 2, 7))
        os.mkdir(self.path('frames'))
        copies, cameras = video.extract_frames(path, self.path('frames'), 80)
        self.assertEqual(cameras, [{'width': 80, 'height': 60, 'focal_px': None}])
        self.assertEqual(len(copies), 12)  # stretches of two frames
        frames = [int(copy.source.split()[-1]) for copy in copies]
        self.assertEqual([frame // 2 for frame in frames], list(range(12)))
        self.assertEqual([frames[i] for i in (0, 1, 3)], [1, 2, 7])
        self.assertEqual(cv2.imread(self.path('frames/' + copies[0].name)).shape, (60, 80, 3))

    def test_too_short_or_no_video(self):
        with self.assertRaisesRegex(InputError, 'has 5 frames'):
            video.extract_frames(self.film(5, ()), self.folder, 80)
        with open(self.path('b.mp4'), 'wb') as file:
            file.write(b'text')
        with self.assertRaisesRegex(InputError, "b.mp4' cannot be decoded"):
            video.extract_frames(self.path('b.mp4'), self.folder, 80)


class Missing(unittest.TestCase):
    def test_reasons(self):
        facts = {'sharpness': 100.0, 'features': {'a': 1000, 'b': 1000, 'c': 100, 'd': 1000, 'e': 1000},
                 'partners': {'b': 10, 'c': 10, 'd': 1, 'e': 10}}
        found = [missing.reason(intake.Copy(name, name, 0, False, 1, sharp), facts)
                 for name, sharp in (('a', 30), ('c', 90), ('d', 90), ('e', 90))]
        self.assertEqual(found, ['too blurred', 'too little texture in view', 'they overlap too little with the others',
                                 'their place does not agree with the others'])

    def test_summary(self):
        self.assertEqual(missing.summary({}, 60), '')
        self.assertEqual(missing.summary({'a': 'too blurred'}, 60), '1 of 60 photos has no pose: 1 too blurred (a)')
        self.assertEqual(missing.summary({'a': 'x', 'b': 'y', 'c': 'y', 'd': 'y', 'e': 'y'}, 60),
                         '5 of 60 photos have no pose: 4 y (b, c, d ..); 1 x (a)')

    def test_directions(self):
        centres = np.array([[1, 0, 1], [0, 2, 2], [-3, 0, 3.0]])
        azimuth, elevation = missing.angles(centres, np.zeros(3))
        np.testing.assert_allclose(azimuth, [0, 90, 180])
        np.testing.assert_allclose(elevation, 45)
        self.assertEqual(missing.largest_gap(azimuth), (180, 180))
        advice = missing.direction_advice(azimuth, elevation)
        self.assertEqual(len(advice), 2)
        self.assertIn('No photos from low (10 to 35', advice[0])
        self.assertIn('180 degrees', advice[1])
        around = np.arange(0, 360, 20)
        self.assertEqual(missing.direction_advice(np.tile(around, 2), np.repeat([20, 50], len(around))), [])


class WholeFolders(InFolder):
    def test_all_or_nothing(self):
        path = self.path('result')
        for content in ('one', 'two'):
            with whole_folder(path) as folder, open(os.path.join(folder, 'file'), 'w', encoding='utf-8') as file:
                file.write(content)
                self.assertEqual(os.path.exists(path), content == 'two')
        with self.assertRaises(InputError), whole_folder(path) as folder:
            with open(os.path.join(folder, 'other'), 'w', encoding='utf-8'):
                raise InputError('it failed')
        with open(os.path.join(path, 'file'), encoding='utf-8') as file:
            self.assertEqual(file.read(), 'two')
        os.mkdir(self.path('.result.part'))  # of a process that was killed
        with whole_folder(path):
            pass
        self.assertEqual((os.listdir(self.folder), os.listdir(path)), (['result'], []))

    def test_a_folder_is_one_process_at_a_time(self):
        with locked(self.path('a')):
            code = f'import fcntl; fcntl.flock(open({self.path("a/.lock")!r}), fcntl.LOCK_EX | fcntl.LOCK_NB)'
            self.assertNotEqual(subprocess.run([sys.executable, '-c', code], stderr=subprocess.DEVNULL).returncode, 0)
        self.assertEqual(subprocess.run([sys.executable, '-c', code]).returncode, 0)


class StepsAgain(InFolder):
    def test_what_is_done_is_not_done_again(self):
        calls = []

        def run(first=1, second=1):
            made = steps.Steps(self.path('steps.json'))
            for name, value in (('a', first), ('b', second)):
                result = made.run(name, value, [self.path(name)], lambda name=name, value=value: self.make(calls, name, value))
            return result

        self.assertEqual(run(), {'made': ['b', 1]})
        self.assertEqual(run(), {'made': ['b', 1]})
        self.assertEqual(calls, ['a', 'b'])
        run(second=2)
        self.assertEqual(calls, ['a', 'b', 'b'])
        run(first=2, second=2)          # a step before has changed
        self.assertEqual(calls[3:], ['a', 'b'])
        os.unlink(self.path('b'))       # what it made is gone
        run(first=2, second=2)
        self.assertEqual(calls[5:], ['b'])
        with open(self.path('steps.json'), 'w', encoding='utf-8') as file:
            file.write('{"a": ')
        run(first=2, second=2)
        self.assertEqual(calls[6:], ['a', 'b'])

    def make(self, calls, name, value):
        calls.append(name)
        with open(self.path(name), 'w', encoding='utf-8'):
            return {'made': (name, value)}


if __name__ == '__main__':
    unittest.main()
