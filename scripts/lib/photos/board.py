# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""The ChArUco board: what it is, how it is drawn, and its corners in photos.

Squares alternate, the first (upper left) one is black; the white ones hold markers, numbered row by row. This is the
pattern of OpenCV from 4.6 on. The board's frame has its origin in the middle, x to the right, y up, z out of the paper.
Of OpenCV only markers are used, whose interface is found out: it differs from 4.2 to 4.6 and from 4.7 on; classes of
boards differ more.
"""
import collections
import re

import cv2
import numpy as np

from photos.common import InputError, require

# `columns` x `rows` squares of `square_mm`, with markers of `marker_mm` of one of OpenCV's dictionaries.
Board = collections.namedtuple('Board', 'columns rows square_mm marker_mm dictionary')

DEFAULT = 'charuco:7x10:25:18:5X5_100'
MIN_CORNERS = 6           # of a photo that says anything
CLEAR = 0.7               # half the side of the window in which a corner is refined, of its distance from a marker
MAX_WINDOW_PX = 7
MIN_WINDOW_PX = 2


def parse_board(text):
    """'charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM:DICTIONARY', as make_board prints it."""
    match = re.fullmatch(r'charuco:(\d+)x(\d+):([\d.]+):([\d.]+):(\w+)', text)
    try:
        board = Board(int(match[1]), int(match[2]), float(match[3]), float(match[4]), match[5])
    except (TypeError, ValueError) as error:
        raise InputError(f"'{text}' is no board: write it as {DEFAULT}") from error
    require(3 <= board.columns <= 40 and 3 <= board.rows <= 40, f"'{text}': 3 to 40 squares each way")
    require(0 < board.marker_mm < board.square_mm, f"'{text}': markers are smaller than squares")
    require(hasattr(cv2, 'aruco'), 'this OpenCV has no aruco module: install python3-opencv')
    require(hasattr(cv2.aruco, 'DICT_' + board.dictionary), f"'{text}': OpenCV has no dictionary {board.dictionary}")
    markers = board.columns * board.rows // 2
    require(markers <= dictionary_of(board).bytesList.shape[0],
            f"'{text}': the dictionary has fewer than {markers} markers")
    return board


def text_of(board):
    return (f'charuco:{board.columns}x{board.rows}:{board.square_mm:g}:{board.marker_mm:g}:{board.dictionary}')


def dictionary_of(board):
    return aruco_dictionary(board.dictionary)


def aruco_dictionary(name):
    number = getattr(cv2.aruco, 'DICT_' + name)
    if hasattr(cv2.aruco, 'getPredefinedDictionary'):
        return cv2.aruco.getPredefinedDictionary(number)
    return cv2.aruco.Dictionary_get(number)


def marker_squares(board):
    """(row, column) of the square of each marker, by the marker's number."""
    return [(row, column) for row in range(board.rows) for column in range(board.columns) if (row + column) % 2]


def marker_bits(board, number):
    """Black cells of a marker with its border: [cells][cells] of bool."""
    draw = getattr(cv2.aruco, 'generateImageMarker', None) or cv2.aruco.drawMarker
    dictionary = dictionary_of(board)
    return draw(dictionary, number, dictionary.markerSize + 2) < 128


def rectangles(board):
    """Black rectangles of the board: yields (x, y, width, height) [mm from its upper left corner, y down]."""
    for row in range(board.rows):
        for column in range(row % 2, board.columns, 2):
            yield column * board.square_mm, row * board.square_mm, board.square_mm, board.square_mm
    inset = 0.5 * (board.square_mm - board.marker_mm)
    for number, (row, column) in enumerate(marker_squares(board)):
        bits = marker_bits(board, number)
        cell = board.marker_mm / len(bits)
        x, y = column * board.square_mm + inset, row * board.square_mm + inset
        for i, j in zip(*np.nonzero(bits)):
            yield x + j * cell, y + i * cell, cell, cell


def board_frame(board, x_mm, y_mm):
    """A place on the paper [mm from the upper left corner, y down] in the board's frame [m]."""
    return np.array([x_mm - 0.5 * board.columns * board.square_mm, 0.5 * board.rows * board.square_mm - y_mm, 0]) / 1000


def inner_corners(board):
    """(row, column) of the squares below and right of each inner corner, by the corner's number."""
    return [(row, column) for row in range(1, board.rows) for column in range(1, board.columns)]


def corner_points(board):
    """{number: point in the board's frame [m]} of the inner corners."""
    return {number: board_frame(board, column * board.square_mm, row * board.square_mm)
            for number, (row, column) in enumerate(inner_corners(board))}


def detected_markers(board, grey):
    """{(row, column) of the square: corners [4][2] px, clockwise from the upper left}."""
    if hasattr(cv2.aruco, 'ArucoDetector'):
        corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary_of(board)).detectMarkers(grey)
    else:
        corners, numbers, _ = cv2.aruco.detectMarkers(grey, dictionary_of(board))
    places = marker_squares(board)
    found = zip([] if numbers is None else numbers.ravel(), corners)
    return {places[number]: quad.reshape(4, 2) for number, quad in found if number < len(places)}


def marker_outline(board, square):
    """Corners of a square's marker on the paper [4][2] mm."""
    row, column = square
    inset = 0.5 * (board.square_mm - board.marker_mm)
    x, y = column * board.square_mm + inset, row * board.square_mm + inset
    return np.array([(x, y), (x + board.marker_mm, y), (x + board.marker_mm, y + board.marker_mm),
                     (x, y + board.marker_mm)])


def predicted_corner(board, markers, place):
    """Where an inner corner should be, and how far it is from the nearest marker [px]; None unless both markers at it
    are seen. @param place (row, column) of the square below and right of it."""
    row, column = place
    around = [(row - 1, column - 1), (row - 1, column), (row, column - 1), (row, column)]
    seen = [square for square in around if square in markers]
    if len(seen) < 2:
        return None
    paper = np.concatenate([marker_outline(board, square) for square in seen])
    pixels = np.concatenate([markers[square] for square in seen])
    H, _ = cv2.findHomography(paper, pixels)
    if H is None:
        return None
    corner = np.array([column * board.square_mm, row * board.square_mm, 1])
    x, y, w = H @ corner
    predicted = np.array([x, y]) / w
    return predicted, float(np.min(np.linalg.norm(pixels - predicted, axis=1)))


def find_corners(board, image):
    """{number: (x, y)} [px from the image's corner] of the inner corners that are seen; empty if too few."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    markers = detected_markers(board, grey)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)
    corners = {}
    for number, place in enumerate(inner_corners(board)):
        prediction = predicted_corner(board, markers, place)
        if prediction is None:
            continue
        predicted, clearance = prediction
        half = int(np.clip(CLEAR * clearance, MIN_WINDOW_PX, MAX_WINDOW_PX))
        if not (predicted > half + 1).all() or not (predicted < np.array(grey.shape[::-1]) - half - 2).all():
            continue
        refined = cv2.cornerSubPix(grey, predicted.astype(np.float32).reshape(1, 1, 2), (half, half), (-1, -1), criteria)
        if np.linalg.norm(refined.ravel() - predicted) < half:
            corners[number] = tuple(refined.ravel().astype(float) + 0.5)
    return corners if len(corners) >= MIN_CORNERS else {}
