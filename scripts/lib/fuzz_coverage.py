#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Says which lines of the readers the inputs of the fuzzers reach. scripts/fuzz --coverage calls it."""
import argparse
import collections
import os
import re
import subprocess
import sys
import tempfile

LEAST = 0.9

# The files that each target is to read all of.
PARSERS = {
    'bag': ['ros/bag/bag_sequence.cpp'],
    'bop_scene': ['dataset/bop_scene.cpp'],
    'camera_messages': ['ros/conversions/camera_input.cpp'],
    'colmap_binary': ['dataset/colmap_binary.cpp', 'files/binary_reader.cpp'],
    'colmap_text': ['dataset/colmap_text.cpp'],
    'detections': ['ros/conversions/detection_boxes.h', 'ros/conversions/detection_boxes.cpp'],
    'image_size': ['image/image_size.cpp', 'image/orientation.cpp', 'image/jpeg_segments.h'],
    'initial_pose': ['ros/conversions/pose_conversions.cpp', 'tracking/prior.cpp'],
    'landmark_file': ['detection/landmark_file.cpp'],
    'model_file': ['field/model_file.cpp', 'field/description.cpp'],
    'object_metadata': ['field/object_metadata.cpp'],
    'phone_scan': ['dataset/polycam.cpp', 'dataset/record3d.cpp', 'dataset/json_values.cpp'],
    'transforms_json': ['dataset/transforms_json.cpp'],
}

# Functions in these files that do not read bytes: they write, list folders, or belong to another target.
OTHERS = re.compile(r'::(saveModel|headerOf|requireModelWritable|describe|saveLandmarks|placeOf|landmarkKey|'
                    r'landmarkPathOf|countColmap\w+|toMessage|toPoint|toPoseArray|covarianceToMessage|judge|'
                    r'toJson|adviceFor|writeObjectMetadata|toTransform|upright|prefixIn|metadataIn|is\w+Folder|'
                    r'read\w+Folder)\b|fromMessage\(geometry_msgs::Transform')


def lines_reached(program, folders, files):
    """@return {file: {line: count}} without the lines of functions that do not read."""
    with tempfile.TemporaryDirectory() as folder:
        raw, data = folder + '/raw', folder + '/data'
        subprocess.run([program, *folders], env={**os.environ, 'LLVM_PROFILE_FILE': raw}, check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)  # what tf2 and rosbag say of the inputs
        subprocess.run(['llvm-profdata', 'merge', raw, '-o', data], check=True)
        lcov = subprocess.run(['llvm-cov', 'export', '-format=lcov', '-instr-profile', data, program], check=True,
                              stdout=subprocess.PIPE, universal_newlines=True).stdout
    lcov = subprocess.run(['c++filt'], input=re.sub(r'^(FN:\d+),(\S+:)?(_Z)', r'\1 \3', lcov, flags=re.M), check=True,
                          stdout=subprocess.PIPE, universal_newlines=True).stdout
    counts, starts = collections.defaultdict(dict), collections.defaultdict(dict)
    for line in lcov.splitlines():
        kind, _, rest = line.partition(':')
        if kind == 'SF':
            # Absolute, or relative to where it was compiled.
            file = next((name for name in files if rest.endswith('/src/' + name)), '')
        elif kind == 'FN':
            number, _, name = rest.partition(' ')
            if number.isdigit():
                starts[file][int(number)] = name
        elif kind == 'DA':
            number, count = rest.split(',')[:2]
            counts[file][int(number)] = int(count)
    counts.pop('', None)
    for file, of_file in counts.items():
        for number in list(of_file):
            begun = [start for start in starts[file] if start <= number]
            if begun and OTHERS.search(starts[file][max(begun)]):
                del of_file[number]
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--top', required=True)
    parser.add_argument('--programs', required=True)
    parser.add_argument('--found', required=True, help='folder of the inputs that were found, if it is there')
    parser.add_argument('--missed', action='store_true', help='print the lines that are not reached')
    parser.add_argument('targets', nargs='+')
    args = parser.parse_args()
    short = False
    for target in args.targets:
        program = os.path.join(args.programs, 'fuzz_' + target)
        if not os.path.exists(program):
            print('%-16s was not built' % target)
            continue
        folders = [os.path.join(args.top, 'fuzz', 'corpus', target), os.path.join(args.found, target)]
        counts = lines_reached(program, [folder for folder in folders if os.path.isdir(folder)], PARSERS[target])
        all_lines = [(file, line, count) for file, lines in counts.items() for line, count in lines.items()]
        reached = sum(count > 0 for _, _, count in all_lines)
        share = reached / max(1, len(all_lines))
        short = short or share < LEAST
        print('%-16s %5.1f %% of %4d lines%s' % (target, 100 * share, len(all_lines),
                                                '' if share >= LEAST else '   BELOW %d %%' % (100 * LEAST)))
        if args.missed:
            for file, line, count in sorted(all_lines):
                if not count:
                    print('    src/%s:%d' % (file, line))
    return 1 if short else 0


if __name__ == '__main__':
    sys.exit(main())
