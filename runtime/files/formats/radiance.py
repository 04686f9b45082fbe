"""The header of a Radiance HDR file, checked before OpenCV decodes its samples.

    #?RADIANCE, NAME=VALUE lines, an empty line, "-Y HEIGHT +X WIDTH", RGBE samples in runs

OpenCV logs what it does not like, and leaves a copy of a file that claims too much in the folder of
temporary files; what is checked here gets that far no more. `EXPOSURE` is not applied: a scene has
the scale of its samples.

References: Ward, "Real pixels", Graphics Gems II, 1991; the Radiance file formats.
"""

import re
from typing import Final

from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import MAX_PIXELS

MAGIC: Final = b"#?"
FORMAT: Final = b"32-bit_rle_rgbe"
_MOST_HEADER_BYTES: Final = 65_536
_MOST_PX_PER_BYTE: Final = 16
"""A run of 127 equal samples of one of four planes takes two bytes: at most 16 pixels a byte."""
_SIZE: Final = re.compile(rb"-Y (\d{1,6}) \+X (\d{1,6})\n")


def check_header(data: bytes) -> None:
    """Refuse a file whose header OpenCV cannot follow, or that is cut off.

    Args:
        data: The whole file, which begins with `MAGIC`.

    Raises:
        DecodeError: If it does.
    """
    head, end, _ = data[:_MOST_HEADER_BYTES].partition(b"\n\n")
    if not end:
        raise DecodeError("the Radiance HDR has no end of its header: it is cut off or damaged")
    formats = re.findall(rb"(?m)^FORMAT=(.*)$", head)
    if formats != [FORMAT]:
        text = b", ".join(formats).decode("ascii", "replace") or "none"
        raise DecodeError(f"a Radiance HDR must have FORMAT={FORMAT.decode()}; got {text}")
    place = len(head) + len(end)
    size = _SIZE.match(data, place)
    if size is None:
        raise DecodeError("a Radiance HDR must say its size as '-Y HEIGHT +X WIDTH'")
    height, width = (int(side) for side in size.groups())
    most = min(MAX_PIXELS, _MOST_PX_PER_BYTE * (len(data) - size.end()))
    if not 0 < height * width <= most:
        raise DecodeError(
            f"the header claims {width}x{height} pixels in {len(data)} bytes; it is cut off or "
            "damaged"
        )
