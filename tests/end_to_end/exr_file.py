"""Writes OpenEXR files without the library: what the tests feed must not depend on what they test."""
import struct


def exr(width, height, values):
    """A scan-line OpenEXR file of one float channel, without compression."""
    def attribute(name, kind, payload):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(payload)) + payload
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = struct.pack("<ii", 20000630, 2) + attribute("channels", "chlist", b"Y\0" + struct.pack("<iiii", 2, 0, 1, 1) + b"\0")
    head += attribute("compression", "compression", b"\0") + attribute("dataWindow", "box2i", box) + attribute("displayWindow", "box2i", box)
    head += attribute("lineOrder", "lineOrder", b"\0") + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
    head += attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)) + attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0"
    lines = [struct.pack("<ii", y, 4 * width) + struct.pack(f"<{width}f", *values[y * width:(y + 1) * width]) for y in range(height)]
    first = len(head) + 8 * height
    return head + b"".join(struct.pack("<Q", first + k * len(lines[0])) for k in range(height)) + b"".join(lines)
