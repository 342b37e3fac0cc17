"""Pictures of 16 bits a colour as the bytes of files, which Pillow does not make."""

import struct
import zlib

import numpy as np


def png(picture: np.ndarray, texts: dict[str, str]) -> bytes:
    """uint16 (y, x, 3) as PNG (ISO/IEC 15948) with texts in UTF-8."""
    rows, columns, _ = picture.shape
    body = picture.astype(">u2").view(np.uint8).reshape(rows, columns * 6)
    filtered = np.zeros((rows, columns * 6 + 1), np.uint8)
    filtered[:, 0] = 2  # each row less that above
    filtered[0, 1:] = body[0]
    filtered[1:, 1:] = body[1:] - body[:-1]
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 16, 2, 0, 0, 0))]
    chunks += [(b"iTXt", key.encode("latin-1", "replace") + bytes(5) + text.encode()) for key, text in texts.items()]
    chunks += [(b"IDAT", zlib.compress(filtered.tobytes(), 6)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def tiff(picture: np.ndarray, texts: dict[str, str]) -> bytes:
    """uint16 (y, x, 3) as TIFF 6.0, deflated, with a description."""
    rows, columns, _ = picture.shape
    data = zlib.compress(np.ascontiguousarray(picture, "<u2").tobytes(), 6)
    data += bytes(len(data) % 2)
    tags: dict[int, int | bytes | tuple[int, ...]] = {
        256: columns, 257: rows, 258: (16, 16, 16), 259: 8, 262: 2,  # deflate; RGB
        270: texts["Description"].encode() + b"\0", 273: 8, 277: 3, 278: rows, 279: len(data), 284: 1,
        305: texts["Software"].encode() + b"\0",
    }  # fmt: skip
    place = 8 + len(data)  # of what does not fit an entry of 4 bytes
    extra, entries = b"", b""
    for tag, value in tags.items():
        if isinstance(value, int):
            entries += struct.pack("<HHII", tag, 4, 1, value)
            continue
        kind, raw = (2, value) if isinstance(value, bytes) else (3, struct.pack("<3H", *value))
        raw += bytes(4 - len(raw)) if len(raw) <= 4 else b""  # so short a text would belong into its entry
        entries += struct.pack("<HHII", tag, kind, len(raw) if kind == 2 else 3, place + len(extra))
        extra += raw + bytes(len(raw) % 2)
        if kind == 2 and len(raw) == 4:
            entries = entries[:-4] + raw
    head = struct.pack("<2sHI", b"II", 42, place + len(extra))
    return head + data + extra + struct.pack("<H", len(tags)) + entries + struct.pack("<I", 0)
