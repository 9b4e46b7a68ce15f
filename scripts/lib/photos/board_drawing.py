# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""A board as PDF, SVG or PNG of exact size."""
import math
import os
import tempfile

import cv2
import numpy as np

from photos.board import rectangles, text_of
from photos.common import InputError, mode_of, require, write_text

PAGES = {'A4': (210, 297), 'A3': (297, 420), 'A2': (420, 594), 'letter': (215.9, 279.4)}  # [mm]
PRINTER_MARGIN_MM = 4
LINE_MM = 100          # of the line to measure
FOOT_MM = 14           # below the board, for that line and its text
POINTS_OF_MM = 72 / 25.4
MAX_PIXELS = 1 << 28


def layout(board, page):
    """(page width, height, board's left, top) [mm]; the page is turned if the board fits only so."""
    width, height = board.columns * board.square_mm, board.rows * board.square_mm
    if page == 'none':
        return width + 2 * board.square_mm, height + 2 * board.square_mm + FOOT_MM, board.square_mm, board.square_mm
    for w, h in (PAGES[page], PAGES[page][::-1]):
        if width + 2 * PRINTER_MARGIN_MM <= w and height + FOOT_MM + 2 * PRINTER_MARGIN_MM <= h:
            return w, h, 0.5 * (w - width), 0.5 * (h - FOOT_MM - height)
    raise InputError(f'a board of {width:g} x {height:g} mm does not fit on {page}: take --page A3 or none, or smaller '
                     'squares')


def foot(board, place):
    """(x, y, width) of the line to measure, and the text beside it [mm]."""
    left, top = place
    line = min(LINE_MM, board.columns * board.square_mm)
    return left, top + board.rows * board.square_mm + 6, line, f'This line is {line:g} mm long. {text_of(board)}'


def svg(board, page):
    width, height, left, top = layout(board, page)
    x, y, line, text = foot(board, (left, top))
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" height="{height:g}mm" '
             f'viewBox="0 0 {width:g} {height:g}" shape-rendering="crispEdges">',
             f'<rect width="{width:g}" height="{height:g}" fill="#fff"/>']
    for rx, ry, rw, rh in rectangles(board):
        parts.append(f'<rect x="{left + rx:.4f}" y="{top + ry:.4f}" width="{rw:.4f}" height="{rh:.4f}"/>')
    parts.append(f'<rect x="{x:.4f}" y="{y:.4f}" width="{line:g}" height="0.3"/>')
    parts.append(f'<text x="{x:.4f}" y="{y + 4:.4f}" font-family="sans-serif" font-size="3">{text}</text></svg>\n')
    return '\n'.join(parts)


def pdf_objects(board, page):
    """The objects of a PDF of one page, from 1 on, as bytes."""
    width, height, left, top = layout(board, page)
    x, y, line, text = foot(board, (left, top))
    drawn = [f'{left + rx:.4f} {height - top - ry - rh:.4f} {rw:.4f} {rh:.4f} re' for rx, ry, rw, rh in rectangles(board)]
    drawn.append(f'{x:.4f} {height - y:.4f} {line:.4f} 0.3 re')
    content = (f'{POINTS_OF_MM:.8f} 0 0 {POINTS_OF_MM:.8f} 0 0 cm 0 g\n' + '\n'.join(drawn) +
               f'\nf\nBT /F 3 Tf {x:.4f} {height - y - 4:.4f} Td ({text}) Tj ET\n').encode('ascii')
    box = f'[0 0 {width * POINTS_OF_MM:.4f} {height * POINTS_OF_MM:.4f}]'
    return [b'<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>',
            b'<< /Type /Pages /Kids [3 0 R] /Count 1 >>',
            f'<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R /Resources << /Font << /F 5 0 R >> >> '
            '>>'.encode('ascii'),
            f'<< /Length {len(content)} >>\nstream\n'.encode('ascii') + content + b'endstream',
            b'<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>']


def pdf(board, page):
    data, offsets = b'%PDF-1.4\n', []
    for number, content in enumerate(pdf_objects(board, page), 1):
        offsets.append(len(data))
        data += f'{number} 0 obj\n'.encode('ascii') + content + b'\nendobj\n'
    table = ''.join(f'{offset:010d} 00000 n \n' for offset in offsets)
    trailer = (f'xref\n0 {len(offsets) + 1}\n0000000000 65535 f \n{table}trailer\n<< /Size {len(offsets) + 1} '
               f'/Root 1 0 R >>\nstartxref\n{len(data)}\n%%EOF\n')
    return (data + trailer.encode('ascii')).decode('ascii')


def write_page(board, page, path):
    write_text(path, svg(board, page) if path.lower().endswith('.svg') else pdf(board, page))


def picture(board, pixels_per_mm):
    """Grey image of the board with a white border of half a square. Squares begin at whole pixels where
    square_mm * pixels_per_mm is whole; inner edges of markers are rounded."""
    border = 0.5 * board.square_mm
    size = [math.ceil((n * board.square_mm + 2 * border) * pixels_per_mm) for n in (board.rows, board.columns)]
    require(0 < size[0] * size[1] <= MAX_PIXELS, f'{size[1]} x {size[0]} pixels are too many: fewer --pixels-per-mm')
    image = np.full(size, 255, np.uint8)
    for x, y, width, height in rectangles(board):
        x0, y0, x1, y1 = (round((border + value) * pixels_per_mm) for value in (x, y, x + width, y + height))
        image[y0:y1, x0:x1] = 0
    return image


def write_png(board, pixels_per_mm, path):
    require(pixels_per_mm > 0, '--pixels-per-mm is not positive')
    encoded, data = cv2.imencode('.png', picture(board, pixels_per_mm))
    require(encoded, f"cannot make '{path}'")
    handle, temporary = tempfile.mkstemp(prefix='.', dir=os.path.dirname(os.path.abspath(path)))
    try:
        with os.fdopen(handle, 'wb') as file:
            file.write(data.tobytes())
        os.chmod(temporary, mode_of(path))
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise
