# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""report.html, one file with its pictures inside, and report.json with the same figures."""
import base64
import html
import math
import os

import cv2
import numpy as np

from photos.common import in_threads, write_json, write_text
from photos.dataset import is_held_out
from photos.summary import advice, figures
from photos.turntable import STYLE, html_of

THUMB_SIDE = 240
JPEG_QUALITY = 80
MASK_COLOUR = (60, 220, 60)  # BGR
PAGE = '''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>
body {{ font: 15px/1.45 sans-serif; max-width: 75em; margin: 2em auto; padding: 0 1em; color: #222; }}
table {{ border-collapse: collapse; margin: 1em 0; }}
td, th {{ border: 1px solid #ccc; padding: .25em .6em; text-align: left; vertical-align: top; }}
.sheet {{ display: flex; flex-wrap: wrap; gap: 10px; }}
.sheet figure {{ margin: 0; font-size: 12px; }}
.sheet img {{ display: block; }}
.held {{ outline: 3px solid #2166ac; }}
{style}</style></head><body>
<h1>{title}</h1>
{body}
</body></html>
'''


def embedded(image, quality=JPEG_QUALITY):
    data = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return 'data:image/jpeg;base64,' + base64.b64encode(data.tobytes()).decode('ascii')


def thumbnail(image):
    scale = THUMB_SIDE / max(image.shape[:2])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def with_outline(photo, mask):
    outlines, _ = cv2.findContours(np.uint8(mask >= 128), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    drawn = photo.copy()
    cv2.drawContours(drawn, outlines, -1, MASK_COLOUR, max(2, max(photo.shape) // 200))
    return drawn


def on_grey(rendering):
    alpha = rendering[:, :, 3:].astype(np.float32) / 255
    return (rendering[:, :, :3] * alpha + 128 * (1 - alpha)).astype(np.uint8)


def pair_of(job, view):
    """The photo with its mask's outline, and beside it the rendering if there is one."""
    photo = cv2.imread(job.path('dataset', 'images', view['name'] + '.jpg'))
    mask = cv2.imread(job.path('dataset', 'masks', view['name'] + '.png'), cv2.IMREAD_GRAYSCALE)
    pictures = [thumbnail(with_outline(photo, mask))]
    path = job.path('renderings', view['name'] + '.png')
    if os.path.exists(path):
        rendering = on_grey(cv2.imread(path, cv2.IMREAD_UNCHANGED))
        pictures.append(cv2.resize(rendering, pictures[0].shape[1::-1], interpolation=cv2.INTER_AREA))
    return np.hstack(pictures)


def contact_sheet(job, facts):
    quality = {row['name']: row for row in facts.get('quality', ())}
    pictures = in_threads(lambda view: embedded(pair_of(job, view)), facts['views'])
    parts = []
    for i, (view, picture) in enumerate(zip(facts['views'], pictures)):
        row = quality.get(view['name'])
        shown = f", {row['psnr_object_db']:.1f} dB" if row and row['psnr_object_db'] is not None else ''
        held_out = is_held_out(i)
        text = html.escape(view['source']) + (' (held out)' if held_out else '') + shown
        parts.append(f'<figure{" class=held" if held_out else ""}><img alt="{text}" src="{picture}">'
                     f'<figcaption>{text}</figcaption></figure>')
    return '<div class="sheet">' + '\n'.join(parts) + '</div>'


def directions_drawing(views):
    """The sky over the object from above: its middle is straight above, the outer circle is the table's height."""
    parts = ['<svg width="360" height="360" viewBox="-180 -180 360 360" role="img" '
             'aria-label="Directions from which photos were taken">']
    for elevation in (0, 30, 60):
        radius = 150 * (90 - elevation) / 90
        parts.append(f'<circle r="{radius:g}" fill="none" stroke="#bbb"/><text x="3" y="{-radius - 2:g}" font-size="10" '
                     f'fill="#777">{elevation} deg</text>')
    for azimuth in range(0, 360, 30):
        x, y = math.cos(math.radians(azimuth)), -math.sin(math.radians(azimuth))
        parts.append(f'<line x2="{150 * x:.1f}" y2="{150 * y:.1f}" stroke="#eee"/><text x="{165 * x:.1f}" '
                     f'y="{165 * y + 4:.1f}" font-size="10" fill="#777" text-anchor="middle">{azimuth}</text>')
    for i, view in enumerate(views):
        radius = 150 * (90 - max(-15, view['elevation_deg'])) / 90
        x = radius * math.cos(math.radians(view['azimuth_deg']))
        y = -radius * math.sin(math.radians(view['azimuth_deg']))
        colour = '#2166ac' if is_held_out(i) else '#333'
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"><title>{html.escape(view["source"])}'
                     '</title></circle>')
    return ''.join(parts) + '</svg>'


def table(header, rows):
    head = ''.join(f'<th>{html.escape(cell)}</th>' for cell in header)
    body = ''.join('<tr>' + ''.join(f'<td>{html.escape(str(cell))}</td>' for cell in row) + '</tr>' for row in rows)
    return f'<table><tr>{head}</tr>{body}</table>' if header else f'<table>{body}</table>'


def photo_table(facts):
    quality = {row['name']: row for row in facts.get('quality', ())}
    rows = []
    for i, view in enumerate(facts['views']):
        row = quality.get(view['name'], {})
        psnr, error = row.get('psnr_object_db'), view['error_px']
        rows.append((view['source'], 'held out' if is_held_out(i) else 'learned', '' if psnr is None else f'{psnr:.1f}',
                     '' if error is None else f'{error:.2f}', f"{view['mask_agreement']:.2f}",
                     f"{view['azimuth_deg']:.0f}", f"{view['elevation_deg']:.0f}"))
    return table(('photo', '', 'PSNR on the object [dB]', 'reprojection error, median [px]', "mask's agreement",
                  'azimuth [deg]', 'elevation [deg]'), rows)


def turning(job):
    """The model on a turntable, or nothing where none was learned."""
    path = job.path('turntable.jpg')
    if not os.path.exists(path):
        return ''
    with open(path, 'rb') as file:
        return html_of('data:image/jpeg;base64,' + base64.b64encode(file.read()).decode('ascii'))


def write_report(job, facts):
    sentences = advice(facts) or ['Nothing: all is well.']
    body = '\n'.join((
        table((), figures(facts)),
        turning(job),
        '<h2>What to do better</h2><ul>' + ''.join(f'<li>{html.escape(text)}</li>' for text in sentences) + '</ul>',
        '<h2>Directions of the photos</h2>' + directions_drawing(facts['views']),
        '<h2>Photos, masks and renderings</h2><p>Green: the mask. Right: the model, rendered where the photo was taken. '
        'Framed in blue: held out, the model has not seen it.</p>' + contact_sheet(job, facts),
        '<h2>Each photo</h2>' + photo_table(facts)))
    # The page first: an overview links it as soon as there is a report.json.
    write_text(job.path('report.html'), PAGE.format(title=html.escape(facts['name']), body=body, style=STYLE))
    write_json(job.path('report.json'), {**facts, 'advice': sentences})
