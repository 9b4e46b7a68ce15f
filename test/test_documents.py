#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Checks that the documents agree with the package: links, names, pictures, and the figures of the first page."""
import fnmatch
import glob
import json
import os
import re
import subprocess
import unittest

import test_modules

TOP = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
README_LINES = 200
WITH_PICTURE = ('README.md', 'demo/README.md', 'docs/evaluation.md', 'docs/frames.md', 'docs/own_object.md',
                'docs/performance.md', 'docs/results.md', 'docs/ros_interface.md')

LINK = re.compile(r'\[[^\]]*\]\(([^)\s]+)\)')
PICTURE = re.compile(r'!\[([^\]]*)\]\(([^)\s]+)\)')
COUNT = re.compile(r'\b\d+ of \d+\b')
FIGURE = re.compile(r'(\d+(?:\.\d+)?) (ms|s|deg|dB|%)(?![\w/])')


def read(path):
    with open(os.path.join(TOP, path), encoding='utf-8') as file:
        return file.read()


def pages():
    """Paths of all Markdown pages, below the top folder."""
    found = glob.glob(os.path.join(TOP, '*.md')) + glob.glob(os.path.join(TOP, 'docs', '*.md'))
    return sorted(os.path.relpath(path, TOP) for path in found) + ['cuda/README.md', 'demo/README.md']


def prose(text):
    """The text without code, whose brackets are no links."""
    without_blocks = '\n'.join('' if line.startswith('    ') else line for line in text.splitlines())
    return re.sub(r'`[^`\n]*`', '', without_blocks)


def commands(text):
    """Command lines of the text's code blocks, with continued lines joined."""
    for line in re.sub(r'\\\n\s*', '', text).splitlines():
        if line.startswith('    '):
            yield line.strip()


def anchors(text):
    """What a page's headings are called in links, as GitHub makes it."""
    for heading in re.findall(r'^#+ (.+)$', text, re.MULTILINE):
        yield re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')


def broken_links(path, text):
    """Yields the relative links of a page that lead nowhere."""
    for target in LINK.findall(prose(text)):
        if re.match(r'\w+://', target):
            continue
        file, _, anchor = target.partition('#')
        other = os.path.normpath(os.path.join(os.path.dirname(path), file))
        if file and not os.path.exists(os.path.join(TOP, other)):
            yield target
        elif anchor and anchor not in anchors(read(other) if file else text):
            yield target


