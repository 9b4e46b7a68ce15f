#!/usr/bin/env python3
# Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
"""Writes inputs of the fuzzers of messages and landmarks to fuzz/corpus: every valid form, and some that are refused.

The layout of messages is that of fuzz/message_bytes.h."""
import os
import struct

CORPUS = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'corpus')
SIZE = 8, 6  # of images [px]
CHANNELS = {'rgb8': 3, 'bgr8': 3, 'rgba8': 4, 'bgra8': 4, 'mono8': 1, 'bayer_rggb8': 1, 'yuv422': 2, 'mono16': 2,
            '32FC1': 4, 'nothing': 1}
IDENTITY = (1, 0, 0, 0, 1, 0, 0, 0, 1)


def doubles(*values):
    return struct.pack('<%dd' % len(values), *values)


def text(value):
    return bytes([len(value)]) + value.encode()


def header(frame='camera', stamp=(10, 0)):
    return struct.pack('<2I', *stamp) + text(frame)


def info(**changes):
    """camera_info. @param changes of these fields: roi is x, y, height, width."""
    fields = {'frame': 'camera', 'stamp': (10, 0), 'size': SIZE, 'model': 'plumb_bob', 'D': (),
              'K': (10, 0, 3.5, 0, 10, 2.5, 0, 0, 1), 'P': (10, 0, 3.5, 0, 0, 10, 2.5, 0, 0, 0, 1, 0), 'binning': (0, 0),
              'roi': (0, 0, 0, 0), **changes}
    return (header(fields['frame'], fields['stamp']) + struct.pack('<2I', *reversed(fields['size'])) +
            text(fields['model']) + bytes([len(fields['D'])]) +
            doubles(*fields['D'], *fields['K'], *IDENTITY, *fields['P']) +
            struct.pack('<6I', *fields['binning'], *fields['roi']))


def image(encoding='rgb8', size=SIZE, **changes):
    """@param changes of these fields, and of the frame and the stamp."""
    step = size[0] * CHANNELS[encoding]
    fields = {'frame': 'camera', 'stamp': (10, 0), 'step': step, **changes}
    data = fields.get('data', bytes(i * 7 % 256 for i in range(fields['step'] * size[1])) if step < 1000 else b'')
    return (header(fields['frame'], fields['stamp']) + struct.pack('<2I', size[1], size[0]) + text(encoding) +
            struct.pack('<IH', fields['step'], len(data)) + data)


def pose(position=(0, 0, 0.6), orientation=(0, 0, 0, 1), variances=(), frame='camera', stamp=(10, 0)):
    covariance = [0.0] * 36
    for i, value in enumerate(variances):
        covariance[7 * i] = value
    return header(frame, stamp) + doubles(*position, *orientation, *covariance)


def camera_messages():
    """Flags (1: rectified, 2: with a mask, 4: with an ignore_mask), then camera_info, image and masks of each image."""
    nan, mask = float('nan'), image('mono8')
    seeds = {encoding: b'\0' + info() + image(encoding) for encoding in CHANNELS}
    seeds.update({
        'padded': b'\0' + info() + image(step=29),
        'plumb_bob': b'\0' + info(D=(0.1, 0.01, 0.001, 0.001, 0.01)) + image(),
        'four_numbers': b'\0' + info(D=(0.1, 0.01, 0.001, 0.001)) + image('mono8'),
        'rational': b'\0' + info(model='rational_polynomial', D=(0.1, 0.01, 0, 0, 0.1, 0.1, 0, 0)) + image('bgra8'),
        'fisheye': b'\0' + info(model='equidistant', D=(0.1, 0.01, 0, 0)) + image(),
        'distorted_masks': b'\6' + info(D=(0.1, 0.01, 0.001, 0.001, 0.01)) + image() + mask + mask,
        'folded': b'\0' + info(D=(1e6, -1e6, 1e3, 1e3, 1e6)) + image(),
        'three_numbers': b'\0' + info(D=(0.1, 0.1, 0.1)) + image(),
        'unknown_model': b'\0' + info(model='no_such_model', D=(0.1,) * 5) + image(),
        'nan_distortion': b'\0' + info(D=(nan,) * 5) + image(),
        'rectified': b'\1' + info() + image(),
        'stereo': b'\1' + info(P=(10, 0, 3.5, -1, 0, 10, 2.5, 0, 0, 0, 1, 0)) + image(),
        'masks': b'\6' + info() + image() + mask + mask,
        'wrong_masks': b'\6' + info() + image() + image() + image('mono8', (4, 3)),
        'binned': b'\0' + info(size=(16, 12), binning=(2, 2)) + image(),
        'region': b'\1' + info(size=(16, 12), roi=(2, 1, 6, 8)) + image(),
        'uncalibrated': b'\0' + info(K=(0,) * 9) + image(),
        'vast_focal_length': b'\0' + info(K=(1e10, 0, 3, 0, 1e10, 2, 0, 0, 1)) + image(),
        'another_size': b'\0' + info() + image(size=(4, 3)),
        'truncated': b'\0' + info() + image(data=b'1234'),
        'huge': b'\0' + info(size=(2**32 - 1, 2**31)) + image(size=(2**32 - 1, 2**31), step=2**32 - 1, data=b'12'),
        'zero': b'\0' + info(size=(0, 0)) + image(size=(0, 0)),
        'no_stamp': b'\0' + info() + image(stamp=(0, 0)),
        'no_frame': b'\0' + info() + image(frame='/'),
        'camera_changes': b'\0' + info() + image() + info(size=(4, 3)) + image(size=(4, 3)) + info() + image('mono8'),
    })
    return seeds


