# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Size and camera of an image file, from its header alone: nothing is decoded."""
import collections
import struct

from photos.common import InputError

# `width` and `height` as stored [px]; `orientation` is EXIF's, 1 where they are upright. `camera` is maker and model, ''
# if not said. `focal_35mm` is the focal length of a 36 mm wide sensor [mm], 0 if not said.
Header = collections.namedtuple('Header', 'width height orientation camera focal_35mm')

HEADER_BYTES = 1 << 20  # EXIF with its thumbnail comes within the first 64 KiB blocks
START_OF_FRAME = set(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
MAKE, MODEL, ORIENTATION, EXIF_FOLDER, FOCAL_35MM = 0x010F, 0x0110, 0x0112, 0x8769, 0xA405
ASCII, SHORT, LONG = 2, 3, 4
MAX_ENTRIES = 512
HEIC_BRANDS = (b'heic', b'heix', b'mif1', b'msf1', b'hevc', b'avif')


def tags(data, offset, order):
    """Entries of one folder of a TIFF: {tag: text or number}; other types are left out."""
    found = {}
    entries, = struct.unpack_from(order + 'H', data, offset)
    for i in range(min(entries, MAX_ENTRIES)):
        tag, kind, length, value = struct.unpack_from(order + 'HHI4s', data, offset + 2 + 12 * i)
        if kind == ASCII:
            start = struct.unpack(order + 'I', value)[0] if length > 4 else offset + 2 + 12 * i + 8
            found[tag] = data[start:start + min(length, 64)].split(b'\0')[0].decode('ascii', 'replace').strip()
        elif kind in (SHORT, LONG) and length == 1:
            found[tag], = struct.unpack_from(order + ('H' if kind == SHORT else 'I'), value)
    return found


def exif(data):
    """(orientation, camera, focal length for 35 mm) of a TIFF block; (1, '', 0) where it is damaged or silent."""
    try:
        order = {b'II': '<', b'MM': '>'}[data[:2]]
        top = tags(data, struct.unpack_from(order + 'I', data, 4)[0], order)
        inner = tags(data, top[EXIF_FOLDER], order) if isinstance(top.get(EXIF_FOLDER), int) else {}
    except (KeyError, struct.error):
        return 1, '', 0
    camera = ' '.join(str(top[tag]) for tag in (MAKE, MODEL) if tag in top)
    focal = inner.get(FOCAL_35MM, 0)
    return top.get(ORIENTATION, 1), camera, focal if isinstance(focal, int) else 0


def jpeg_header(data):
    described, position = (1, '', 0), 2
    while position + 9 <= len(data) and data[position] == 0xFF:
        marker, length = data[position + 1], struct.unpack_from('>H', data, position + 2)[0]
        if marker == 0xFF:  # padding
            position += 1
            continue
        if marker in START_OF_FRAME:
            height, width = struct.unpack_from('>HH', data, position + 5)
            return Header(width, height, *described)
        if marker == 0xE1 and data[position + 4:position + 10] == b'Exif\0\0':
            described = exif(data[position + 10:position + 2 + length])
        position += 2 + length
    return None


def read_header(path):
    """@throws InputError naming what the file is instead of a photo."""
    try:
        with open(path, 'rb') as file:
            data = file.read(HEADER_BYTES)
    except OSError as error:
        raise InputError(f"cannot read '{path}': {error.strerror}") from error
    header = None
    if data[:2] == b'\xff\xd8':
        header = jpeg_header(data)
    elif data[:8] == b'\x89PNG\r\n\x1a\n' and len(data) >= 24:
        header = Header(*struct.unpack_from('>II', data, 16), 1, '', 0)
    elif data[4:8] == b'ftyp' and data[8:12] in HEIC_BRANDS:
        raise InputError(f"'{path}' is HEIC, which OpenCV does not read: convert it to JPEG first (heif-convert of "
                         "Debian's libheif-examples; or set the phone to its most compatible format)")
    if header is None or min(header.width, header.height) < 1:
        raise InputError(f"'{path}' is no JPEG or PNG, or it is damaged")
    return header
