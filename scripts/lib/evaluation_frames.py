# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""What evaluate_bag wrote of each image, for plots."""
import csv
import math


def read_frames(path):
    """Rows of the CSV; what is empty there was not found: infinite."""
    with open(path, newline='', encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    text = ('stamp', 'outcome')
    return [{key: value if key in text else float(value) if value else math.inf for key, value in row.items()}
            for row in rows]


def seconds(rows, first=None):
    """Times since a stamp, by default that of the first image [s]; stamps have more digits than a float."""
    whole, rest = (first or rows[0]['stamp']).split('.')
    return [int(row_whole) - int(whole) + float('0.' + row_rest) - float('0.' + rest)
            for row_whole, row_rest in (row['stamp'].split('.') for row in rows)]