def initial_poses():
    half = 0.5 ** 0.5
    return {
        'plain': pose(),
        'turned': pose(orientation=(half, 0, 0, half), frame='/world', stamp=(0, 0)),
        'covariance': pose(variances=(1e-4, 1e-4, 4e-4, 0.01, 0.01, 0.02)),
        'about_the_axis': pose(variances=(0, 0, 0, 0, 0, 3)),
        'position_alone': pose(variances=(1e-4, 1e-4, 1e-4)),
        'vast_variance': pose(variances=(1e300,) * 6),
        'negative_variance': pose(variances=(-1,)),
        'nan': pose(position=(float('nan'), 0, 0)),
        'infinite': pose(orientation=(0, 0, 0, float('inf'))),
        'zero_quaternion': pose(orientation=(0, 0, 0, 0)),
        'far': pose(position=(1e200, 0, 1)),
        'no_frame': pose(frame=''),
    }


def bags():
    """Flags (topics that are named, see fuzz/ros_targets.cpp), then for each message topic, type and message."""
    def record(topic, kind, message):
        return bytes([topic, kind]) + message
    IMAGE, INFO, MASK, INITIAL, TRUTH, TF, TF_STATIC, OTHER = range(8)
    images = b''.join(record(IMAGE, 0, image(stamp=(i, 0))) + record(INFO, 1, info(stamp=(i, 0))) for i in (10, 11))
    moves = b''.join(record(TF, 5, b'\1' + text(child) + pose(frame=parent, stamp=(i, 0)))
                     for i in (10, 12) for parent, child in (('world', 'camera'), ('/world', 'object')))
    return {
        'truth_frame': b'\0' + images + moves,
        'static': b'\0' + images + record(TF_STATIC, 5, b'\1' + text('object') + pose(frame='camera')),
        'truth': bytes([9]) + images + b''.join(record(TRUTH, 3, pose(stamp=(i, 0))) for i in (10, 11)),
        'truth_wide': bytes([8]) + images + record(TRUTH, 2, pose()),
        'truth_transform': bytes([8]) + images + record(TRUTH, 4, text('object') + pose()),
        'initial_pose': bytes([4]) + images + moves + record(INITIAL, 3, pose()),
        'initial_pose_wide': bytes([20]) + images + moves + record(INITIAL, 2, pose(variances=(0.1,), frame='world')),
        'bad_initial_pose': bytes([4]) + images + moves + record(INITIAL, 3, pose(orientation=(0, 0, 0, 0))),
        'masks': bytes([2]) + images + moves + record(MASK, 0, image('mono8')),
        'one_info': b'\0' + record(IMAGE, 0, image(stamp=(11, 0))) + record(INFO, 1, info()) + moves,
        'no_info': b'\0' + record(IMAGE, 0, image()) + moves,
        'other_stamps': b'\0' + images + record(IMAGE, 0, image(stamp=(13, 0))) + moves,
        'two_images': b'\0' + images + record(OTHER, 0, image()),
        'wrong_type': b'\1' + record(IMAGE, 7, text('x')) + images,
        'wrong_info': b'\1' + record(INFO, 0, image()) + images,
        'nan_truth': bytes([8]) + images + record(TRUTH, 3, pose(position=(float('nan'),) * 3)),
        'empty': b'\0',
    }