def parameters():
    """Names of the nodes' parameters as the configuration files list them: `name` and `group/name`."""
    names = set()
    for path in ('config/pose_refiner.yaml', 'config/capture_views.yaml'):
        groups = []
        for indent, name in re.findall(r'^((?:  )*)(?:#\s+)?([a-z_0-9]+):(?:\s|$)', read(path), re.MULTILINE):
            groups = groups[:len(indent) // 2] + [name]
            names.add('/'.join(groups))
    return names


def ros_names():
    """Strings of the ROS sources: topics, services, and parameters of the small nodes."""
    names = {f'{group}set_parameters' for group in ('', 'refiner/', 'tracker/', 'overlay/')}
    for path in glob.glob(os.path.join(TOP, 'src', 'ros', '**', '*.*'), recursive=True):
        names.update(re.findall(r'"([a-z_][a-z_0-9/]*)"', read(path)))
    names.add('overlay/camera_info')  # image_transport's sibling of overlay/image_raw
    return names


def programs():
    """What `rosrun` finds: tools, nodes and installed scripts."""
    text = read('CMakeLists.txt') + read('cmake/ros_nodes.cmake')
    names = re.findall(r'npr_add_tool\((\w+)', text) + re.findall(r'OUTPUT_NAME (\w+)', text)
    return set(names) | set(re.findall(r'\bscripts/(\w+)', text)) | {
        name for nodes in re.findall(r'foreach\((?:node|tool) ([\w ]+)\)', text) for name in nodes.split()}


def figures(text):
    return {f'{number} {unit}' for number, unit in FIGURE.findall(text)} | set(COUNT.findall(text))


def program_of_cpp_page():
    """The first program of docs/cpp.md, with what it leaves to its reader."""
    block = re.search(r'(?:^    .*\n|^\n)+', read('docs/cpp.md').split('## Track in a video')[1], re.MULTILINE).group(0)
    lines = [line.strip() for line in block.splitlines()]
    begin = [line for line in lines if line.startswith(('#include', 'using'))]
    yours = ['bool readFrame(Image8* image, std::int64_t* stamp_ns);',
             'void use(const Pose& T_C_O, const Eigen::Matrix<double, 6, 6>& covariance);', 'void track() {']
    return '\n'.join(begin + yours + [line for line in lines if line not in begin] + ['}'])


class Links(unittest.TestCase):
    def test_links_and_anchors_lead_somewhere(self):
        for path in pages():
            self.assertEqual(list(broken_links(path, read(path))), [], path)

    def test_code_stands_in_blocks(self):
        for page in pages():
            self.assertEqual(re.findall(r'^#\w+.*', prose(read(page)), re.MULTILINE), [], page)  # a heading has a blank

    def test_a_broken_link_is_seen(self):
        text = '# One page\n[a](#one-page) [b](nowhere.md) [c](../README.md#no-such) `[d](code)` <https://e.org>'
        self.assertEqual(list(broken_links('docs/x.md', text)), ['nowhere.md', '../README.md#no-such'])

    def test_every_page_is_linked_from_the_first_one(self):
        for path in pages():
            if path != 'README.md':
                self.assertIn(path, [target.partition('#')[0] for target in LINK.findall(read('README.md'))])


class Pictures(unittest.TestCase):
    def test_pages_that_show_something_have_a_picture_with_a_description(self):
        for path in WITH_PICTURE:
            found = PICTURE.findall(read(path))
            self.assertTrue(found, path)
            self.assertTrue(all(description for description, _ in found), path)

    def test_every_picture_is_shown_and_has_an_origin(self):
        shown = {os.path.normpath(os.path.join(os.path.dirname(path), target))
                 for path in pages() for _, target in PICTURE.findall(read(path))}
        origins = re.findall(r'`([^`]+)`', read('demo/README.md').split('## Origin')[1].split('\n## ')[0])
        for extension in ('jpg', 'png', 'svg'):
            for picture in glob.glob(os.path.join(TOP, 'docs', '*.' + extension)):
                path = os.path.relpath(picture, TOP)
                self.assertIn(path, shown)
                self.assertTrue(any(fnmatch.fnmatch(path, origin) for origin in origins), path + ' has no origin')


class Names(unittest.TestCase):
    def test_launch_files_and_their_arguments_exist(self):
        for path in pages():
            for name in re.findall(r'\b(\w+\.launch)\b', read(path)):
                self.assertTrue(os.path.exists(os.path.join(TOP, 'launch', name)), f'{path}: {name}')
            for line in commands(read(path)):
                call = re.match(r'roslaunch nerf_pose_refiner (\w+\.launch)(.*)', line)
                if call:
                    known = re.findall(r'<arg name="(\w+)"', read('launch/' + call.group(1)))
                    for argument in re.findall(r' (\w+):=', call.group(2)):
                        self.assertIn(argument, known, f'{path}: {line}')

    def test_programs_and_their_options_exist(self):
        self.assertLessEqual({'train', 'evaluate_bag', 'capture_views', 'pose_refiner', 'llff_to_transforms'}, programs())
        options = ''.join(read(path) for folder in ('tools', 'ros/bag')
                          for path in glob.glob(os.path.join(TOP, 'src', folder, '*.cpp')))
        options += ''.join(read('scripts/' + name) for name in ('llff_to_transforms', 'make_board', 'photos_to_object'))
        # Of train: an option for each setting of a registration.
        for name in re.findall(r'visit\("(\w+)"', read('src/registration/registration_options.h')):
            options += '"--%s"' % re.sub('_db$', '', name).replace('_', '-')
        for path in pages():
            for line in commands(read(path)):
                call = re.match(r'rosrun nerf_pose_refiner (\w+)(.*)', line)
                if call:
                    self.assertIn(call.group(1), programs(), f'{path}: {line}')
                    for option in re.findall(r' (--[\w-]+)', call.group(2)):
                        self.assertTrue(re.search(r'''["',]%s["',{]''' % option, options), f'{path}: {line}')

    def test_scripts_and_folders_exist(self):
        for path in pages() + ['CHANGELOG.rst']:
            for name in re.findall(r'(?<![\w./])((?:scripts|config|test|src|launch|demo)/[\w./]*\w)', read(path)):
                self.assertTrue(os.path.exists(os.path.join(TOP, name)), f'{path}: {name}')

    def test_parameters_topics_and_services_exist(self):
        known = parameters() | ros_names()
        self.assertLessEqual({'tracker/predict', 'refiner/stages', 'min_views', 'hypotheses/poses'}, known)
        for path in pages():
            for name in re.findall(r'`~([a-z][a-z_/]*)', read(path)):
                self.assertIn(name, known | {'refiner', 'tracker'}, path)

    def test_the_interface_is_documented(self):
        interface = read('docs/ros_interface.md')
        for name in re.findall(r'= "([^"]+)"', read('src/ros/conversions/topics.h')):
            self.assertRegex(interface, '`~?%s`' % name)
        for name in os.listdir(os.path.join(TOP, 'launch')):
            self.assertIn(f'`{name}`', interface)
            self.assertIn(f'`{name}`', read('README.md'))
        status = read('msg/RefinementStatus.msg')
        for state in re.findall(r'uint8 (STATE_\w+)=', status):
            self.assertIn(f'`{state}`', interface)
        for reason in re.findall(r'uint8 (REASON_\w+)=', status):
            self.assertIn(f'`{reason}`', read('docs/troubleshooting.md'))

    def test_every_module_is_described(self):
        table = read('docs/architecture.md')
        for module in test_modules.MODULES:
            self.assertRegex(table, r'`(src/)?%s[`/]' % module)


class Library(unittest.TestCase):
    def test_every_public_header_is_described(self):
        page = read('docs/cpp.md')
        for header in os.listdir(os.path.join(TOP, 'include', 'nerf_pose_refiner')):
            self.assertIn(f'`{header}`', page)

    def test_the_program_compiles(self):
        call = ['c++', '-std=c++17', '-fsyntax-only', '-I', os.path.join(TOP, 'include'), '-I', '/usr/include/eigen3',
                '-x', 'c++', '-']
        result = subprocess.run(call, input=program_of_cpp_page(), stderr=subprocess.PIPE, check=False,
                                universal_newlines=True)
        self.assertEqual(result.returncode, 0, result.stderr)


class Figures(unittest.TestCase):
    def test_the_first_page_is_short(self):
        self.assertLessEqual(len(read('README.md').splitlines()), README_LINES)

    def test_figures_of_the_first_page_are_those_that_were_measured(self):
        readme = read('README.md')
        claims = [readme.split('\n## What it does not do\n')[1].split('\n## ')[0],
                  readme.split('\n## What is measured\n')[1].split('\n## ')[0]]
        measured = figures(re.sub(r'[|;,]', ' ', read('docs/performance.md')))
        for claim in claims:
            self.assertTrue(figures(claim))
            self.assertEqual(figures(claim) - measured, set())

    def test_a_figure_is_a_number_with_its_unit(self):
        self.assertEqual(figures('0.34 s, 39 to 46 ms; 2 samples, 25 of 25, 0.10 %'), {'0.34 s', '46 ms', '25 of 25', '0.10 %'})

    def test_all_differences_from_the_paper_are_listed(self):
        results = read('docs/results.md')
        for difference in json.loads(read('scripts/lib/paper_results.json'))['differences']:
            self.assertIn(difference, results)


if __name__ == '__main__':
    unittest.main()
