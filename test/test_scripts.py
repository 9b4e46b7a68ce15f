#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks the shell scripts: their form, and that they install only what is missing, and only when allowed."""
import ast
import glob
import importlib.util
import os
import shutil
import stat
import subprocess
import tempfile
import unittest

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCRIPTS = os.path.join(TOP, 'scripts')
SOURCES = ('.cpp', '.h', '.inl', '.cu', '.cuh', '.cmake', '.py', '.msg', '.srv', '.launch', '.test', '.yaml', '.xml')
OWN_MODULES = ('bars', 'depth_sensor', 'detection_tables', 'evaluation_frames', 'faults', 'kiosk_model', 'motion',
               'nerf_pose_refiner', 'object_command', 'photo_trials', 'photos', 'pose_evaluation', 'recorded_trial',
               'rig', 'run_faults', 'run_record', 'scenes', 'soak_verdict', 'source_files', 'stepped_demo', 'svg_plot',
               'trial_plots', 'trial_statistics', 'trial_tables', 'trials')


def run(*command, **environment):
    env = {key: value for key, value in os.environ.items() if key != 'CI'}
    env.update(environment)
    return subprocess.run(command, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, timeout=60)


def package_files(top=TOP):
    """What git knows of; in a copy without a repository everything but build folders and hidden ones."""
    if os.path.exists(os.path.join(top, '.git')) and shutil.which('git'):
        listed = run('git', '-C', top, 'ls-files', '-z')
        if listed.returncode == 0:
            paths = [os.path.join(top, name) for name in listed.stdout.split('\0') if name]
            return [path for path in paths if os.path.isfile(path)]  # a removed one may be listed still
    paths = []
    for folder, folders, names in os.walk(top):
        folders[:] = [name for name in folders if not name.startswith('.') and name not in ('build', 'out')]
        paths += [os.path.join(folder, name) for name in names]
    return paths


def shell_scripts():
    for folder in (SCRIPTS, os.path.join(SCRIPTS, 'lib'), os.path.join(TOP, '.ci')):
        for name in sorted(os.listdir(folder)):
            path = os.path.join(folder, name)
            if os.path.isfile(path):
                with open(path, encoding='utf-8') as file:
                    if 'bash' in ''.join(file.readlines()[:3]):
                        yield path


class Form(unittest.TestCase):
    def test_every_script_is_valid_bash(self):
        scripts = list(shell_scripts())
        for name in ('scripts/demo', 'scripts/test', '.ci/run'):
            self.assertIn(os.path.join(TOP, name), scripts)
            self.assertTrue(os.access(os.path.join(TOP, name), os.X_OK), name)
        for script in scripts:
            result = run('bash', '-n', script)
            self.assertEqual(result.returncode, 0, result.stderr)

    def test_help_and_wrong_usage(self):
        for name in ('demo', 'gpu_check', 'test'):
            script = os.path.join(SCRIPTS, name)
            result = run(script, '--help')
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn('--yes', result.stdout)
            self.assertEqual(run(script, '--no-such-option').returncode, 2)

    def test_another_python_leaves_the_path(self):
        with tempfile.TemporaryDirectory() as folder:
            os.symlink('/bin/true', os.path.join(folder, 'python3'))
            result = run('bash', '-c', f'. "{SCRIPTS}/lib/common.sh"; echo "$PATH"; command -v python3',
                         PATH=f'{folder}:/usr/bin:/bin:/no such folder')
            self.assertEqual(result.stdout.split('\n')[:2],
                             ['/usr/bin:/bin:/no such folder', '/usr/bin/python3'], result.stderr)

    def test_every_source_says_whose_it_is(self):
        paths = [path for path in package_files()
                 if path.endswith(SOURCES) or (os.access(path, os.X_OK) and not path.endswith('.png'))]
        self.assertIn(os.path.abspath(__file__), paths)
        for path in paths:
            with open(path, encoding='utf-8') as file:
                self.assertIn('(c) 2026, the nerf_pose_refiner authors', ''.join(file.readlines()[:4]), path)

    def test_package_files_without_a_repository(self):
        with tempfile.TemporaryDirectory() as top:
            for name in ('a.h', 'src/b.cpp', 'build/c.cpp', '.git/d.py'):
                os.makedirs(os.path.join(top, os.path.dirname(name)), exist_ok=True)
                with open(os.path.join(top, name), 'w', encoding='utf-8'):
                    pass
            self.assertEqual(sorted(package_files(top)), [os.path.join(top, name) for name in ('a.h', 'src/b.cpp')])


class Dependencies(unittest.TestCase):
    """What the Python programs import is named where it is installed from."""

    def imports(self):
        """Modules that are neither the standard library's nor this package's own."""
        paths = [path for pattern in ('test/**/*.py', 'scripts/lib/**/*.py', 'demo/make_bag.py')
                 for path in glob.glob(os.path.join(TOP, pattern), recursive=True)]
        for path in paths:
            with open(path, encoding='utf-8') as file:
                tree = ast.parse(file.read())
            for node in ast.walk(tree):
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom):
                    names = [node.module]
                else:
                    continue
                for name in (name.split('.')[0] for name in names):
                    spec = importlib.util.find_spec(name)
                    if name not in OWN_MODULES and (not spec or '-packages' in (spec.origin or '')):
                        yield name

    def test_imports_are_dependencies(self):
        with open(os.path.join(TOP, 'package.xml'), encoding='utf-8') as file:
            package = file.read()
        with open(os.path.join(SCRIPTS, 'packages_debian.txt'), encoding='utf-8') as file:
            debian = file.read().split('\n')
        found = set(self.imports())
        self.assertIn('rosbag', found)
        for module in found:
            name = 'python3-' + {'cv2': 'opencv'}.get(module, module.replace('_', '-'))
            key = name if module in ('cv2', 'matplotlib', 'numpy') else module  # of rosdep
            self.assertTrue(any(f'<{kind}>{key}<' in package for kind in ('test_depend', 'depend', 'exec_depend')),
                            f'package.xml does not name {key}')
            self.assertIn(name, debian)


