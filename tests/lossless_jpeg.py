"""A writer of lossless JPEG (ITU-T T.81, annex H), as cameras put it into DNGs; slow and plain."""

import struct

import numpy as np
from numpy.typing import NDArray

CATEGORIES = 17
CODE_BITS = 5  # of every category: a table that any reader takes


def lossless_jpeg(
    samples: NDArray[np.uint16], predictor: int = 1, components: int = 1, restart_rows: int = 0
) -> bytes:
    """Return (h, w) samples of 16 bits as one frame; w is a multiple of the components."""
    rows = samples.astype(np.int64).reshape(len(samples), -1, components)
    height, width, _ = rows.shape
    frame = struct.pack(">BHHB", 16, height, width, components)
    frame += b"".join(bytes((c, 0x11, 0)) for c in range(components))
    counts = [CATEGORIES if bits == CODE_BITS else 0 for bits in range(1, 17)]
    scan = bytes((components, *(n for c in range(components) for n in (c, 0)), predictor, 0, 0))
    segments = [
        (0xC3, frame),
        (0xC4, bytes((0, *counts, *range(CATEGORIES)))),
        *([(0xDD, struct.pack(">H", restart_rows * width))] if restart_rows else []),
        (0xDA, scan),
    ]
    head = b"".join(struct.pack(">BBH", 255, n, len(body) + 2) + body for n, body in segments)
    step = restart_rows or height
    parts = [_entropy(rows[top : top + step], predictor) for top in range(0, height, step)]
    body = parts[0]
    for number, part in enumerate(parts[1:]):
        body += bytes((255, 0xD0 + number % 8)) + part
    return b"\xff\xd8" + head + body + b"\xff\xd9"


def _entropy(rows: NDArray[np.int64], predictor: int) -> bytes:
    left, above, corner = rows.copy(), rows.copy(), rows.copy()
    left[:, 1:] = rows[:, :-1]
    above[1:] = rows[:-1]
    corner[1:, 1:] = rows[:-1, :-1]
    rules = {
        1: left, 2: above, 3: corner, 4: left + above - corner, 5: left + (above - corner) // 2,
        6: above + (left - corner) // 2, 7: (left + above) // 2,
    }  # fmt: skip
    guess = rules[predictor].copy()
    guess[0] = left[0]
    guess[1:, 0] = above[1:, 0]
    guess[0, 0] = 1 << 15
    bits = []
    for difference in (rows - guess).ravel().tolist():
        value = (difference + 32767) % 65536 - 32767  # -32767 to 32768
        size = 16 if value == 32768 else abs(value).bit_length()
        bits.append(f"{size:0{CODE_BITS}b}")
        if 0 < size < 16:
            bits.append(f"{value if value > 0 else value + (1 << size) - 1:0{size}b}")
    text = "".join(bits)
    text += "1" * (-len(text) % 8)
    return int(text, 2).to_bytes(len(text) // 8, "big").replace(b"\xff", b"\xff\x00")
