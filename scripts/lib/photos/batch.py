# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Many objects: a folder of folders (or videos), in parts for job arrays, and one report over all that are there."""
import dataclasses
import html
import os
import re
import urllib.parse

from photos.common import InputError, locked, read_json, require, say, write_json, write_text
from photos.pipeline import make_object
from photos.report import PAGE, table
from photos.summary import held_out_psnr_db, size_text, summary_of
from photos.video import is_video


def object_sources(folder):
    """{name: path} of the folders and videos in a folder."""
    require(os.path.isdir(folder), f"there is no folder '{folder}'")
    found = {}
    for entry in sorted(os.listdir(folder)):
        path = os.path.join(folder, entry)
        if entry[0] != '.' and (os.path.isdir(path) or is_video(entry)):
            name = entry if os.path.isdir(path) else os.path.splitext(entry)[0]
            require(name not in found, f"'{folder}' holds two objects of the name '{name}'")
            found[name] = path
    require(found, f"'{folder}' holds no folders or videos: one for each object")
    return found


def part_of(names, part):
    """@param part 'i/n': each n-th name, from i on."""
    match = re.fullmatch(r'(\d+)/(\d+)', part)
    require(match and int(match[1]) < int(match[2]), f"--part {part}: write i/n with i from 0 to n - 1")
    return names[int(match[1])::int(match[2])]


def make_one(options):
    """One object. @return whether it succeeded; why not is in its error.txt."""
    failure = os.path.join(options.output, 'error.txt')
    try:
        say(summary_of(make_object(options), options.output))
    except Exception as error:  # whatever it is: the other objects are made
        text = str(error) if isinstance(error, (InputError, OSError)) else f'{type(error).__name__}: {error}'
        say(f'{options.name}: {text}')
        os.makedirs(options.output, exist_ok=True)
        write_text(failure, text + '\n')
        return False
    if os.path.exists(failure):
        os.unlink(failure)
    return True


def make_objects(options, part):
    """@return the exit code: 1 if an object of this part failed."""
    sources = object_sources(options.source)
    made = [make_one(dataclasses.replace(options, source=sources[name], name=name,
                                         output=os.path.join(options.output, name)))
            for name in part_of(list(sources), part)]
    with locked(options.output):  # or a task that read the states earlier writes them over those of one that read later
        write_overview(options.output, list(sources))
    return 0 if all(made) else 1


def row_of(folder, name):
    """What is known of one object: {name, state, ..}."""
    try:
        with open(os.path.join(folder, name, 'error.txt'), encoding='utf-8') as file:
            return {'name': name, 'state': 'failed', 'why': file.read().strip()}
    except FileNotFoundError:  # it did not fail; another process may have removed the file just now
        pass
    if not os.path.exists(os.path.join(folder, name, 'report.json')):
        return {'name': name, 'state': 'not yet'}
    facts = read_json(os.path.join(folder, name, 'report.json'))
    return {'name': name, 'state': 'done', 'posed': facts['posed'], 'photos': facts['photos'],
            'size': size_text(facts), 'psnr_object_db': held_out_psnr_db(facts), 'why': ' '.join(facts['advice'])}


def write_overview(folder, names):
    """index.html and index.json over all objects, whichever process made them."""
    rows = [row_of(folder, name) for name in names]
    cells = []
    for row in rows:
        psnr = row.get('psnr_object_db')
        cells.append((row['name'], row['state'], f"{row['posed']} of {row['photos']}" if 'posed' in row else '',
                      row.get('size', ''), '' if psnr is None else f'{psnr:.1f}', row.get('why', '')))
    body = table(('object', '', 'photos with a pose', 'size', 'PSNR [dB]', 'advice'), cells)
    links = ''.join(f'<li><a href="{urllib.parse.quote(row["name"])}/report.html">{html.escape(row["name"])}</a></li>'
                    for row in rows if row['state'] == 'done')
    write_json(os.path.join(folder, 'index.json'), rows)
    write_text(os.path.join(folder, 'index.html'), PAGE.format(title=f'{len(names)} objects', body=f'{body}<ul>{links}</ul>',
                                                              style=''))
