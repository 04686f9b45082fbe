"""The white level of a decode where the data contradict what the file states.

LibRaw gives 255 for a film scanner whose samples it has spread over 16 bits; a damaged header may
state anything. The samples themselves then say how far they reach.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from camkit.caller import option_text
from camkit.cfa import CfaPattern
from camkit.errors import DecodeError
from camkit.runtime.files.doubts import is_noise
from camkit.runtime.files.raw_checks import OVER_WHITE_SHARE, Levels, Samples, share_over_white

_USUAL_BITS: Final = (8, 10, 12, 14, 16)


def check_said_white(samples: Samples, white: float) -> None:
    """Refuse a white level of the caller that a good part of the samples exceeds.

    Raises:
        DecodeError: If they do.
    """
    share = share_over_white(samples, white)
    if share > OVER_WHITE_SHARE:
        raise DecodeError(
            f"{share:.0%} of the samples lie above {option_text('white_level', white)} "
            f"(largest {samples.max()}); give the true white level"
        )


def believable_white(
    samples: Samples, levels: Levels, cfa: CfaPattern | None, bits: int
) -> tuple[Levels, str]:
    """Return the levels of a decode, white raised where the data go far beyond it, and a note.

    Args:
        samples: (h, w) mosaic or (c, h, w) planes, unsigned integers.
        levels: What the file states.
        cfa: Pattern of a mosaic; None for planes.
        bits: Of a sample in the file; 0 where that is not known.

    Returns:
        The same levels and no note where they fit the data, or where the samples are pure noise.
    """
    share = share_over_white(samples, levels.white)
    if share <= OVER_WHITE_SHARE or is_noise(samples, levels, cfa):
        return levels, ""
    largest = int(samples.max())
    # planes whose samples exceed what the file holds were spread over 16 bits by LibRaw
    usual = _USUAL_BITS if cfa is not None else (16,)
    fitting = [n for n in (bits, *usual) if 2**n > largest]
    white = float(2 ** fitting[0] - 1) if fitting else float(np.iinfo(samples.dtype).max)
    note = (
        f"{share:.0%} of the pixels lie above the stated white {levels.white:g}, which is damaged "
        f"or of another scale: {white:g} is used (set it with {option_text('white_level')})"
    )
    return replace(levels, white=white), note
