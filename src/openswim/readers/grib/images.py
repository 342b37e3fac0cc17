"""Fields of GRIB2 that are packed as images (WMO data templates 5.40, JPEG 2000, and 5.41, PNG).

ecCodes takes an image's own size on trust, and writes past its memory where that is not the field's.
"""

from __future__ import annotations

import struct

_JPEG, _PNG = (40, 40000), (41, 40010)  # templates, and those of before they were agreed on
_JPEG_START, _PNG_START = b"\xff\x4f\xff\x51", b"\x89PNG\r\n\x1a\n"  # ISO/IEC 15444-1, A.4-5; ISO/IEC 15948, 5.2


def fits(section5: bytes, section7: bytes) -> bool:
    """Whether the image in which a field's values are packed, if they are, has one grey pixel for each of them."""
    template, count = int.from_bytes(section5[9:11], "big"), int.from_bytes(section5[5:9], "big")
    image = section7[5:]
    if not image:  # all values are the same
        return True
    if template in _JPEG:
        if len(image) < 45 or not image.startswith(_JPEG_START):
            return False
        right, lower, left, upper = struct.unpack(">4I", image[8:24])
        return image[40:42] == b"\0\1" and image[43:45] == b"\1\1" and (right - left) * (lower - upper) == count
    if template in _PNG:
        if len(image) < 26 or not image.startswith(_PNG_START):
            return False
        width, height = struct.unpack(">2I", image[16:24])
        return width * height == count
    return True
