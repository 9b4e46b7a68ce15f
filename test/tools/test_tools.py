#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs the command-line tools as a user does: photos to a model, renderings, a refined pose.

    test_tools.py FOLDER_FOR_FILES TRAIN RENDER REFINE [unittest arguments]
"""
import json
import os
import select
import shlex
import shutil
import signal
import struct
import subprocess
import sys
import time
import unittest

FOLDER, TRAIN, RENDER, REFINE = sys.argv[1:5]
TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(TOP, 'test', 'support'))
from kiosk_model import PHOTOS, STEPS, put_kiosk_model  # noqa: E402

TEST_VIEWS = os.path.join(PHOTOS, 'transforms_test.json')


def run(*arguments):
    return subprocess.run(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=300)


def path(name):
    return os.path.join(FOLDER, name)


def read_until(terminal, text):
    """Reads what a process writes until a text has come; None: to its end."""
    output = b''
    deadline = time.monotonic() + 60
    while text is None or text not in output:
        if not select.select([terminal], [], [], max(0, deadline - time.monotonic()))[0]:
            raise TimeoutError(output)
        try:
            piece = os.read(terminal, 4096)
        except OSError:  # Linux' way to say that nobody writes any more
            piece = b''
        if not piece:
            break
        output += piece
    return output


def train_until_interrupted(arguments, folder=None):
    """Runs train in a folder and interrupts it once it learns: its exit status and what it wrote."""
    terminal, stderr = os.openpty()  # progress is drawn for somebody who sees it
    try:
        with subprocess.Popen([TRAIN, *arguments], stdout=subprocess.DEVNULL, stderr=stderr, cwd=folder) as process:
            os.close(stderr)
            output = read_until(terminal, b'training')
            process.send_signal(signal.SIGINT)
            output += read_until(terminal, None)
            return process.wait(timeout=30), output
    finally:
        os.close(terminal)


def png_header(file_name):
    """Width, height, bit depth, colour type (0: grey, 2: RGB, 6: RGBA)."""
    with open(file_name, 'rb') as file:
        return struct.unpack('>IIBB', file.read(26)[16:26])


class CommandLine(unittest.TestCase):
    def test_help_explains_with_an_example(self):
        for tool in (TRAIN, RENDER, REFINE):
            result = run(tool, '--help')
            self.assertEqual(result.returncode, 0)
            self.assertIn('Example', result.stdout)
            self.assertIn('Exit code', result.stdout)

    def check_usage_error(self, *arguments):
        result = run(*arguments)
        self.assertEqual(result.returncode, 2, result)
        self.assertEqual(result.stdout, '')
        self.assertIn('--help', result.stderr)

    def test_wrong_usage(self):
        self.check_usage_error(TRAIN)
        self.check_usage_error(TRAIN, PHOTOS, '-o', path('x.safetensors'), '--profile', 'huge')
        self.check_usage_error(TRAIN, PHOTOS, '-o', path('x.safetensors'), '--steps', '-5')
        self.check_usage_error(RENDER, path('no_such_model'))
        self.check_usage_error(REFINE, '--unknown-option')

    def test_what_is_no_dataset(self):
        empty = path('empty')
        os.makedirs(empty, exist_ok=True)
        result = run(TRAIN, empty, '-o', path('x.safetensors'))
        self.assertEqual(result.returncode, 1, result)
        self.assertIn(empty, result.stderr)
        self.assertFalse(os.path.exists(path('x.safetensors')))

    def test_a_folder_that_does_not_exist_is_seen_before_training(self):
        result = run(TRAIN, PHOTOS, '-o', path('missing/x.safetensors'))
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('missing', result.stderr)

    def test_a_box_that_is_none(self):
        for box in (('1', '1', '1', '0', '0', '0'), ('0', '0', '0', '1', '1', 'nan')):
            self.check_usage_error(TRAIN, PHOTOS, '-o', path('x.safetensors'), '--box', *box)
        self.assertFalse(os.path.exists(path('x.safetensors')))

    def test_interrupt(self):
        model = path('interrupted.safetensors')
        status, output = train_until_interrupted((PHOTOS, '-o', model))
        self.assertEqual(status, 1, output)
        self.assertIn(b'cancelled', output)
        self.assertFalse(os.path.exists(model))


def examples_of_readme():
    """The command lines of README's section on the tools: (tool, arguments)."""
    with open(os.path.join(TOP, 'README.md'), encoding='utf-8') as file:
        section = file.read().split('\n## Tools\n')[1].split('\n## ')[0]
    lines = section.splitlines()
    words = [shlex.split(line) for line in lines if line.startswith('    rosrun nerf_pose_refiner ')]
    return [(line[2], line[3:]) for line in words]


