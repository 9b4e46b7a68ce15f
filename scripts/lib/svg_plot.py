# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Plots of measurements over time as SVG, without a plotting library."""

WIDTH, HEIGHT = 900, 130  # of a panel [px]
LEFT, RIGHT, TOP, BOTTOM = 70, 15, 25, 25
COLOURS = ('#1f5fa8', '#c2571a', '#3a8a3a')


def _points(xs, ys, x_range, y_range):
    """Places in a panel, as SVG wants them."""
    (x0, x1), (y0, y1) = x_range, y_range
    return ' '.join('%.1f,%.1f' % (LEFT + (WIDTH - LEFT - RIGHT) * (x - x0) / (x1 - x0),
                                   HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (y - y0) / (y1 - y0))
                    for x, y in zip(xs, ys))


def _range(values):
    """From 0, or from the least value where that is far from 0, to the largest one."""
    low, high = min(values), max(values)
    if high - low > 0.2 * high:
        low = min(0, low)
    margin = 0.05 * (high - low) or 1
    return low - margin * (low != 0), high + margin


def _panel(title, xs, curves):
    """@param curves name -> values."""
    x_range, y_range = (min(xs), max(xs) or 1), _range([y for ys in curves.values() for y in ys])
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    parts = ['<text x="%d" y="16" font-weight="bold">%s</text>' % (LEFT, title),
             '<path d="M%d %dV%dH%d" fill="none" stroke="#888"/>' % (LEFT, TOP, bottom, right),
             '<text x="%d" y="%d" text-anchor="end">%.4g</text>' % (LEFT - 6, TOP + 8, y_range[1]),
             '<text x="%d" y="%d" text-anchor="end">%.4g</text>' % (LEFT - 6, bottom, y_range[0]),
             '<text x="%d" y="%d">%.4g</text>' % (LEFT, HEIGHT - 8, x_range[0]),
             '<text x="%d" y="%d" text-anchor="end">%.4g min</text>' % (right, HEIGHT - 8, x_range[1])]
    for i, (name, ys) in enumerate(curves.items()):
        colour = COLOURS[i % len(COLOURS)]
        parts.append('<polyline fill="none" stroke="%s" points="%s"/>' % (colour, _points(xs, ys, x_range, y_range)))
        parts.append('<text x="%d" y="16" fill="%s">%s</text>' % (LEFT + 300 + 150 * i, colour, name))
    return parts


def svg(minutes, panels):
    """@param minutes the time of each measurement. @param panels title -> {name -> values}."""
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" width="%d" height="%d" font-family="sans-serif" font-size="11">'
             % (WIDTH, HEIGHT * len(panels)), '<rect width="100%" height="100%" fill="white"/>']
    for i, (title, curves) in enumerate(panels.items()):
        lines += ['<g transform="translate(0 %d)">' % (HEIGHT * i)] + _panel(title, minutes, curves) + ['</g>']
    return '\n'.join(lines + ['</svg>\n'])
