"""Reads OpenEXR files without the library: what the tests see must not depend on what they test."""
import struct
import zlib

import numpy as np


def read_exr(path):
    """(attributes, {channel: rows from the top}) of a scan-line file of float channels with ZIP compression."""
    data = path.read_bytes()
    assert struct.unpack_from("<ii", data)[0] == 20000630
    attributes, at = {}, 8
    while data[at]:
        name, kind, rest = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        size = struct.unpack_from("<i", data, at)[0]
        attributes[name.decode()] = data[at + 4:at + 4 + size]
        at += 4 + size
    at += 1
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    assert attributes["compression"] == b"\3"
    names, channels = [], attributes["channels"]
    while channels[0]:
        name, channels = channels.split(b"\0", 1)
        assert struct.unpack_from("<i", channels)[0] == 2
        names.append(name.decode())
        channels = channels[16:]
    width, height = x1 - x0 + 1, y1 - y0 + 1
    picture = np.zeros((height, len(names), width), "<f4")
    for block in range((height + 15) // 16):
        place = struct.unpack_from("<Q", data, at + 8 * block)[0]
        y, size = struct.unpack_from("<ii", data, place)
        rows, packed = min(16, y1 - y + 1), data[place + 8:place + 8 + size]
        whole = rows * len(names) * width * 4
        if size < whole:  # differences of neighbours; bytes of even places, then those of odd ones
            unpacked = np.frombuffer(zlib.decompress(packed), np.uint8).astype(np.int64)
            unpacked[1:] -= 128
            halves = np.split(np.cumsum(unpacked).astype(np.uint8), [(whole + 1) // 2])
            packed = np.stack(halves, axis=1).tobytes()
        picture[y - y0:y - y0 + rows] = np.frombuffer(packed, "<f4").reshape(rows, len(names), width)
    return attributes, {name: picture[:, k] for k, name in enumerate(names)}