def detections():
    """A class, camera_info and image of a camera, then a vision_msgs/Detection2DArray as it is sent."""
    def sent(value):
        return struct.pack('<I', len(value)) + value

    def array(*boxes, count=None):
        count = len(boxes) if count is None else count
        return struct.pack('<3I', 1, 10, 0) + sent(b'camera') + struct.pack('<I', count) + b''.join(boxes)

    def box(place=(4, 3, 0, 2, 2), classes=((1, 0.5),), count=None, pixels=None):
        nothing = struct.pack('<3I', 0, 0, 0) + sent(b'')
        content = nothing + struct.pack('<I', len(classes) if count is None else count)
        for number, score in classes:
            content += struct.pack('<qd', number, score) + doubles(*[0] * 43)
        content += doubles(*place) + nothing + struct.pack('<2I', 1, 1) + sent(b'mono8')
        return content + struct.pack('<B2I', 0, 1, 1 if pixels is None else pixels) + b'x'
    start, distorted = b'\1' + info() + image(), b'\xff' + info(D=(0.1, 0.01, 0.001, 0.001, 0.01)) + image()
    nan = float('nan')
    return {
        'one': start + array(box()), 'none': start + array(), 'two': start + array(box(), box((1, 1, 0, 2, 2), classes=((1, 0.7),))),
        'other_class': start + array(box(classes=((2, 0.9),))), 'classes': start + array(box(classes=((2, 0.9), (1, 0.2)))),
        'no_class': start + array(box(classes=())), 'turned': distorted + array(box((4, 3, 0.5, 2, 2))),
        'odd': b'\xff' + info(size=(9, 7)) + image('mono8', (9, 7)) + array(box((5, 4, 0, 9, 7))),
        'beside': distorted + array(box((-10, 2, 0, 2, 2))), 'vast': start + array(box((4, 3, 0, 1e300, 1))),
        'nan': start + array(box((nan, 1, 0, 2, 2)), box(classes=((1, nan),))), 'negative': start + array(box((4, 3, 0, -2, 2))),
        'many': start + array(box(), count=2**32 - 1), 'many_classes': start + array(box(count=2**32 - 1)),
        'many_pixels': start + array(box(pixels=2**32 - 1)), 'short': start + array(box())[:-3],
    }


def fnv(data):
    value = 0xcbf29ce484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001b3 % 2**64
    return value


def landmarks():
    def file(kind, count, numbers, form=b'NPRLMK01', **changes):
        content = struct.pack('<QII', kind, count, numbers)
        for i in range(min(count, 3)):
            content += struct.pack('<12ffi', 0.1 * i, 2, -3, *IDENTITY, changes.get('size', 1), i + 1)
        content += bytes(i % 256 for i in range(min(count, 3) * numbers)) + changes.get('extra', b'')
        return form + struct.pack('<QQ', 7, fnv(content)) + content
    sift = file(1, 3, 128)
    return {
        'sift': sift, 'akaze': file(2, 3, 64), 'none': file(1, 0, 128), 'none_akaze': file(2, 0, 64),
        'damaged': sift[:-1] + b'\0', 'short': sift[:-1], 'long': file(1, 3, 128, extra=b'1'),
        'kind_3': file(3, 3, 128), 'numbers': file(1, 3, 64), 'many': file(1, 2**32 - 1, 128),
        'not_finite': file(1, 3, 128, size=float('nan')), 'another_form': file(1, 3, 128, form=b'NPRLMK02'),
        'header': sift[:30],
    }


def main():
    for name, seeds in (('camera_messages', camera_messages()), ('initial_pose', initial_poses()), ('bag', bags()),
                        ('detections', detections()),
                        ('landmark_file', landmarks())):
        folder = os.path.join(CORPUS, name)
        os.makedirs(folder, exist_ok=True)
        for seed, content in seeds.items():
            with open(os.path.join(folder, seed), 'wb') as file:
                file.write(content)


if __name__ == '__main__':
    main()