def examples_of_help(tool):
    """The command lines that a tool's help shows: lists of arguments."""
    lines = run(tool, '--help').stdout.splitlines()
    name = os.path.basename(tool)
    return [shlex.split(line)[1:] for line in lines if line.startswith(f'  {name} ')]


class Examples(unittest.TestCase):
    """What the README and the tools' help show can be typed as it stands."""

    @classmethod
    def setUpClass(cls):
        cls.folder = path('examples')
        shutil.rmtree(cls.folder, ignore_errors=True)
        os.makedirs(os.path.join(cls.folder, 'photos'))
        os.symlink(PHOTOS, os.path.join(cls.folder, 'photos', 'mug'))
        os.symlink(os.path.join(TOP, 'demo'), os.path.join(cls.folder, 'demo'))
        shutil.copy(os.path.join(PHOTOS, 'test', 'view_003.png'),
                    os.path.join(cls.folder, 'photo.jpg'))  # what it is the bytes tell

    def learn(self, arguments):
        """An example of train begins to learn; then the shared model takes the place of what it would write."""
        status, output = train_until_interrupted(arguments, self.folder)
        self.assertEqual((status, b'cancelled' in output), (1, True), output)
        put_kiosk_model(TRAIN, FOLDER, os.path.join(self.folder, arguments[arguments.index('-o') + 1]))
        return 0, ''

    def run_example(self, tool, arguments):
        if tool == TRAIN:
            return self.learn(arguments)
        result = subprocess.run([tool, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                universal_newlines=True, timeout=300, cwd=self.folder)
        return result.returncode, result.stderr

    def test_readme(self):
        tools = {'train': TRAIN, 'render': RENDER, 'refine': REFINE}
        examples = examples_of_readme()
        self.assertEqual({name for name, _ in examples}, set(tools))
        for name, arguments in examples:  # the first makes the model of the others
            with self.subTest(tool=name):
                self.assertEqual(self.run_example(tools[name], arguments), (0, ''))

    def test_their_help(self):
        for tool in (TRAIN, RENDER, REFINE):  # the first makes the model of the others
            examples = examples_of_help(tool)
            self.assertTrue(examples, tool)
            for arguments in examples:
                with self.subTest(tool=tool, arguments=arguments):
                    status, error = self.run_example(tool, arguments)
                    # A made-up pose of a made-up photo need not be found.
                    self.assertIn(status, (0, 1) if 'photo.jpg' in arguments else (0,), error)


class WholePath(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = path('kiosk.safetensors')
        cls.trained, _ = put_kiosk_model(TRAIN, FOLDER, cls.model)

    def test_train_reports(self):
        self.assertEqual(self.trained['steps'], STEPS)
        self.assertEqual(self.trained['name'], 'toy_kiosk')  # the file's name
        self.assertEqual(self.trained['metres_per_unit'], 1)  # as the dataset says
        self.assertGreater(self.trained['psnr_db'], 20)
        self.assertAlmostEqual(self.trained['diameter'], 0.205, delta=0.03)

    def test_render_views(self):
        out = path('views')
        shutil.rmtree(out, ignore_errors=True)
        os.makedirs(out)
        result = run(RENDER, self.model, '--transforms', TEST_VIEWS, '--max-size', '80', '--psnr',
                     '--depth', '-o', out, '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads(result.stdout)
        self.assertEqual(len(report['views']), 8)
        mean = sum(view['psnr_db'] for view in report['views']) / 8
        self.assertAlmostEqual(report['mean_psnr_db'], mean, places=6)
        self.assertGreater(mean, 20)
        self.assertEqual(png_header(os.path.join(out, 'view_003.png')), (80, 80, 8, 6))
        self.assertEqual(png_header(os.path.join(out, 'view_003_depth.png')), (80, 80, 16, 0))

    def test_render_makes_its_folder(self):
        out = path('new/folder')
        shutil.rmtree(path('new'), ignore_errors=True)
        result = run(RENDER, self.model, '--transforms', TEST_VIEWS, '--max-size', '20', '-o', out)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(os.listdir(out)), 8)

    def write_views(self, folder, names):
        """A transforms.json of copies of one view under other names."""
        with open(TEST_VIEWS, encoding='utf-8') as file:
            scene = json.load(file)
        frame = scene['frames'][0]
        scene['frames'] = [{**frame, 'file_path': name} for name in names]
        for name in names:
            os.makedirs(os.path.dirname(os.path.join(folder, name)), exist_ok=True)
            shutil.copy(os.path.join(PHOTOS, frame['file_path']), os.path.join(folder, name))
        views = os.path.join(folder, 'transforms.json')
        with open(views, 'w', encoding='utf-8') as file:
            json.dump(scene, file)
        return views

    def test_render_names_pictures_by_all_but_the_last_extension(self):
        folder, out = path('dotted'), path('dotted_out')
        shutil.rmtree(out, ignore_errors=True)
        views = self.write_views(folder, ['frame.0001.png', 'frame.0002.png'])
        result = run(RENDER, self.model, '--transforms', views, '--max-size', '20', '-o', out)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(sorted(os.listdir(out)), ['frame.0001.png', 'frame.0002.png'])

    def test_render_overwrites_nothing_of_its_own(self):
        folder, out = path('twins'), path('twins_out')
        for names in (['left/view.png', 'right/view.png'], ['view.png', 'view_depth.png']):
            shutil.rmtree(out, ignore_errors=True)
            views = self.write_views(folder, names)
            result = run(RENDER, self.model, '--transforms', views, '--max-size', '20', '--depth',
                         '-o', out)
            self.assertEqual(result.returncode, 1, result)
            self.assertIn('two views would be written to', result.stderr)
            self.assertEqual(os.listdir(out), [])

    def test_render_a_pose_on_a_background(self):
        picture = path('picture.png')
        result = run(RENDER, self.model, '--pose', '0', '0', '0.6', '1', '0', '0', '0',
                     '--intrinsics', '100', '100', '31.5', '23.5', '--size', '64', '48',
                     '--background', '1', '1', '1', '-o', picture)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(png_header(picture), (64, 48, 8, 2))

    def test_refine_a_view(self):
        result = run(REFINE, self.model, '--transforms', TEST_VIEWS, '--view', 'view_003', '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads(result.stdout)
        self.assertEqual(report['outcome'], 'refined')
        self.assertTrue(report['trusted'])
        self.assertEqual(len(report['pose']), 7)
        self.assertLess(report['error']['rotation_deg'], 3)
        self.assertLess(report['error']['diameters'], 0.05)
        self.assertGreater(report['error_at_start']['rotation_deg'], 3)

    def test_refine_by_keyframes_as_the_node_does(self):
        """Trusted and near, and not by following the field, as with the preset `track`."""
        view = ('--transforms', TEST_VIEWS, '--view', 'view_003', '--start-rotation', '15', '--json')
        reports = {preset: json.loads(run(REFINE, self.model, *view, '--preset', preset).stdout)
                   for preset in ('keyframes', 'track')}
        found = reports['keyframes']
        self.assertTrue(found['trusted'], found)
        self.assertLess(found['error']['rotation_deg'], 1)
        self.assertLess(found['error']['diameters'], 0.02)
        self.assertNotEqual(found['pose'], reports['track']['pose'])

    def test_poses_are_of_the_frame_in_the_metadata(self):
        view = ('--transforms', TEST_VIEWS, '--view', 'view_003', '--start-rotation', '0', '--start-translation',
                '0', '--preset', 'track', '--json')
        plain = json.loads(run(REFINE, self.model, *view).stdout)
        model, metadata = path('moved.safetensors'), path('moved.yaml')
        shutil.copy(self.model, model)
        with open(metadata, 'w', encoding='utf-8') as file:
            file.write('frame_in_model: {position: [0, 0, 0.5], orientation: [0, 0, 1, 0]}\nmetres_per_unit: 2\n'
                       'symmetries: {discrete: [{axis: [0, 0, 1], fold: 2}]}\n')
        result = run(REFINE, model, *view[:-1])
        self.assertIn('modulo symmetries: 1 motion', result.stdout)
        moved = json.loads(run(REFINE, model, *view).stdout)
        x, y, z, w = plain['pose'][3:]
        axis = (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))  # the model's z axis
        for i in range(3):
            self.assertAlmostEqual(moved['pose'][i], plain['pose'][i] + 0.5 * axis[i], delta=1e-6)
            self.assertAlmostEqual(moved['pose_m'][i], 2 * moved['pose'][i], delta=1e-6)
        self.assertAlmostEqual(moved['error']['rotation_deg'], plain['error']['rotation_deg'], delta=1e-6)
        with open(metadata, 'w', encoding='utf-8') as file:
            file.write('frame: {}\n')
        result = run(REFINE, model, *view)
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('moved.yaml', result.stderr)
        self.assertIn("line 1: 'frame' is unknown", result.stderr)

    def test_refine_an_image_from_a_pose(self):
        view = run(REFINE, self.model, '--transforms', TEST_VIEWS, '--view', 'view_003',
                   '--start-rotation', '0', '--start-translation', '0', '--preset', 'track',
                   '--json')
        truth = json.loads(view.stdout)
        with open(TEST_VIEWS, encoding='utf-8') as file:
            camera = json.load(file)
        intrinsics = [camera['fl_x'], camera['fl_y'], camera['cx'] - 0.5, camera['cy'] - 0.5]
        result = run(REFINE, self.model, os.path.join(PHOTOS, 'test', 'view_003.png'),
                     '--intrinsics', *map(str, intrinsics),
                     '--pose', *map(str, truth['pose']), '--preset', 'track', '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        for found, expected in zip(json.loads(result.stdout)['pose'], truth['pose']):
            self.assertAlmostEqual(found, expected, delta=0.05)

    def depth_of_a_view(self):
        """Words of the tool: the camera, the true pose; and the model's depth there, rendered."""
        pose = ['0', '0.02', '0.5', '1', '0', '0', '0']
        camera = ['--intrinsics', '300', '300', '159.5', '119.5']
        result = run(RENDER, self.model, '--pose', *pose, *camera, '--size', '320', '240', '--background', '0', '0',
                     '0', '--depth', '-o', path('deep.png'))
        self.assertEqual(result.returncode, 0, result.stderr)
        return camera, pose, path('deep_depth.png')

    def test_refine_by_depth(self):
        camera, pose, depth = self.depth_of_a_view()
        start = ['0.01', '0.02', '0.51', '0.9990', '0.0447', '0', '0']  # 5 degrees off, a twentieth of the diameter
        alone = json.loads(run(REFINE, self.model, *camera, '--depth', depth, '--pose', *start, '--json').stdout)
        both = json.loads(run(REFINE, self.model, path('deep.png'), *camera, '--depth', depth, '--pose', *start,
                              '--json').stdout)
        for report in (alone, both):
            self.assertEqual((report['outcome'], report['depth']['use']), ('refined', 'used'), report)
            for found, expected in zip(report['pose'][:3], pose):
                self.assertAlmostEqual(found, float(expected), delta=0.004)
        self.assertNotEqual(alone['pose'], both['pose'])
        ten_times = run(REFINE, self.model, path('deep.png'), *camera, '--depth', depth, '--depth-unit', '0.01',
                        '--pose', *start)
        self.assertIn('depth: refused, ', ten_times.stdout)

    def test_depth_that_cannot_be_used_is_named(self):
        camera, pose, depth = self.depth_of_a_view()
        small = os.path.join(PHOTOS, 'test', 'view_003.png')  # of another size
        for words, status, why in (((small, '--depth', depth), 2, 'the depth image has 320 x 240 pixels'),
                                   (('--depth', small), 1, 'view_003.png\': it is not a PNG of 16-bit grey'),
                                   (('--depth', depth, '--background', '0', '0', '0'), 2, 'depth alone takes neither'),
                                   (('--depth-unit', '1', path('deep.png')), 2, '--depth'),
                                   (('--depth', depth, '--preset', 'track'), 2, '--preset track compares colours'),
                                   (('--depth', depth, path('deep.png'), '--preset', 'align'), 2,
                                    '--preset align compares colours alone: --depth needs --preset keyframes')):
            result = run(REFINE, self.model, *words, *camera, '--pose', *pose)
            self.assertEqual((result.returncode, why in result.stderr), (status, True), result.stderr)

    def test_a_pose_with_a_low_score_is_a_failure(self):
        """Started where the object is seen from behind."""
        start = ('--transforms', TEST_VIEWS, '--view', 'view_003', '--start-rotation', '170', '--seed', '2', '--json')
        result = run(REFINE, self.model, *start)
        report = json.loads(result.stdout)
        self.assertEqual(report['outcome'], 'refined')
        self.assertLess(report['score'], 0.5)
        self.assertFalse(report['trusted'])
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn('below --min-score 0.5', result.stderr)
        anyhow = run(REFINE, self.model, *start, '--min-score', '0')
        self.assertEqual(anyhow.returncode, 0, anyhow.stderr)
        self.assertEqual(json.loads(anyhow.stdout)['pose'], report['pose'])
        self.assertIn('--min-score', run(REFINE, '--help').stdout)

    def test_a_start_outside_of_the_image_is_a_failure(self):
        result = run(REFINE, self.model, os.path.join(PHOTOS, 'test', 'view_003.png'),
                     '--intrinsics', '640', '640', '159.5', '159.5',
                     '--pose', '5', '0', '0.6', '1', '0', '0', '0', '--json')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('no overlap', json.loads(result.stdout)['outcome'])

    def test_a_truncated_model_is_refused(self):
        cut = path('cut.safetensors')
        with open(self.model, 'rb') as whole, open(cut, 'wb') as file:
            file.write(whole.read()[:10000])
        result = run(RENDER, cut, '--transforms', TEST_VIEWS, '--psnr')
        self.assertEqual(result.returncode, 1, result)
        self.assertIn('cut.safetensors', result.stderr)


if __name__ == '__main__':
    os.makedirs(FOLDER, exist_ok=True)
    unittest.main(argv=sys.argv[:1] + sys.argv[5:])
