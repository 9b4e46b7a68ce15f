#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Runs a test that is a script and writes its result where catkin looks for it: a JUnit file with one test case.

    run_script.py NAME RESULT.xml COMMAND [ARGUMENT...]

The exit code is the command's; 77 means skipped.
"""
import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

SKIPPED = 77


def main(name, result_path, *command):
    start = time.monotonic()
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True,
                            errors='replace')
    seconds = '%.3f' % (time.monotonic() - start)
    print(result.stdout, end='', flush=True)
    failed = result.returncode not in (0, SKIPPED)
    suite = ElementTree.Element('testsuite', name=name, tests='1', failures=str(int(failed)), errors='0',
                                skipped=str(int(result.returncode == SKIPPED)), time=seconds)
    case = ElementTree.SubElement(suite, 'testcase', classname=name, name=name, time=seconds)
    if failed:
        ElementTree.SubElement(case, 'failure', message='exit code %d' % result.returncode).text = ''.join(
            c for c in result.stdout if c in '\t\n' or c >= ' ')  # XML holds no other control characters
    elif result.returncode == SKIPPED:
        ElementTree.SubElement(case, 'skipped')
    os.makedirs(os.path.dirname(os.path.abspath(result_path)), exist_ok=True)
    ElementTree.ElementTree(suite).write(result_path, encoding='utf-8', xml_declaration=True)
    return result.returncode


if __name__ == '__main__':
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