class AmongFakes(unittest.TestCase):
    """Scripts among programs that only write down how they were called."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.bin = os.path.join(self.folder.name, 'bin')
        self.calls_file = os.path.join(self.folder.name, 'calls')
        self.noetic = os.path.join(self.folder.name, 'noetic')
        os.makedirs(self.bin)
        for name in ('apt-get', 'sudo', 'dpkg-query', 'rosdep'):
            self.program(name, '')

    def tearDown(self):
        self.folder.cleanup()

    def program(self, name, body):
        path = os.path.join(self.bin, name)
        with open(path, 'w', encoding='utf-8') as file:
            file.write(f'#!/bin/bash\necho "{name} $*" >>"{self.calls_file}"\n{body}\n')
        os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)

    def installed_packages(self, missing=()):
        with open(os.path.join(SCRIPTS, 'packages_debian.txt'), encoding='utf-8') as file:
            names = [line.strip() for line in file if not line.startswith('#')]
        self.program('dpkg-query', '\n'.join(
            f'echo "installed {name}"' for name in names if name not in missing))


class Testing(AmongFakes):
    def test_no_test_that_matches_is_an_error(self):
        self.installed_packages()
        self.program('cmake', '')
        self.program('ctest', 'echo "No tests were found!!!"')
        result = run(os.path.join(SCRIPTS, 'test'), '--build', os.path.join(self.folder.name, 'build'),
                     '--only', 'nothing', PATH=f'{self.bin}:/usr/bin:/bin')
        self.assertIn('no tests were run', result.stderr)
        self.assertEqual(result.returncode, 1)

    def test_skipped_cases_do_not_count_as_passed(self):
        self.installed_packages()
        self.program('cmake', '')
        build = os.path.join(self.folder.name, 'build')
        log = os.path.join(build, 'Testing', 'Temporary')
        # Of three tests one is skipped as a whole, and two others skip 37 and 1 of their cases.
        self.program('ctest', f"""mkdir -p "{log}"
printf '[  SKIPPED ] 37 tests, listed below:\\n[  SKIPPED ] Cuda.a\\n[  SKIPPED ] 1 test, listed below:\\n' \
  >"{log}/LastTest.log"
echo '3/3 Test #3: lint ...***Skipped'
echo '100% tests passed, 0 tests failed out of 3'""")
        result = run(os.path.join(SCRIPTS, 'test'), '--build', build, PATH=f'{self.bin}:/usr/bin:/bin')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout.splitlines()[-1],
                         '2 passed, 0 failed, 1 skipped; 38 cases skipped in those that passed')


class Installing(AmongFakes):
    def install(self, yes, function='install_with_apt'):
        """What was called, and how it ended."""
        result = run('bash', '-euo', 'pipefail', '-c',
                     f'. "{SCRIPTS}/lib/common.sh"; . "{SCRIPTS}/lib/install.sh"\n'
                     f'ASSUME_YES={yes}; NOETIC="{self.noetic}"; PATH="{self.bin}:$PATH"\n'
                     f'{function}')
        calls = []
        if os.path.exists(self.calls_file):
            with open(self.calls_file, encoding='utf-8') as file:
                calls = [line.strip() for line in file]
        return [call for call in calls if not call.startswith('dpkg-query')], result

    def test_nothing_missing(self):
        self.installed_packages()
        calls, result = self.install('false')
        self.assertEqual((calls, result.returncode), ([], 0), result.stderr)

    def test_missing_is_listed_and_not_installed_without_consent(self):
        self.installed_packages(missing=('catkin', 'cmake'))
        calls, result = self.install('false')
        self.assertEqual(calls, [])
        self.assertNotEqual(result.returncode, 0)
        self.assertIn('catkin cmake', result.stderr)

    def test_only_what_is_missing_is_installed(self):
        self.installed_packages(missing=('catkin', 'cmake'))
        calls, result = self.install('true')
        self.assertEqual(result.returncode, 0, result.stderr)
        installs = [call for call in calls if call.startswith('apt-get') and ' install ' in call]
        if os.geteuid() != 0:  # the recording sudo calls nothing
            installs = [call for call in calls if call.startswith('sudo') and ' install ' in call]
        self.assertEqual(len(installs), 1, calls)
        self.assertTrue(installs[0].endswith('--no-install-recommends catkin cmake'), installs)

    def on_noetic(self):
        os.makedirs(self.noetic)
        with open(os.path.join(self.noetic, 'setup.bash'), 'w', encoding='utf-8') as file:
            file.write('export ROS_DISTRO=noetic; true "$NOT_SET"\n')

    def test_noetic_with_all_there(self):
        self.on_noetic()
        calls, result = self.install('false', 'install_dependencies')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(calls), 1, calls)
        self.assertTrue(calls[0].startswith('rosdep check'), calls)

    def test_noetic_installs_through_rosdep_alone(self):
        self.on_noetic()
        self.program('rosdep', '[ "$1" != check ]')
        calls, result = self.install('true', 'install_dependencies')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertTrue(any(call.startswith('rosdep install') and '--default-yes' in call
                            for call in calls), calls)
        self.assertFalse([call for call in calls if call.startswith('apt-get')], calls)


if __name__ == '__main__':
    unittest.main()
